"""Columns of transfer at hand: those that moving lights needed of late."""

from __future__ import annotations

import numpy as np

from ..arrays import Int64
from ..encoding.sparse_tiles import GROUP
from .column_kernels import QUAD, move_by_columns, plan_columns
from .layer import EnvironmentLayer
from .pace import Pace

_BYTES = 64_000_000  # in all, about; memory is used as places are
_FEWEST = 16  # places of a zone
_LONG_AGO = -1000


class Columns:
    """A number of places for each zone, which those take that were needed last, about."""

    def __init__(self, layer: EnvironmentLayer) -> None:
        self._tiles = layer.tiles
        groups, channels = self._tiles.zones[:, 1], self._tiles.zones[:, 2]
        quads = -(-np.diff(layer.starts) // QUAD)
        size = groups * channels * (QUAD * GROUP)
        count = np.minimum(quads, np.maximum(quads * _BYTES // int(quads @ size), _FEWEST))
        ends, used = np.cumsum(count), np.cumsum(count * size)
        table = np.stack([ends - count, ends, used - count * size, size], axis=1).astype(np.int64)
        table.flags.writeable = False
        self._table: Int64[np.ndarray, "zones 4"] = table
        self._place_of = np.full(len(layer.scales) // QUAD, -1, np.int64)
        self._quad_in = np.full(int(ends[-1]), -1, np.int64)
        self._needed = np.full(int(ends[-1]), _LONG_AGO, np.int64)
        self._hand = (ends - count).astype(np.int64)
        self._pool = np.empty(int(used[-1]), np.uint8)
        self._now, self._is_sound, self._pace = 0, True, Pace(move_by_columns)

    def move(self, size: int, changes: tuple, weights: np.ndarray, lights: tuple, units: tuple) -> bool:
        """As ``tile_kernels.move_discs``; where there is not room for so many clusters, False and nothing done."""
        if not self._is_sound:  # the last update broke off: places may not have what they should
            self._place_of.fill(-1)
            self._quad_in.fill(-1)
        self._now, self._is_sound = self._now + 1, False
        places = self._table, self._place_of, self._quad_in, self._needed, self._hand
        fits, columns, fills = plan_columns(
            changes, len(lights[0]), places, self._now, self._pool.ctypes.data
        )
        if fits:
            self._pace(size, self._tiles, changes, columns, fills, weights, *lights, *units)
            self._is_sound = True
        return fits

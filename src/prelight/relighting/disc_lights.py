"""Soft disc lights on top of the cube: what each brings at strength one is kept, and added in its colour.

So brightening a disc reads no transfer, and moving it only that of the clusters where more or less of it falls
than before (Eq. 15, with one change of light for three colours), most of which is at hand (``columns``). A disc
that is gone leaves no trace.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ..arrays import Float64, Int64
from ..encoding.sparse_tiles import GROUP
from ..lighting.regions import Cap
from .columns import Columns
from .layer import EnvironmentLayer
from .light_tree import LightTree, Weights
from .pace import Pace
from .tile_kernels import EVERY, move_discs

Colour = Float64[np.ndarray, "3"]
_NOWHERE: Weights = (np.zeros(0, np.int64), np.zeros((0, 1)))


@dataclass
class _Lit:
    """A disc that is alight: its row of the units, its colour, and how much of it falls where."""

    place: int
    colour: Colour
    weights: Weights
    clusters: int = 0


@dataclass(frozen=True)
class _Move:
    place: int
    weights: Weights  # changes of them, or if ``afresh`` what they now are
    afresh: bool


class DiscLights:
    """The discs that shine on a layer."""

    def __init__(self, layer: EnvironmentLayer, tree: LightTree) -> None:
        self._layer, self._tree = layer, tree
        self._lit: dict[Cap, _Lit] = {}
        self._unit_starts = np.append(0, np.cumsum(layer.channels_of_group, dtype=np.int64)) * GROUP
        self._unit_starts.flags.writeable = False
        self._units = np.zeros((0, int(self._unit_starts[-1])))
        self._alight = np.zeros((0, layer.groups), bool)
        self._free: list[int] = []
        self._pace, self._columns = Pace(move_discs), Columns(layer)
        self._is_sound = True

    def change(self, wanted: Mapping[Cap, Colour], shares: Int64[np.ndarray, "threads+1"]) -> tuple[int, int]:
        """Let these discs and no others shine: clusters whose light changes, and bytes of tiles read."""
        if not self._is_sound:  # the last change broke off: units may not be what their weights say
            self._lit.clear()
            self._free = list(range(len(self._units)))
        self._is_sound = False
        gone = [region for region in self._lit if region not in wanted]
        clusters, moves = 0, []
        for region, colour in wanted.items():
            lit = self._lit.get(region)
            if lit is None:
                lit = self._lit.pop(gone.pop(0)) if gone else _Lit(self._new_place(), colour, _NOWHERE)
                moves.append(self._move(lit, region))
                self._lit[region] = lit
            elif (colour == lit.colour).all():
                continue
            lit.colour = colour
            clusters += lit.clusters
        for region in gone:
            lit = self._lit.pop(region)
            self._free.append(lit.place)
            clusters += lit.clusters
        read = self._apply(moves, shares) if moves else 0
        self._is_sound = True
        return clusters, read

    def shine(self) -> tuple[tuple, np.ndarray, np.ndarray, np.ndarray]:
        """What ``write_radiance`` wants to know of them."""
        lit = self._lit.values()
        places = np.array([disc.place for disc in lit], np.int64)
        colours = np.array([disc.colour for disc in lit]).reshape(-1, 3)
        return (places, colours, EVERY), self._unit_starts, self._units, self._alight

    def falling(self) -> Iterator[tuple[Weights, Colour]]:
        """How much of each disc falls where, and its colour."""
        return ((lit.weights, lit.colour) for lit in self._lit.values())

    @property
    def bytes(self) -> int:
        """That writing them reads."""
        return len(self._lit) * self._units.shape[1] * self._units.itemsize

    def _move(self, lit: _Lit, region: Cap) -> _Move:
        weights = self._tree.weights_of(region)
        change = self._tree.difference(weights, lit.weights)
        lit.weights, lit.clusters = weights, self._tree.clusters_of(weights[0])
        afresh = len(change[0]) >= len(weights[0])  # it is read anew where that is no more
        return _Move(lit.place, weights if afresh else change, afresh)

    def _apply(self, moves: list[_Move], shares: np.ndarray) -> int:
        *where, weights = self._tree.gather(*(move.weights for move in moves))
        changes = tuple(where)
        lights = np.array([move.place for move in moves]), np.array([move.afresh for move in moves])
        units = self._unit_starts, self._units, self._alight, shares
        read = self._layer.bytes_in(where[1], where[2])
        size = read + len(moves) * self._units.shape[1] * self._units.itemsize
        if not self._columns.move(size, changes, weights, lights, units):
            self._pace(size, self._layer.tiles, changes, weights, *lights, *units)
        return read

    def _new_place(self) -> int:
        if self._free:
            return self._free.pop()
        self._units = np.concatenate([self._units, np.zeros((1, self._units.shape[1]))])
        self._alight = np.concatenate([self._alight, np.zeros((1, self._layer.groups), bool)])
        return len(self._units) - 1

"""Entries of the one-bounce operator weighed by the light that is likely to leave from where they lead.

What thinning loses is told in light, not in rays. The sun on a window's outer reveal is a hundred times as bright as
anything indoors; a row that divides what it does not keep as all rows do, a thousandth of it to that reveal, would be
twice as bright as it should be. Weighed entries differ by more than the threshold there, and are kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Float32

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..transport.gathering import Gathering

_LEAST_LIGHT = 1e-3  # of the mean: as if everywhere were so much
_LEAST_OF_MOST = 1e-5  # and of the most; readers refuse factors of light above its inverse
_LEAST_ROW = 0.05  # of the mean: what is darker is not known better


@dataclass(frozen=True)
class EntryWeights:
    """Factors of an operator's columns and divisors of its rows; none at all where nothing is known of the light.

    Attributes
    ----------
    columns
        ``(V,)`` the light likely to leave a vertex, the most of it 1.
    rows
        ``(V,)`` the light likely to arrive at one: what a row may be wrong by is a share of it.
    """

    columns: Float32[np.ndarray, "vertices"] | None = None
    rows: Float32[np.ndarray, "vertices"] | None = None

    @classmethod
    def of(
        cls, direct: Float32[np.ndarray, "vertices"], bounced: Float32[np.ndarray, "vertices"]
    ) -> EntryWeights:
        """For light that falls, and bounces, about like this; both in any unit. None is told of a dark room."""
        whole, bounced = direct.astype(np.float64) + bounced, bounced.astype(np.float64)
        if not whole.any() or not bounced.any():
            return cls()
        columns = whole + max(_LEAST_LIGHT * whole.mean(), _LEAST_OF_MOST * whole.max())
        rows = np.maximum(bounced, _LEAST_ROW * bounced.mean()) / columns.max()
        return cls((columns / columns.max()).astype(np.float32), rows.astype(np.float32))

    def tiles(
        self, gathering: Gathering
    ) -> Iterator[tuple[slice, tuple, Float32[np.ndarray, "channels entries"]]]:
        """Rows of the operator as (which, (starts, columns, grey values), values of each channel), weighed."""
        for tile in gathering.tiles():
            values = tile.values
            if self.columns is not None and self.rows is not None:
                values = values * self.columns[tile.columns]
                values /= np.repeat(self.rows[tile.rows], np.diff(tile.starts))
            grey = values[0] if len(values) == 1 else values.mean(axis=0, dtype=np.float32)
            yield tile.rows, (tile.starts, tile.columns, grey), values

    def of_row(self, values: Float32[np.ndarray, "rows"], rows: slice) -> Float32[np.ndarray, "rows"]:
        """What belongs to whole rows of weighed entries, as it is without that."""
        return values if self.rows is None else values * self.rows[rows]

    def of_column(self, colours: Float32[np.ndarray, "vertices 3"]) -> Float32[np.ndarray, "vertices 3"]:
        """The factors of light that go with weighed entries."""
        return colours if self.columns is None else colours / self.columns[:, None]

"""What the rows of a portals layer bring to its vertices, each as much as its pane lets through."""

from __future__ import annotations

import numpy as np

from ..arrays import Float32, Radiance
from .pace import Pace
from .portal_kernels import add_panes
from .portals_layer import PortalsLayer


class PaneSums:
    """Rows of a layer, sorted by the ``vertices`` that they are for."""

    def __init__(self, layer: PortalsLayer, vertices: int) -> None:
        order = np.argsort(layer.receiver, kind="stable").astype(np.int32)
        starts = np.searchsorted(layer.receiver[order], np.arange(vertices + 1)).astype(np.int64)
        pane = np.repeat(np.arange(len(layer.portal_of_pane), dtype=np.int32), np.diff(layer.pane_rows))
        self._by_vertex = starts, order, np.ascontiguousarray(pane[order])
        self._add = Pace(add_panes)

    def onto(
        self, total: Radiance, of_pane: Float32[np.ndarray, "panes 3"], of_row: Float32[np.ndarray, "rows 3"]
    ) -> None:
        """Add to (V, 3) what rows bring, each times the factor of its pane."""
        factors = np.ascontiguousarray(of_pane, np.float32)
        self._add(of_row.nbytes + total.nbytes, *self._by_vertex, factors, of_row, total)

"""The thinned operator of one bounce in place of the whole one: a tenth of its entries, for what has bounced before."""

from __future__ import annotations

import numpy as np

from ..arrays import Float32
from ..encoding.vertex_tree import from_halves, halves
from ..transport.sparse_product import multiply
from ..transport.spreading import spread
from .first_bounce import FirstBounce

Light = Float32[np.ndarray, "vertices columns 3"]


class ThinnedGathering:
    """Gρ of a ``FirstBounce`` on many columns of three colours: what ``transport.bounces`` solves with."""

    is_grey = False

    def __init__(self, first: FirstBounce) -> None:
        counts = first.counts.astype(np.int64)
        starts = np.concatenate([[0], np.cumsum(counts)])
        along = np.concatenate([[0], np.cumsum(first.steps, dtype=np.int64)])
        rows = np.repeat(np.arange(len(counts)), counts)
        entries = int(starts[-1])
        self._columns = (along[1 : entries + 1] - along[starts[rows]]).astype(np.int32)
        codes = first.codes[:entries].astype(np.float32)
        self._values = codes * np.abs(codes) * first.scales[rows]
        self._starts, self._first = starts, first
        self.rows = self.columns = len(counts)

    def bounce(self, B: Light) -> Light:
        """Gρ B, irradiance / π (V, K, 3) of irradiance / π before albedo."""
        first, (V, K, C) = self._first, B.shape
        light = (B * first.colours[:, None, :]).reshape(V, K * C)
        nodes = halves(light, first.order, first.left)
        out = np.empty((V, K * C), np.float32)
        multiply(self._starts, self._columns, self._values, nodes, out)
        out += first.sums[:, None] * nodes[0]
        return out.reshape(V, K, C)

    def spread(self, X: Light) -> Light:
        """(Gρ)ᵀ X."""
        first, (V, K, C) = self._first, X.shape
        wide = np.ascontiguousarray(X.reshape(V, K * C))
        nodes = np.zeros((len(first.left), K * C), np.float32)
        spread(self._starts, self._columns, self._values, wide, nodes)
        nodes[0] = np.einsum("v,vk->k", first.sums.astype(np.float64), wide)
        light = from_halves(nodes, first.order, first.left)
        return light.reshape(V, K, C) * first.colours[:, None, :]


class ThinnedSpreading:
    """Its transpose per area of a vertex, as ``transport.spreading.Spreading``."""

    is_grey = False

    def __init__(self, gathering: ThinnedGathering, areas: Float32[np.ndarray, "vertices"]) -> None:
        self._gathering, self.areas = gathering, areas[:, None, None]

    def bounce(self, X: Light) -> Light:
        """(Gρ)ᵀ (areas · X) / areas."""
        return self._gathering.spread(X * self.areas) / self.areas

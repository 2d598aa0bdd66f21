"""Modes of bounced light: the few shapes that what bounces of any lamp is made of, learnt from lamps here and there.

How much of each a lamp brings is solved backwards, vertex by vertex, so it is known for light that falls anywhere: a
lamp beside a wall lights a spot smaller than any patch of surface that could stand for it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64
from ..encoding.modes import in_bytes

_FAINTEST = 1e-7  # of the first eigenvalue


@dataclass(frozen=True)
class Mixtures:
    """Modes as sums of what lamps bring.

    Attributes
    ----------
    shares
        ``(lamps, modes)``: a mode is Σ share · what the lamp brings.
    squares
        ``(modes,)`` of each mode, area · irradiance² summed over the surfaces and colours: the first the largest.
    """

    shares: Float64[np.ndarray, "lamps modes"]
    squares: Float64[np.ndarray, "modes"]

    def __len__(self) -> int:
        return len(self.squares)


def mixtures(gram: Float64[np.ndarray, "lamps lamps"], most: int) -> Mixtures:
    """At most so many principal components of lamps that all count alike, from the products of what they bring.

    Their sizes fall off as those of lamps do; the first is as bright as a usual lamp. None where nothing bounces.
    """
    bright = np.sqrt(np.maximum(np.diag(gram), 0))
    usual = float(np.median(bright[bright > 0])) if (bright > 0).any() else 0.0
    inverse = np.divide(1, bright, out=np.zeros_like(bright), where=bright > 1e-9 * usual)
    squares, vectors = np.linalg.eigh(gram * inverse[:, None] * inverse)
    squares, vectors = squares[::-1], vectors[:, ::-1]
    count = min(most, int(np.count_nonzero(squares > _FAINTEST * max(float(squares[0]), 1e-300))))
    if not usual > 0:
        count = 0
    scale = usual / np.sqrt(max(float(squares[0]), 1e-300))
    return Mixtures(inverse[:, None] * vectors[:, :count] * scale, scale**2 * squares[:count])


def products(
    slabs: Iterable[tuple[Float32[np.ndarray, "lamps some colours"], Float32[np.ndarray, "some"]]],
) -> Float64[np.ndarray, "lamps lamps"]:
    """Σ area · irradiance · irradiance of every two lamps, over slabs of vertices: what they bring, and areas."""
    found: np.ndarray | float = 0.0
    for brought, areas in slabs:
        weighted = brought * np.sqrt(areas)[None, :, None]
        flat = weighted.reshape(len(brought), -1)
        found = found + (flat @ flat.T).astype(np.float64)
    return np.asarray(found)


@dataclass(frozen=True)
class Sources:
    """How much light on a vertex brings of each mode, a byte each.

    ``rows`` (V, modes) times ``scales`` (modes,): for irradiance / π of 1 on 1 m² around the vertex. ``areas`` (V,) m².
    """

    rows: np.ndarray
    scales: Float32[np.ndarray, "modes"]
    areas: Float32[np.ndarray, "vertices"]

    @classmethod
    def of(
        cls, values: Float32[np.ndarray, "vertices modes"], areas: Float32[np.ndarray, "vertices"]
    ) -> Sources:
        return cls(*in_bytes(values), areas)

    def brought(self, direct: np.ndarray) -> Float64[np.ndarray, "lamps modes"]:
        """Of direct irradiance / π (vertices, lamps)."""
        out = np.zeros((direct.shape[1], len(self.scales)))
        for first in range(0, len(direct), _SLAB):
            own = slice(first, first + _SLAB)
            fallen = direct[own] * self.areas[own, None]
            out += fallen.T.astype(np.float32) @ self.rows[own].astype(np.float32)
        return out * self.scales


_SLAB = 4096

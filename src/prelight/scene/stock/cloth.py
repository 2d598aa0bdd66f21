"""A square napkin that lies on a table and hangs over its front edge in folds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Float64
from .parts import Part, split_quads

_BEND = 0.011  # radius at the table's edge, metres
_ABOVE = 0.0025  # the table, at least
_DIFFERENCE = 1e-6  # metres, for derivatives


@dataclass(frozen=True)
class Napkin:
    """Seen from above, its sides are turned by ``turn_deg`` against the table's edge, which runs along x at z = 0.

    In metres, the table's top at y = 0. ``ahead``: how far its middle lies before the edge (negative: behind it).
    """

    side: float
    turn_deg: float
    ahead: float

    def point(self, a: np.ndarray, b: np.ndarray) -> Float64[np.ndarray, "n 3"]:
        """Where the cloth's own point (a, b), from −side/2 to side/2, comes to lie."""
        c, s = np.cos(np.radians(self.turn_deg)), np.sin(np.radians(self.turn_deg))
        x, t = c * a - s * b, s * a + c * b + self.ahead
        angle = np.clip(t / _BEND, 0.0, np.pi / 2)
        beyond = np.maximum(t - _BEND * np.pi / 2, 0.0)
        y = _BEND * (np.cos(angle) - 1) - beyond + _ABOVE
        place = np.stack([x, y, np.minimum(t, 0.0) + _BEND * np.sin(angle)], axis=-1)
        outward = np.stack([np.zeros_like(x), np.cos(angle), np.sin(angle)], axis=-1)
        return place + self._folds(x, t)[..., None] * outward

    def _folds(self, x: np.ndarray, t: np.ndarray) -> np.ndarray:
        """How far it stands off: never below 0. Deep folds where it hangs, faint creases where it lies."""
        hanging = _eased((t + 0.02) / 0.13)
        deep = 0.5 + 0.5 * np.sin(34.0 * x + 0.8 * np.sin(11.0 * x + 1.0) + 5.0 * np.maximum(t, 0.0))
        crease = _ridge(0.6 * x + t + 0.10, 0.012) + 0.7 * _ridge(x - 0.5 * t - 0.03, 0.014)
        ripple = 0.5 + 0.5 * np.sin(23.0 * x + 31.0 * t + 2.0 * np.sin(17.0 * t))
        return hanging * 0.017 * deep**1.5 + (1 - hanging) * (0.0035 * crease + 0.0022 * ripple)

    def normal(self, a: np.ndarray, b: np.ndarray) -> Float64[np.ndarray, "n 3"]:
        """The upper side's."""
        h = _DIFFERENCE
        along_a = self.point(a + h, b) - self.point(a - h, b)
        along_b = self.point(a, b + h) - self.point(a, b - h)
        normal = np.cross(along_b, along_a)
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def part(self, cells: int) -> Part:
        line = np.linspace(-self.side / 2, self.side / 2, cells + 1)
        a, b = (x.ravel() for x in np.meshgrid(line, line, indexing="ij"))
        positions = self.point(a, b)
        i, j = np.divmod(np.arange(cells * cells), cells)
        k = i * (cells + 1) + j
        quads = np.stack([k, k + 1, k + cells + 2, k + cells + 1], axis=1)
        return Part(positions, self.normal(a, b), split_quads(positions, quads))


def _ridge(distance: np.ndarray, width: float) -> np.ndarray:
    return np.exp(-((distance / width) ** 2))


def _eased(x: np.ndarray) -> np.ndarray:
    """From 0 to 1, smoothly."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)

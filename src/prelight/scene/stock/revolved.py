"""Bodies turned on a lathe: a smooth profile, revolved about the y axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Float64
from .parts import Part, split_quads

_TABLE = 2048
_ROUND = 0.5  # how much vertices gather where a profile is round: 0 not at all


@dataclass(frozen=True)
class Profile:
    """A smooth open curve from axis to axis: the uniform cubic B-spline of its control points.

    Points are (radius, y) in metres, in the order that keeps the outside on the right: up the outer side, down the
    inner. The first and last are on the axis (radius 0). A point given twice pulls the curve to itself.
    """

    points: tuple[tuple[float, float], ...]

    def _controls(self) -> Float64[np.ndarray, "points 2"]:
        """Mirrored at the axis, so that the curve meets it at a right angle."""
        p = np.asarray(self.points, np.float64)
        return np.concatenate([p[1:2] * (-1, 1), p, p[-2:-1] * (-1, 1)])

    def at(self, t: np.ndarray, *, derivative: bool = False) -> Float64[np.ndarray, "n 2"]:
        """Points, or derivatives, at t from 0 to 1."""
        p = self._controls()
        spans = len(p) - 3
        k = np.minimum((t * spans).astype(int), spans - 1)
        f = (t * spans - k)[:, None]
        a, b, c, d = (p[k + i] for i in range(4))
        if derivative:
            return (
                -((1 - f) ** 2) * a + (3 * f * f - 4 * f) * b + (1 + 2 * f - 3 * f * f) * c + f * f * d
            ) / 2
        rise = (1 - f) ** 3 * a + (3 * f**3 - 6 * f * f + 4) * b
        return (rise + (1 + 3 * f + 3 * f * f - 3 * f**3) * c + f**3 * d) / 6

    def spread(self, count: int) -> Float64[np.ndarray, "count"]:
        """``count`` places t along it, ends included: even in length, nearer each other where it bends."""
        t = np.linspace(0.0, 1.0, _TABLE)
        along = self.at((t[1:] + t[:-1]) / 2, derivative=True)
        length = np.linalg.norm(np.diff(self.at(t), axis=0), axis=1)
        angle = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
        bend = np.abs(np.gradient(angle))
        pace = length / length.sum() + _ROUND * bend / max(bend.sum(), 1e-12)
        travelled = np.concatenate([[0.0], np.cumsum(pace)])
        return np.interp(np.linspace(0.0, travelled[-1], count), travelled, t)

    def part(self, *, along: int, around: int, textured: bool = False) -> Part:
        """The closed body: ``along`` rings of ``around`` vertices, the first and last drawn together to one.

        ``textured``: with coordinates, u once around and v along the profile's length from its end (v = 0) to its
        start, and for the seam a column of vertices more.
        """
        t = self.spread(along + 2)[1:-1]
        columns = around + 1 if textured else around
        theta = np.arange(columns) * (2 * np.pi / around)
        c, s = np.cos(theta), -np.sin(theta)  # counter-clockwise seen from above
        place, slope = self.at(t), self.at(t, derivative=True)
        normal = np.stack([slope[:, 1], -slope[:, 0]], axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        rings = [_turn(values, c, s) for values in (place, normal)]
        ends = np.array([(0.0, y, 0.0) for y in self.at(np.array([0.0, 1.0]))[:, 1]])
        positions = np.concatenate([rings[0], ends])
        normals = np.concatenate([rings[1], [(0, -1, 0), (0, 1, 0)]])
        triangles = _woven(positions, along, columns, wrapped=not textured)
        uv = None
        if textured:
            length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1))])
            v = 1 - length / length[-1]
            grid = np.stack(np.broadcast_arrays(np.arange(columns) / around, v[:, None]), axis=-1)
            uv = np.concatenate([grid.reshape(-1, 2), [(0.5, 1.0), (0.5, 0.0)]])
        return Part(positions, normals, triangles, uv)


def _turn(values: Float64[np.ndarray, "n 2"], c: np.ndarray, s: np.ndarray) -> Float64[np.ndarray, "m 3"]:
    """(radius, y) all around, ring by ring."""
    radius, y = values[:, :1], values[:, 1:]
    return np.stack([radius * c, y + 0 * c, radius * s], axis=-1).reshape(-1, 3)


def _woven(positions: np.ndarray, along: int, columns: int, *, wrapped: bool) -> np.ndarray:
    """Quads between the rings, and a fan to each end's vertex, which are the last two."""
    j = np.arange(columns if wrapped else columns - 1)
    j_next = (j + 1) % columns
    i = np.arange(along - 1)[:, None] * columns
    quads = np.stack([i + j, i + j_next, i + columns + j_next, i + columns + j], axis=-1).reshape(-1, 4)
    first, last = along * columns, along * columns + 1
    bottom = np.stack([np.full(len(j), first), j_next, j], axis=1)
    top = np.stack([np.full(len(j), last), (along - 1) * columns + j, (along - 1) * columns + j_next], axis=1)
    return np.concatenate([split_quads(positions, quads), bottom, top]).astype(np.int32)

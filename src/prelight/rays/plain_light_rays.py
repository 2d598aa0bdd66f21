"""How much of a light each vertex sees, without a renderer: as `transport.light_rays`, on processors alone.

Places on a light are spread evenly and shifted for each vertex by numbers that only the vertex decides.
"""

from __future__ import annotations

from copy import copy

import numpy as np

from ..arrays import Float32, Float64, Int32, Normals, Positions, Triangles
from .offset import ray_offset
from .segments import PlainSegments

_LANES = 1 << 19  # rays made at a time
_SHORT = 1e-4  # of the way to a panel that a ray leaves out: what the panel hangs on must not shadow it
_GOLDEN = 0.6180339887498949  # of Weyl's sequence, one number a vertex
_PLASTIC = (0.7548776662466927, 0.5698402909980532)  # Roberts's, two numbers a sample

Share = Float32[np.ndarray, "chosen"]


class PlainLightRays:
    """Shadow rays of the vertices of a scene.

    Parameters
    ----------
    positions, triangles, normals
        Its vertices and triangles; normals tell which side is lit.
    origins
        ``(V, 3)`` where the vertices' rays begin, before they are lifted.

    Attributes
    ----------
    points
        ``(V, 3)`` where they begin, lifted.
    segments
        What stands between points.
    """

    def __init__(
        self, positions: Positions, triangles: Triangles, *, normals: Normals, origins: Positions
    ) -> None:
        self.segments = PlainSegments(positions, triangles, normals)
        self.points: Positions = np.ascontiguousarray(
            origins + np.float32(ray_offset(positions)) * normals, np.float32
        )
        self._normals = normals
        self._offset = np.float32(ray_offset(positions))
        self._extent = float(np.ptp(positions, axis=0).max())

    def elsewhere(self, origins: Positions, normals: Normals) -> PlainLightRays:
        """The same of other points (n, 3) with unit normals; ``rows`` are theirs then."""
        other = copy(self)
        other.points = np.ascontiguousarray(origins + self._offset * normals, np.float32)
        other._normals = normals
        return other

    def of_ball(
        self, rows: Int32[np.ndarray, "chosen"], centre: Float64[np.ndarray, "3"], radius: float, *, rays: int
    ) -> Share:
        """The share of its light, 0 to 1, that vertices outside a ball get; ``rays`` each, one to a point."""
        if radius == 0:
            return self._shares(rows, 1, lambda o, n, _: (np.broadcast_to(centre, o.shape), np.ones(len(o))))

        def to_ball(o: np.ndarray, n: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            way = centre - o
            square = np.einsum("ij,ij->i", way, way)
            sin2 = np.minimum(radius * radius / square, 1)
            low = (
                sin2 / (1 + np.sqrt(1 - sin2)) * numbers[:, 0]
            )  # 1 − cos within the cone in which it is seen
            across, turn = np.sqrt(low * (2 - low)), 2 * np.pi * numbers[:, 1]
            w = way / np.sqrt(square)[:, None]
            u, v = _beside(w)
            d = (across * np.cos(turn))[:, None] * u + (across * np.sin(turn))[:, None] * v
            d += (1 - low)[:, None] * w
            into = np.sqrt(np.maximum(radius * radius - square * low * (2 - low), 0))
            end = o + (np.sqrt(square) * (1 - low) - into)[:, None] * d
            return end, np.maximum(np.einsum("ij,ij->i", n, d), 0)

        return self._shares(rows, rays, to_ball)

    def of_panel(
        self, rows: Int32[np.ndarray, "chosen"], corners: Float64[np.ndarray, "4 3"], *, rays: int
    ) -> Share:
        """The share of the light of a rectangle (its corners in turn) that vertices in front of it get."""
        along, up = corners[1] - corners[0], corners[3] - corners[0]
        front = np.cross(along, up)
        front /= np.linalg.norm(front)

        def to_panel(o: np.ndarray, n: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            way = corners[0] + numbers[:, :1] * along + numbers[:, 1:] * up - o
            square = np.maximum(np.einsum("ij,ij->i", way, way), 1e-20)
            weight = np.maximum(np.einsum("ij,ij->i", n, way), 0) * np.maximum(-(way @ front), 0) / square**2
            return o + way * (1 - _SHORT), weight

        return self._shares(rows, rays, to_panel)

    def of_direction(self, rows: Int32[np.ndarray, "chosen"], direction: np.ndarray) -> Share:
        """1 where vertices see a light infinitely far away, 0 where not."""
        far = 4 * self._extent * np.asarray(direction, np.float64)
        return self._shares(rows, 1, lambda o, n, _: (o + far, np.ones(len(o))))

    def share_of_backs(self, point: Float64[np.ndarray, "3"]) -> float:
        """Of rays from a point that meet something, how many meet its unlit side: near 1 inside a solid."""
        return float(self.segments.shares_of_backs(np.asarray(point)[None])[0])

    def _shares(self, rows: np.ndarray, rays: int, aim) -> Share:
        out = np.zeros(len(rows), np.float32)
        step = max(1, _LANES // rays)
        for start in range(0, len(rows), step):
            part = rows[start : start + step]
            origins = np.repeat(self.points[part].astype(np.float64), rays, axis=0)
            normals = np.repeat(self._normals[part].astype(np.float64), rays, axis=0)
            ends, weight = aim(origins, normals, _numbers(part, rays))
            free = self.segments.are_free(origins, ends)
            lit, whole = (x.reshape(-1, rays).sum(axis=1) for x in (weight * free, weight))
            np.divide(lit, whole, out=out[start : start + step], where=whole > 0, casting="same_kind")
        return out


def _numbers(rows: np.ndarray, rays: int) -> Float64[np.ndarray, "lanes 2"]:
    """Two numbers in [0, 1) for each ray of each vertex: Roberts's sequence, turned by the vertex's own two."""
    k, own = np.arange(rays), rows.astype(np.float64)[:, None]
    first = (k * _PLASTIC[0] + own * _GOLDEN) % 1
    second = (k * _PLASTIC[1] + own * _PLASTIC[0]) % 1
    return np.stack([first.ravel(), second.ravel()], axis=1)


def _beside(w: Float64[np.ndarray, "n 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors at right angles to each unit vector and to each other."""
    other = np.where(np.abs(w[:, :1]) > 0.7, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    u = np.cross(w, other)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(w, u)

"""What is between two points, and on which side of surfaces a point is; without a renderer."""

from __future__ import annotations

import numpy as np

from ..arrays import Float64, Normals, Positions, Triangles
from .plain import PlainOccluders
from .segment_kernels import trace_segments

_LOOKS = 64  # rays that tell whether a point is inside a solid
_FAR = 4.0  # in the tree's own coordinates, where the scene is 2 wide: beyond all of it
SOLID = 0.9  # share of backs around a point that is inside a solid


class PlainSegments:
    """Triangles that stand between points, lit on the side of their vertices' normals.

    Parameters
    ----------
    positions, triangles
        As of ``PlainOccluders``; raises InputError as that does.
    normals
        ``(V, 3)`` of the vertices.
    """

    def __init__(self, positions: Positions, triangles: Triangles, normals: Normals) -> None:
        self.occluders = PlainOccluders(positions, _wound(positions, triangles, normals))
        bounds, children, _, corners = self.occluders._tree
        self._tree = bounds, children, corners

    def are_free(self, origins: Float64[np.ndarray, "n 3"], ends: Float64[np.ndarray, "n 3"]) -> np.ndarray:
        """(n,) bool: whether nothing is between each of ``origins`` (n, 3) and its end, metres."""
        return self._found(origins, ends, nearest=False) == 0

    def are_near(self, points: Float64[np.ndarray, "n 3"], reach: float) -> np.ndarray:
        """(n,) bool: whether some surface is within ``reach`` metres, as far as rays all around tell."""
        ends = points[:, None] + reach * even_directions(_LOOKS)
        free = self.are_free(np.repeat(points, _LOOKS, axis=0), ends.reshape(-1, 3))
        return ~np.all(free.reshape(-1, _LOOKS), axis=1)

    def shares_of_backs(self, points: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n"]:
        """Of rays from each point in all directions that meet something, how many meet its unlit side.

        Near 1 inside a solid, 0 in a room and where nothing is met.
        """
        points = np.asarray(points, np.float64).reshape(-1, 3)
        away = even_directions(_LOOKS) * (_FAR / self.occluders._scale)
        reach = np.abs(self.occluders.local(points)).max(axis=1, initial=0) + 1
        ends = points[:, None] + away * reach[:, None, None]
        found = self._found(np.repeat(points, _LOOKS, axis=0), ends.reshape(-1, 3), nearest=True)
        found = found.reshape(-1, _LOOKS)
        met, backs = np.count_nonzero(found, axis=1), np.count_nonzero(found == 2, axis=1)
        return np.divide(backs, met, out=np.zeros(len(points)), where=met > 0)

    def _found(self, origins: np.ndarray, ends: np.ndarray, *, nearest: bool) -> np.ndarray:
        found = np.empty(len(origins), np.uint8)
        starts, stops = (
            np.ascontiguousarray(self.occluders.local(np.asarray(p, np.float64)), np.float32)
            for p in (origins, ends)
        )
        trace_segments(*self._tree, starts, stops, nearest, found)
        return found


def even_directions(count: int) -> Float64[np.ndarray, "count 3"]:
    """Unit directions spread evenly over the sphere, along a spiral."""
    turn, y = np.pi * (1 + 5**0.5) * np.arange(count), 1 - (2 * np.arange(count) + 1) / count
    r = np.sqrt(1 - y * y)
    return np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=1)


def _wound(positions: Positions, triangles: Triangles, normals: Normals) -> Triangles:
    """Triangles whose corners go counter-clockwise as seen from the side of their vertices' normals."""
    triangles = np.asarray(triangles, np.int32)
    a, b, c = np.moveaxis(np.asarray(positions, np.float64)[triangles], 1, 0)
    outward = np.asarray(normals, np.float64)[triangles].sum(axis=1)
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), outward) < 0
    return np.where(turned[:, None], triangles[:, [0, 2, 1]], triangles)

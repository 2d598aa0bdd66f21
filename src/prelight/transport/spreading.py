"""The gathering operator backwards: from what is asked of receivers to where light would have to be for it.

(Gρ)ᵀ X. A few rows of the solved operator then cost as few products as a few of its columns, and these say what
any light at all does, through its direct light.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from ..arrays import Float32
from ..scene.geometry import Scene
from .gathering import Gathering

_STRIP = 16  # columns of one thread


class Spreading:
    """A ``Gathering`` whose ``bounce`` is its transpose, so that whatever solves the one solves the other.

    Per area of a vertex: a fine part of a mesh would otherwise count more than a coarse one, and with it what is seen
    of it, until no bound of what remains holds. By reciprocity it then leaves as much of light as the operator itself.

    Attributes
    ----------
    areas
        (V, 1, 1) of the triangles around each vertex, 1 on the mean, and where there are none.
    """

    def __init__(self, gathering: Gathering, scene: Scene) -> None:
        self._gathering = gathering
        self.areas = vertex_areas(scene)[:, None, None]

    def bounce(
        self, X: Float32[np.ndarray, "vertices columns channels"]
    ) -> Float32[np.ndarray, "vertices columns channels"]:
        """(Gρ)ᵀ (areas · X) / areas, channel by channel."""
        V, K, C = X.shape
        gathering, X = self._gathering, X * self.areas
        coloured = gathering.coloured_entries
        out = np.zeros((C, V, K), np.float32)
        wide = [np.ascontiguousarray(X[:, :, c]) for c in range(C)]
        for tile in gathering.tiles():
            for c in range(C):
                values = tile.values[c if coloured == 3 else 0]
                spread(tile.starts, tile.columns, values, wide[c][tile.rows], out[c])
        if coloured == 0:
            out *= gathering.albedo.T[:C, :, None]
        return np.ascontiguousarray(np.moveaxis(out, 0, 2)) / self.areas


def vertex_areas(scene: Scene) -> Float32[np.ndarray, "vertices"]:
    """Of the triangles around each vertex, 1 on the mean, and where there are none."""
    corners = scene.positions[scene.triangles].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.zeros(len(scene.positions))
    np.add.at(areas, scene.triangles, np.linalg.norm(across, axis=1)[:, None])
    areas[areas <= 0] = areas.mean()
    return (areas / areas.mean()).astype(np.float32)


_i4_1 = types.Array(types.int32, 1, "C", readonly=True)
_i8_1 = types.Array(types.int64, 1, "C", readonly=True)
_f4_1 = types.Array(types.float32, 1, "C", readonly=True)
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)


@njit(cache=True)
def _spread_strip(starts, columns, values, X, out, low, high):
    for row in range(len(starts) - 1):
        x = X[row, low:high]
        for e in range(starts[row], starts[row + 1]):
            value, into = values[e], out[columns[e], low:high]
            for j in range(len(x)):
                into[j] += value * x[j]


@njit([types.void(_i8_1, _i4_1, _f4_1, _f4_2, types.float32[:, ::1])], parallel=True, cache=True)
def spread(starts, columns, values, X, out):
    """out (columns, n) += transpose of rows of a sparse matrix times X (rows, n); a thread has whole columns."""
    n = out.shape[1]
    for strip in prange((n + _STRIP - 1) // _STRIP):
        _spread_strip(starts, columns, values, X, out, strip * _STRIP, min(n, (strip + 1) * _STRIP))


@njit(cache=True)
def _collect_rows(starts, columns, values, B, out, first, last):
    for row in range(first, last):
        into = out[row]
        into[:] = 0
        for e in range(starts[row], starts[row + 1]):
            value, b = values[e], B[columns[e]]
            for j in range(len(into)):
                into[j] += value * b[j]


@njit([types.void(_i8_1, _i4_1, _f4_1, _f4_2, types.float32[:, ::1])], parallel=True, cache=True)
def collect(starts, columns, values, B, out):
    """out (rows, n) = rows of a sparse matrix times B (columns, n), written."""
    for part in prange((len(out) + _STRIP - 1) // _STRIP):
        _collect_rows(starts, columns, values, B, out, part * _STRIP, min(len(out), (part + 1) * _STRIP))

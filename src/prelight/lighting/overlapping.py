"""The compiled loops that know exact areas: finishing a scattered face, faces onto faces, pixels merged."""

from __future__ import annotations

from math import atan2, pi, sin, sqrt

import numpy as np
from numba import njit

from ..arrays import CubeMap, Float32, Float64, Picture


@njit(cache=True, nogil=True)
def _corner_area(u: float, v: float) -> float:
    """As ``bases.cube_map``: solid angle of the rectangle from the centre of a face to (u, v), signed."""
    return atan2(u * v, sqrt(u * u + v * v + 1.0))


@njit(cache=True, nogil=True)
def finish(
    out: Float32[np.ndarray, "row column 3"],
    sums: Float64[np.ndarray, "row column 7"],
    first_row: int,
    resolution: int,
) -> Float64[np.ndarray, "3"]:
    """Radiance of the texels of a slab from its sums (``scattering``); returns ∫ radiance dω over them."""
    total = np.zeros(3)
    step = 2.0 / resolution
    for row in range(sums.shape[0]):
        top = (first_row + row) * step - 1.0
        above, below = _corner_area(-1.0, top), _corner_area(-1.0, top + step)
        for column in range(resolution):
            u = (column + 1) * step - 1.0
            next_above, next_below = _corner_area(u, top), _corner_area(u, top + step)
            area = next_below - next_above - below + above
            above, below = next_above, next_below
            fallen = sums[row, column]
            for k in range(3):
                radiance = fallen[k] / fallen[6] + fallen[3 + k] / area
                total[k] += area * radiance
                out[row, column, k] = radiance
    return total


@njit(cache=True, nogil=True)
def overlap(source: CubeMap, out: CubeMap, first_row: int, end_row: int) -> None:
    """Rows of all six faces of ``out`` as means of ``source`` over each texel, weighed by solid angle.

    Edges are compared as integers on the common grid of both resolutions, so equal edges are equal.
    """
    side, resolution = source.shape[1], out.shape[1]
    unit = 2.0 / (side * resolution)
    sums = np.empty((6, 3))
    for row in range(first_row, end_row):
        top, bottom = row * side, (row + 1) * side  # on the common grid
        i0, i1 = top // resolution, (bottom - 1) // resolution
        for column in range(resolution):
            left, right = column * side, (column + 1) * side
            j0, j1 = left // resolution, (right - 1) // resolution
            if i0 == i1 and j0 == j1:
                for face in range(6):
                    for k in range(3):
                        out[face, row, column, k] = source[face, i0, j0, k]
                continue
            sums[:] = 0.0
            whole = 0.0
            for i in range(i0, i1 + 1):
                v0 = max(top, i * resolution) * unit - 1.0
                v1 = min(bottom, (i + 1) * resolution) * unit - 1.0
                u = left * unit - 1.0
                above, below = _corner_area(u, v0), _corner_area(u, v1)
                for j in range(j0, j1 + 1):
                    u = min(right, (j + 1) * resolution) * unit - 1.0
                    next_above, next_below = _corner_area(u, v0), _corner_area(u, v1)
                    area = next_below - next_above - below + above
                    above, below = next_above, next_below
                    whole += area
                    for face in range(6):
                        for k in range(3):
                            sums[face, k] += area * source[face, i, j, k]
            for face in range(6):
                for k in range(3):
                    out[face, row, column, k] = sums[face, k] / whole


@njit(cache=True, nogil=True)
def merge_latlong(source: Picture, out: Picture, first_row: int, end_row: int) -> None:
    """Rows of ``out``, a lat-long map of a whole fraction of the size, as means weighed by solid angle."""
    merged, height = source.shape[0] // out.shape[0], source.shape[0]
    for row in range(first_row, end_row):
        weights = np.array([sin((row * merged + i + 0.5) * pi / height) for i in range(merged)])
        weights /= weights.sum() * merged
        for column in range(out.shape[1]):
            r = g = b = 0.0
            for i in range(merged):
                for j in range(merged):
                    pixel = source[row * merged + i, column * merged + j]
                    r += weights[i] * pixel[0]
                    g += weights[i] * pixel[1]
                    b += weights[i] * pixel[2]
            out[row, column, 0], out[row, column, 1], out[row, column, 2] = r, g, b

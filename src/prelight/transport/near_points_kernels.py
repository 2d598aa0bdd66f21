"""Which of some fixed points are near others: a table of cells, each as wide as the largest distance that counts."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

_f4 = types.Array(types.float32, 1, "C", readonly=True)
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)
_i8 = types.Array(types.int64, 1, "C", readonly=True)
_i8_2 = types.Array(types.int64, 2, "C", readonly=True)
_table = types.Tuple((_i8, _i8_2, _f4_2, _f4))

_PART = 1024  # points of one thread

PointTable = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@njit(cache=True)
def _bucket(x, y, z, mask):
    return ((x * 73856093) ^ (y * 19349663) ^ (z * 83492791)) & mask


def point_table(points: np.ndarray, radii: np.ndarray) -> tuple[PointTable, np.ndarray, float]:
    """Points (n, 3) with a distance (n,) each, sorted: the table, their order (n,), and the width of its cells.

    At least one point; distances above 0.
    """
    width = float(radii.max())
    cells = np.floor(points.astype(np.float64) / width).astype(np.int64)
    size = 1 << max(4, int(2 * len(points) - 1).bit_length())
    x, y, z = cells.T
    bucket = ((x * 73856093) ^ (y * 19349663) ^ (z * 83492791)) & (size - 1)
    order = np.argsort(bucket, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(bucket, minlength=size))])
    cells, points, radii = (np.ascontiguousarray(part[order]) for part in (cells, points, radii))
    return (starts, cells, points, radii), order, width


@njit(cache=True)
def _near(p, table, width, found, fills):
    """How many points of the table are near enough to ``p``; which ones into ``found`` where ``fills``."""
    starts, cells, points, radii = table
    mask = len(starts) - 2
    cx = np.int64(np.floor(np.float64(p[0]) / width))
    cy = np.int64(np.floor(np.float64(p[1]) / width))
    cz = np.int64(np.floor(np.float64(p[2]) / width))
    count = 0
    for x in range(cx - 1, cx + 2):
        for y in range(cy - 1, cy + 2):
            for z in range(cz - 1, cz + 2):
                b = _bucket(x, y, z, mask)
                for k in range(starts[b], starts[b + 1]):
                    if cells[k, 0] != x or cells[k, 1] != y or cells[k, 2] != z:
                        continue  # another cell of the same bucket
                    square = np.float32(0)
                    for a in range(3):
                        square += (points[k, a] - p[a]) * (points[k, a] - p[a])
                    if square < radii[k] * radii[k]:
                        if fills:
                            found[count] = k
                        count += 1
    return count


@njit(cache=True)
def _count_part(others, table, width, counts, first, last):
    nothing = np.empty(0, np.int64)
    for i in range(first, last):
        counts[i] = _near(others[i], table, width, nothing, False)


@njit([types.void(_f4_2, _table, types.float64, types.int64[::1])], parallel=True, cache=True)
def count_near(others, table, width, counts):
    """counts[i] = how many points of the table have others[i] within their distance."""
    for part in prange((len(others) + _PART - 1) // _PART):
        _count_part(others, table, width, counts, part * _PART, min(len(others), (part + 1) * _PART))


@njit(cache=True)
def _fill_part(others, table, width, starts, found, first, last):
    for i in range(first, last):
        if starts[i + 1] > starts[i]:
            _near(others[i], table, width, found[starts[i] : starts[i + 1]], True)


@njit([types.void(_f4_2, _table, types.float64, _i8, types.int64[::1])], parallel=True, cache=True)
def fill_near(others, table, width, starts, found):
    """found[starts[i] : starts[i + 1]] = which ones, as places in the table."""
    for part in prange((len(others) + _PART - 1) // _PART):
        _fill_part(others, table, width, starts, found, part * _PART, min(len(others), (part + 1) * _PART))

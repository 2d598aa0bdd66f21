"""Rows of the gathering operator: where rays end becomes entries of a sparse matrix.

A row is made by one thread in the order of its rays: the same bytes for any number of threads.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import njit, prange, types
from numba.extending import intrinsic

_ROWS = 64  # a task

_i4_2 = types.Array(types.int32, 2, "C", readonly=True)
_i8_1 = types.Array(types.int64, 1, "C", readonly=True)
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)
_f4_3 = types.Array(types.float32, 3, "C", readonly=True)


@intrinsic
def _lowest_bit(typing_context, word):
    """Which bit of a word that is not zero is its lowest."""

    def code(context, builder, signature, arguments):
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return types.uint64(types.uint64), code


@njit(cache=True)
def _count_rows(triangles, hit, first, last, counts, vertices):
    marked = np.zeros(vertices // 64 + 1, np.uint64)
    for row in range(first, last):
        count = 0
        for k in range(hit.shape[1]):
            t = hit[row, k]
            if t >= 0:
                for corner in range(3):
                    vertex = triangles[t, corner]
                    bit = np.uint64(1) << np.uint64(vertex & 63)
                    if marked[vertex >> 6] & bit == 0:
                        marked[vertex >> 6] |= bit
                        count += 1
        for k in range(hit.shape[1]):
            t = hit[row, k]
            if t >= 0:
                for corner in range(3):
                    marked[triangles[t, corner] >> 6] = 0
        counts[row] = count


@njit([types.void(_i4_2, _i4_2, types.int64[::1], types.int64)], parallel=True, cache=True)
def count_entries(triangles, hit, counts, vertices):
    """How many of the vertices the hits of each row touch.

    triangles (F, 3), hit (rows, rays) negative where there is none, counts (rows,), written.
    """
    for block in prange((len(hit) + _ROWS - 1) // _ROWS):
        _count_rows(triangles, hit, block * _ROWS, min(len(hit), (block + 1) * _ROWS), counts, vertices)


@njit(cache=True)
def _add_hits(triangles, hit, u, v, colours, marked, sums):
    """The hits of one row, added up by vertex in ``sums`` (vertices, channels)."""
    weights = np.empty(3, np.float32)
    share = np.float32(1) / np.float32(len(hit))
    for k in range(len(hit)):
        t = hit[k]
        if t >= 0:
            weights[0] = (np.float32(1) - u[k] - v[k]) * share
            weights[1], weights[2] = u[k] * share, v[k] * share
            for corner in range(3):
                vertex = triangles[t, corner]
                marked[vertex >> 6] |= np.uint64(1) << np.uint64(vertex & 63)
                if colours.shape[1] == 0:
                    sums[vertex, 0] += weights[corner]
                for c in range(colours.shape[1]):
                    sums[vertex, c] += weights[corner] * colours[k, c]


@njit(cache=True)
def _take_entries(marked, sums, start, columns, values):
    """Sums of marked vertices become entries, by ascending vertex; both are zero again."""
    place = start
    for word in range(len(marked)):
        while marked[word] != 0:
            bit = _lowest_bit(marked[word])
            marked[word] &= marked[word] - np.uint64(1)
            vertex = word * 64 + np.int64(bit)
            columns[place] = vertex
            for c in range(sums.shape[1]):
                values[c, place] = sums[vertex, c]
                sums[vertex, c] = 0
            place += 1


@njit(cache=True)
def _fill_rows(triangles, hit, u, v, colours, rows, starts, columns, values, vertices):
    marked = np.zeros(vertices // 64 + 1, np.uint64)
    sums = np.zeros((vertices, len(values)), np.float32)
    for row in range(rows[0], rows[1]):
        _add_hits(triangles, hit[row], u[row], v[row], colours[row], marked, sums)
        _take_entries(marked, sums, starts[row], columns, values)


@njit(
    [
        types.void(
            _i4_2, _i4_2, _f4_2, _f4_2, _f4_3, _i8_1, types.int32[::1], types.float32[:, ::1], types.int64
        )
    ],
    parallel=True,
    cache=True,
)
def fill_entries(triangles, hit, u, v, colours, starts, columns, values, vertices):
    """Entries of rows whose hits are given: columns ascending, one for each vertex that the row touches.

    hit, u, v (rows, rays) and colours (rows, rays, channels) as in ``hemisphere`` and ``hit_colour``; without
    channels an entry has one value, uncoloured. starts (rows + 1,) where each row begins in columns (entries,)
    and values (channels or 1, entries), which are written.
    """
    for block in prange((len(hit) + _ROWS - 1) // _ROWS):
        rows = (block * _ROWS, min(len(hit), (block + 1) * _ROWS))
        _fill_rows(triangles, hit, u, v, colours, rows, starts, columns, values, vertices)

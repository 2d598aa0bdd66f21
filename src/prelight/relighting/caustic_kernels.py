"""Caustics times the light of cells: a few bytes for each vertex that glass or a mirror sends light to."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

_ROWS = 256  # of a task

_i8_1 = types.Array(types.int64, 1, "C", readonly=True)
_u2_1 = types.Array(types.uint16, 1, "C", readonly=True)
_u1_2 = types.Array(types.uint8, 2, "C", readonly=True)
_f4_1 = types.Array(types.float32, 1, "C", readonly=True)
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)


@njit(cache=True)
def _some_rows(starts, cells, codes, scales, light, out, first, last):
    colours = len(codes)
    for row in range(first, last):
        red, green, blue = np.float32(0), np.float32(0), np.float32(0)
        for e in range(starts[row], starts[row + 1]):
            of_cell = light[cells[e]]
            red += np.float32(codes[0, e]) * of_cell[0]
            green += np.float32(codes[min(1, colours - 1), e]) * of_cell[1]
            blue += np.float32(codes[min(2, colours - 1), e]) * of_cell[2]
        out[row, 0], out[row, 1], out[row, 2] = red * scales[row], green * scales[row], blue * scales[row]


@njit(
    [types.void(_i8_1, _u2_1, _u1_2, _f4_1, _f4_2, types.float32[:, ::1])],
    parallel=True,
    cache=True,
)
def shine(starts, cells, codes, scales, light, out):
    """out (rows, 3), written, = scale · Σ code · light of the cell: light (cells, 3), codes (1 or 3, entries)."""
    for part in prange((len(out) + _ROWS - 1) // _ROWS):
        first, last = part * _ROWS, min(len(out), (part + 1) * _ROWS)
        _some_rows(starts, cells, codes, scales, light, out, first, last)

"""Inner products of blocks of columns, each column by itself, in an order that no number of threads changes."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

ROWS = 1024  # summed by one thread, in float64

_f4_2 = types.Array(types.float32, 2, "C", readonly=True)
_f4_3 = types.Array(types.float32, 3, "C", readonly=True)
_f8_2 = types.Array(types.float64, 2, "C", readonly=True)


@njit(cache=True)
def _add_products(basis, w, sums):
    sums[:] = 0
    for i in range(len(basis)):
        for row in range(len(w)):
            q, x, out = basis[i, row], w[row], sums[i]
            for n in range(len(x)):
                out[n] += np.float64(q[n]) * np.float64(x[n])


@njit([types.void(_f4_3, _f4_2, types.float64[:, :, ::1])], parallel=True, cache=True)
def inner_products(basis, w, sums):
    """Σ over a block's rows of basis[i] · w of every column: basis (m, rows, n), w (rows, n), sums (blocks, m, n)."""
    for block in prange(len(sums)):
        rows = slice(block * ROWS, min(len(w), (block + 1) * ROWS))
        _add_products(basis[:, rows], w[rows], sums[block])


@njit(cache=True)
def _add_scaled(factors, basis, w):
    for i in range(len(basis)):
        for row in range(len(w)):
            q, x, f = basis[i, row], w[row], factors[i]
            for n in range(len(x)):
                x[n] += np.float32(f[n]) * q[n]


@njit([types.void(_f8_2, _f4_3, types.float32[:, ::1])], parallel=True, cache=True)
def add_scaled(factors, basis, w):
    """w += Σ_i factors[i] · basis[i], of every column: factors (m, n)."""
    for block in prange((len(w) + ROWS - 1) // ROWS):
        rows = slice(block * ROWS, min(len(w), (block + 1) * ROWS))
        _add_scaled(factors, basis[:, rows], w[rows])

"""Dense products and eigenvectors for finding a few modes of a large matrix.

Every sum has one order, in blocks of fixed size: the same bytes for any number of threads, which libraries of
linear algebra do not promise.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from ..arrays import Float32, Float64

_BLOCK = 512  # rows of one thread
_SWEEPS = 30
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)


@njit(cache=True)
def _add_light(D, weights, out, first, last):
    for k in range(len(D)):
        row = weights[k]
        for v in range(first, last):
            share = D[k, v]
            if share != 0:
                into = out[v]
                for s in range(len(row)):
                    into[s] += share * row[s]


@njit([types.void(_f4_2, _f4_2, types.float32[:, ::1])], parallel=True, cache=True)
def add_light(D, weights, out):
    """out (vertices, n) += Dᵀ · weights: D (cells, vertices), weights (cells, n)."""
    for block in prange((len(out) + _BLOCK - 1) // _BLOCK):
        _add_light(D, weights, out, block * _BLOCK, min(len(out), (block + 1) * _BLOCK))


@njit(cache=True)
def _answer(D, Q, out, partial, first, last):
    partial[:] = 0
    for v in range(first, last):
        share = D[v]
        if share != 0:
            row = Q[v]
            for s in range(len(row)):
                partial[s] += share * row[s]
    for s in range(len(out)):
        out[s] += partial[s]


@njit(cache=True)
def _answers(D, Q, out):
    partial = np.zeros(Q.shape[1], np.float32)
    for first in range(0, len(Q), _BLOCK):
        for k in range(len(D)):
            _answer(D[k], Q, out[k], partial, first, min(len(Q), first + _BLOCK))


@njit([types.void(_f4_2, _f4_2, types.float64[:, ::1])], parallel=True, cache=True)
def answers(D, Q, out):
    """out (cells, n) += D · Q: D (cells, vertices), Q (vertices, n). A thread has whole cells."""
    for part in prange((len(D) + 7) // 8):
        _answers(D[8 * part : 8 * part + 8], Q, out[8 * part : 8 * part + 8])


@njit(cache=True)
def _add_gram(rows, out):
    for row in range(len(rows)):
        x = rows[row]
        for i in range(len(x)):
            value = np.float64(x[i])
            if value != 0:
                into = out[i]
                for j in range(len(x)):
                    into[j] += value * x[j]


@njit([types.void(_f4_2, types.float64[:, :, ::1])], parallel=True, cache=True)
def _grams(rows, out):
    each = (len(rows) + len(out) - 1) // len(out)
    for block in prange(len(out)):
        _add_gram(rows[block * each : (block + 1) * each], out[block])


def gram(rows: Float32[np.ndarray, "rows n"]) -> Float64[np.ndarray, "n n"]:
    """rowsᵀ · rows."""
    blocks = np.zeros((min(64, -(-len(rows) // _BLOCK)), rows.shape[1], rows.shape[1]))
    _grams(np.ascontiguousarray(rows), blocks)
    return np.add.reduce(blocks, axis=0)


@njit(cache=True)
def _add_rows(rows, matrix, out, first, last):
    for row in range(first, last):
        x, into = rows[row], out[row]
        into[:] = 0
        for i in range(len(x)):
            value = x[i]
            if value != 0:
                y = matrix[i]
                for j in range(len(into)):
                    into[j] += value * y[j]


@njit([types.void(_f4_2, _f4_2, types.float32[:, ::1])], parallel=True, cache=True)
def _turn(rows, matrix, out):
    for block in prange((len(rows) + _BLOCK - 1) // _BLOCK):
        _add_rows(rows, matrix, out, block * _BLOCK, min(len(rows), (block + 1) * _BLOCK))


def turned(
    rows: Float32[np.ndarray, "rows n"], matrix: Float64[np.ndarray, "n m"]
) -> Float32[np.ndarray, "rows m"]:
    """rows · matrix."""
    out = np.empty((len(rows), matrix.shape[1]), np.float32)
    _turn(np.ascontiguousarray(rows), np.ascontiguousarray(matrix, np.float32), out)
    return out


@njit([types.void(types.float64[:, ::1], types.float64[:, ::1])], cache=True)
def _diagonalise(A, V):
    """V A Vᵀ becomes diagonal, in place: cyclic Jacobi rotations (Golub and Van Loan, Matrix Computations, 8.5)."""
    n = len(A)
    whole = 0.0
    for i in range(n):
        for j in range(n):
            whole += A[i, j] * A[i, j]
    for _ in range(_SWEEPS):
        off = 0.0
        for i in range(n):
            for j in range(i):
                off += A[i, j] * A[i, j]
        if off <= 1e-28 * whole:
            break
        for p in range(n - 1):
            for q in range(p + 1, n):
                if A[p, q] * A[p, q] <= 1e-34 * whole:
                    continue
                tau = (A[q, q] - A[p, p]) / (2 * A[p, q])
                t = 1 / (abs(tau) + np.sqrt(1 + tau * tau))
                if tau < 0:
                    t = -t
                c = 1 / np.sqrt(1 + t * t)
                s = t * c
                for k in range(n):
                    a, b = A[p, k], A[q, k]
                    A[p, k], A[q, k] = c * a - s * b, s * a + c * b
                for k in range(n):
                    a, b = A[k, p], A[k, q]
                    A[k, p], A[k, q] = c * a - s * b, s * a + c * b
                for k in range(n):
                    a, b = V[p, k], V[q, k]
                    V[p, k], V[q, k] = c * a - s * b, s * a + c * b


def eigenvectors(
    symmetric: Float64[np.ndarray, "n n"],
) -> tuple[Float64[np.ndarray, "n"], Float64[np.ndarray, "n n"]]:
    """Eigenvalues, largest first, and their vectors as columns."""
    A, V = np.array(symmetric, np.float64), np.eye(len(symmetric))
    _diagonalise(A, V)
    order = np.argsort(-np.diag(A), kind="stable")
    return np.diag(A)[order], V[order].T

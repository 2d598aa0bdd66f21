"""Modes of bounced light times their coefficients, and the coefficients that direct light at vertices brings."""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import njit, prange, types

from ..encoding.sparse_tiles import GROUP
from .vector_code import tile_product

_product = tile_product(ir.FloatType(), colours=3, signed=True)
_BLOCK = 1024  # vertices whose shares are summed by one thread
_GROUPS = 64  # of one thread at a time

i1, i4, f4, f8 = types.int8, types.int32, types.float32, types.float64


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


@njit(cache=True)
def _some_groups(modes, every, weights, out, begin, end):
    for g in range(begin, end):
        out[g] = 0
        _product(
            modes.ctypes.data + g * (modes.shape[1] * GROUP), every.ctypes.data, weights.ctypes.data,
            modes.shape[1], out.ctypes.data + g * (3 * GROUP * 4),
        )  # fmt: skip


@njit(
    [types.void(_read_only(i1, 3), _read_only(i4, 1), f4[:, ::1], f4[:, ::1])],
    parallel=True,
    cache=True,
    nogil=True,
)
def bounce(modes, every, weights, out):
    """out (groups, 96) = Σ_k weights_k modes_k: modes (groups, K, 32), every 0 … K − 1, weights (K, 3) with scales."""
    for part in prange((len(modes) + _GROUPS - 1) // _GROUPS):
        _some_groups(modes, every, weights, out, part * _GROUPS, min(len(modes), (part + 1) * _GROUPS))


@njit(cache=True)
def _some_vertices(sources, light, out, begin, end):
    out[:] = 0
    for c in range(3):
        of_colour, into = sources[min(c, len(sources) - 1)], out[c]
        for v in range(begin, end):
            share = light[v, c]
            if share != 0:
                row = of_colour[v]
                for k in range(len(row)):
                    into[k] += share * np.float32(row[k])


@njit(
    [types.void(_read_only(i1, 3), _read_only(f4, 2), f4[:, :, ::1])], parallel=True, cache=True, nogil=True
)
def project(sources, light, out):
    """out (blocks, 3, K): of each thousand vertices Σ_v light[v, colour] · sources[colour, v], scale left out."""
    for block in prange(len(out)):
        _some_vertices(sources, light, out[block], block * _BLOCK, min(len(light), (block + 1) * _BLOCK))


def blocks_of(vertices: int) -> int:
    """How many blocks ``project`` writes."""
    return -(-vertices // _BLOCK)

"""Σ_k w_k·C_k over the byte planes of ``encoding.byte_planes``, every block by one thread, in a fixed order."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from ..encoding.byte_planes import BLOCK
from .plane_code import plane_product

i1, i4, f4, i8 = types.int8, types.int32, types.float32, types.int64


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


@njit(cache=True)
def _add_blocks(data, scales, index, weights, picture, begin, end):
    sums = np.empty((3, BLOCK), np.float32)
    planes, count = data.shape[2], len(index)
    block_at, scale_at = data.ctypes.data, scales.ctypes.data
    for block in range(begin, end):
        for c in range(3):
            n = block * 3 + c
            plane_product(
                block_at + n * planes * BLOCK, scale_at + n * planes * 4, index.ctypes.data,
                weights.ctypes.data + c * count * 4, count, sums.ctypes.data + c * BLOCK * 4,
            )  # fmt: skip
        first = block * BLOCK
        for i in range(min(BLOCK, len(picture) - first)):
            for c in range(3):
                picture[first + i, c] += sums[c, i]


@njit(
    [types.void(_read_only(i1, 4), _read_only(f4, 3), i4[::1], f4[:, ::1], f4[:, ::1], i8[::1])],
    parallel=True,
    cache=True,
)
def add_planes(data, scales, index, weights, picture, shares):
    """picture (pixels, 3) += Σ_n weights[c, n] · plane index[n]; weights (3, planes taken), at least one plane.

    ``shares`` (threads + 1,): thread t has blocks shares[t] … shares[t + 1].
    """
    for t in prange(len(shares) - 1):
        _add_blocks(data, scales, index, weights, picture, shares[t], shares[t + 1])

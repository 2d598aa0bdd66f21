"""Σ_k w_k·C_k over the byte planes of ``encoding.byte_planes``, every block by one thread, in a fixed order."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from ..encoding.byte_planes import BLOCK
from .plane_code import plane_product, write_block
from .vector_code import prefetch

i1, i4, f4, i8 = types.int8, types.int32, types.float32, types.int64

_AHEAD = 10_000  # bytes at least, in whole blocks


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


@njit(cache=True)
def _sum_blocks(data, scales, index, weights, picture, begin, end, adds):
    sums = np.empty((3, BLOCK), np.float32)
    planes, count, whole = data.shape[2], len(index), len(picture) // BLOCK
    block_at, scale_at = data.ctypes.data, scales.ctypes.data
    ahead = (_AHEAD // (3 * planes * BLOCK) + 1) * 3 * planes * BLOCK
    for block in range(begin, end):
        for c in range(3):
            n = block * 3 + c
            plane_product(
                block_at + n * planes * BLOCK, scale_at + n * planes * 4, index.ctypes.data,
                weights.ctypes.data + c * count * 4, count, ahead, sums.ctypes.data + c * BLOCK * 4,
            )  # fmt: skip
        first = block * BLOCK
        if block < whole:
            place = picture.ctypes.data + first * 12
            for line in range(0, 12 * BLOCK, 64):
                prefetch(place + 4 * 12 * BLOCK + line)
            write_block(sums.ctypes.data, place, adds)
            continue
        for i in range(len(picture) - first):
            for c in range(3):
                picture[first + i, c] = sums[c, i] + (picture[first + i, c] if adds else np.float32(0))


@njit(
    [
        types.void(
            _read_only(i1, 4), _read_only(f4, 3), i4[::1], f4[:, ::1], f4[:, ::1], i8[::1], types.boolean
        )
    ],
    parallel=True,
    cache=True,
)
def sum_planes(data, scales, index, weights, picture, shares, adds):
    """picture (pixels, 3) = Σ_n weights[c, n] · plane index[n], or += where ``adds``.

    Weights (3, planes taken), at least one plane. ``shares`` (threads + 1,): thread t has blocks shares[t] …
    shares[t + 1].
    """
    for t in prange(len(shares) - 1):
        _sum_blocks(data, scales, index, weights, picture, shares[t], shares[t + 1], adds)

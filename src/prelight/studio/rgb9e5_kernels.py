"""Radiance in four bytes: three mantissas of nine bits and one exponent (EXT_texture_shared_exponent, OpenGL 3.0).

A colour becomes integers of up to 511 times 2**(e − 24), e from 0 to 31 for all three channels: each is right to
half such a step, at most 2**−9 of the largest channel. Zero is exact; the largest value is 65,408, the smallest
2**−24.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

f4, i8, u4 = types.float32, types.int64, types.uint32
LARGEST = 65408.0
_READ_ROWS = types.Array(f4, 2, "C", readonly=True)
_MOST = np.float32(LARGEST)


@njit(cache=True)
def _bounded(value):
    """A number that can be packed: NaN is 0, as whatever is not above it."""
    return min(value, _MOST) if value > np.float32(0.0) else np.float32(0.0)


@njit(cache=True)
def _whole(value, step):
    return np.int64(value * step + np.float32(0.5))


@njit(cache=True)
def _packed(red, green, blue):
    largest = np.float32(max(red, green, blue))
    exponent = max((largest.view(np.int32) >> 23) - 127, -16) + 16  # of 2, so that mantissas stay below 512
    step = np.int32((24 - exponent + 127) << 23).view(np.float32)  # 2 ** (24 − exponent)
    if _whole(largest, step) == 512:
        exponent += 1
        step *= np.float32(0.5)
    bits = exponent << 27 | _whole(blue, step) << 18 | _whole(green, step) << 9 | _whole(red, step)
    return np.uint32(bits)


@njit(cache=True)
def _pack_some(sky, gain, discs, out, begin, end):
    for i in range(begin, end):
        out[i] = _packed(
            _bounded(sky[i, 0] * gain[0] + discs[i, 0]),
            _bounded(sky[i, 1] * gain[1] + discs[i, 1]),
            _bounded(sky[i, 2] * gain[2] + discs[i, 2]),
        )


@njit([types.void(_READ_ROWS, u4[::1])], cache=True, nogil=True)
def pack_alone(radiance, out):
    """out[i] = rgb9e5(radiance[i]), rows (n, 3), by the thread that calls: for any thread at any time."""
    one, nothing = np.ones(3, np.float32), np.zeros((1, 3), np.float32)
    for i in range(len(out)):
        _pack_some(radiance[i : i + 1], one, nothing, out[i : i + 1], 0, 1)


@njit([types.void(_READ_ROWS, f4[::1], _READ_ROWS, u4[::1], i8)], parallel=True, cache=True, nogil=True)
def pack(sky, gain, discs, out, chunks):
    """out[i] = rgb9e5(sky[i] · gain + discs[i]); rows (n, 3), gain (3,), in ``chunks`` parts side by side."""
    for k in prange(chunks):
        _pack_some(sky, gain, discs, out, k * len(out) // chunks, (k + 1) * len(out) // chunks)

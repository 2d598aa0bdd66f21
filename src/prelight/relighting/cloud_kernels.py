"""Clustered components times weights: a few numbers for each cluster, then a few for each of its vertices."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from ..encoding.modes import BLOCK

STRIP = 1024  # vertices of one thread
_BLOCK = BLOCK

f4, i4, i8 = types.float32, types.int32, types.int64
_list = types.Array(f4, 1, "C", readonly=True)
_places = types.Array(i8, 2, "C", readonly=True)
_order = types.Array(i4, 1, "C", readonly=True)
_weights = types.Array(f4, 2, "C", readonly=True)


@njit(cache=True, fastmath={"reassoc", "contract"})
def _dot(a, b):
    total = np.float32(0)
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


@njit(cache=True)
def _cluster(k, places, bases, codes, scales, weights, is_grey, order, out):
    """The rows of one cluster, in three channels: what a shared basis brings is the same for all of a grey light."""
    first, rows, slot, width = places[k, 0], places[k, 1], places[k, 2], places[k, 3]
    sums = np.empty(rows, np.float32)
    channels = (places.shape[1] - 4) // 4
    most = 0
    for c in range(channels):
        most = max(most, places[k, 4 + 4 * c])
    brought = np.empty(most + 1, np.float32)
    last = np.int64(-1)
    for c in range(3):
        at = 4 + 4 * (c if channels == 3 else 0)
        components, base, code, scale = places[k, at], places[k, at + 1], places[k, at + 2], places[k, at + 3]
        if base != last or not is_grey:
            w = weights[c, slot : slot + width]
            for i in range(components + 1):
                start = base + i * width
                brought[i] = _dot(bases[start : start + width], w)
            last = base
        sums[:] = brought[0]
        for i in range(components):
            b = brought[i + 1] * scales[scale + i]
            own = codes[code + i * rows : code + (i + 1) * rows]
            for r in range(len(own)):
                sums[r] += b * np.float32(own[r])
        for r in range(rows):
            out[order[first + r], c] = sums[r]


@njit(
    [
        types.void(
            _places,
            _list,
            types.Array(code, 1, "C", readonly=True),
            _list,
            _weights,
            types.boolean,
            _order,
            f4[:, ::1],
        )
        for code in (types.int8, f4)
    ],
    parallel=True,
    cache=True,
    nogil=True,
)
def cloud_light(places, bases, codes, scales, weights, is_grey, order, out):
    """out (V, 3) = Σ over lights of weight · what is kept of the vertex's answer, x ≈ m + Σ b z.

    places (clusters, 4 + 4 · channels): first row in ``order``, rows, first weight, weights; then for each channel
    how many components, and where bases, codes and their scales begin. weights (3, …) of each zone one after the other,
    all three alike if ``is_grey``.
    """
    for k in prange(len(places)):
        _cluster(k, places, bases, codes, scales, weights, is_grey, order, out)


@njit(cache=True)
def _strip(sources, scales, light, out, first, last):
    for c in range(light.shape[1]):
        for begin in range(first, last, _BLOCK):
            sums, is_lit = np.zeros(sources.shape[1], np.float32), False
            for v in range(begin, min(last, begin + _BLOCK)):
                share = light[v, c]
                if share != 0:
                    is_lit, row = True, sources[v]
                    for k in range(len(row)):
                        sums[k] += share * np.float32(row[k])
            if is_lit:
                of_block = scales[begin // _BLOCK]
                for k in range(len(sums)):
                    out[c, k] += sums[k] * of_block[k]


@njit(
    [types.void(types.Array(types.int16, 2, "C", readonly=True), _weights, _weights, f4[:, :, ::1])],
    parallel=True,
    cache=True,
)
def brought_of_modes(sources, scales, light, out):
    """out (strips, channels, modes) += of each thousand vertices Σ light[v, c] · sources[v] · scales[block of v].

    sources (V, modes), scales of each 64 of them, light (V, channels): irradiance / π times area.
    """
    for strip in prange(len(out)):
        _strip(sources, scales, light, out[strip], strip * STRIP, min(len(light), (strip + 1) * STRIP))

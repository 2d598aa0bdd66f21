"""Full and local relighting over the tiles of ``encoding.sparse_tiles``.

Sums over the clusters of a panel are float32, sums over panels float64; increments are float64
throughout, so that they cancel what they once added. Each group of 32 receivers belongs to one
thread and is summed in a fixed order: the result does not depend on the number of threads.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import njit, prange, types

from ..encoding.sparse_tiles import GROUP, TILE, TILES
from .vector_code import prefetch, tile_product

_product32 = tile_product(ir.FloatType())
_product64 = tile_product(ir.DoubleType())

_TILE_BYTES = TILE * GROUP
_AHEAD = 12  # groups whose tiles are on their way while one is multiplied


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


@njit(cache=True)
def _count_bits(bits):
    count = 0
    while bits:
        bits &= bits - 1
        count += 1
    return count


@njit(cache=True)
def _full_groups(addresses, first, present, lit, weights, every, scratch, sums, begin, end):
    panels = len(addresses)
    for g in range(begin, end):
        for i in range(3 * GROUP):
            sums[g, i] = 0
    for p in range(panels):
        if lit[p] == 0:
            continue
        for g in range(begin, end):
            bits = present[p, g] & lit[p]
            if bits == 0:
                continue
            for i in range(3 * GROUP):
                scratch[i] = 0
            t = first[p, g]
            for s in range(TILES):
                if (bits >> s) & 1:
                    _product32(
                        addresses[p] + t * _TILE_BYTES,
                        every.ctypes.data,
                        weights.ctypes.data + ((p * TILES + s) * TILE) * 12,
                        TILE,
                        scratch.ctypes.data,
                    )
                t += (present[p, g] >> s) & 1
            for i in range(3 * GROUP):
                sums[g, i] += scratch[i]


@njit(
    [
        types.void(
            _read_only(types.int64, 1),
            _read_only(types.int32, 2),
            _read_only(types.uint16, 2),
            types.uint16[::1],
            types.float32[:, ::1],
            types.int32[::1],
            types.float32[:, ::1],
            types.float64[:, ::1],
        )
    ],
    parallel=True,
    cache=True,
)
def relight_full(addresses, first, present, lit, weights, every, scratch, sums):
    """sums = Σ_k weights_k T_k  (Eq. 8).

    addresses (P,) of the panels' tiles; first, present (P, G); lit (P,) bits of the tiles that have a
    weight; weights (P·256, 3), scale included; every = 0 … 15; scratch (threads, 96);
    sums (G, 96): three channels of 32 receivers, in storage order.
    """
    threads, groups = len(scratch), present.shape[1]
    for t in prange(threads):
        begin, end = groups * t // threads, groups * (t + 1) // threads
        _full_groups(addresses, first, present, lit, weights, every, scratch[t], sums, begin, end)


@njit(cache=True)
def _tile_address(addresses, first, present, column, g):
    """Where a group's tile of a tile column is, 0 if it is all zero."""
    p, s = column // TILES, column % TILES
    bits = present[p, g]
    if not (bits >> s) & 1:
        return 0
    return addresses[p] + (first[p, g] + _count_bits(bits & ((1 << s) - 1))) * _TILE_BYTES


@njit(cache=True)
def _local_groups(addresses, first, present, column, start, index, weights, sums, begin, end):
    for g in range(begin, end):
        for c in range(len(column)):
            if g + _AHEAD < end:
                soon = _tile_address(addresses, first, present, column[c], g + _AHEAD)
                if soon:
                    for n in range(start[c], start[c + 1]):
                        prefetch(soon + index[n] * GROUP)
            tile = _tile_address(addresses, first, present, column[c], g)
            if tile:
                a = start[c]
                _product64(
                    tile,
                    index.ctypes.data + a * 4,
                    weights.ctypes.data + a * 24,
                    start[c + 1] - a,
                    sums.ctypes.data + g * (3 * GROUP * 8),
                )


_local_signature = types.void(
    _read_only(types.int64, 1),
    _read_only(types.int32, 2),
    _read_only(types.uint16, 2),
    types.int64[::1],
    types.int64[::1],
    types.int32[::1],
    types.float64[:, ::1],
    types.float64[:, ::1],
    types.int64,
)


@njit([_local_signature], parallel=True, cache=True)
def relight_local(addresses, first, present, column, start, index, weights, sums, threads):
    """sums += Σ_t (L'_t − L_t) T_t over the changed clusters (Eq. 15).

    column (C,) tile columns p·16 + s that hold a changed cluster; start (C + 1,) where each one's clusters
    begin in index (cluster within the tile) and weights (n, 3) float64, scale included.
    """
    groups = present.shape[1]
    for t in prange(threads):
        begin, end = groups * t // threads, groups * (t + 1) // threads
        _local_groups(addresses, first, present, column, start, index, weights, sums, begin, end)


@njit([_local_signature], cache=True)
def relight_local_alone(addresses, first, present, column, start, index, weights, sums, threads):
    """The same, to the last bit, in the calling thread: where others keep the processors busy, waiting for a
    second thread costs a time slice (8 ms seen) and the work itself a fraction of a millisecond."""
    _local_groups(addresses, first, present, column, start, index, weights, sums, 0, present.shape[1])


@njit(cache=True)
def _write_group(g, order, albedo, sums, radiance):
    for i in range(min(GROUP, len(order) - g * GROUP)):
        r = order[g * GROUP + i]
        for c in range(3):
            radiance[r, c] = np.float32(max(sums[g, c * GROUP + i], 0.0)) * albedo[r, c]


@njit(
    [
        types.void(
            _read_only(types.int32, 1),
            _read_only(types.float32, 2),
            types.float64[:, ::1],
            types.float32[:, ::1],
        )
    ],
    parallel=True,
    cache=True,
)
def write_radiance(order, albedo, sums, radiance):
    """radiance[receiver] = albedo · sum, (R, 3), from storage order to the scene's."""
    for g in prange(len(sums)):
        _write_group(g, order, albedo, sums, radiance)


@njit(cache=True)
def _rectangle_sum(cube, solid_angles, rectangle, out):
    f, i0, j0, h, w = rectangle[0], rectangle[1], rectangle[2], rectangle[3], rectangle[4]
    r = g = b = 0.0
    for i in range(i0, i0 + h):
        texels, weight = cube[f, i, j0 : j0 + w], solid_angles[i, j0 : j0 + w]
        for j in range(w):
            r += texels[j, 0] * weight[j]
            g += texels[j, 1] * weight[j]
            b += texels[j, 2] * weight[j]
    out[0], out[1], out[2] = r, g, b


@njit(
    [
        types.void(
            _read_only(types.float32, 4),
            _read_only(types.float32, 2),
            _read_only(types.int32, 2),
            _read_only(types.int64, 1),
            types.float64[:, ::1],
        )
    ],
    parallel=True,
    cache=True,
)
def cluster_light(cube, solid_angles, rectangles, clusters, light):
    """L_C of the clusters: radiance times solid angle, summed over their texels (section 5.1); light (n, 3)."""
    for n in prange(len(clusters)):
        _rectangle_sum(cube, solid_angles, rectangles[clusters[n]], light[n])


EVERY = np.arange(TILE, dtype=np.int32)

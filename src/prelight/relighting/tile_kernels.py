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
from .vector_code import tile_product

_product32 = tile_product(ir.FloatType())
_product64 = tile_product(ir.DoubleType())

_TILE_BYTES = TILE * GROUP


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
def _write_group(albedo, sums, radiance):
    for i in range(3 * GROUP):
        radiance[i] = np.float32(max(sums[i], 0.0)) * albedo[i]


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
            types.float32[:, ::1],
            types.float64[:, ::1],
            types.float32[:, ::1],
        )
    ],
    parallel=True,
    cache=True,
)
def relight_full(addresses, first, present, lit, weights, every, scratch, albedo, sums, radiance):
    """sums = Σ_k weights_k T_k  (Eq. 8), and the radiance that follows.

    addresses (P,) of the panels' tiles; first, present (P, G); lit (P,) bits of the tiles that have a
    weight; weights (P·256, 3), scale included; every = 0 … 15; scratch (threads, 96);
    albedo, sums and radiance (G, 96): three channels of 32 receivers, in storage order.
    """
    threads, groups = len(scratch), present.shape[1]
    for t in prange(threads):
        begin, end = groups * t // threads, groups * (t + 1) // threads
        _full_groups(addresses, first, present, lit, weights, every, scratch[t], sums, begin, end)
        for g in range(begin, end):
            _write_group(albedo[g], sums[g], radiance[g])


@njit(cache=True)
def _local_groups(
    addresses, first, present, column, start, index, weights, albedo, sums, radiance, begin, end
):
    for g in range(begin, end):
        touched = False
        for c in range(len(column)):
            p, s = column[c] // TILES, column[c] % TILES
            bits = present[p, g]
            if (bits >> s) & 1:
                t = first[p, g] + _count_bits(bits & ((1 << s) - 1))
                a = start[c]
                _product64(
                    addresses[p] + t * _TILE_BYTES,
                    index.ctypes.data + a * 4,
                    weights.ctypes.data + a * 24,
                    start[c + 1] - a,
                    sums.ctypes.data + g * (3 * GROUP * 8),
                )
                touched = True
        if touched:
            _write_group(albedo[g], sums[g], radiance[g])


@njit(
    [
        types.void(
            _read_only(types.int64, 1),
            _read_only(types.int32, 2),
            _read_only(types.uint16, 2),
            types.int64[::1],
            types.int64[::1],
            types.int32[::1],
            types.float64[:, ::1],
            types.float32[:, ::1],
            types.float64[:, ::1],
            types.float32[:, ::1],
            types.int64,
        )
    ],
    parallel=True,
    cache=True,
)
def relight_local(addresses, first, present, column, start, index, weights, albedo, sums, radiance, threads):
    """sums += Σ_t (L'_t − L_t) T_t over the changed clusters (Eq. 15), and the radiance of who sees them.

    column (C,) tile columns p·16 + s that hold a changed cluster; start (C + 1,) where each one's clusters
    begin in index (cluster within the tile) and weights (n, 3) float64, scale included. albedo, sums and
    radiance (G, 96): three channels of 32 receivers, in storage order.
    """
    groups = present.shape[1]
    for t in prange(threads):
        begin, end = groups * t // threads, groups * (t + 1) // threads
        _local_groups(
            addresses, first, present, column, start, index, weights, albedo, sums, radiance, begin, end
        )


@njit(cache=True)
def _order_group(order, grouped, g, out):
    for i in range(min(GROUP, len(order) - g * GROUP)):
        r = order[g * GROUP + i]
        for c in range(3):
            out[r, c] = grouped[g, c * GROUP + i]


@njit(
    [types.void(_read_only(types.int32, 1), types.float32[:, ::1], types.float32[:, ::1])],
    parallel=True,
    cache=True,
)
def in_receiver_order(order, grouped, out):
    """From groups (G, 96) in storage order to (R, 3) in the scene's."""
    for g in prange(len(grouped)):
        _order_group(order, grouped, g, out)


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

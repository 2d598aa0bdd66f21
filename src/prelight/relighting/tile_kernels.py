"""Full and local relighting over the tiles of ``encoding.sparse_tiles``.

Sums over the clusters of a panel are float32, sums over panels float64; increments are float64
throughout, so that they cancel what they once added. Each group of 32 receivers belongs to one
thread and is summed in a fixed order: the result does not depend on the number of threads.

``sums`` (groups, 96) holds three channels of 32 receivers, in storage order; ``shares`` (threads + 1,)
says that thread t has groups shares[t] … shares[t + 1]. A zone's tiles have one channel, which
three colours of light multiply, or three, each multiplied by its own.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import njit, prange, types

from ..encoding.sparse_tiles import GROUP, TILE, TILES
from .layer import Tiles
from .vector_code import count_bits, prefetch, tile_product

_full_grey = tile_product(ir.FloatType(), colours=3)
_full_one = tile_product(ir.FloatType(), colours=1)
_local_grey = tile_product(ir.DoubleType(), colours=3)
_local_one = tile_product(ir.DoubleType(), colours=1)
_blend_grey = tile_product(ir.DoubleType(), colours=3, source=ir.DoubleType())
_blend_one = tile_product(ir.DoubleType(), colours=1, source=ir.DoubleType())

_TILE_BYTES = TILE * GROUP
AHEAD = 16  # groups whose tiles are on their way while one is multiplied
_SUM_BYTES = 8 * GROUP  # of a channel of a group

i8, i4, f4, f8 = types.int64, types.int32, types.float32, types.float64


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


TILE_TABLES = types.NamedTuple(
    [_read_only(i8, 2), _read_only(i8, 1), _read_only(i8, 1), _read_only(i4, 1), _read_only(types.uint16, 1)],
    Tiles,
)
SHARES = _read_only(i8, 1)


@njit(cache=True)
def _full_groups(tiles, lit, weights, every, scratch, sums, begin, end):
    sums[begin:end] = 0
    for z in range(len(tiles.zones)):
        first_group, groups, channels, panel, panels = tiles.zones[z]
        low, high = max(begin - first_group, 0), min(end - first_group, groups)
        if low >= high:
            continue
        for p in range(panel, panel + panels):
            if lit[p] == 0:
                continue
            for c in range(channels):
                for g in range(low, high):
                    word = tiles.words[p] + c * groups + g
                    bits = tiles.present[word]
                    if bits & lit[p] == 0:
                        continue
                    scratch[:] = 0
                    tile = tiles.addresses[p] + tiles.first[word] * _TILE_BYTES
                    weight = weights.ctypes.data + p * (TILES * TILE * 12) + c * 4
                    for s in range(TILES):
                        if (bits & lit[p]) >> s & 1:
                            if channels == 1:
                                _full_grey(tile, every.ctypes.data, weight, TILE, scratch.ctypes.data)
                            else:
                                _full_one(tile, every.ctypes.data, weight, TILE, scratch.ctypes.data)
                        tile += (bits >> s & 1) * _TILE_BYTES
                        weight += TILE * 12
                    if channels == 1:
                        for i in range(3 * GROUP):
                            sums[first_group + g, i] += scratch[i]
                    else:
                        for i in range(GROUP):
                            sums[first_group + g, c * GROUP + i] += scratch[i]


@njit(
    [
        types.void(
            TILE_TABLES, types.uint16[::1], f4[:, ::1], _read_only(i4, 1), f4[:, ::1], f8[:, ::1], SHARES
        )
    ],
    parallel=True,
    cache=True,
)
def relight_full(tiles, lit, weights, every, scratch, sums, shares):
    """sums = Σ_k weights_k T_k  (Eq. 8).

    lit (panels,) bits of the tiles that have a weight; weights (panels·256, 3), scale included;
    every = 0 … 15; scratch (threads, 96).
    """
    for t in prange(len(shares) - 1):
        _full_groups(tiles, lit, weights, every, scratch[t], sums, shares[t], shares[t + 1])


@njit(cache=True)
def tile_address(addresses, words, first, present, column, word):
    """Where the tile of a tile column p·16 + s and the word-th group of the panel is, 0 if it is all zero."""
    p, s = column // TILES, column % TILES
    word += words[p]
    bits = present[word]
    if not (bits >> s) & 1:
        return 0
    return addresses[p] + (first[word] + count_bits(bits & ((1 << s) - 1))) * _TILE_BYTES


@njit(cache=True)
def _local_groups(tiles, changes, weights, sums, begin, end):
    zones, addresses, words, first, present = tiles
    begins, column, start, index = changes
    for z in range(len(zones)):
        first_group, groups, channels = zones[z, 0], zones[z, 1], zones[z, 2]
        if begins[z] == begins[z + 1]:
            continue
        for g in range(max(begin - first_group, 0), min(end - first_group, groups)):
            for c in range(channels):
                into = sums.ctypes.data + ((first_group + g) * 3 + c) * _SUM_BYTES
                for n in range(begins[z], begins[z + 1]):
                    a, b, word = start[n], start[n + 1], c * groups + g
                    if g + AHEAD < groups:
                        soon = tile_address(addresses, words, first, present, column[n], word + AHEAD)
                        if soon:
                            for i in range(a, b):
                                prefetch(soon + index[i] * GROUP)
                    tile = tile_address(addresses, words, first, present, column[n], word)
                    if tile == 0:
                        continue
                    where, weight = index.ctypes.data + a * 4, weights.ctypes.data + a * 24 + c * 8
                    if channels == 1:
                        _local_grey(tile, where, weight, b - a, into)
                    else:
                        _local_one(tile, where, weight, b - a, into)


CHANGES = types.Tuple((i8[::1], i8[::1], i8[::1], i4[::1]))  # begins, column, start, index
_local_signature = types.void(TILE_TABLES, CHANGES, f8[:, ::1], f8[:, ::1], SHARES)


@njit([_local_signature], parallel=True, cache=True)
def relight_local(tiles, changes, weights, sums, shares):
    """sums += Σ_t (L'_t − L_t) T_t over the changed clusters (Eq. 15), as ``gather_changes`` lists them."""
    for t in prange(len(shares) - 1):
        _local_groups(tiles, changes, weights, sums, shares[t], shares[t + 1])


@njit(cache=True)
def _disc_groups(tiles, changes, weights, places, afresh, unit_starts, units, alight, begin, end):
    zones, addresses, words, first, present = tiles
    begins, column, start, index = changes
    soon = np.zeros((AHEAD, 3, len(column)), np.int64)  # addresses of tiles on their way
    where, weight, unit_at = index.ctypes.data, weights.ctypes.data, units.ctypes.data
    for z in range(len(zones)):
        first_group, groups, channels = zones[z, 0], zones[z, 1], zones[z, 2]
        low, high = max(begin - first_group, 0), min(end - first_group, groups)
        for ahead in range(low, high + AHEAD if low < high else low):
            turn, g = ahead & AHEAD - 1, first_group + ahead - AHEAD
            for d in range(len(places)):
                from_, to, place = begins[d * len(zones) + z], begins[d * len(zones) + z + 1], places[d]
                if ahead >= low + AHEAD:
                    if afresh[d]:
                        for i in range(unit_starts[g], unit_starts[g + 1]):
                            units[place, i] = 0.0
                        alight[place, g] = False
                    into = unit_at + (place * units.shape[1] + unit_starts[g]) * 8
                    for c in range(channels):
                        for n in range(from_, to):
                            tile, a = soon[turn, c, n], start[n]
                            if tile:
                                _local_one(
                                    tile, where + a * 4, weight + a * 24 + c * 8, start[n + 1] - a, into
                                )
                                alight[place, g] = True
                        into += _SUM_BYTES
                if ahead < high:
                    for c in range(channels):
                        for n in range(from_, to):
                            word = c * groups + ahead
                            tile = tile_address(addresses, words, first, present, column[n], word)
                            soon[turn, c, n] = tile
                            if tile:
                                for i in range(start[n], start[n + 1]):
                                    prefetch(tile + index[i] * GROUP)


UNITS = (_read_only(i8, 1), f8[:, ::1], types.boolean[:, ::1])


@njit(
    [types.void(TILE_TABLES, CHANGES, f8[:, ::1], i8[::1], types.boolean[::1], *UNITS, SHARES)],
    parallel=True,
    cache=True,
)
def move_discs(tiles, changes, weights, places, afresh, unit_starts, units, alight, shares):
    """What lights bring at strength one, as their weights change: unit += Σ_t (w'_t − w_t) T_t.

    Light d has row places[d] of units, 32 numbers for each group and channel, those of group g from
    unit_starts[g] on, and of alight (places, groups), which says where its unit may not be zero.
    ``gather_changes`` lists, light after light, by how much weights change, or with ``afresh`` what they now are.
    """
    for t in prange(len(shares) - 1):
        _disc_groups(
            tiles, changes, weights, places, afresh, unit_starts, units, alight, shares[t], shares[t + 1]
        )


@njit(cache=True)
def _write_groups(order, albedo, sums, discs, unit_starts, units, alight, radiance, begin, end):
    places, colours, every = discs
    total = np.empty(3 * GROUP)
    for g in range(begin, end):
        for i in range(3 * GROUP):
            total[i] = sums[g, i]
        is_grey = unit_starts[g + 1] - unit_starts[g] == GROUP
        for d in range(len(places)):
            if not alight[places[d], g]:
                continue
            unit = units.ctypes.data + (places[d] * units.shape[1] + unit_starts[g]) * 8
            colour, into = colours.ctypes.data + d * 24, total.ctypes.data
            if is_grey:
                _blend_grey(unit, every.ctypes.data, colour, 1, into)
            else:
                for c in range(3):
                    at = c * _SUM_BYTES
                    _blend_one(unit + at, every.ctypes.data, colour + c * 8, 1, into + at)
        for i in range(GROUP):
            r = order[g * GROUP + i]
            if r < 0:
                continue
            for c in range(3):
                value = np.float32(max(total[c * GROUP + i], 0.0))
                radiance[r, c] = value * albedo[r, c] if is_grey else value


_DISCS = types.Tuple((i8[::1], f8[:, ::1], _read_only(i4, 1)))


@njit(
    [types.void(_read_only(i4, 1), _read_only(f4, 2), f8[:, ::1], _DISCS, *UNITS, f4[:, ::1], SHARES)],
    parallel=True,
    cache=True,
)
def write_radiance(order, albedo, sums, discs, unit_starts, units, alight, radiance, shares):
    """Radiance (rows, 3) from storage order: sums and lights, times albedo (rows, 3) in groups of one channel.

    discs is (places (D,), colours (D, 3), 0 … 15); units as for ``move_discs``.
    """
    for t in prange(len(shares) - 1):
        _write_groups(
            order, albedo, sums, discs, unit_starts, units, alight, radiance, shares[t], shares[t + 1]
        )


EVERY = np.arange(TILE, dtype=np.int32)
EVERY.flags.writeable = False

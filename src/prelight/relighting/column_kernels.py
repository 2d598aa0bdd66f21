"""Transfer columns at hand, each in one piece: what lights bring whose weights change, from those.

A tile has 16 clusters side by side, of which a light that moves needs a few: 32 bytes here, 32 bytes a page
further on. The edge of a disc that moves in small steps crosses the same clusters for some while, so they are
copied out once, with their neighbours: four clusters, a *quad*, mostly siblings in the tree, have a *place*.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from ..encoding.sparse_tiles import GROUP, TILE
from .tile_kernels import AHEAD, CHANGES, SHARES, TILE_TABLES, UNITS, tile_address
from .vector_code import column_product, copy_quad, prefetch

QUAD = 4  # clusters
_LATELY = 8  # updates: what they needed is likely to be needed again

i8, f8 = types.int64, types.float64
_TABLE = types.Array(i8, 2, "C", readonly=True)
_PLACES = types.Tuple((_TABLE, i8[::1], i8[::1], i8[::1], i8[::1]))
_FILLS = types.Tuple((i8[::1], i8[::1], i8[::1]))  # begins (zones + 1,), quad, target


@njit(cache=True)
def _free_place(first, end, needed, now, hand, z):
    """A place of a zone that was not needed of late, or at least not now; −1 if there is none."""
    for limit in (now - _LATELY, now - 1):
        for _ in range(end - first):
            place = hand[z]
            hand[z] = place + 1 if place + 1 < end else first
            if needed[place] <= limit:
                return place
    return -1


@njit(cache=True)
def _quads_of(column, start, index):
    quads = np.empty(len(index), np.int64)
    for n in range(len(column)):
        for i in range(start[n], start[n + 1]):
            quads[i] = column[n] * (TILE // QUAD) + index[i] // QUAD
    return quads


@njit([types.Tuple((types.boolean, i8[::1], _FILLS))(CHANGES, i8, _PLACES, i8, i8)], cache=True)
def plan_columns(changes, lights, places, now, pool):
    """Where the columns of changed clusters are, or will be: ``changes`` as ``gather_changes`` lists them.

    places: table (zones, 4), each zone's first place, its last + 1, where in the pool it begins, and the bytes of
    a place; place_of (quads,), −1 where it has none; quad_in (places,); needed (places,), by which update last;
    hand (zones,), the place to try next. pool: its address. Returns whether there is room for all; the address of
    each column (m,); and of each zone the quads that are to be copied out, and where to.
    """
    begins, column, start, index = changes
    table, place_of, quad_in, needed, hand = places
    zones, quads = len(table), _quads_of(column, start, index)
    columns, fill_begins = np.empty(len(quads), np.int64), np.zeros(zones + 1, np.int64)
    filled, targets = np.empty(len(quads), np.int64), np.empty(len(quads), np.int64)
    fills = 0
    for z in range(zones):
        first, end, at, size = table[z]
        for is_second in range(2):  # those at hand first, so that none of them is given up
            for b in range(z, lights * zones, zones):
                for i in range(start[begins[b]], start[begins[b + 1]]):
                    place = place_of[quads[i]]
                    if place < 0 and is_second:
                        place = _free_place(first, end, needed, now, hand, z)
                        if place < 0:
                            return False, columns, (fill_begins, filled, targets)
                        if quad_in[place] >= 0:
                            place_of[quad_in[place]] = -1
                        place_of[quads[i]], quad_in[place] = place, quads[i]
                        filled[fills], targets[fills] = quads[i], pool + at + (place - first) * size
                        fills += 1
                    if place >= 0:
                        needed[place] = now
                        columns[i] = pool + at + (place - first) * size + index[i] % QUAD * (size // QUAD)
        fill_begins[z + 1] = fills
    return True, columns, (fill_begins, filled, targets)


@njit(cache=True)
def _copy_out(tiles, z, quad, target, low, high):
    """Four columns of a zone out of its tiles, one behind the other, groups low … high."""
    zones, addresses, words, first, present = tiles
    groups, channels = zones[z, 1], zones[z, 2]
    column, inside = quad // (TILE // QUAD), quad % (TILE // QUAD) * (QUAD * GROUP)
    on_their_way = np.empty(AHEAD, np.int64)
    for c in range(channels):
        for ahead in range(low, high + AHEAD):
            turn, g = ahead & AHEAD - 1, ahead - AHEAD
            if g >= low:
                into = target + (c * groups + g) * GROUP
                copy_quad(on_their_way[turn], into, channels * groups * GROUP)
            if ahead < high:
                tile = tile_address(addresses, words, first, present, column, c * groups + ahead)
                tile += inside if tile else 0
                on_their_way[turn] = tile
                prefetch(tile)
                prefetch(tile + 2 * GROUP)


@njit(cache=True)
def _move_groups(
    tiles, changes, columns, fills, weights, places, afresh, unit_starts, units, alight, begin, end
):
    zones, begins, start = tiles.zones, changes[0], changes[2]
    fill_begins, quads, targets = fills
    for z in range(len(zones)):
        first_group, groups, channels = zones[z, 0], zones[z, 1], zones[z, 2]
        low, high = max(begin - first_group, 0), min(end - first_group, groups)
        if low >= high:
            continue
        for n in range(fill_begins[z], fill_begins[z + 1]):
            _copy_out(tiles, z, quads[n], targets[n], low, high)
        for d in range(len(places)):
            place, b = places[d], d * len(zones) + z
            first, count = start[begins[b]], start[begins[b + 1]] - start[begins[b]]
            if afresh[d]:
                units[place, unit_starts[first_group + low] : unit_starts[first_group + high]] = 0.0
                alight[place, first_group + low : first_group + high] = False
            if count == 0:
                continue
            alight[place, first_group + low : first_group + high] = True
            column, weight = columns.ctypes.data + first * 8, weights.ctypes.data + first * 24
            into = units.ctypes.data + (place * units.shape[1] + unit_starts[first_group + low]) * 8
            for g in range(low, high):
                for c in range(channels):
                    column_product(column, (c * groups + g) * GROUP, weight + c * 8, count, into)
                    into += GROUP * 8


@njit(
    [
        types.void(
            TILE_TABLES, CHANGES, i8[::1], _FILLS, f8[:, ::1], i8[::1], types.boolean[::1], *UNITS, SHARES
        )
    ],
    parallel=True,
    cache=True,
)
def move_by_columns(
    tiles, changes, columns, fills, weights, places, afresh, unit_starts, units, alight, shares
):
    """``tile_kernels.move_discs``, from columns at hand: columns and fills as of ``plan_columns``."""
    for t in prange(len(shares) - 1):
        _move_groups(
            tiles, changes, columns, fills, weights, places, afresh, unit_starts, units, alight,
            shares[t], shares[t + 1],
        )  # fmt: skip

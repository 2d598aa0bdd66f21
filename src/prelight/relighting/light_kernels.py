"""The light of nodes of the cube's quadtree: radiance times solid angle, summed over their texels (section 5.1).

Nodes come in *pre-order*: a node before those inside it, otherwise in Z-order; ``after[i]`` is the first node
behind node i that is not inside it. A node with none inside is an *atom* and sums texels; others sum the nodes
just inside them, in order. It is the same order everywhere, so light that did not change is the same bits.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from ..encoding.sparse_tiles import PANEL, TILE

i8, i4, f4, f8 = types.int64, types.int32, types.float32, types.float64


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


BOX = 32  # nodes, whose rectangles have one around them
NODES, AFTER, _OMEGA = _read_only(i4, 2), _read_only(i8, 1), _read_only(f4, 2)


@njit(cache=True, fastmath={"reassoc", "contract"})
def _rectangle_light(cube, omega, node, out):
    f, i0, j0, h, w = node[0], node[1], node[2], node[3], node[4]
    r = g = b = 0.0
    for i in range(i0, i0 + h):
        texels, weight = cube[f, i, j0 : j0 + w], omega[i, j0 : j0 + w]
        for j in range(w):
            r += texels[j, 0] * weight[j]
            g += texels[j, 1] * weight[j]
            b += texels[j, 2] * weight[j]
    out[0], out[1], out[2] = r, g, b


@njit(cache=True)
def _some_atoms(cube, omega, nodes, after, begin, end, light):
    for i in range(begin, end):
        if after[i] == i + 1:
            _rectangle_light(cube, omega, nodes[i], light[i])


@njit(cache=True)
def sum_inside(after, light, i, out):
    out[:] = 0.0
    j = i + 1
    while j < after[i]:
        for c in range(len(out)):
            out[c] += light[j, c]
        j = after[j]


@njit(
    [types.void(_read_only(f4, 4), _OMEGA, NODES, AFTER, _read_only(i8, 1), f8[:, ::1])],
    parallel=True,
    cache=True,
)
def light_everywhere(cube, omega, nodes, after, shares, light):
    """Light (nodes, 3) of all nodes; shares (threads + 1,): thread t does the atoms among shares[t] … shares[t + 1]."""
    for t in prange(len(shares) - 1):
        _some_atoms(cube, omega, nodes, after, shares[t], shares[t + 1], light)
    for i in range(len(after) - 1, -1, -1):
        if after[i] > i + 1:
            sum_inside(after, light, i, light[i])


@njit(cache=True)
def touched(nodes, after, boxes, begin, end, top, left, bottom, right, found):
    """Nodes begin … end of a face that a rectangle of texels touches (section 5.2), ascending.

    boxes (nodes / 32, 4): first and last row + 1, first and last column + 1 of 32 nodes each, if of one face.
    """
    count, i = 0, begin
    while i < end:
        if i % BOX == 0 and i + BOX <= end:
            box = boxes[i // BOX]
            if box[0] >= bottom or box[1] <= top or box[2] >= right or box[3] <= left:
                i += BOX
                continue
        node = nodes[i]
        if node[1] < bottom and node[1] + node[3] > top and node[2] < right and node[2] + node[4] > left:
            found[count] = i
            count += 1
            i += 1
        else:
            i = after[i]
    return count


@njit(
    [
        i8(
            _read_only(f4, 4),
            _OMEGA,
            NODES,
            AFTER,
            NODES,
            i8,
            i8,
            _read_only(i8, 1),
            f8[:, ::1],
            i8[::1],
            f8[:, ::1],
        )
    ],
    cache=True,
)
def light_again(cube, omega, nodes, after, boxes, begin, end, place, light, found, change):
    """New light of the nodes that changed texels touch; place (4,): their top, left, bottom, right.

    Sets ``light``, and found (n,), ascending, and change (n, 3) of the nodes whose light is another; returns n.
    """
    count = touched(nodes, after, boxes, begin, end, place[0], place[1], place[2], place[3], found)
    new = np.empty(3)
    for n in range(count - 1, -1, -1):
        i = found[n]
        if after[i] == i + 1:
            _rectangle_light(cube, omega, nodes[i], new)
        else:
            sum_inside(after, light, i, new)
        for c in range(3):
            change[n, c] = new[c] - light[i, c]
            light[i, c] = new[c]
    kept = 0
    for n in range(count):
        if change[n, 0] != 0 or change[n, 1] != 0 or change[n, 2] != 0:
            found[kept] = found[n]
            change[kept] = change[n]
            kept += 1
    return kept


@njit(
    [
        types.Tuple((i8[::1], i8[::1], i8[::1], i4[::1], f8[:, ::1]))(
            _read_only(i8, 2), i8[::1], i8[::1], f8[:, ::1], AFTER, AFTER, _read_only(f4, 2)
        )
    ],
    cache=True,
)
def gather_changes(zones, owners, changed, change, starts, slots, scales):
    """Changes of nodes as changes of clusters, zone by zone, in the columns of tiles they are in.

    owners (lights + 1,): light d changes the nodes changed[owners[d]] …, ascending, by change (n, 3); the clusters
    of node i are slots[starts[i]] … of scales (slots, 3). Returns

    begins (lights·zones + 1,) of the columns of each light and zone; column (C,) p·16 + s; start (C + 1,) of
    each one's clusters in index (m,), which tells the cluster in the tile, and weights (m, 3), scale included.
    """
    panels = 0
    for z in range(len(zones)):
        panels += zones[z, 4]
    zone_of = np.empty(panels, np.int32)
    for z in range(len(zones)):
        zone_of[zones[z, 3] : zones[z, 3] + zones[z, 4]] = z

    buckets = (len(owners) - 1) * len(zones)
    ends = np.zeros(buckets + 1, np.int64)
    for d in range(len(owners) - 1):
        for n in range(owners[d], owners[d + 1]):
            for r in range(starts[changed[n]], starts[changed[n] + 1]):
                ends[d * len(zones) + zone_of[slots[r] // PANEL] + 1] += 1
    for b in range(buckets):
        ends[b + 1] += ends[b]
    at, total = ends[:-1].copy(), ends[-1]
    slot, source = np.empty(total, np.int64), np.empty(total, np.int64)
    for d in range(len(owners) - 1):
        for n in range(owners[d], owners[d + 1]):
            for r in range(starts[changed[n]], starts[changed[n] + 1]):
                b = d * len(zones) + zone_of[slots[r] // PANEL]
                slot[at[b]], source[at[b]] = slots[r], n
                at[b] += 1

    begins = np.zeros(buckets + 1, np.int64)
    column, start = np.empty(total, np.int64), np.empty(total + 1, np.int64)
    index, weights = np.empty(total, np.int32), np.empty((total, 3))
    columns = 0
    only = change.shape[1] == 1
    for b in range(buckets):
        for m in range(ends[b], ends[b + 1]):
            if m == ends[b] or slot[m] // TILE != column[columns - 1]:
                column[columns], start[columns] = slot[m] // TILE, m
                columns += 1
            index[m] = slot[m] % TILE
            for c in range(3):
                weights[m, c] = change[source[m], 0 if only else c] * scales[slot[m], c]
        begins[b + 1] = columns
    start[columns] = total
    return begins, column[:columns].copy(), start[: columns + 1].copy(), index, weights


@njit(
    [types.Tuple((i8[::1], f8[:, ::1]))(i8[::1], f8[:, ::1], i8[::1], f8[:, ::1])],
    cache=True,
)
def difference(nodes, weights, old_nodes, old_weights):
    """Where the weights (n, 3) of a light differ from its old ones, and by how much; nodes (n,) ascend."""
    most = len(nodes) + len(old_nodes)
    found, change = np.empty(most, np.int64), np.empty((most, weights.shape[1]))
    count = n = o = 0
    while n < len(nodes) or o < len(old_nodes):
        i = nodes[n] if n < len(nodes) else np.int64(2**62)
        j = old_nodes[o] if o < len(old_nodes) else np.int64(2**62)
        found[count] = min(i, j)
        change[count] = 0.0
        if i <= j:
            change[count] += weights[n]
            n += 1
        if j <= i:
            change[count] -= old_weights[o]
            o += 1
        if change[count, 0] != 0.0:
            count += 1
    return found[:count].copy(), change[:count].copy()


@njit(cache=True)
def _weigh_panel(light, node_of, scales, weights, p):
    bits = 0
    for k in range(PANEL * p, PANEL * p + PANEL):
        for c in range(3):
            weights[k, c] = np.float32(light[node_of[k], c] * scales[k, c])
            if weights[k, c] != 0:
                bits |= 1 << ((k - PANEL * p) // TILE)
    return bits


@njit(
    [types.void(f8[:, ::1], AFTER, _read_only(f4, 2), f4[:, ::1], types.uint16[::1])],
    parallel=True,
    cache=True,
)
def weigh_clusters(light, node_of, scales, weights, lit):
    """Weights (slots, 3) of all clusters, scale included, and the bits (panels,) of tiles that have one."""
    for p in prange(len(lit)):
        lit[p] = _weigh_panel(light, node_of, scales, weights, p)

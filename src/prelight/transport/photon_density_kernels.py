"""Photons around points of a surface: a k-d tree, the k-th nearest of one's own side, and sums under a kernel.

Everything is measured flattened: what lies off the plane of the point counts eight times its distance, so that a
picture is far from the wall it hangs on. The kernel is 1 − (d/r)²; what it covers of the surface is integrated over
triangles, not taken for a disc, so that an edge or a corner is no darker than the middle of a wall.

References
----------
Bentley, Multidimensional binary search trees, 1975. Jensen, Realistic Image Synthesis Using Photon Mapping, 2001.
Epanechnikov, Non-parametric estimation of a multivariate probability density, 1969.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

OWN_SIDE = 0.5  # cosine between a point's normal and that of a photon's triangle, at least
FLATTENED = 8.0
_OFF_PLANE = np.float32(FLATTENED * FLATTENED - 1)
_LEAF = 8
_POINTS = 64  # of a task
_DEEPEST = 96

_f1 = types.Array(types.float32, 1, "C", readonly=True)
_f2 = types.Array(types.float32, 2, "C", readonly=True)
_i1 = types.Array(types.int32, 1, "C", readonly=True)
_a1 = types.Array(types.int8, 1, "C", readonly=True)


# ---- the tree -----------------------------------------------------------------------------------------


@njit(cache=True)
def _select(points, order, low, high, k, axis):
    """Partition order[low:high] so that what belongs at place k stands there."""
    high -= 1
    while low < high:
        pivot = points[order[(low + high) // 2], axis]
        i, j = low, high
        while i <= j:
            while points[order[i], axis] < pivot:
                i += 1
            while points[order[j], axis] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if k <= j:
            high = j
        elif k >= i:
            low = i
        else:
            return


@njit([types.void(_f2, types.int32[::1], types.int8[::1])], cache=True)
def build_tree(points, order, axes):
    """A balanced tree over points (n, 3): ``order`` becomes its order, ``axes`` where each range is cut.

    The range [low, high) has its cut at the middle; ranges of eight points or fewer are searched through.
    """
    todo = np.empty((_DEEPEST, 2), np.int64)
    todo[0, 0], todo[0, 1] = 0, len(points)
    waiting = 1
    while waiting > 0:
        waiting -= 1
        low, high = todo[waiting, 0], todo[waiting, 1]
        if high - low <= _LEAF:
            continue
        best, axis = np.float32(-1), 0
        for a in range(3):
            least, most = points[order[low], a], points[order[low], a]
            for i in range(low + 1, high):
                value = points[order[i], a]
                least, most = min(least, value), max(most, value)
            if most - least > best:
                best, axis = most - least, a
        middle = (low + high) // 2
        _select(points, order, low, high, middle, axis)
        axes[middle] = axis
        todo[waiting, 0], todo[waiting, 1] = low, middle
        todo[waiting + 1, 0], todo[waiting + 1, 1] = middle + 1, high
        waiting += 2


@njit(cache=True)
def flat_square(p, x, n):
    """The square of the flattened distance."""
    a, b, c = p[0] - x[0], p[1] - x[1], p[2] - x[2]
    off = a * n[0] + b * n[1] + c * n[2]
    return a * a + b * b + c * c + _OFF_PLANE * off * off


@njit(cache=True)
def _sift(heap, count, value):
    """Put a value below the top of a max-heap that is full; the top leaves."""
    i = 0
    while True:
        child = 2 * i + 1
        if child >= count:
            break
        if child + 1 < count and heap[child + 1] > heap[child]:
            child += 1
        if heap[child] <= value:
            break
        heap[i] = heap[child]
        i = child
    heap[i] = value


@njit(cache=True)
def _push(heap, count, value):
    i = count
    while i > 0 and heap[(i - 1) // 2] < value:
        heap[i] = heap[(i - 1) // 2]
        i = (i - 1) // 2
    heap[i] = value


@njit(cache=True)
def _kth_square(points, normals, axes, x, n, k, most, heap, todo):
    """Square of the distance of the k-th nearest photon of one's own side, or ``most``."""
    reach, count, waiting = most, 0, 1
    todo[0, 0], todo[0, 1], todo[0, 2] = 0, len(points), 0
    while waiting > 0:
        waiting -= 1
        low, high = np.int64(todo[waiting, 0]), np.int64(todo[waiting, 1])
        if todo[waiting, 2] > reach:
            continue
        leaf = high - low <= _LEAF
        middle = (low + high) // 2
        first, last = (low, high) if leaf else (middle, middle + 1)
        for i in range(first, last):
            d2 = flat_square(points[i], x, n)
            if d2 < reach:
                m = normals[i]
                if m[0] * n[0] + m[1] * n[1] + m[2] * n[2] > OWN_SIDE:
                    if count < k:
                        _push(heap, count, d2)
                        count += 1
                    else:
                        _sift(heap, count, d2)
                    if count == k:
                        reach = heap[0]
        if leaf:
            continue
        axis = axes[middle]
        way = x[axis] - points[middle, axis]
        near_low, near_high = (low, middle) if way < 0 else (middle + 1, high)
        far_low, far_high = (middle + 1, high) if way < 0 else (low, middle)
        if way * way < reach:
            todo[waiting, 0], todo[waiting, 1], todo[waiting, 2] = far_low, far_high, way * way
            waiting += 1
        todo[waiting, 0], todo[waiting, 1], todo[waiting, 2] = near_low, near_high, 0.0
        waiting += 1
    return reach


@njit(cache=True)
def _some_radii(tree, x, n, limits, k, radii, first, last):
    points, normals, axes = tree
    heap, todo = np.empty(k, np.float32), np.empty((_DEEPEST, 3), np.float64)
    for v in range(first, last):
        least, most = limits[v, 0], limits[v, 1]
        radii[v] = 0
        if most > 0 and (n[v, 0] != 0 or n[v, 1] != 0 or n[v, 2] != 0):
            found = _kth_square(points, normals, axes, x[v], n[v], k, most * most, heap, todo)
            radii[v] = max(least, np.sqrt(found))


@njit(
    [types.void(types.Tuple((_f2, _f2, _a1)), _f2, _f2, _f2, types.int64, types.float32[::1])],
    parallel=True,
    cache=True,
)
def nearest_radii(tree, x, n, limits, k, radii):
    """How far the k-th nearest photon of its own side is from each point, within its limits (points, 2).

    tree: positions and normals (photons, 3) in the tree's order, and its axes; x, n (points, 3).
    """
    for part in prange((len(x) + _POINTS - 1) // _POINTS):
        _some_radii(tree, x, n, limits, k, radii, part * _POINTS, min(len(x), (part + 1) * _POINTS))


# ---- sums under the kernel ----------------------------------------------------------------------------


@njit(cache=True)
def _within(points, normals, axes, x, n, square, todo, found, weights):
    """The photons of one's own side within a distance, and their kernel's weights; how many. Too many: −1."""
    waiting, count = 1, 0
    todo[0, 0], todo[0, 1] = 0, len(points)
    while waiting > 0:
        waiting -= 1
        low, high = np.int64(todo[waiting, 0]), np.int64(todo[waiting, 1])
        leaf = high - low <= _LEAF
        middle = (low + high) // 2
        first, last = (low, high) if leaf else (middle, middle + 1)
        for i in range(first, last):
            d2 = flat_square(points[i], x, n)
            if d2 < square:
                m = normals[i]
                if m[0] * n[0] + m[1] * n[1] + m[2] * n[2] > OWN_SIDE:
                    if count == len(found):
                        return -1
                    found[count] = i
                    weights[count] = np.float32(1) - d2 / square
                    count += 1
        if leaf:
            continue
        axis = axes[middle]
        way = x[axis] - points[middle, axis]
        if way < 0 or way * way < square:
            todo[waiting, 0], todo[waiting, 1] = low, middle
            waiting += 1
        if way >= 0 or way * way < square:
            todo[waiting, 0], todo[waiting, 1] = middle + 1, high
            waiting += 1
    return count


@njit(cache=True)
def _neighbours(tree, x, n, radius, todo, found, weights):
    """As ``_within``, with room made for as many as there are."""
    points, normals, axes = tree
    count = _within(points, normals, axes, x, n, radius * radius, todo, found, weights)
    while count < 0:
        found, weights = np.empty(4 * len(found), np.int64), np.empty(4 * len(weights), np.float32)
        count = _within(points, normals, axes, x, n, radius * radius, todo, found, weights)
    return count, found, weights


@njit(cache=True)
def _some_sums(tree, values, x, n, radii, areas, out, squares, first, last):
    todo = np.empty((_DEEPEST, 3), np.float64)
    found, weights = np.empty(4096, np.int64), np.empty(4096, np.float32)
    for v in range(first, last):
        into, square = out[v], squares[v]
        into[:] = 0
        square[:] = 0
        if radii[v] <= 0 or areas[v] <= 0:
            continue
        count, found, weights = _neighbours(tree, x[v], n[v], radii[v], todo, found, weights)
        share = np.float32(1) / areas[v]
        for j in range(count):
            w, value = weights[j] * share, values[found[j]]
            for f in range(len(into)):
                add = w * value[f]
                into[f] += add
                square[f] += add * add


@njit(
    [types.void(types.Tuple((_f2, _f2, _a1)), _f2, _f2, _f2, _f1, _f1, types.float32[:, ::1], types.float32[:, ::1])],
    parallel=True,
    cache=True,
)  # fmt: skip
def kernel_sums(tree, values, x, n, radii, areas, out, squares):
    """Σ K v / A of each point's neighbours, and Σ (K v / A)², written: out and squares (points, functions).

    values (photons, functions) in the tree's order; ``areas`` are integrals of the kernel over the surface.
    """
    for part in prange((len(x) + _POINTS - 1) // _POINTS):
        first, last = part * _POINTS, min(len(x), (part + 1) * _POINTS)
        _some_sums(tree, values, x, n, radii, areas, out, squares, first, last)


@njit(cache=True)
def _some_cell_sums(tree, values, cells, x, n, radii, areas, out, first, last):
    todo = np.empty((_DEEPEST, 3), np.float64)
    found, weights = np.empty(4096, np.int64), np.empty(4096, np.float32)
    for v in range(first, last):
        out[v] = 0
        if radii[v] <= 0 or areas[v] <= 0:
            continue
        count, found, weights = _neighbours(tree, x[v], n[v], radii[v], todo, found, weights)
        share = np.float32(1) / areas[v]
        for j in range(count):
            value, into = values[found[j]], out[v, cells[found[j]]]
            for c in range(len(into)):
                into[c] += weights[j] * share * value[c]


@njit(
    [types.void(types.Tuple((_f2, _f2, _a1)), _f2, _i1, _f2, _f2, _f1, _f1, types.float32[:, :, ::1])],
    parallel=True,
    cache=True,
)
def cell_sums(tree, values, cells, x, n, radii, areas, out):
    """As ``kernel_sums`` for functions that are 1 in one cell each: out (points, cells, colours), written."""
    for part in prange((len(x) + _POINTS - 1) // _POINTS):
        first, last = part * _POINTS, min(len(x), (part + 1) * _POINTS)
        _some_cell_sums(tree, values, cells, x, n, radii, areas, out, first, last)


# ---- which photons, one by one ------------------------------------------------------------------------


@njit(cache=True)
def _some_pairs(tree, x, n, radii, areas, starts, photons, weights, first, last):
    """``starts`` says where each point's are written; while ``photons`` has no room, counts go there."""
    todo = np.empty((_DEEPEST, 3), np.float64)
    found, kernel = np.empty(4096, np.int64), np.empty(4096, np.float32)
    for v in range(first, last):
        count = 0
        if radii[v] > 0 and areas[v] > 0:
            count, found, kernel = _neighbours(tree, x[v], n[v], radii[v], todo, found, kernel)
        if len(photons) == 0:
            starts[v + 1] = count
            continue
        for j in range(count):
            photons[starts[v] + j] = found[j]
            weights[starts[v] + j] = kernel[j] / areas[v]


@njit(
    [types.void(types.Tuple((_f2, _f2, _a1)), _f2, _f2, _f1, _f1, types.int64[::1], types.int32[::1],
                types.float32[::1])],
    parallel=True,
    cache=True,
)  # fmt: skip
def kernel_pairs(tree, x, n, radii, areas, starts, photons, weights):
    """Each point's photons, numbers of the tree's order, and the kernel's K / A; called twice.

    First with no room in ``photons``: ``starts[v + 1]`` (points + 1) becomes how many point v has. Then with their
    sums in ``starts``.
    """
    for part in prange((len(x) + _POINTS - 1) // _POINTS):
        first, last = part * _POINTS, min(len(x), (part + 1) * _POINTS)
        _some_pairs(tree, x, n, radii, areas, starts, photons, weights, first, last)

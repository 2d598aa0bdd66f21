"""Places in space halved again and again, the nearest of them found, and light spread from a few to many."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

_VERTICES = 1024  # of a thread at a time
_DEEPEST = 64  # halvings

f4, i4, i8 = types.float32, types.int32, types.int64


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


_points = _read_only(f4, 2)


@njit(cache=True)
def _widest(points, order, first, last, low, high):
    """The axis along which places first … last lie farthest apart; their box is written."""
    low[:], high[:] = np.inf, -np.inf
    for k in range(first, last):
        for a in range(len(low)):
            low[a], high[a] = min(low[a], points[order[k], a]), max(high[a], points[order[k], a])
    axis = 0
    for a in range(1, len(low)):
        if high[a] - low[a] > high[axis] - low[axis]:
            axis = a
    return axis


@njit([i8(_points, i8, i4[::1], i4[:, ::1], f4[:, :, ::1])], cache=True, nogil=True)
def halve(points, most, order, nodes, boxes):
    """Halve places (n, d) where they lie farthest apart until no more than ``most`` are together; how many nodes.

    ``order`` (n,) becomes their order; ``nodes`` are first, last, and the second child, the first being the next node,
    or −1; ``boxes`` (nodes, 2, d) low and high.
    """
    for k in range(len(order)):
        order[k] = k
    todo, waiting, count = np.empty((_DEEPEST, 3), np.int64), 1, 0
    todo[0, 0], todo[0, 1], todo[0, 2] = 0, len(order), -1
    while waiting > 0:
        waiting -= 1
        first, last, parent = todo[waiting]
        if parent >= 0:
            nodes[parent, 2] = count
        nodes[count, 0], nodes[count, 1], nodes[count, 2] = first, last, -1
        axis = _widest(points, order, first, last, boxes[count, 0], boxes[count, 1])
        if last - first > most:
            part = order[first:last].copy()
            along = np.empty(len(part), np.float32)
            for k in range(len(part)):
                along[k] = points[part[k], axis]
            order[first:last] = part[np.argsort(along, kind="mergesort")]
            middle = (first + last) // 2
            todo[waiting, 0], todo[waiting, 1], todo[waiting, 2] = middle, last, count
            todo[waiting + 1, 0], todo[waiting + 1, 1], todo[waiting + 1, 2] = first, middle, -1
            waiting += 2
        count += 1
    return count


@njit(cache=True)
def _beyond(box, place):
    """The square of the distance from a place to a box."""
    total = np.float32(0)
    for a in range(len(place)):
        out = max(box[0, a] - place[a], place[a] - box[1, a], np.float32(0))
        total += out * out
    return total


@njit(cache=True)
def _find(place, points, order, nodes, boxes, todo, near, square):
    """The nearest of points to one place, by rising distance: their numbers and the squares of distances."""
    square[:] = np.inf
    near[:] = 0
    last = len(near) - 1
    todo[0], waiting = 0, 1
    while waiting > 0:
        waiting -= 1
        n = todo[waiting]
        if _beyond(boxes[n], place) >= square[last]:
            continue
        if nodes[n, 2] >= 0:
            a, b = n + 1, nodes[n, 2]
            if _beyond(boxes[a], place) < _beyond(boxes[b], place):
                a, b = b, a
            todo[waiting], todo[waiting + 1] = a, b  # the nearer one is looked at first
            waiting += 2
            continue
        for k in range(nodes[n, 0], nodes[n, 1]):
            j = order[k]
            far = np.float32(0)
            for axis in range(len(place)):
                far += (points[j, axis] - place[axis]) ** 2
            if far < square[last]:
                at = last
                while at > 0 and square[at - 1] > far:
                    square[at], near[at] = square[at - 1], near[at - 1]
                    at -= 1
                square[at], near[at] = far, j


@njit(
    [types.void(_points, _points, _read_only(i4, 1), _read_only(i4, 2), _read_only(f4, 3), i4[:, ::1], f4[:, ::1])],
    parallel=True,
    cache=True,
    nogil=True,
)  # fmt: skip
def nearest(places, points, order, nodes, boxes, near, square):
    """near, square (n, k): the k nearest of ``points``, halved as ``halve`` does it, to each of ``places``."""
    for part in prange((len(places) + _VERTICES - 1) // _VERTICES):
        todo = np.empty(2 * _DEEPEST, np.int64)
        for i in range(part * _VERTICES, min(len(places), (part + 1) * _VERTICES)):
            _find(places[i], points, order, nodes, boxes, todo, near[i], square[i])


@njit(cache=True)
def _spread_some(near, weights, light, before, out, begin, end):
    for v in range(begin, end):
        red = green = blue = np.float32(0)
        for k in range(near.shape[1]):
            s, w = near[v, k], weights[v, k]
            red += w * light[s, 0]
            green += w * light[s, 1]
            blue += w * light[s, 2]
        out[v, 0], out[v, 1], out[v, 2] = red, green, blue
        if len(before) > 0:
            for c in range(3):
                spread_before, detail = before[v, c], before[v, 3 + c]
                if spread_before > 0:
                    out[v, c] += min(max(out[v, c] / spread_before, np.float32(0)), np.float32(1)) * detail


@njit(
    [types.void(_read_only(i4, 2), _points, _points, _points, f4[:, ::1])], parallel=True, cache=True, nogil=True
)  # fmt: skip
def spread(near, weights, light, before, out):
    """out (V, 3) = Σ weights (V, k) · light (n, 3) of those ``near`` (V, k), and detail as far as there is light.

    ``before`` (V, 6), or (0, 6): what was spread of an earlier light, and what that lacked.
    """
    for part in prange((len(out) + _VERTICES - 1) // _VERTICES):
        begin, end = part * _VERTICES, min(len(out), (part + 1) * _VERTICES)
        _spread_some(near, weights, light, before, out, begin, end)


@njit([types.void(_read_only(i4, 2), _points, _read_only(types.int8, 2), f4[:, ::1])], cache=True, nogil=True)
def gathered(near, weights, rows, out):
    """out (n, m) += what light at stand-ins brings by rows (V, m) of all vertices: the transpose of ``spread``."""
    for v in range(len(rows)):
        for k in range(near.shape[1]):
            w, into = weights[v, k], out[near[v, k]]
            if w != 0:
                for m in range(rows.shape[1]):
                    into[m] += w * np.float32(rows[v, m])


@njit(cache=True)
def _weighted_some(starts, of_entry, weights, light, out, begin, end):
    for k in range(begin, end):
        red = green = blue = np.float32(0)
        for e in range(starts[k], starts[k + 1]):
            s = of_entry[e]
            red += weights[e, 0] * light[s, 0]
            green += weights[e, 1] * light[s, 1]
            blue += weights[e, 2] * light[s, 2]
        out[k, 0], out[k, 1], out[k, 2] = red, green, blue


@njit(
    [types.void(_read_only(i8, 1), _read_only(i4, 1), _points, _points, f4[:, ::1])],
    parallel=True,
    cache=True,
    nogil=True,
)
def weighted(starts, of_entry, weights, light, out):
    """out (m, 3) = Σ weights (entries, 3) · light (n, 3): of row k entries ``starts[k]`` up to the next start."""
    for part in prange((len(out) + _VERTICES - 1) // _VERTICES):
        begin, end = part * _VERTICES, min(len(out), (part + 1) * _VERTICES)
        _weighted_some(starts, of_entry, weights, light, out, begin, end)

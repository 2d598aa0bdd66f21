"""Building the tree of boxes that `packet_kernels` sends rays through.

A node holds the boxes of its two children, ``bounds[n] = (low, high of the first, low, high of the second)``,
and ``children[n]``: another node, or −1 − (first · 8 + count − 1) of its triangles. ``axes[n]`` is the axis along
which they were parted, the first child on the lower side.

References
----------
Wald, On fast construction of SAH-based bounding volume hierarchies, 2007.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

DEEPEST = 64  # levels a tree may have
_BINS = 16
_LEAF = 4  # triangles
_BY_COST = 32  # levels; below, halves: 26 more levels are enough for 50 million triangles

_boxes = types.Array(types.float32, 2, "C", readonly=True)


@njit(cache=True)
def _half_area(box):
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return x * y + y * z + z * x


@njit(cache=True)
def _empty(box):
    for k in range(3):
        box[k], box[3 + k] = np.inf, -np.inf


@njit(cache=True)
def _enclose(box, other):
    for k in range(3):
        box[k] = min(box[k], other[k])
        box[3 + k] = max(box[3 + k], other[3 + k])


@njit(cache=True)
def _bound(boxes, order, first, last, box, centres):
    """The box of triangles order[first:last], and that of their centres (doubled)."""
    _empty(box)
    _empty(centres)
    for i in range(first, last):
        here = boxes[order[i]]
        for k in range(3):
            box[k] = min(box[k], here[k])
            box[3 + k] = max(box[3 + k], here[3 + k])
            middle = here[k] + here[3 + k]
            centres[k] = min(centres[k], middle)
            centres[3 + k] = max(centres[3 + k], middle)


@njit(cache=True)
def _fill_bins(boxes, order, first, last, centres, scale, bins, counts):
    for axis in range(3):
        for b in range(_BINS):
            _empty(bins[axis, b])
            counts[axis, b] = 0
    for i in range(first, last):
        here = boxes[order[i]]
        for axis in range(3):
            b = min(_BINS - 1, int((here[axis] + here[3 + axis] - centres[axis]) * scale[axis]))
            counts[axis, b] += 1
            _enclose(bins[axis, b], here)


@njit(cache=True)
def _best_split(bins, counts, total, right_area):
    """Axis and last bin of the left side that cost least; axis −1 if no plane parts the triangles."""
    best, best_axis, best_bin = np.inf, -1, 0
    box = np.empty(6, np.float32)
    for axis in range(3):
        _empty(box)
        for b in range(_BINS - 1, 0, -1):
            _enclose(box, bins[axis, b])
            right_area[b] = _half_area(box)
        _empty(box)
        left = 0
        for b in range(_BINS - 1):
            _enclose(box, bins[axis, b])
            left += counts[axis, b]
            if 0 < left < total:
                cost = left * _half_area(box) + (total - left) * right_area[b + 1]
                if cost < best:
                    best, best_axis, best_bin = cost, axis, b
    return best_axis, best_bin


@njit(cache=True)
def _part(boxes, order, first, last, axis, low, scale, last_left):
    """Left of the plane first; where the right side begins."""
    i, j = first, last - 1
    while i <= j:
        here = boxes[order[i]]
        if min(_BINS - 1, int((here[axis] + here[3 + axis] - low) * scale)) <= last_left:
            i += 1
        else:
            order[i], order[j] = order[j], order[i]
            j -= 1
    return i


@njit(
    [types.int64(_boxes, types.int32[::1], types.float32[:, ::1], types.int32[:, ::1], types.int8[::1])],
    cache=True,
)
def build(boxes, order, bounds, children, axes):
    """Fill a tree over boxes (F, 6); ``order`` becomes the order of triangles in leaves. How many nodes there are.

    bounds (F, 12), children (F, 2) and axes (F,) have room for the most there can be.
    """
    bins, counts = np.empty((3, _BINS, 6), np.float32), np.empty((3, _BINS), np.int32)
    scale, right_area = np.empty(3, np.float32), np.empty(_BINS, np.float32)
    box, centres = np.empty(6, np.float32), np.empty(6, np.float32)
    # What is still to do: triangles first to last, and the parent's place that points to them.
    todo = np.empty((DEEPEST + 2, 4), np.int64)
    todo[0, 0], todo[0, 1], todo[0, 2], todo[0, 3] = 0, len(order), -1, 0
    waiting, nodes = 1, 0
    while waiting > 0:
        waiting -= 1
        first, last, place, depth = todo[waiting, 0], todo[waiting, 1], todo[waiting, 2], todo[waiting, 3]
        _bound(boxes, order, first, last, box, centres)
        total = last - first
        if place >= 0:
            for k in range(6):
                bounds[place // 2, 6 * (place % 2) + k] = box[k]
        if total <= _LEAF and place >= 0:
            children[place // 2, place % 2] = -1 - (first * 8 + total - 1)
            continue
        node = nodes
        nodes += 1
        if place >= 0:
            children[place // 2, place % 2] = node
        middle, axis = first + total // 2, -1
        if depth < _BY_COST and total > 1:
            for k in range(3):
                extent = centres[3 + k] - centres[k]
                scale[k] = np.float32(_BINS) / extent if extent > np.float32(1e-30) else np.float32(0)
            _fill_bins(boxes, order, first, last, centres, scale, bins, counts)
            axis, last_left = _best_split(bins, counts, total, right_area)
            if axis >= 0:
                middle = _part(boxes, order, first, last, axis, centres[axis], scale[axis], last_left)
        axes[node] = max(axis, 0)
        if total == 1:  # one triangle alone: the other child is empty
            _empty(bounds[node, 6:12])
            for k in range(6):
                bounds[node, k] = box[k]
            children[node, 0] = children[node, 1] = -1 - first * 8
            continue
        for side in range(2):
            todo[waiting, 0] = middle if side == 0 else first
            todo[waiting, 1] = last if side == 0 else middle
            todo[waiting, 2] = 2 * node + 1 - side
            todo[waiting, 3] = depth + 1
            waiting += 1
    return nodes

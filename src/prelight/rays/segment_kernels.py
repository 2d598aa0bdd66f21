"""Single rays between two points through the tree of `box_tree_kernels`: what they meet first, and from which side.

Coordinates are those of `plain`: the scene within [−1, 1]³.

References
----------
Woop, Benthin and Wald, Watertight ray/triangle intersection, 2013.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from .box_tree_kernels import DEEPEST

_TASK = 256  # segments

_f4_2 = types.Array(types.float32, 2, "C", readonly=True)
_i4_2 = types.Array(types.int32, 2, "C", readonly=True)


@njit(cache=True)
def _enters(bounds, node, offset, o, inverse, limit):
    """Where a ray enters a box, in multiples of the ray; infinite if it does not before ``limit``."""
    enter, leave = np.float32(0), limit
    for k in range(3):
        a = (bounds[node, offset + k] - o[k]) * inverse[k]
        b = (bounds[node, offset + 3 + k] - o[k]) * inverse[k]
        enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    return enter if enter <= leave else np.float32(np.inf)


@njit(cache=True)
def _meets(corners, t, o, shear, axis_of):
    """How far along the ray a triangle is met (infinite if not), and 1 from the front, 2 from the back."""
    kx, ky, kz = axis_of[0], axis_of[1], axis_of[2]
    az, bz, cz = corners[t, kz] - o[kz], corners[t, 3 + kz] - o[kz], corners[t, 6 + kz] - o[kz]
    ax, ay = corners[t, kx] - o[kx] - shear[0] * az, corners[t, ky] - o[ky] - shear[1] * az
    bx, by = corners[t, 3 + kx] - o[kx] - shear[0] * bz, corners[t, 3 + ky] - o[ky] - shear[1] * bz
    cx, cy = corners[t, 6 + kx] - o[kx] - shear[0] * cz, corners[t, 6 + ky] - o[ky] - shear[1] * cz
    u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
    determinant = u + v + w
    same = (u >= 0 and v >= 0 and w >= 0) or (u <= 0 and v <= 0 and w <= 0)
    if not same or determinant == 0:
        return np.float32(np.inf), 0
    along = (u * az + v * bz + w * cz) * shear[2] / determinant
    # Which way round the corners go as the ray sees them; axes were not swapped, so the sign of its depth counts.
    front = (determinant > 0) == (shear[2] > 0)
    return (along if along > 0 else np.float32(np.inf)), 1 if front else 2


@njit(cache=True)
def _look(bounds, children, corners, o, d, nearest, stack, inverse, shear, axis_of):
    """0 if nothing is met before the ray's end, 1 a front, 2 a back: of what is nearest, or of anything."""
    largest = 0
    for k in range(3):
        small = abs(d[k]) < np.float32(1e-18)
        inverse[k] = np.float32(1e18) if small else np.float32(1) / d[k]
        if abs(d[k]) > abs(d[largest]):
            largest = k
    if d[largest] == 0:
        return 0
    axis_of[0], axis_of[1], axis_of[2] = (largest + 1) % 3, (largest + 2) % 3, largest
    shear[0], shear[1] = d[axis_of[0]] / d[largest], d[axis_of[1]] / d[largest]
    shear[2] = np.float32(1) / d[largest]
    limit, found = np.float32(1), 0
    waiting = 1
    stack[0] = 0
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        for side in range(2):
            if _enters(bounds, node, 6 * side, o, inverse, limit) > limit:
                continue
            child = children[node, side]
            if child >= 0:
                stack[waiting] = child
                waiting += 1
                continue
            start, count = (-1 - child) // 8, (-1 - child) % 8 + 1
            for t in range(start, start + count):
                along, face = _meets(corners, t, o, shear, axis_of)
                if along < limit:
                    limit, found = along, face
                    if not nearest:
                        return found
    return found


@njit(cache=True)
def _look_some(bounds, children, corners, origins, ends, nearest, found, first, last):
    stack = np.empty(2 * DEEPEST + 2, np.int32)
    d, inverse, shear = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    axis_of = np.empty(3, np.int64)
    for i in range(first, last):
        for k in range(3):
            d[k] = ends[i, k] - origins[i, k]
        found[i] = _look(bounds, children, corners, origins[i], d, nearest, stack, inverse, shear, axis_of)


@njit(
    [types.void(_f4_2, _i4_2, _f4_2, _f4_2, _f4_2, types.boolean, types.uint8[::1])],
    parallel=True,
    cache=True,
    nogil=True,
)
def trace_segments(bounds, children, corners, origins, ends, nearest, found):
    """found (n,): 0 where nothing is between origins (n, 3) and ends (n, 3), 1 where the front, 2 where the back of a
    triangle is; of the nearest, or (``nearest`` false, faster) of any."""
    for task in prange((len(origins) + _TASK - 1) // _TASK):
        last = min(len(origins), (task + 1) * _TASK)
        _look_some(bounds, children, corners, origins, ends, nearest, found, task * _TASK, last)

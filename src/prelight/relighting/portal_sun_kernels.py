"""Parallel rays through panes: which pane of a room a receiver sees a light through that is infinitely far away.

All is seen along the rays: the panes' triangles and the receivers lie in a plane then, each with its depth. A grid
over that plane lists the triangles of each of its cells; one serves all points of a small disc. Of several sheets
behind each other the last one counts.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

_TASK = 4096  # receivers

_f8_2 = types.Array(types.float64, 2, "C", readonly=True)
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)
_i4_1 = types.Array(types.int32, 1, "C", readonly=True)
_i8_1 = types.Array(types.int64, 1, "C", readonly=True)


@njit(cache=True)
def _cell(value, low, scale, cells):
    return min(max(np.int64((value - low) * scale), 0), cells - 1)


@njit(cache=True)
def _spanned(box, frame, cells):
    return (
        _cell(box[0], frame[0], frame[2], cells), _cell(box[2], frame[0], frame[2], cells),
        _cell(box[1], frame[1], frame[3], cells), _cell(box[3], frame[1], frame[3], cells),
    )  # fmt: skip


@njit(types.void(_f8_2, types.float64[::1], types.int64, types.int64[::1], types.int32[::1]), cache=True)
def list_cells(boxes, frame, cells, starts, listed):
    """Fill ``starts`` (cells² + 1) and, if it has room, ``listed``: the boxes that meet each cell of a grid.

    ``boxes`` (T, 4): low x and y, high x and y; ``frame``: the grid's low x and y, cells a metre in x and y.
    """
    starts[:] = 0
    for t in range(len(boxes)):
        x0, x1, y0, y1 = _spanned(boxes[t], frame, cells)
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                starts[y * cells + x + 1] += 1
    for k in range(cells * cells):
        starts[k + 1] += starts[k]
    if len(listed) == 0:
        return
    for t in range(len(boxes)):
        x0, x1, y0, y1 = _spanned(boxes[t], frame, cells)
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                k = y * cells + x
                listed[starts[k]] = t
                starts[k] += 1
    for k in range(cells * cells, 0, -1):
        starts[k] = starts[k - 1]
    starts[0] = 0


@njit(cache=True)
def _side(ax, ay, bx, by, x, y):
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@njit(cache=True)
def _depth_within(c, shear, x, y):
    """The sheared triangle's depth at (x, y); −∞ outside it. What lies on an edge is inside of both its triangles."""
    ax, ay = c[0] - shear[0] * c[2], c[1] - shear[1] * c[2]
    bx, by = c[3] - shear[0] * c[5], c[4] - shear[1] * c[5]
    cx, cy = c[6] - shear[0] * c[8], c[7] - shear[1] * c[8]
    u = _side(bx, by, cx, cy, x, y)
    v = _side(cx, cy, ax, ay, x, y)
    w = _side(ax, ay, bx, by, x, y)
    inside = (u >= 0 and v >= 0 and w >= 0) or (u <= 0 and v <= 0 and w <= 0)
    whole = u + v + w
    if not inside or whole == 0:
        return -np.inf
    return (u * c[2] + v * c[5] + w * c[8]) / whole


@njit(cache=True)
def _look_some(origins, normals, axes, shears, corners, pane_of, grid, frame, found, first, last):
    starts, listed, cells = grid
    reach = 0.0
    for k in range(len(shears)):
        reach = max(reach, abs(shears[k, 0]), abs(shears[k, 1]))
    for i in range(first, last):
        found[i] = -1
        o, n = origins[i], normals[i]
        if n[0] * axes[2, 0] + n[1] * axes[2, 1] + n[2] * axes[2, 2] <= 0:
            continue
        x0 = o[0] * axes[0, 0] + o[1] * axes[0, 1] + o[2] * axes[0, 2]
        y0 = o[0] * axes[1, 0] + o[1] * axes[1, 1] + o[2] * axes[1, 2]
        z = o[0] * axes[2, 0] + o[1] * axes[2, 1] + o[2] * axes[2, 2]
        aside = np.abs(z) * reach
        if x0 < frame[0] - aside or x0 > frame[4] + aside or y0 < frame[1] - aside or y0 > frame[5] + aside:
            continue  # along none of the rays
        for k in range(len(shears)):
            x, y = x0 - shears[k, 0] * z, y0 - shears[k, 1] * z
            if not (frame[0] <= x <= frame[4] and frame[1] <= y <= frame[5]):
                continue
            cell = _cell(y, frame[1], frame[3], cells) * cells + _cell(x, frame[0], frame[2], cells)
            best = z
            for j in range(starts[cell], starts[cell + 1]):
                depth = _depth_within(corners[listed[j]], shears[k], x, y)
                if depth > best:
                    best, found[i, k] = depth, pane_of[listed[j]]


_GRID = types.Tuple((_i8_1, _i4_1, types.int64))


@njit(
    types.void(
        _f4_2, _f4_2, _f8_2, _f8_2, _f8_2, _i4_1, _GRID, types.float64[::1], types.int32[:, ::1]
    ),
    parallel=True,
    cache=True,
    nogil=True,
)  # fmt: skip
def look_through(origins, normals, axes, shears, corners, pane_of, grid, frame, found):
    """``found`` (n, k): the pane through which each of ``origins`` (n, 3) looks along each of k rays, or −1.

    −1 also where ``normals`` turn away. ``axes`` (3, 3): two across the rays' middle, and that. Along ray k
    (x, y) − ``shears[k]`` · z stays the same; ``corners`` (T, 9): the triangles in (x, y, z). ``grid``
    for all rays: starts (cells² + 1), places in ``listed``, that, and the cells of a side; ``frame`` (6,) as in
    ``list_cells``, the high x and y behind.
    """
    for task in prange((len(origins) + _TASK - 1) // _TASK):
        first, last = task * _TASK, min(len(origins), (task + 1) * _TASK)
        _look_some(origins, normals, axes, shears, corners, pane_of, grid, frame, found, first, last)

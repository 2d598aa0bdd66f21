"""How much of a soft disc light falls in each node of the cube's quadtree, without looking at a texel.

The integral of the disc's share over any rectangle of a face is one around its four sides (see
``lighting.cap_kernels``), so it costs the same for a texel and for a face, and is the sum over the texels: to
rounding for a hard edge, to a few 1e-8 of the disc for a soft one.
"""

from __future__ import annotations

from math import asin, atan2, ceil, floor, pi, sqrt, tan

from numba import njit, types

from ..lighting.cap_kernels import (
    _between,
    _corner,
    _crossings,
    _depth,
    _side,
    _triangle,
)
from .light_kernels import AFTER, NODES, sum_inside, touched

f8, i8 = types.float64, types.int64
_NOTHING = 1e-13  # of the disc: what is left of four sides outside it
ANGLES = types.Array(f8, 1, "C", readonly=True)
_ROWS = types.Array(f8, 2, "C", readonly=True)


@njit(cache=True)
def _long_side(p, q, edge, depths, is_far):
    """∫ G dφ from p to q, of these depths; where ``is_far``, of G less what it is outside, which gives the same
    around rectangles that do not have the disc's middle, and does not see the point opposite it."""
    outside = 0.5 * (edge[0] + edge[1])
    if max(depths[0], depths[1]) <= edge[0] <= 1.0 and not is_far:
        return _triangle(p, q)
    first, second = _crossings(p, q, edge[1])
    total, before, start = 0.0, 0.0, p
    for cut in (min(first, second), max(first, second), 1.0):
        if not before < cut <= 1.0:
            continue
        end = _between(p, q, cut) if cut < 1.0 else q
        is_in = _depth(_between(start, end, 0.5)) < edge[1]
        if is_in:
            if edge[0] < edge[1]:
                total += _side(start, end, edge, (_depth(start), _depth(end)))
            else:
                total += _triangle(start, end)
        if is_in == is_far:
            azimuth = atan2(start[0] * end[1] - start[1] * end[0], start[0] * end[0] + start[1] * end[1])
            total += -outside * azimuth if is_far else outside * azimuth
        before, start = cut, end
    return total


@njit(cache=True)
def _weight(frame, node, resolution, edge, solid_angle):
    """∫ share dω over a node."""
    step = 2.0 / resolution
    u0, v0 = node[2] * step - 1.0, node[1] * step - 1.0
    u1, v1 = (node[2] + node[4]) * step - 1.0, (node[1] + node[3]) * step - 1.0
    p, q = _corner(frame, u0, v0), _corner(frame, u1, v0)
    r, s = _corner(frame, u0, v1), _corner(frame, u1, v1)
    a, b, c, d = _depth(p), _depth(q), _depth(r), _depth(s)
    if max(a, b, c, d) <= edge[0]:
        return solid_angle
    far = p[2] + q[2] + r[2] + s[2] < 0.0
    found = (
        _long_side(p, r, edge, (a, c), far)
        + _long_side(r, s, edge, (c, d), far)
        - _long_side(q, s, edge, (b, d), far)
        - _long_side(p, q, edge, (a, b), far)
    )
    return found if found > _NOTHING * pi * (edge[0] + edge[1]) else 0.0


@njit(cache=True)
def _range(along, across, sine, resolution):
    """First and last texel + 1, in one direction of a face, that a cone may touch; none: (0, 0).

    On the plane of the face's axis and that direction it spans the angle of its axis ± asin(sine / length of
    its axis there); ``sine`` 1: it may be any of them.
    """
    length = sqrt(along * along + across * across)
    if length <= sine:
        return 0, resolution
    middle, spread = atan2(across, along), asin(sine / length) + 1e-12
    low, high = max(middle - spread, -0.25 * pi), min(middle + spread, 0.25 * pi)
    if low > high:
        return 0, 0
    first = min(max(floor(0.5 * resolution * (1.0 + tan(low)) - 1e-6), 0), resolution - 1)
    last = min(ceil(0.5 * resolution * (1.0 + tan(high)) + 1e-6), resolution)
    return first, max(last, first + 1)


@njit(cache=True)
def _along(row, axis):
    return row[0] * axis[0] + row[1] * axis[1] + row[2] * axis[2]


@njit(cache=True)
def _frame_of(rows, u_axis, v_axis, axis):
    a = (_along(rows[0], u_axis), _along(rows[1], u_axis), _along(rows[2], u_axis))
    b = (_along(rows[0], v_axis), _along(rows[1], v_axis), _along(rows[2], v_axis))
    c = (_along(rows[0], axis), _along(rows[1], axis), _along(rows[2], axis))
    return a, b, c


@njit(
    [
        i8(
            _ROWS,
            types.UniTuple(f8, 2),
            _ROWS,
            _ROWS,
            _ROWS,
            i8,
            NODES,
            AFTER,
            NODES,
            AFTER,
            ANGLES,
            f8[:, ::1],
            i8[::1],
            f8[:, ::1],
        )
    ],
    cache=True,
)
def weigh_disc(
    rows, edge, u_axes, v_axes, axes, resolution, nodes, after, boxes, faces, angles, scratch, found, weights
):
    """∫ share dω over the nodes that a disc touches.

    rows (3, 3): two directions across the disc, and its middle, right-handed; edge: 1 − cosine of the angles
    from its middle where its share begins to fall from 1, and where it is 0; u_axes, v_axes, axes (6, 3) of the
    faces; faces (7,) the first node of each. angles (nodes,) their solid angles. Sets found (n,), ascending, and
    weights (n, 1); returns n. scratch (nodes, 1) is zero before and after.
    """
    sine = sqrt(edge[1] * (2.0 - edge[1])) if edge[1] < 1.0 else 1.0
    count = 0
    for face in range(6):
        frame = _frame_of(rows, u_axes[face], v_axes[face], axes[face])
        top, bottom = _range(frame[2][2], frame[1][2], sine, resolution)
        left, right = _range(frame[2][2], frame[0][2], sine, resolution)
        if top == bottom or left == right:
            continue
        here = touched(
            nodes, after, boxes, faces[face], faces[face + 1], top, left, bottom, right, found[count:]
        )
        for n in range(count + here - 1, count - 1, -1):
            i = found[n]
            if after[i] == i + 1:
                scratch[i, :] = _weight(frame, nodes[i], resolution, edge, angles[i])
            else:
                sum_inside(after, scratch, i, scratch[i])
        count += here
    kept = 0
    for n in range(count):
        i = found[n]
        if scratch[i, 0] > 0.0:
            found[kept] = i
            weights[kept] = scratch[i]
            kept += 1
        scratch[i, :] = 0.0
    return kept

"""Packets of parallel rays through the tree of `box_tree_kernels`.

Coordinates are those of `plain`: the scene within [−1, 1]³. A packet is up to 16 rays of one direction, so that
compilers make each loop over them one or two vector instructions.

References
----------
Woop, Benthin and Wald, Watertight ray/triangle intersection, 2013.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from .box_tree_kernels import DEEPEST

LANES = 16  # rays of a packet
CHUNK = 2048  # receivers a task

_f4_2 = types.Array(types.float32, 2, "C", readonly=True)
_i4_1 = types.Array(types.int32, 1, "C", readonly=True)
_i4_2 = types.Array(types.int32, 2, "C", readonly=True)
_tree = (
    _f4_2,
    _i4_2,
    types.Array(types.int8, 1, "C", readonly=True),
    _f4_2,
)  # bounds, children, axes, corners


@njit(cache=True)
def _set_direction(d, inverse, near, shear, axis_of):
    """What all rays of a direction share: for boxes, and for triangles (Woop's axes and shear)."""
    largest = 0
    for k in range(3):
        small = abs(d[k]) < np.float32(1e-18)
        inverse[k] = np.float32(1e18) if small else np.float32(1) / d[k]
        near[k] = 3 if inverse[k] < 0 else 0
        if abs(d[k]) > abs(d[largest]):
            largest = k
    axis_of[0], axis_of[1], axis_of[2] = (largest + 1) % 3, (largest + 2) % 3, largest
    shear[0], shear[1] = d[axis_of[0]] / d[largest], d[axis_of[1]] / d[largest]
    shear[2] = np.float32(1) / d[largest]


@njit(cache=True)
def _add_ray(x, y, z, lane, inverse, shear, axis_of, rays):
    """A ray in a packet: where it begins, in multiples of the direction along each axis, and sheared."""
    o = (x, y, z)
    for k in range(3):
        rays[k, lane] = o[k] * inverse[k]
    depth = o[axis_of[2]]
    rays[3, lane] = o[axis_of[0]] - shear[0] * depth
    rays[4, lane] = o[axis_of[1]] - shear[1] * depth
    rays[5, lane] = depth


@njit(cache=True)
def _meets_box(bounds, node, offset, rays, lanes, inverse, near, live):
    """Whether any ray that is still free meets a box, from 0 to infinity.

    Distances to planes are differences of products: boxes are padded by more than that rounds away.
    """
    nx, fx = bounds[node, offset + near[0]] * inverse[0], bounds[node, offset + 3 - near[0]] * inverse[0]
    ny, fy = bounds[node, offset + 1 + near[1]] * inverse[1], bounds[node, offset + 4 - near[1]] * inverse[1]
    nz, fz = bounds[node, offset + 2 + near[2]] * inverse[2], bounds[node, offset + 5 - near[2]] * inverse[2]
    met = np.int32(0)
    for i in range(lanes):
        x, y, z = rays[0, i], rays[1, i], rays[2, i]
        ax, ay, az = nx - x, ny - y, nz - z
        bx, by, bz = fx - x, fy - y, fz - z
        enter = ax if ax > ay else ay
        enter = enter if enter > az else az
        enter = enter if enter > np.float32(0) else np.float32(0)
        leave = bx if bx < by else by
        leave = leave if leave < bz else bz
        met |= live[i] & np.int32(leave >= enter)
    return met


@njit(cache=True)
def _meet_triangle(corners, t, rays, lanes, shear, axis_of, live):
    """Free rays that meet a triangle are no longer free.

    In the plane across the direction the sign of an edge's function is right or zero, and zero counts as
    inside: no ray passes between triangles that share an edge.
    """
    kx, ky, kz = axis_of[0], axis_of[1], axis_of[2]
    sx, sy, sz = shear[0], shear[1], shear[2]
    a_z, b_z, c_z = corners[t, kz], corners[t, 3 + kz], corners[t, 6 + kz]
    a_x, b_x, c_x = corners[t, kx] - sx * a_z, corners[t, 3 + kx] - sx * b_z, corners[t, 6 + kx] - sx * c_z
    a_y, b_y, c_y = corners[t, ky] - sy * a_z, corners[t, 3 + ky] - sy * b_z, corners[t, 6 + ky] - sy * c_z
    free = np.int32(0)
    for i in range(lanes):
        x, y, z = rays[3, i], rays[4, i], rays[5, i]
        ax, bx, cx = a_x - x, b_x - x, c_x - x
        ay, by, cy = a_y - y, b_y - y, c_y - y
        u, v_, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
        within = ((u >= 0) & (v_ >= 0) & (w >= 0)) | ((u <= 0) & (v_ <= 0) & (w <= 0))
        determinant = u + v_ + w
        distance = (u * (a_z - z) + v_ * (b_z - z) + w * (c_z - z)) * sz  # times the determinant
        ahead = ((distance > 0) & (determinant > 0)) | ((distance < 0) & (determinant < 0))
        live[i] &= np.int32(1) - np.int32(within & ahead)
        free |= live[i]
    return free


@njit(cache=True)
def _trace_packet(bounds, children, axes, corners, rays, lanes, inverse, near, shear, axis_of, live, stack):
    """Rays that meet a triangle are no longer free: ``live`` 1 becomes 0."""
    waiting, node = 0, 0
    while True:
        first = 1 if near[axes[node]] == 3 else 0  # the child on the side that the rays come from
        into = -1
        for turn in range(2):
            side = first if turn == 0 else 1 - first
            if not _meets_box(bounds, node, 6 * side, rays, lanes, inverse, near, live):
                continue
            child = children[node, side]
            if child < 0:
                start, count = (-1 - child) // 8, (-1 - child) % 8 + 1
                for t in range(start, start + count):
                    if not _meet_triangle(corners, t, rays, lanes, shear, axis_of, live):
                        return
            elif into < 0:
                into = child
            else:
                stack[waiting] = child
                waiting += 1
        if into >= 0:
            node = into
        elif waiting > 0:
            waiting -= 1
            node = stack[waiting]
        else:
            return


@njit(cache=True)
def _trace_chunk(bounds, children, axes, corners, origins, normals, order, first, last, d, state):
    """State of receivers order[first:last]: 0 faces away, 2 shadowed, 3 visible. Packets of those that face."""
    rays, live = np.empty((6, LANES), np.float32), np.empty(LANES, np.int32)
    stack, who = np.empty(DEEPEST, np.int32), np.empty(LANES, np.int32)
    inverse, shear = np.empty(3, np.float32), np.empty(3, np.float32)
    near, axis_of = np.empty(3, np.int64), np.empty(3, np.int64)
    _set_direction(d, inverse, near, shear, axis_of)
    lanes = 0
    for place in range(first, last):
        i = order[place]
        if normals[i, 0] * d[0] + normals[i, 1] * d[1] + normals[i, 2] * d[2] > 0:
            _add_ray(origins[i, 0], origins[i, 1], origins[i, 2], lanes, inverse, shear, axis_of, rays)
            who[lanes], live[lanes] = i, 1
            lanes += 1
        else:
            state[i] = 0
        if lanes == LANES or (place == last - 1 and lanes > 0):
            _trace_packet(
                bounds, children, axes, corners, rays, lanes, inverse, near, shear, axis_of, live, stack
            )
            for lane in range(lanes):
                state[who[lane]] = 2 + live[lane]
            lanes = 0


@njit(
    [types.void(*_tree, _f4_2, _f4_2, _i4_1, _f4_2, types.uint8[:, ::1])],
    parallel=True,
    cache=True,
    nogil=True,
)
def trace_receivers(bounds, children, axes, corners, origins, normals, order, directions, state):
    """state (D, R) of every receiver and direction: 0 faces away, 2 shadowed, 3 visible.

    ``order`` (R,) names receivers so that neighbours are near each other.
    """
    chunks = (len(order) + CHUNK - 1) // CHUNK
    for task in prange(len(directions) * chunks):
        j, chunk = task // chunks, task % chunks
        last = min(len(order), (chunk + 1) * CHUNK)
        _trace_chunk(
            bounds,
            children,
            axes,
            corners,
            origins,
            normals,
            order,
            chunk * CHUNK,
            last,
            directions[j],
            state[j],
        )


@njit(cache=True)
def _are_same(directions, i, j):
    a, b = directions[i], directions[j]
    return a[0] == b[0] and a[1] == b[1] and a[2] == b[2]


@njit(cache=True)
def _trace_rays(bounds, children, axes, corners, origins, directions, first, last, free):
    rays, live = np.empty((6, LANES), np.float32), np.empty(LANES, np.int32)
    stack = np.empty(DEEPEST, np.int32)
    inverse, shear = np.empty(3, np.float32), np.empty(3, np.float32)
    near, axis_of = np.empty(3, np.int64), np.empty(3, np.int64)
    start = first
    while start < last:
        lanes = 0
        _set_direction(directions[start], inverse, near, shear, axis_of)
        while start + lanes < last and lanes < LANES and _are_same(directions, start, start + lanes):
            o = origins[start + lanes]
            _add_ray(o[0], o[1], o[2], lanes, inverse, shear, axis_of, rays)
            live[lanes] = 1
            lanes += 1
        _trace_packet(
            bounds, children, axes, corners, rays, lanes, inverse, near, shear, axis_of, live, stack
        )
        for lane in range(lanes):
            free[start + lane] = live[lane]
        start += lanes


@njit([types.void(*_tree, _f4_2, _f4_2, types.uint8[::1])], parallel=True, cache=True)
def trace_rays(bounds, children, axes, corners, origins, directions, free):
    """free (n,): 1 if a ray meets no triangle. Runs of one direction go together."""
    chunks = (len(origins) + CHUNK - 1) // CHUNK
    for chunk in prange(chunks):
        last = min(len(origins), (chunk + 1) * CHUNK)
        _trace_rays(bounds, children, axes, corners, origins, directions, chunk * CHUNK, last, free)


@njit([types.void(_f4_2, types.uint32[::1])], cache=True)
def morton_codes(points, codes):
    """Of points in [−1, 1]³, ten bits an axis."""
    for i in range(len(points)):
        code = np.uint32(0)
        for k in range(3):
            cell = np.uint32(min(1023, max(0, int((points[i, k] + 1) * 512))))
            for bit in range(10):
                code |= ((cell >> np.uint32(bit)) & np.uint32(1)) << np.uint32(3 * bit + k)
        codes[i] = code

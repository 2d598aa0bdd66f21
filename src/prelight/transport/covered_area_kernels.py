"""What a photon's kernel covers of a surface: 1 − (d/r)² integrated over triangles, d flattened as for photons.

A triangle wholly within the kernel is integrated exactly; one that the kernel ends in is halved until it is fine.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from .photon_density_kernels import FLATTENED, OWN_SIDE, flat_square

_POINTS = 64  # of a task
_WAITING = 384  # nodes of the tree, at most
_FINE = 1.0 / 36  # of r², a triangle's longest edge: fine enough where the kernel ends within it
_HALVINGS = 24

_f1 = types.Array(types.float32, 1, "C", readonly=True)
_f2 = types.Array(types.float32, 2, "C", readonly=True)
_i2 = types.Array(types.int32, 2, "C", readonly=True)


@njit(cache=True)
def _kernel_integral(a, b, c, x, n, square, stack):
    """∫ max(0, 1 − d²/r²) over a triangle: cut until it lies within the kernel, or is fine.

    Over a triangle wholly inside the rule of edge middles is exact, the kernel being quadratic.
    """
    for k in range(3):
        stack[0, 0, k], stack[0, 1, k], stack[0, 2, k] = a[k], b[k], c[k]
    depths = np.zeros(len(stack), np.int64)
    waiting, total = 1, 0.0
    inverse = 1.0 / square
    middle = np.empty((3, 3), np.float64)
    while waiting > 0:
        waiting -= 1
        t, depth = stack[waiting].copy(), depths[waiting]
        longest, edge, inside = 0.0, 0, True
        for k in range(3):
            p, q = t[k], t[(k + 1) % 3]
            length = (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2
            if length > longest:
                longest, edge = length, k
            if flat_square(p, x, n) > square:
                inside = False
            for axis in range(3):
                middle[k, axis] = 0.5 * (p[axis] + q[axis])
        if not inside:
            # Farther from its longest edge's middle than that edge is long, no point of the triangle is.
            away = flat_square(middle[edge], x, n)
            if away > square and np.sqrt(away) - FLATTENED * np.sqrt(longest) > np.sqrt(square):
                continue
            if longest > _FINE * square and depth < _HALVINGS:
                far = (edge + 2) % 3
                for k in range(3):
                    stack[waiting, 0, k], stack[waiting, 1, k] = t[edge, k], middle[edge, k]
                    stack[waiting, 2, k] = t[far, k]
                    stack[waiting + 1, 0, k], stack[waiting + 1, 1, k] = middle[edge, k], t[(edge + 1) % 3, k]
                    stack[waiting + 1, 2, k] = t[far, k]
                depths[waiting] = depths[waiting + 1] = depth + 1
                waiting += 2
                continue
        u0, u1, u2 = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
        w0, w1, w2 = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
        across = np.sqrt((u1 * w2 - u2 * w1) ** 2 + (u2 * w0 - u0 * w2) ** 2 + (u0 * w1 - u1 * w0) ** 2)
        value = 0.0
        for k in range(3):
            value += max(0.0, 1.0 - flat_square(middle[k], x, n) * inverse)
        total += across / 6 * value
    return total


@njit(cache=True)
def _covered(tree, corners, sides, x, n, radius, todo, stack):
    bounds, children = tree
    square, total, waiting = np.float64(radius) * radius, 0.0, 1
    todo[0] = 0
    while waiting > 0:
        waiting -= 1
        node = todo[waiting]
        for side in range(2):
            gap = 0.0
            for k in range(3):
                out = max(bounds[node, 6 * side + k] - x[k], x[k] - bounds[node, 6 * side + 3 + k])
                if out > 0:
                    gap += out * out
            if not gap < square:
                continue
            child = children[node, side]
            if child >= 0:
                todo[waiting] = child
                waiting += 1
                continue
            first, count = (-1 - child) // 8, (-1 - child) % 8 + 1
            for i in range(first, first + count):
                m = sides[i]
                if m[0] * n[0] + m[1] * n[1] + m[2] * n[2] > OWN_SIDE:
                    t = corners[i]
                    total += _kernel_integral(t[0:3], t[3:6], t[6:9], x, n, square, stack)
    return total


@njit(cache=True)
def _some_areas(tree, corners, sides, x, n, radii, areas, first, last):
    todo, stack = np.empty(_WAITING, np.int32), np.empty((2 * _HALVINGS + 4, 3, 3), np.float64)
    for v in range(first, last):
        areas[v] = 0
        if radii[v] > 0:
            areas[v] = _covered(tree, corners, sides, x[v], n[v], radii[v], todo, stack)


@njit(
    [types.void(types.Tuple((_f2, _i2)), _f2, _f2, _f2, _f2, _f1, types.float32[::1])],
    parallel=True,
    cache=True,
)
def covered_areas(tree, corners, sides, x, n, radii, areas):
    """∫ K over the surface on each point's own side, square metres, written.

    tree: bounds (nodes, 12) and children (nodes, 2) of ``rays.box_tree_kernels`` over triangles; corners (F, 9)
    and sides (F, 3), unit normals of their lit sides, in the order of its leaves.
    """
    for part in prange((len(x) + _POINTS - 1) // _POINTS):
        first, last = part * _POINTS, min(len(x), (part + 1) * _POINTS)
        _some_areas(tree, corners, sides, x, n, radii, areas, first, last)

"""Unshadowed direct light at vertices in closed form: balls and rectangles over the horizon of each vertex.

E / π for unit intensity of a ball, for unit radiance of a rectangle.
"""

from __future__ import annotations

from math import acos, asin, pi, sqrt

import numpy as np
from numba import njit, prange, types

_VERTICES = 1024  # of a task

f4, f8 = types.float32, types.float64
_rows = types.Array(f4, 2, "C", readonly=True)
_few = types.Array(f8, 1, "C", readonly=True)
_corners = types.Array(f8, 2, "C", readonly=True)


@njit(cache=True)
def _of_ball(cosine, square, radius):
    """Naraghi and Chung, Radiation configuration factors between disks and a class of axisymmetric bodies, 1982."""
    r2 = radius * radius
    if square <= r2 or square <= 0.0:
        return 0.0  # inside of it
    if cosine * cosine * square >= r2:  # wholly above the horizon, or below
        return max(cosine, 0.0) / (pi * square)
    h2 = square / r2
    root, sine = sqrt(h2 - 1.0), sqrt(1.0 - cosine * cosine)
    above = 0.5 - asin(min(root / sqrt(h2) / sine, 1.0)) / pi
    edge = cosine * acos(max(min(-root * cosine / sine, 1.0), -1.0))
    edge -= root * sqrt(max(1.0 - h2 * cosine * cosine, 0.0))
    return max(above + edge / (pi * h2), 0.0) / (pi * r2)


@njit(cache=True)
def _some_of_ball(begin, end, points, normals, centre, axes, radius, out, along):
    for i in range(begin, end):
        x, y, z = centre[0] - points[i, 0], centre[1] - points[i, 1], centre[2] - points[i, 2]
        square = x * x + y * y + z * z
        distance = sqrt(max(square, 1e-30))
        up = (normals[i, 0] * x + normals[i, 1] * y + normals[i, 2] * z) / distance
        is_dark = normals[i, 0] == 0 and normals[i, 1] == 0 and normals[i, 2] == 0
        out[i] = 0.0 if is_dark else _of_ball(up, square, radius)
        for k in range(3):
            along[i, k] = -(axes[0, k] * x + axes[1, k] * y + axes[2, k] * z) / distance


@njit(
    [types.void(_rows, _rows, _few, _corners, f8, f4[::1], f8[:, ::1])], parallel=True, cache=True, nogil=True
)
def of_ball(points, normals, centre, axes, radius, out, along):
    """out (V,): of a ball at ``centre``, 0 inside of it; along (V, 3): directions in which its light leaves for the
    vertices, in the lamp's frame, whose axes are the columns of ``axes``."""
    for part in prange((len(out) + _VERTICES - 1) // _VERTICES):
        begin, end = part * _VERTICES, min(len(out), (part + 1) * _VERTICES)
        _some_of_ball(begin, end, points, normals, centre, axes, radius, out, along)


@njit(cache=True)
def _clipped(corners, count, height, out):
    """The part of a polygon above the horizon: how many corners."""
    n = 0
    for a in range(count):
        b = (a + 1) % count
        if height[a] > 0:
            for k in range(3):
                out[n, k] = corners[a, k]
            n += 1
        if (height[a] > 0) != (height[b] > 0):
            t = height[a] / (height[a] - height[b])
            for k in range(3):
                out[n, k] = corners[a, k] + t * (corners[b, k] - corners[a, k])
            n += 1
    return n


@njit(cache=True)
def _of_polygon(normal, corners, count):
    """Lambert's formula: the sum over edges of the angle times the cosine of what is across it."""
    total = 0.0
    for a in range(count):
        b = (a + 1) % count
        ax, ay, az = corners[a, 0], corners[a, 1], corners[a, 2]
        bx, by, bz = corners[b, 0], corners[b, 1], corners[b, 2]
        cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        across = sqrt(cx * cx + cy * cy + cz * cz)
        if across > 0.0:
            angle = np.arctan2(across, ax * bx + ay * by + az * bz)
            total += angle * (normal[0] * cx + normal[1] * cy + normal[2] * cz) / across
    return abs(total) / (2.0 * pi)


@njit(cache=True)
def _some_of_panel(begin, end, points, normals, corners, facing, out):
    way, height, above = np.empty((4, 3)), np.empty(4), np.empty((6, 3))
    for i in range(begin, end):
        out[i] = 0.0
        front, highest = 0.0, 0.0
        for a in range(4):
            height[a] = 0.0
            for k in range(3):
                way[a, k] = corners[a, k] - points[i, k]
                height[a] += normals[i, k] * way[a, k]
            highest = max(highest, height[a])
        for k in range(3):
            front -= facing[k] * way[0, k]
        if front > 0.0 and highest > 0.0:
            count = _clipped(way, 4, height, above)
            out[i] = _of_polygon(normals[i], above, count)


@njit([types.void(_rows, _rows, _corners, _few, f4[::1])], parallel=True, cache=True, nogil=True)
def of_panel(points, normals, corners, facing, out):
    """out (V,): of a rectangle (4 corners in turn) that shines toward ``facing``; 0 behind it."""
    for part in prange((len(out) + _VERTICES - 1) // _VERTICES):
        begin, end = part * _VERTICES, min(len(out), (part + 1) * _VERTICES)
        _some_of_panel(begin, end, points, normals, corners, facing, out)


@njit(cache=True)
def _some_of_sky(begin, end, bits, directions, energy, normals, out):
    for i in range(begin, end):
        x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
        r, g, b = 0.0, 0.0, 0.0
        for byte in range(bits.shape[1]):
            seen = bits[i, byte]
            if seen == 0:  # of a room most of the sky is not seen
                continue
            for k in range(8):
                if seen >> k & 1:
                    c = 8 * byte + k
                    cosine = x * directions[c, 0] + y * directions[c, 1] + z * directions[c, 2]
                    if cosine > 0:
                        r += cosine * energy[c, 0]
                        g += cosine * energy[c, 1]
                        b += cosine * energy[c, 2]
        out[i, 0], out[i, 1], out[i, 2] = r / pi, g / pi, b / pi


@njit(
    [types.void(types.Array(types.uint8, 2, "C", readonly=True), _rows, _corners, _rows, f4[:, ::1])],
    parallel=True,
    cache=True,
    nogil=True,
)
def of_sky(bits, directions, energy, normals, out):
    """out (V, 3) = Σ over cells of the sky of energy · cosine / π where the vertex's bit says that it is seen.

    bits (V, bytes), cell c in bit c mod 8 of byte c div 8; directions (cells, 3), energy (cells, 3) radiance times
    solid angle.
    """
    for part in prange((len(out) + _VERTICES - 1) // _VERTICES):
        begin, end = part * _VERTICES, min(len(out), (part + 1) * _VERTICES)
        _some_of_sky(begin, end, bits, directions, energy, normals, out)

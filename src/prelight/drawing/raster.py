"""The kernels of a view: which triangle each sample sees, and what to do with it (Numba).

Triangles are drawn in homogeneous coordinates and never clipped (Olano and Greer 1997, "Triangle scan
conversion using 2D homogeneous coordinates"). A vertex in *pixel space* is q = (x·w, y·w, w), with (x, y) its
place in the picture in pixels (y downward) and w its depth along the viewing axis, negative behind the eye. The
ray through the picture point (x, y) is then d = (x, y, 1), and for a triangle with vertices q0, q1, q2 the numbers

    u0 = ±d·(q1 × q2),   u1 = ±d·(q2 × q0),   u2 = ±d·(q0 × q1),   with the sign of D = q0·(q1 × q2)

are linear in x and y. The ray meets the triangle in front of the eye where none of them is negative; their sum
is |D| / depth there, and each divided by the sum is a perspective-correct barycentric coordinate.

A shared edge gives its two triangles exactly opposite values (so nothing may be scaled before the signs are
tested), and a sample with u = 0 belongs to both: no cracks.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from ..arrays import Float64, Int32

BAND = 8  # picture rows drawn together by one thread; its depth buffer stays in the cache
NOTHING = np.int32(-1)


@njit(cache=True)
def edge_planes(
    q: Float64[np.ndarray, "vertices 3"], corners: Int32[np.ndarray, "3"], planes: Float64[np.ndarray, "3 3"]
) -> float:
    """Fills rows a, b, c with u_i = a·x + b·y + c; returns 1 / |D|, or 0 for a triangle seen edge-on."""
    for i in range(3):
        j, k = corners[(i + 1) % 3], corners[(i + 2) % 3]
        planes[i, 0] = q[j, 1] * q[k, 2] - q[j, 2] * q[k, 1]
        planes[i, 1] = q[j, 2] * q[k, 0] - q[j, 0] * q[k, 2]
        planes[i, 2] = q[j, 0] * q[k, 1] - q[j, 1] * q[k, 0]
    v = corners[0]
    determinant = q[v, 0] * planes[0, 0] + q[v, 1] * planes[0, 1] + q[v, 2] * planes[0, 2]
    if not 1e-300 < abs(determinant) < np.inf:
        return 0.0
    if determinant < 0.0:
        for i in range(3):
            for j in range(3):
                planes[i, j] = -planes[i, j]
    return 1.0 / abs(determinant)


@njit(cache=True)
def _extent(q: Float64[np.ndarray, "vertices 3"], corners: Int32[np.ndarray, "3"], near: float):
    """Bounding box (x0, x1, y0, y1) in the picture of the part beyond the near plane; empty if x0 > x1."""
    x0, x1, y0, y1 = np.inf, -np.inf, np.inf, -np.inf
    for i in range(3):
        a, b = corners[i], corners[(i + 1) % 3]
        wa, wb = q[a, 2], q[b, 2]
        if wa >= near:
            x, y = q[a, 0] / wa, q[a, 1] / wa
            x0, x1, y0, y1 = min(x0, x), max(x1, x), min(y0, y), max(y1, y)
        if (wa >= near) != (wb >= near):
            s = (near - wa) / (wb - wa)
            x, y = (q[a, 0] + s * (q[b, 0] - q[a, 0])) / near, (q[a, 1] + s * (q[b, 1] - q[a, 1])) / near
            x0, x1, y0, y1 = min(x0, x), max(x1, x), min(y0, y), max(y1, y)
    return x0, x1, y0, y1


@njit(cache=True)
def _clamped(x: float, low: int, high: int) -> int:
    """The float x as an integer in [low, high], for any finite or infinite x."""
    return int(min(max(x, float(low)), float(high)))


@njit(cache=True, parallel=True)
def pixel_bounds(q, triangles, near, lowest, highest, width, height):
    """For each triangle, the pixels (x0, x1, y0, y1), ends excluded, any of whose samples may see it.

    ``lowest`` and ``highest`` are the extremes of the samples' offsets (x, y) from a pixel's corner.
    """
    slack = 1e-4  # pixels; more than the rounding of a projection
    bounds = np.zeros((len(triangles), 4), np.int32)
    for t in prange(len(triangles)):
        x0, x1, y0, y1 = _extent(q, triangles[t], near)
        if x0 <= x1:
            bounds[t, 0] = _clamped(np.ceil(x0 - highest[0] - slack), 0, width)
            bounds[t, 1] = _clamped(np.floor(x1 - lowest[0] + slack) + 1.0, 0, width)
            bounds[t, 2] = _clamped(np.ceil(y0 - highest[1] - slack), 0, height)
            bounds[t, 3] = _clamped(np.floor(y1 - lowest[1] + slack) + 1.0, 0, height)
    return bounds


@njit(cache=True)
def bands_of_triangles(bounds, bands):
    """Which triangles touch each band of rows: ``order[starts[b] : starts[b + 1]]`` are those of band b."""
    starts = np.zeros(bands + 1, np.int64)
    for t in range(len(bounds)):
        if bounds[t, 0] < bounds[t, 1] and bounds[t, 2] < bounds[t, 3]:
            for b in range(bounds[t, 2] // BAND, (bounds[t, 3] - 1) // BAND + 1):
                starts[b + 1] += 1
    starts = np.cumsum(starts)
    order, cursor = np.empty(starts[-1], np.int32), starts[:-1].copy()
    for t in range(len(bounds)):
        if bounds[t, 0] < bounds[t, 1] and bounds[t, 2] < bounds[t, 3]:
            for b in range(bounds[t, 2] // BAND, (bounds[t, 3] - 1) // BAND + 1):
                order[cursor[b]] = t
                cursor[b] += 1
    return starts, order


@njit(cache=True)
def _comes_first(triangles, a: int, b: int) -> bool:
    """Whether triangle a wins at equal depth: by its vertices, so that the order of triangles does not matter."""
    for i in range(3):
        if triangles[a, i] != triangles[b, i]:
            return triangles[a, i] < triangles[b, i]
    return False


@njit(cache=True)
def _draw_triangle(t, triangles, planes, scale, bounds, row, offsets, shift, nearest, depths, winners):
    """Enter triangle t into the buffer of inverse depths of the rows from ``row`` on; ``shift`` is scratch."""
    samples = len(offsets)
    a0, b0, c0 = planes[0, 0], planes[0, 1], planes[0, 2]
    a1, b1, c1 = planes[1, 0], planes[1, 1], planes[1, 2]
    a2, b2, c2 = planes[2, 0], planes[2, 1], planes[2, 2]
    reach0 = reach1 = reach2 = -np.inf
    for s in range(samples):
        x, y = offsets[s, 0], offsets[s, 1]
        shift[0, s], shift[1, s], shift[2, s] = a0 * x + b0 * y, a1 * x + b1 * y, a2 * x + b2 * y
        reach0, reach1, reach2 = max(reach0, shift[0, s]), max(reach1, shift[1, s]), max(reach2, shift[2, s])
    x0, x1, y0, y1 = bounds
    for y in range(y0, y1):
        for x in range(x0, x1):
            u0, u1, u2 = a0 * x + b0 * y + c0, a1 * x + b1 * y + c1, a2 * x + b2 * y + c2
            if u0 + reach0 < 0.0 or u1 + reach1 < 0.0 or u2 + reach2 < 0.0:
                continue
            for s in range(samples):
                v0, v1, v2 = u0 + shift[0, s], u1 + shift[1, s], u2 + shift[2, s]
                if min(v0, v1, v2) >= 0.0:
                    inverse_depth = (v0 + v1 + v2) * scale
                    best = depths[y - row, x, s]
                    if best <= inverse_depth <= nearest and (
                        inverse_depth > best or _comes_first(triangles, t, winners[y - row, x, s])
                    ):
                        depths[y - row, x, s] = inverse_depth
                        winners[y - row, x, s] = t


@njit(cache=True, parallel=True)
def visible_triangles(q, triangles, bounds, starts, order, first_row, offsets, near, threads, winners):
    """Fill ``winners`` (rows, width, samples) from picture row ``first_row``, a multiple of BAND, on.

    Each sample gets the nearest triangle in front of the near plane, or NOTHING. A thread owns whole bands, so
    the answer does not depend on how many threads there are.
    """
    rows, width, samples = winners.shape
    first, last = first_row // BAND, (first_row + rows + BAND - 1) // BAND
    for thread in prange(threads):
        depths = np.empty((BAND, width, samples))
        planes, shift = np.empty((3, 3)), np.empty((3, samples))
        for band in range(first + thread, last, threads):
            top, bottom = band * BAND, min((band + 1) * BAND, first_row + rows)
            depths[:] = 0.0
            here = winners[top - first_row : bottom - first_row]
            here[:] = NOTHING
            for n in range(starts[band], starts[band + 1]):
                t = order[n]
                scale = edge_planes(q, triangles[t], planes)
                box = bounds[t, 0], bounds[t, 1], max(bounds[t, 2], top), min(bounds[t, 3], bottom)
                if scale > 0.0:
                    _draw_triangle(
                        t, triangles, planes, scale, box, top, offsets, shift, 1.0 / near, depths, here
                    )


@njit(cache=True, parallel=True)
def count_seen(winners):
    """How many different triangles each pixel sees, (rows·width,) int64, and how many samples see one, int32."""
    rows, width, samples = winners.shape
    counts = np.zeros(rows * width, np.int64)
    hits = np.zeros(rows * width, np.int32)
    for row in prange(rows):
        for column in range(width):
            for s in range(samples):
                t = winners[row, column, s]
                new = t >= 0
                hits[row * width + column] += new
                for earlier in range(s):
                    new = new and winners[row, column, earlier] != t
                counts[row * width + column] += new
    return counts, hits


@njit(cache=True)
def _at(planes, i: int, x: float, y: float) -> float:
    return max(planes[i, 0] * x + planes[i, 1] * y + planes[i, 2], 0.0)


@njit(cache=True, parallel=True)
def mean_weights(q, triangles, winners, first_row, offsets, starts, seen, weights):
    """Average the barycentric coordinates of each pixel's samples, triangle by triangle.

    ``seen[starts[p] : starts[p + 1]]`` become the triangles of pixel p, and ``weights`` (n, 3) the weights of
    their vertices; those of a wholly covered pixel add up to 1.
    """
    rows, width, samples = winners.shape
    for row in prange(rows):
        planes = np.empty((3, 3))
        for column in range(width):
            entry = starts[row * width + column]
            for s in range(samples):
                t = winners[row, column, s]
                new = t >= 0
                for earlier in range(s):
                    new = new and winners[row, column, earlier] != t
                if not new:
                    continue
                edge_planes(q, triangles[t], planes)
                sum0 = sum1 = sum2 = 0.0
                for other in range(s, samples):
                    if winners[row, column, other] == t:
                        x, y = column + offsets[other, 0], first_row + row + offsets[other, 1]
                        u0, u1, u2 = _at(planes, 0, x, y), _at(planes, 1, x, y), _at(planes, 2, x, y)
                        share = 1.0 / (samples * max(u0 + u1 + u2, 1e-300))
                        sum0, sum1, sum2 = sum0 + share * u0, sum1 + share * u1, sum2 + share * u2
                seen[entry] = t
                weights[entry, 0], weights[entry, 1], weights[entry, 2] = sum0, sum1, sum2
                entry += 1


@njit(cache=True, parallel=True)
def interpolate(starts, seen, weights, triangles, radiance, coverage, behind, picture):
    """Write what each pixel sees, over what is ``behind`` it, to ``picture`` (rows, width, 3)."""
    rows, width, _ = picture.shape
    for row in prange(rows):
        for column in range(width):
            through = np.float32(1.0) - coverage[row, column]
            red, green, blue = np.float32(0.0), np.float32(0.0), np.float32(0.0)
            if through > 0.0:
                red = through * behind[row, column, 0]
                green = through * behind[row, column, 1]
                blue = through * behind[row, column, 2]
            pixel = row * width + column
            for n in range(starts[pixel], starts[pixel + 1]):
                t = seen[n]
                for i in range(3):
                    v, weight = triangles[t, i], weights[n, i]
                    red += weight * radiance[v, 0]
                    green += weight * radiance[v, 1]
                    blue += weight * radiance[v, 2]
            picture[row, column, 0] = red
            picture[row, column, 1] = green
            picture[row, column, 2] = blue

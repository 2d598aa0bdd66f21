"""The compiled loop that finds how much of each texel a window of a lat-long map covers, by samples."""

from __future__ import annotations

from math import atan2, pi, sqrt

import numpy as np
from numba import njit

from ..arrays import Float64

Vector = tuple[float, float, float]
Cone = tuple[float, float, float, float]  # axis, cosine
Limits = tuple[float, float, float, float]  # azimuth: middle, half width; sines of the elevations


@njit(cache=True, nogil=True, inline="always")
def _inside(axes: tuple[Vector, Vector, Vector], u: float, v: float, limits: Limits) -> bool:
    a, b, c = axes
    y = (c[1] + u * a[1] + v * b[1]) / sqrt(1.0 + u * u + v * v)
    if y < limits[2] or y > limits[3]:
        return False
    x, z = c[0] + u * a[0] + v * b[0], c[2] + u * a[2] + v * b[2]
    off = abs((atan2(x, -z) - limits[0] + pi) % (2.0 * pi) - pi)
    return off <= limits[1]


@njit(cache=True, nogil=True)
def _sampled(axes: tuple, u: float, v: float, step: float, limits: Limits, samples: int) -> float:
    inside = whole = 0.0
    for i in range(samples):
        b = v + (i + 0.5) * step / samples
        for j in range(samples):
            a = u + (j + 0.5) * step / samples
            weight = (1.0 + a * a + b * b) ** -1.5  # solid angle for its area on the face
            whole += weight
            if _inside(axes, a, b, limits):
                inside += weight
    return inside / whole


@njit(cache=True, nogil=True)
def _beyond(axes: tuple[Vector, Vector, Vector], u: float, v: float, cone: Cone) -> bool:
    a, b, c = axes
    along = 0.0
    for k in range(3):
        along += cone[k] * (c[k] + u * a[k] + v * b[k])
    return along < cone[3] * sqrt(1.0 + u * u + v * v)


@njit(cache=True, nogil=True)
def cover(
    out: Float64[np.ndarray, "row column"],
    axes: tuple[Vector, Vector, Vector],
    limits: Limits,
    cone: Cone,
    sampling: tuple[int, bool],
) -> None:
    """The mean share, 0 to 1, of the texels of a face with these U, V, AXIS (``bases.cube_map``).

    ``cone``: texels whose middle lies outside it are not touched. ``sampling``: samples a side of a texel, and
    whether a texel whose corners are all inside, or all outside, is so altogether.
    """
    side = out.shape[0]
    step, (samples, corners_tell) = 2.0 / side, sampling
    known = np.zeros((2, side + 1), np.bool_)  # of the corners above and below a row
    for i in range(side + 1):
        v = i * step - 1.0
        known[0] = known[1]
        for j in range(side + 1):
            known[1, j] = _inside(axes, j * step - 1.0, v, limits)
        if i == 0:
            continue
        v -= step
        for j in range(side):
            u = j * step - 1.0
            corners = int(known[0, j]) + int(known[0, j + 1]) + int(known[1, j]) + int(known[1, j + 1])
            if corners_tell and (corners == 0 or corners == 4):
                out[i - 1, j] = corners // 4
            elif _beyond(axes, u + 0.5 * step, v + 0.5 * step, cone):
                out[i - 1, j] = 0.0
            else:
                out[i - 1, j] = _sampled(axes, u, v, step, limits, samples)

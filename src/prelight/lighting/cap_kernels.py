"""The compiled loops that find how much of each texel a round region of the sphere covers, to rounding.

With w = 1 − cos θ at an angle θ from the middle of a region, an azimuth φ around it, and its share f(w), let
G(w) be the integral of f from 0 to w. Then ∫ f dω = ∫∫ f dw dφ = ∮ G dφ along the boundary (Green). The four
sides of a texel are arcs of great circles, straight in the plane of the face, so each of them is cut where it
meets the edges of the region, and

* inside, where G = w, the integral is the area of the spherical triangle with the middle [VanOosterom1983];
* outside, where G is constant, it is G times a difference of azimuths;
* in between the integrand is smooth, and a few Gauss points do.

Two neighbours share a side, so what one loses the other has: the sum over all texels is 2π·G to rounding,
however small the region or coarse the cube map. Points are in the frame of the region (middle at +z).
"""

from __future__ import annotations

from math import atan2, pi, sqrt

import numpy as np
from numba import njit

from ..arrays import Float64

Point = tuple[float, float, float]
Edge = tuple[float, float]  # w where the share begins to fall, and where it is zero

_GAUSS_3 = np.polynomial.legendre.leggauss(3)
_GAUSS_8 = np.polynomial.legendre.leggauss(8)
_NODES_3, _WEIGHTS_3 = 0.5 * (_GAUSS_3[0] + 1.0), 0.5 * _GAUSS_3[1]
_NODES_8, _WEIGHTS_8 = 0.5 * (_GAUSS_8[0] + 1.0), 0.5 * _GAUSS_8[1]
_NOTHING = 1e-13  # of the region: what is left of four sides outside it
_NODE_2 = 0.5 - 0.5 / sqrt(3.0)
_SHORT, _SHORTER = 0.2, 0.06  # of the region's reach: shorter pieces need fewer Gauss points


@njit(cache=True, nogil=True, inline="always")
def _between(p: Point, q: Point, t: float) -> Point:
    return p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]), p[2] + t * (q[2] - p[2])


@njit(cache=True, nogil=True, inline="always")
def _depth(p: Point) -> float:
    """w = 1 − cos θ of a point, precise near the middle."""
    aside = p[0] * p[0] + p[1] * p[1]
    length = sqrt(aside + p[2] * p[2])
    return aside / (length * (length + p[2])) if p[2] > 0.0 else 1.0 - p[2] / length


@njit(cache=True, nogil=True, inline="always")
def _gathered(p: Point, edge: Edge) -> float:
    """G / sin² θ inside the falling edge, where f = 1 − 3y² + 2y³ with y from 0 to 1 across it."""
    aside = p[0] * p[0] + p[1] * p[1]
    length = sqrt(aside + p[2] * p[2])
    one = 1.0 / (length * (length + p[2]))
    w = aside * one
    y = (w - edge[0]) / (edge[1] - edge[0])
    part = (w - edge[0]) / w if w > 0.0 else 1.0
    return (1.0 - part * y * y * (1.0 - 0.5 * y)) * one


@njit(cache=True, nogil=True)
def _triangle(p: Point, q: Point) -> float:
    """Signed area of the spherical triangle of the middle, p and q."""
    a = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
    b = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    dot = p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
    return 2.0 * atan2(p[0] * q[1] - p[1] * q[0], a * b + dot + p[2] * b + q[2] * a)


@njit(cache=True, nogil=True, inline="always")
def _length2(p: Point, q: Point) -> float:
    return (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2


@njit(cache=True, nogil=True)
def _falling(p: Point, q: Point, edge: Edge) -> float:
    """∫ G dφ over a piece that lies in the falling edge."""
    length2 = _length2(p, q) / (2.0 * edge[1])
    across = p[0] * q[1] - p[1] * q[0]
    if length2 < _SHORTER**2:
        return (
            0.5
            * across
            * (_gathered(_between(p, q, _NODE_2), edge) + _gathered(_between(q, p, _NODE_2), edge))
        )
    nodes, weights = (_NODES_3, _WEIGHTS_3) if length2 < _SHORT**2 else (_NODES_8, _WEIGHTS_8)
    total = 0.0
    for n in range(len(nodes)):
        total += weights[n] * _gathered(_between(p, q, nodes[n]), edge)
    return across * total


@njit(cache=True, nogil=True)
def _crossings(p: Point, q: Point, w: float) -> tuple[float, float]:
    """Where the line from p to q meets the cone of a depth, or −1; false ones do no harm."""
    cosine2, sine2 = (1.0 - w) * (1.0 - w), w * (2.0 - w)
    x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    a = cosine2 * (x * x + y * y) - sine2 * z * z
    half = cosine2 * (p[0] * x + p[1] * y) - sine2 * p[2] * z
    c = cosine2 * (p[0] * p[0] + p[1] * p[1]) - sine2 * p[2] * p[2]
    turn, i, j = p[0] * y - p[1] * x, p[2] * x - z * p[0], p[2] * y - z * p[1]
    under = cosine2 * (sine2 * (i * i + j * j) - cosine2 * turn * turn)  # half² − a·c, without cancellation
    if under <= 0.0:
        return -1.0, -1.0
    far = -(half + sqrt(under)) if half > 0.0 else -half + sqrt(under)
    return (far / a if a != 0.0 else -1.0), (c / far if far != 0.0 else -1.0)


@njit(cache=True, nogil=True)
def _piece(p: Point, q: Point, edge: Edge) -> float:
    """∫ G dφ over a piece on which no edge of the region is met."""
    w = _depth(_between(p, q, 0.5))
    if w <= edge[0]:
        return _triangle(p, q)
    if w < edge[1]:
        return _falling(p, q, edge)
    azimuth = atan2(p[0] * q[1] - p[1] * q[0], p[0] * q[0] + p[1] * q[1])
    return 0.5 * (edge[0] + edge[1]) * azimuth


@njit(cache=True, nogil=True)
def _side(p: Point, q: Point, edge: Edge, depths: tuple[float, float]) -> float:
    """∫ G dφ from p to q, which lie on one side of a texel and have these depths."""
    least, most = min(depths[0], depths[1]), max(depths[0], depths[1])
    if least > edge[0] and most < edge[1] and _length2(p, q) < 2.0 * edge[1] * _SHORT**2:
        return _falling(p, q, edge)
    first, second = _crossings(p, q, edge[1])
    third, fourth = _crossings(p, q, edge[0]) if edge[0] < edge[1] else (-1.0, -1.0)
    total, before, start = 0.0, 0.0, p
    for _ in range(4):
        following = 1.0
        for t in (first, second, third, fourth):
            if before < t < following:
                following = t
        if following == 1.0:
            break
        end = _between(p, q, following)
        total += _piece(start, end, edge)
        before, start = following, end
    return total + _piece(start, q, edge)


@njit(cache=True, nogil=True, inline="always")
def _corner_area(u: float, v: float) -> float:
    return atan2(u * v, sqrt(u * u + v * v + 1.0))


@njit(cache=True, nogil=True)
def _solid_angle(u: float, v: float, step: float) -> float:
    return (
        _corner_area(u + step, v + step)
        - _corner_area(u, v + step)
        - _corner_area(u + step, v)
        + _corner_area(u, v)
    )


@njit(cache=True, nogil=True, inline="always")
def _corner(frame: tuple[Point, Point, Point], u: float, v: float) -> Point:
    a, b, c = frame
    return c[0] + u * a[0] + v * b[0], c[1] + u * a[1] + v * b[1], c[2] + u * a[2] + v * b[2]


@njit(cache=True, nogil=True)
def cover(
    out: Float64[np.ndarray, "row column"],
    frame: tuple[Point, Point, Point],
    first: tuple[int, int],
    resolution: int,
    edge: Edge,
    beyond: float,
) -> None:
    """The mean share, from 0 to 1, of the texels of a rectangle of a face.

    Parameters
    ----------
    out
        A value for each texel of the rectangle.
    frame
        U, V and AXIS of the face (``bases.cube_map``) in the frame of the region.
    first
        The first row and column of the rectangle.
    edge
        w where the share begins to fall, and where it is zero; at most 1.5.
    beyond
        w that only corners of texels outside the region have.
    """
    height, width = out.shape
    step, whole = 2.0 / resolution, pi * (edge[0] + edge[1])
    depths = np.empty((2, width + 1))  # of the corners above and below a row
    above = np.full(width, np.nan)  # integrals along the sides above a row, as far as they are known
    for i in range(height + 1):
        v = (first[0] + i) * step - 1.0
        depths[0] = depths[1]
        for j in range(width + 1):
            depths[1, j] = _depth(_corner(frame, (first[1] + j) * step - 1.0, v))
        if i == 0:
            continue
        v -= step
        left = np.nan
        for j in range(width):
            a, b, c, d = depths[0, j], depths[0, j + 1], depths[1, j], depths[1, j + 1]
            high = max(a, b, c, d)
            if high <= edge[0] or high > beyond:
                out[i - 1, j] = 1.0 if high <= edge[0] else 0.0
                above[j] = left = np.nan
                continue
            u = (first[1] + j) * step - 1.0
            p, q = _corner(frame, u, v), _corner(frame, u + step, v)
            r, s = _corner(frame, u, v + step), _corner(frame, u + step, v + step)
            top = _side(p, q, edge, (a, b)) if np.isnan(above[j]) else above[j]
            if np.isnan(left):
                left = _side(p, r, edge, (a, c))
            right, bottom = _side(q, s, edge, (b, d)), _side(r, s, edge, (c, d))
            gathered = left + bottom - right - top
            if gathered < -0.5 * whole:  # around the point opposite the middle
                gathered += whole
            if gathered < _NOTHING * whole:
                gathered = 0.0
            out[i - 1, j] = min(gathered / _solid_angle(u, v, step), 1.0)
            above[j], left = bottom, right

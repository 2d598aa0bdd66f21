"""The compiled loops that scatter a radiance map, at any turn, over a cube map without losing light.

Every pixel is cut into sub-samples of about half a texel, each with its share of the pixel's solid angle,
and each is spread over the texels under a square of its own solid angle. A pixel's radiance is split in
two: the *floor*, the least of its 3×3 neighbourhood and of 50 times the map's mean, and the *peak* above
it. With Σ over what falls into a texel of solid angle ω,

    radiance = Σ floor·dω / Σ dω  +  Σ peak·dω / ω .

The first term is an average: a constant map stays constant although sub-samples never tile a texel
exactly (to about 1 %). The second only moves light about: a sun keeps its energy to the last digit.

All sums are float64 and in an order that does not depend on threads: a slab of rows of one face is one
job, done by one thread.

Where a pixel falls depends on the map's size and turn alone: ``Places`` in place of sums note it, and light is given
to them later (``give``), to the same bits.
"""

from __future__ import annotations

from math import ceil, cos, floor, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit, types
from numba.extending import overload

from ..arrays import Float64, Int32, Int64, Picture

SAMPLES_PER_TEXEL_SIDE = 2.0
COARSEST_STEP = 1.0 / 64.0  # radians; however large a texel is, a sub-sample is smaller than this

_BLOCK = 16  # pixels a side that are passed over together where they miss a slab
_TABLED = 16  # pieces of a pixel whose sines are tabled
Offsets = tuple[Float64[np.ndarray, "pieces piece"], Float64[np.ndarray, "pieces piece"]]

Vector = tuple[float, float, float]


class Places(NamedTuple):
    """Which shares of which pixels fall where, one after another; ``count`` may be more than there is room for."""

    texels: Int32[np.ndarray, "n"]
    pixels: Int32[np.ndarray, "n"]
    shares: Float64[np.ndarray, "n"]  # steradians
    count: Int64[np.ndarray, "1"]


class Slab(NamedTuple):
    """Rows of one face and what has fallen into them."""

    face: int
    first_row: int
    rows: int
    resolution: int
    u_axis: Vector  # U, V, AXIS of ``bases.cube_map``; tuples, since an array
    v_axis: Vector  # is counted up and down at every call, 20 times the cost
    axis: Vector
    sums: Float64[np.ndarray, "row column 7"] | Places  # Σ floor·dω (3), Σ peak·dω (3), Σ dω


@njit(cache=True, nogil=True, inline="always")
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True)
def _misses(slab: Slab, d: Vector, radius: float) -> bool:
    """Whether nothing within ``radius`` radians of a unit direction can fall into the slab."""
    along, u, v = _dot(slab.axis, d), _dot(slab.u_axis, d), _dot(slab.v_axis, d)
    if along + radius <= 0.0 or along + radius < max(abs(u), abs(v)) - radius:
        return True
    if slab.rows == slab.resolution or along < 0.5 or radius > 0.1:
        return False
    middle, margin = 0.5 * (v / along + 1.0) * slab.resolution, 3.0 * radius * slab.resolution + 2.0
    return middle + margin < slab.first_row or middle - margin > slab.first_row + slab.rows


@njit(cache=True, nogil=True)
def _pieces(resolution: int, d: Vector, angle: float) -> int:
    """How many sub-samples an angle is cut into, near a unit direction: texels are smaller off the centre."""
    along = max(max(abs(d[0]), abs(d[1]), abs(d[2])) - 0.5 * angle, 0.577)
    texels = angle * 0.5 * resolution / (along * sqrt(along))
    return max(1, ceil(max(SAMPLES_PER_TEXEL_SIDE * texels, angle / COARSEST_STEP) - 1e-9))


@njit(cache=True, nogil=True, inline="always")
def _inside(middle: float, reach: float) -> float:
    """The part of [middle − reach, middle + reach] that lies in [−1, 1]."""
    return max(0.0, min(middle + reach, 1.0) - max(middle - reach, -1.0)) / (2.0 * reach)


@njit(cache=True, nogil=True)
def _on_all_faces(d: Vector, e: Vector, f: Vector) -> float:
    """The parts of a patch that fall on the faces around it, seen by each in its own plane; about one."""
    parts = 0.0
    for m in range(3):
        if abs(d[m]) > 0.1:
            scale, i, j = 1.0 / d[m], (m + 1) % 3, (m + 2) % 3
            u, v = d[i] * scale, d[j] * scale
            wide = 0.5 * abs(scale) * sqrt((e[i] - u * e[m]) ** 2 + (f[i] - u * f[m]) ** 2)
            tall = 0.5 * abs(scale) * sqrt((e[j] - v * e[m]) ** 2 + (f[j] - v * f[m]) ** 2)
            parts += _inside(u, wide) * _inside(v, tall)
    return parts


def _add(slab: Slab, row: int, column: int, share: float, light: object) -> None:
    """Give a texel its share of light; or note it, where light is the number of a pixel."""
    raise TypeError("for compiled callers alone")


@overload(_add, inline="always")
def _add_compiled(slab, row, column, share, light):
    if isinstance(light, types.Integer):

        def note(slab, row, column, share, light):
            places = slab.sums
            n = places.count[0]
            if n < len(places.shares):
                places.texels[n] = (row - slab.first_row) * slab.resolution + column
                places.pixels[n] = light
                places.shares[n] = share
            places.count[0] = n + 1

        return note

    def add(slab, row, column, share, light):
        texel = slab.sums[row - slab.first_row, column]
        texel[0] += light[0] * share
        texel[1] += light[1] * share
        texel[2] += light[2] * share
        texel[3] += light[3] * share
        texel[4] += light[4] * share
        texel[5] += light[5] * share
        texel[6] += share

    return add


@njit(cache=True, nogil=True, inline="always")
def _spread(slab: Slab, d: Vector, e: Vector, f: Vector, weight: float, light: object) -> None:
    """Share dω = ``weight`` steradians of ``light`` among the texels under a patch of the sphere.

    The patch has its middle at the unit vector ``d`` and the sides ``e`` and ``f``, which touch the sphere
    there. On the face it becomes a rectangle along rows and columns with the same variance along either.
    """
    along = _dot(slab.axis, d)
    if along < 0.1:
        return
    scale, half = 1.0 / along, 0.5 * slab.resolution
    u, v = scale * _dot(slab.u_axis, d), scale * _dot(slab.v_axis, d)
    e_out, f_out = _dot(slab.axis, e), _dot(slab.axis, f)
    wide = (
        0.5 * scale * sqrt((_dot(slab.u_axis, e) - u * e_out) ** 2 + (_dot(slab.u_axis, f) - u * f_out) ** 2)
    )
    tall = (
        0.5 * scale * sqrt((_dot(slab.v_axis, e) - v * e_out) ** 2 + (_dot(slab.v_axis, f) - v * f_out) ** 2)
    )
    u0, u1, v0, v1 = u - wide, u + wide, v - tall, v + tall
    if u0 >= 1.0 or u1 <= -1.0 or v0 >= 1.0 or v1 <= -1.0:
        return
    density = weight / (4.0 * wide * tall * half * half)
    if abs(u) + 3.0 * wide > 1.0 or abs(v) + 3.0 * tall > 1.0:  # another face may see it reach over the edge
        density /= _on_all_faces(d, e, f)
    u0, u1 = half * (1.0 + max(u0, -1.0)), half * (1.0 + min(u1, 1.0))
    v0, v1 = half * (1.0 + max(v0, -1.0)), half * (1.0 + min(v1, 1.0))
    first, last = int(u0), min(int(u1), slab.resolution - 1)
    top = max(int(v0), slab.first_row)
    bottom = min(int(v1), slab.first_row + slab.rows - 1)
    for row in range(top, bottom + 1):
        high = (min(v1, row + 1.0) - max(v0, float(row))) * density
        for column in range(first, last + 1):
            share = (min(u1, column + 1.0) - max(u0, float(column))) * high
            _add(slab, row, column, share, light)


@njit(cache=True, nogil=True)
def split(pixels: Picture, own: tuple, rows: tuple, columns: tuple, highest: Vector) -> tuple:
    """Floor and peak of a pixel, given the rows and columns of its neighbourhood and the highest floor."""
    r, g, b = pixels[own[0], own[1], 0], pixels[own[0], own[1], 1], pixels[own[0], own[1], 2]
    floor_r, floor_g, floor_b = min(r, highest[0]), min(g, highest[1]), min(b, highest[2])
    for row in rows:
        for column in columns:
            floor_r = min(floor_r, pixels[row, column, 0])
            floor_g = min(floor_g, pixels[row, column, 1])
            floor_b = min(floor_b, pixels[row, column, 2])
    return floor_r, floor_g, floor_b, r - floor_r, g - floor_g, b - floor_b


def _light_of(pixels: Picture, own: tuple, rows: tuple, columns: tuple, highest: Vector | None) -> object:
    """``split`` of a pixel; its number, where there is no highest floor."""
    raise TypeError("for compiled callers alone")


@overload(_light_of)
def _light_of_compiled(pixels, own, rows, columns, highest):
    if isinstance(highest, types.NoneType):
        return lambda pixels, own, rows, columns, highest: own[0] * pixels.shape[1] + own[1]
    return lambda pixels, own, rows, columns, highest: split(pixels, own, rows, columns, highest)  # noqa: PLW0108


@njit(cache=True, nogil=True)
def _offsets(angle: float) -> Offsets:
    """Sines and cosines of the middles of 1 … ``_TABLED`` pieces of an angle, from its own middle."""
    sines, cosines = np.zeros((_TABLED + 1, _TABLED)), np.zeros((_TABLED + 1, _TABLED))
    for pieces in range(1, _TABLED + 1):
        for i in range(pieces):
            off = ((i + 0.5) / pieces - 0.5) * angle
            sines[pieces, i], cosines[pieces, i] = sin(off), cos(off)
    return sines, cosines


@njit(cache=True, nogil=True, inline="always")
def _offset(table: Offsets, angle: float, pieces: int, i: int) -> tuple[float, float]:
    if pieces <= _TABLED:
        return table[0][pieces, i], table[1][pieces, i]
    off = ((i + 0.5) / pieces - 0.5) * angle
    return sin(off), cos(off)


@njit(cache=True, nogil=True, inline="always")
def _scatter_pixel(slab: Slab, place: tuple, size: tuple, pieces: tuple, tables: tuple, light: tuple) -> None:
    """Share one pixel of a lat-long map; ``place``: sine and cosine of its azimuth and of its polar angle."""
    sine, cosine, ring, y = place
    (wide, tall), (across, down) = size, pieces
    h, w = tall / down, wide / across
    area = w * 2.0 * sin(0.5 * h)  # times the sine of the polar angle: exactly ∫ sin t dt da
    for i in range(across):
        so, co = _offset(tables[0], wide, across, i)
        sa, ca = sine * co + cosine * so, cosine * co - sine * so
        for j in range(down):
            so, co = _offset(tables[1], tall, down, j)
            s, c = ring * co + y * so, y * co - ring * so
            d = (s * sa, c, -s * ca)
            e, f = (w * s * ca, 0.0, w * s * sa), (h * c * sa, -h * s, -h * c * ca)
            _spread(slab, d, e, f, area * s, light)


@njit(cache=True, nogil=True)
def scatter_latlong(slab: Slab, pixels: Picture, turn: float, highest: Vector | None) -> None:
    """Scatter a latitude-longitude map turned by ``turn`` radians about +Y; without ``highest`` note ``Places``."""
    height, width = pixels.shape[:2]
    tall, wide = np.pi / height, 2.0 * np.pi / width
    azimuths = -np.pi - turn + wide * (np.arange(width) + 0.5)
    sines, cosines = np.sin(azimuths), np.cos(azimuths)
    tables = (_offsets(wide), _offsets(tall))
    for top in range(0, height, _BLOCK):
        rows_here = min(_BLOCK, height - top)
        middle_polar = (top + 0.5 * rows_here) * tall
        ring = min(1.0, sin(middle_polar) + 0.5 * rows_here * tall)
        for left in range(0, width, _BLOCK):
            columns_here = min(_BLOCK, width - left)
            a = -np.pi - turn + wide * (left + 0.5 * columns_here)
            s = sin(middle_polar)
            if _misses(
                slab, (s * sin(a), cos(middle_polar), -s * cos(a)),
                0.5 * (rows_here * tall + columns_here * wide * ring) + tall + wide,
            ):  # fmt: skip
                continue
            for row in range(top, top + rows_here):
                polar = (row + 0.5) * tall
                ring_here, y = sin(polar), cos(polar)
                widest = min(1.0, ring_here + 0.5 * tall)
                rows = (max(row - 1, 0), row, min(row + 1, height - 1))
                for column in range(left, left + columns_here):
                    middle = (ring_here * sines[column], y, -ring_here * cosines[column])
                    if _misses(slab, middle, tall + wide * widest):
                        continue
                    pieces = (
                        _pieces(slab.resolution, middle, wide * widest),
                        _pieces(slab.resolution, middle, tall),
                    )
                    columns = ((column - 1) % width, column, (column + 1) % width)
                    light = _light_of(pixels, (row, column), rows, columns, highest)
                    place = (sines[column], cosines[column], ring_here, y)
                    _scatter_pixel(slab, place, (wide, tall), pieces, tables, light)


@njit(cache=True, nogil=True)
def _on_disc(row: int, column: int, height: int, width: int) -> bool:
    p, q = (2.0 * column + 1.0) / width - 1.0, (2.0 * row + 1.0) / height - 1.0
    return p * p + q * q <= 1.0


@njit(cache=True, nogil=True)
def _disc_light(pixels: Picture, row: int, column: int, highest: Vector) -> tuple:
    """Floor and peak of a pixel of an angular map; what is centred outside the disc does not count."""
    height, width = pixels.shape[:2]
    if not _on_disc(row, column, height, width):  # as ``layouts.AngularMap.inward``
        p, q = (2.0 * column + 1.0) / width - 1.0, (2.0 * row + 1.0) / height - 1.0
        shrink = (1.0 - 2.0 / min(height, width)) / sqrt(p * p + q * q)
        row = min(max(floor((q * shrink + 1.0) * 0.5 * height), 0), height - 1)
        column = min(max(floor((p * shrink + 1.0) * 0.5 * width), 0), width - 1)
    light = pixels[row, column]
    r, g, b = min(light[0], highest[0]), min(light[1], highest[1]), min(light[2], highest[2])
    for i in range(max(row - 1, 0), min(row + 2, height)):
        for j in range(max(column - 1, 0), min(column + 2, width)):
            if _on_disc(i, j, height, width):
                r, g, b = min(r, pixels[i, j, 0]), min(g, pixels[i, j, 1]), min(b, pixels[i, j, 2])
    return r, g, b, light[0] - r, light[1] - g, light[2] - b


@njit(cache=True, nogil=True, inline="always")
def _turned(x: float, y: float, z: float, turn: tuple[float, float]) -> Vector:
    """Turned about +Y by an angle given as cosine and sine."""
    return turn[0] * x + turn[1] * z, y, turn[0] * z - turn[1] * x


@njit(cache=True, nogil=True)
def _spread_disc(slab: Slab, p: float, q: float, step: tuple, turn: tuple, light: tuple) -> None:
    """Share a rectangle of the disc, ``step`` wide and tall, around the point (p, q)."""
    r2 = p * p + q * q
    if r2 >= 1.0:
        return
    r = sqrt(r2)
    c, reach, bend = cos(np.pi * r), np.pi, -(np.pi**3) / 3.0
    if r > 1e-6:
        reach = sin(np.pi * r) / r
        bend = (np.pi * c - reach) / r2  # (d reach / dr) / r
    w, h = step
    d = _turned(p * reach, q * reach, -c, turn)
    e = _turned(w * (reach + p * p * bend), w * p * q * bend, w * np.pi * reach * p, turn)
    f = _turned(h * p * q * bend, h * (reach + q * q * bend), h * np.pi * reach * q, turn)
    _spread(slab, d, e, f, np.pi * reach * w * h, light)


@njit(cache=True, nogil=True)
def scatter_angular(slab: Slab, pixels: Picture, turn: float, highest: Vector) -> None:
    """Scatter an angular map turned by ``turn`` radians about +Y."""
    height, width = pixels.shape[:2]
    tall, wide, turned = 2.0 / height, 2.0 / width, (cos(turn), sin(turn))
    for row in range(height):
        for column in range(width):
            p, q = (column + 0.5) * wide - 1.0, 1.0 - (row + 0.5) * tall
            r = sqrt(p * p + q * q)
            if r > 1.0 + 0.5 * (tall + wide):
                continue
            reach = sin(np.pi * r) / r if r > 1e-9 else np.pi
            middle = _turned(p * reach, q * reach, -cos(np.pi * r), turned)
            if _misses(slab, middle, np.pi * (tall + wide)):
                continue
            narrow = sqrt(max(reach, 0.8))  # pixels are narrow behind, where r is near 1
            across = _pieces(slab.resolution, middle, sqrt(np.pi) * narrow * wide)
            down = _pieces(slab.resolution, middle, sqrt(np.pi) * narrow * tall)
            if r > 1.0 - 0.5 * (tall + wide):
                across, down = max(across, 4), max(down, 4)  # the edge of the disc runs through it
            light = _disc_light(pixels, row, column, highest)
            step = (wide / across, tall / down)
            for j in range(down):
                for i in range(across):
                    p, q = column * wide - 1.0 + (i + 0.5) * step[0], 1.0 - row * tall - (j + 0.5) * step[1]
                    _spread_disc(slab, p, q, step, turned, light)


@njit(cache=True, nogil=True, inline="always")
def _face_direction(frame: tuple[Vector, Vector, Vector], u: float, v: float, scale: float) -> Vector:
    a, b, c = frame
    return (
        (c[0] + u * a[0] + v * b[0]) * scale,
        (c[1] + u * a[1] + v * b[1]) * scale,
        (c[2] + u * a[2] + v * b[2]) * scale,
    )


@njit(cache=True, nogil=True)
def scatter_face(slab: Slab, pixels: Picture, frame: tuple[Vector, Vector, Vector], highest: Vector) -> None:
    """Scatter one face; ``frame`` holds its U, V, AXIS, turned about +Y."""
    side, (a, b, _) = pixels.shape[0], frame
    width = 2.0 / side
    for row in range(side):
        rows = (max(row - 1, 0), row, min(row + 1, side - 1))
        for column in range(side):
            u, v = (column + 0.5) * width - 1.0, (row + 0.5) * width - 1.0
            scale = 1.0 / sqrt(1.0 + u * u + v * v)
            middle = _face_direction(frame, u, v, scale)
            if _misses(slab, middle, 2.0 * width):
                continue
            pieces = _pieces(slab.resolution, middle, width * min(1.0, scale + 0.5 * width))
            columns = (max(column - 1, 0), column, min(column + 1, side - 1))
            light = split(pixels, (row, column), rows, columns, highest)
            step = width / pieces
            for j in range(pieces):
                v = row * width - 1.0 + (j + 0.5) * step
                for i in range(pieces):
                    u = column * width - 1.0 + (i + 0.5) * step
                    scale = 1.0 / sqrt(1.0 + u * u + v * v)
                    d, h = _face_direction(frame, u, v, scale), step * scale
                    ud, vd = u * scale, v * scale  # U·d and V·d: the sides stand upright on d
                    e = (h * (a[0] - ud * d[0]), h * (a[1] - ud * d[1]), h * (a[2] - ud * d[2]))
                    f = (h * (b[0] - vd * d[0]), h * (b[1] - vd * d[1]), h * (b[2] - vd * d[2]))
                    _spread(slab, d, e, f, h * h * scale, light)

"""From a radiance map to a cube map of any resolution, with the same light in every channel.

Faces that are turned by a multiple of 90° are overlapped with the texels exactly. Everything else is
scattered (``scattering``). A cube map much finer than the map has nothing to add: it is made at twice the
map's own resolution and its texels are repeated, or overlapped where the resolutions do not divide. Of a map
much finer than the cube map, pixels are merged first, to no more than a quarter of a texel.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from math import cos, pi, radians, sin

import numpy as np

from ..arrays import CubeMap, Float32, Float64
from ..bases import cube_map
from ..errors import PrelightError
from .layouts import quarter_turned

ALWAYS_SCATTERED = 256  # up to here the texels are scattered to, however coarse the map
PIXELS_PER_TEXEL_SIDE = 4  # finer pixels are merged
PERMITTED_LOSS = 2e-3  # of a channel's energy, before it is put right: 3e-4 is the most ever seen

_HIGHEST_FLOOR = 50.0  # times the mean of the map
_SLAB_TEXELS = 1_000_000  # with 7 float64 sums each: 56 MB a thread
_OVERLAP_ROWS = 64
_MOST_THREADS = 4

_Vector = tuple[float, float, float]


def _in_threads(job: Callable[..., object], arguments: Iterable[tuple]) -> list:
    """Results in the order of the arguments; the compiled loops let go of the interpreter."""
    with ThreadPoolExecutor(min(_MOST_THREADS, os.cpu_count() or 1)) as pool:
        return [done.result() for done in [pool.submit(job, *each) for each in arguments]]


def _face_axes(degrees: float) -> list[tuple[_Vector, _Vector, _Vector]]:
    """U, V, AXIS of each face, turned about +Y."""
    c, s = cos(radians(degrees)), sin(radians(degrees))

    def turned(axis: Float64[np.ndarray, "3"]) -> _Vector:
        x, y, z = axis.tolist()
        return c * x + s * z, y, c * z - s * x

    return [
        (turned(u), turned(v), turned(w))
        for u, v, w in zip(cube_map.U, cube_map.V, cube_map.AXIS, strict=True)
    ]


def _scattered(
    pixels: Float32[np.ndarray, "... 3"],
    resolution: int,
    *,
    layout: str,
    degrees: float,
    total: Float64[np.ndarray, "3"],
) -> tuple[CubeMap, Float64[np.ndarray, "3"]]:
    """The cube map by scattering, and its ∫ L dω."""
    from .overlapping import finish
    from .remembered_places import latlong_places, split
    from .scattering import Slab, scatter_angular, scatter_face, scatter_latlong

    out = np.empty((6, resolution, resolution, 3), np.float32)
    rows = min(resolution, max(1, _SLAB_TEXELS // resolution))
    highest = tuple((total * (_HIGHEST_FLOOR / (4.0 * pi))).tolist())
    axes, turned_axes = _face_axes(0.0), _face_axes(degrees)
    places = None
    if layout == "latlong":
        places = latlong_places(*pixels.shape[:2], resolution, degrees)
    if places is not None and places.are_there(tuple(axes)):
        light = split(pixels, highest)
        given = (places.sums(face, light) for face in range(6))  # sooner done than threads are begun
        found = [finish(part, sums, 0, resolution) for part, sums in zip(out, given, strict=True)]
        return out, np.sum(found, axis=0)

    def fill(face: int, first: int) -> Float64[np.ndarray, "3"]:
        part = out[face, first : first + rows]
        sums = np.zeros((*part.shape[:2], 7))
        u_axis, v_axis, axis = axes[face]
        slab = Slab(face, first, len(part), resolution, u_axis, v_axis, axis, sums)
        if layout == "latlong":
            scatter_latlong(slab, pixels, radians(degrees), highest)
        elif layout == "angular":
            scatter_angular(slab, pixels, radians(degrees), highest)
        else:
            for source, frame in zip(pixels, turned_axes, strict=True):
                scatter_face(slab, source, frame, highest)
        return finish(part, sums, first, resolution)

    slabs = [(face, first) for face in range(6) for first in range(0, resolution, rows)]
    return out, np.sum(_in_threads(fill, slabs), axis=0)


def _overlapped(faces: CubeMap, resolution: int) -> CubeMap:
    if resolution == faces.shape[1]:
        return faces.copy()
    from .overlapping import overlap

    out = np.empty((6, resolution, resolution, 3), np.float32)
    starts = range(0, resolution, _OVERLAP_ROWS)
    _in_threads(overlap, [(faces, out, row, min(row + _OVERLAP_ROWS, resolution)) for row in starts])
    return out


def own_resolution(shape: tuple[int, ...], layout: str) -> int:
    """The cube map whose texels, in the middle of a face, are as large as the map's pixels."""
    if layout == "cube":
        return shape[1]
    return max(1, round(shape[1] / pi))  # angular: the pixel is 2π/width; lat-long: also, at the equator


def _repeat(resolution: int, finest: int) -> int:
    """How many texels a side share a value so that there are at most ``finest``; a divisor if one is near."""
    least = -(-resolution // finest)
    return next((r for r in range(least, 2 * least) if resolution % r == 0), least)


def _merged(
    pixels: Float32[np.ndarray, "... 3"], resolution: int, *, layout: str
) -> Float32[np.ndarray, "... 3"]:
    """The map with as many pixels a side as a cube map can tell apart, or a few times more."""
    merged, most = 1, own_resolution(pixels.shape, layout) // (PIXELS_PER_TEXEL_SIDE * resolution)
    sides = pixels.shape[:2] if layout == "latlong" else pixels.shape[1:3]
    while 2 * merged <= most and all(side % (2 * merged) == 0 for side in sides):
        merged *= 2
    if merged == 1 or layout == "angular":
        return pixels
    if layout == "cube":
        return _overlapped(pixels, pixels.shape[1] // merged)
    from .overlapping import merge_latlong

    out = np.empty((sides[0] // merged, sides[1] // merged, 3), np.float32)
    starts = range(0, len(out), _OVERLAP_ROWS)
    _in_threads(merge_latlong, [(pixels, out, row, min(row + _OVERLAP_ROWS, len(out))) for row in starts])
    return out


def resampled(
    pixels: Float32[np.ndarray, "... 3"],
    resolution: int,
    *,
    layout: str,
    degrees: float,
    total: Float64[np.ndarray, "3"],
) -> CubeMap:
    """The mean radiance of each texel of a map turned by ``degrees`` about +Y.

    Parameters
    ----------
    pixels, layout
        A ``latlong`` or ``angular`` picture or the six faces of a ``cube``; finite, not negative.
    total
        ∫ L dω of the map, by the exact solid angles of its pixels; the result has the same.
    """
    if layout == "cube" and degrees % 90.0 == 0.0:
        return _overlapped(quarter_turned(pixels, round(degrees / 90.0)), resolution)
    finest = max(ALWAYS_SCATTERED, 2 * own_resolution(pixels.shape, layout))
    repeat = _repeat(resolution, finest)
    pixels = _merged(pixels, resolution, layout=layout)
    out, got = _scattered(pixels, -(-resolution // repeat), layout=layout, degrees=degrees, total=total)
    off = np.divide(total, got, out=np.ones(3), where=got > 0.0)
    if np.abs(off - 1.0).max() > PERMITTED_LOSS:
        raise PrelightError(f"resampling lost light: a fault of ours; please report it ({got} of {total})")
    out *= off.astype(np.float32)
    return out if repeat == 1 else _overlapped(out, resolution)


def remember_turns(height: int, width: int, resolution: int) -> None:
    """Find now where the pixels of latitude-longitude maps of a size fall that are turned by ``turned_columns``."""
    from .remembered_places import latlong_places, rests

    axes = tuple(_face_axes(0.0))
    for degrees in rests(width):
        if (places := latlong_places(height, width, resolution, degrees)) is not None:
            places.are_there(axes, at_once=True)

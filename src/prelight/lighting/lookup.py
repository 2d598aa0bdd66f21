"""The compiled loops that look radiance up along directions: bilinear, turned about +Y."""

from __future__ import annotations

from math import atan2, cos, floor, hypot, pi, sin

import numpy as np
from numba import njit

from ..arrays import CubeMap, Float32, Picture, Radiance

Points = Float32[np.ndarray, "directions 3"]


@njit(cache=True, nogil=True, inline="always")
def _add(out: np.ndarray, pixel: np.ndarray, weight: float) -> None:
    for k in range(3):
        out[k] += weight * pixel[k]


@njit(cache=True, nogil=True)
def along_latlong(pixels: Picture, directions: Points, turn: float, out: Radiance) -> None:
    """Columns go around; beyond the first and last row lies the same row."""
    height, width = pixels.shape[:2]
    for n in range(directions.shape[0]):
        x, y, z = np.float64(directions[n, 0]), np.float64(directions[n, 1]), np.float64(directions[n, 2])
        across = ((atan2(x, -z) + turn) / (2.0 * pi) + 0.5) * width - 0.5
        down = atan2(hypot(x, z), y) / pi * height - 0.5
        column, row = floor(across), floor(down)
        s, t = across - column, down - row
        left, right = column % width, (column + 1) % width
        above, below = max(row, 0), min(row + 1, height - 1)
        out[n] = 0.0
        _add(out[n], pixels[above, left], (1.0 - s) * (1.0 - t))
        _add(out[n], pixels[above, right], s * (1.0 - t))
        _add(out[n], pixels[below, left], (1.0 - s) * t)
        _add(out[n], pixels[below, right], s * t)


@njit(cache=True, nogil=True, inline="always")
def _inward(row: int, column: int, height: int, width: int) -> tuple[int, int]:
    """As ``layouts.AngularMap.inward``."""
    p, q = (2.0 * column + 1.0) / width - 1.0, (2.0 * row + 1.0) / height - 1.0
    r = hypot(p, q)
    if r > 1.0:
        shrink = (1.0 - 2.0 / min(height, width)) / r
        row, column = int((q * shrink + 1.0) * 0.5 * height), int((p * shrink + 1.0) * 0.5 * width)
    return min(max(row, 0), height - 1), min(max(column, 0), width - 1)


@njit(cache=True, nogil=True)
def along_angular(pixels: Picture, directions: Points, turn: float, out: Radiance) -> None:
    """Pixels centred outside the disc give way to pixels further in."""
    height, width = pixels.shape[:2]
    c, s = cos(turn), sin(turn)
    for n in range(directions.shape[0]):
        x, y, z = np.float64(directions[n, 0]), np.float64(directions[n, 1]), np.float64(directions[n, 2])
        x, z = c * x - s * z, s * x + c * z
        aside = hypot(x, y)
        r = atan2(aside, -z) / pi
        p, q = (x / aside * r, y / aside * r) if aside > 0.0 else (r, 0.0)
        across, down = 0.5 * (1.0 + p) * width - 0.5, 0.5 * (1.0 - q) * height - 0.5
        column, row = floor(across), floor(down)
        u, v = across - column, down - row
        out[n] = 0.0
        for j in range(2):
            for i in range(2):
                at, to = _inward(row + j, column + i, height, width)
                _add(out[n], pixels[at, to], (u if i else 1.0 - u) * (v if j else 1.0 - v))


@njit(cache=True, nogil=True)
def _on_face(x: float, y: float, z: float) -> tuple[int, float, float]:
    """As ``bases.cube_map.face_coordinates``."""
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        scale = 1.0 / ax if ax > 0.0 else 0.0
        return (0, -z * scale, -y * scale) if x >= 0.0 else (1, z * scale, -y * scale)
    if ay >= az:
        scale = 1.0 / ay
        return (2, x * scale, z * scale) if y >= 0.0 else (3, x * scale, -z * scale)
    scale = 1.0 / az
    return (4, x * scale, -y * scale) if z >= 0.0 else (5, -x * scale, -y * scale)


@njit(cache=True, nogil=True)
def _beyond(face: int, u: float, v: float) -> tuple[int, float, float]:
    """The face and place on which a point beyond the edge of another face lies."""
    if face < 2:
        sign = 1.0 - 2.0 * face
        return _on_face(sign, -v, -u * sign)
    if face < 4:
        sign = 5.0 - 2.0 * face
        return _on_face(u, sign, v * sign)
    sign = 9.0 - 2.0 * face
    return _on_face(u * sign, -v, sign)


@njit(cache=True, nogil=True)
def along_faces(faces: CubeMap, directions: Points, turn: float, out: Radiance) -> None:
    """Beyond the edge of a face lies the texel of the next one that is seen there."""
    side = faces.shape[1]
    c, s = cos(turn), sin(turn)
    for n in range(directions.shape[0]):
        x, y, z = np.float64(directions[n, 0]), np.float64(directions[n, 1]), np.float64(directions[n, 2])
        face, u, v = _on_face(c * x - s * z, y, s * x + c * z)
        across, down = 0.5 * (1.0 + u) * side - 0.5, 0.5 * (1.0 + v) * side - 0.5
        column, row = floor(across), floor(down)
        u, v = across - column, down - row
        out[n] = 0.0
        for j in range(2):
            for i in range(2):
                at, to, on = row + j, column + i, face
                if at < 0 or to < 0 or at >= side or to >= side:
                    on, a, b = _beyond(face, (2.0 * to + 1.0) / side - 1.0, (2.0 * at + 1.0) / side - 1.0)
                    at = min(max(int(0.5 * (1.0 + b) * side), 0), side - 1)
                    to = min(max(int(0.5 * (1.0 + a) * side), 0), side - 1)
                _add(out[n], faces[on, at, to], (u if i else 1.0 - u) * (v if j else 1.0 - v))

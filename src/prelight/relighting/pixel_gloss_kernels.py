"""Harmonics of three corners, evaluated where a pixel between them mirrors the same light."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

ROWS = 64  # points of one thread at a time
f4, i8 = types.float32, types.int64


def recurrence(order: int) -> np.ndarray:
    """(3, n + 1, n + 1) float32: factors a and b of ``spherical_harmonics.components`` by m and band; its diagonal."""
    factors = np.zeros((3, order + 1, order + 1))
    diagonal = (4 * np.pi) ** -0.5
    for m in range(order + 1):
        factors[2, 0, m] = diagonal
        for band in range(m, order + 1):
            square = (band + 1.0) ** 2
            factors[0, m, band] = np.sqrt((4 * square - 1) / (square - m * m))
            if band > m:
                factors[1, m, band] = np.sqrt((band**2 - m * m) / (4.0 * band**2 - 1))
        diagonal *= np.sqrt((2 * m + 3) / (2 * m + 2)) * (np.sqrt(2.0) if m == 0 else 1.0)
    return factors.astype(np.float32)


@njit(cache=True)
def _harmonics(factors, x, y, z, values):
    c, s = np.float32(1), np.float32(0)
    for m in range(factors.shape[1]):
        before, here = np.float32(0), factors[2, 0, m]
        for l in range(m, factors.shape[1]):
            values[l * (l + 1) + m] = here * c
            if m:
                values[l * (l + 1) - m] = here * s
            before, here = here, (z * here - factors[1, m, l] * before) * factors[0, m, l]
        c, s = c * x - s * y, s * x + c * y


@njit(cache=True)
def _some_points(corners, weights, normals, away, frames, coefficients, factors, grazing, out, first, last):
    values = np.empty(coefficients.shape[2], np.float32)
    for n in range(first, last):
        nx, ny, nz = normals[n, 0], normals[n, 1], normals[n, 2]
        ox, oy, oz = away[n, 0], away[n, 1], away[n, 2]
        up = nx * ox + ny * oy + nz * oz
        if up < grazing:  # seen from behind, or flatly: as if from a little above
            ox, oy, oz = ox + (grazing - up) * nx, oy + (grazing - up) * ny, oz + (grazing - up) * nz
            up = grazing
        rx, ry, rz = 2 * up * nx - ox, 2 * up * ny - oy, 2 * up * nz - oz  # what the pixel mirrors
        red = green = blue = np.float32(0)
        for k in range(3):
            row, share = corners[n, k], weights[n, k]
            x = frames[row, 0, 0] * rx + frames[row, 0, 1] * ry + frames[row, 0, 2] * rz
            y = frames[row, 1, 0] * rx + frames[row, 1, 1] * ry + frames[row, 1, 2] * rz
            z = frames[row, 2, 0] * rx + frames[row, 2, 1] * ry + frames[row, 2, 2] * rz
            z = max(z, grazing)
            length = np.float32(1) / np.sqrt(x * x + y * y + z * z)
            _harmonics(factors, -x * length, -y * length, z * length, values)
            for j in range(len(values)):
                wave = share * values[j]
                red += wave * coefficients[row, 0, j]
                green += wave * coefficients[row, 1, j]
                blue += wave * coefficients[row, 2, j]
        out[n, 0], out[n, 1], out[n, 2] = max(red, 0), max(green, 0), max(blue, 0)


@njit(
    [
        types.void(
            i8[:, ::1], f4[:, ::1], f4[:, ::1], f4[:, ::1], types.Array(f4, 3, "C", readonly=True),
            f4[:, :, ::1], f4[:, :, ::1], f4, f4[:, ::1],
        )
    ],
    parallel=True,
    cache=True,
)  # fmt: skip
def shine_of_corners(corners, weights, normals, away, frames, coefficients, factors, grazing, out):
    """out (N, 3), written: Σ weights × harmonics of the corners' rows, never below 0.

    corners (N, 3) rows; normals (N, 3) and away (N, 3), to the eye, unit length; frames (G, 3, 3); coefficients
    (G, 3, (n + 1)²); factors of ``recurrence``; grazing: the least cosine that a surface is seen at.
    """
    for part in prange((len(out) + ROWS - 1) // ROWS):
        _some_points(
            corners, weights, normals, away, frames, coefficients, factors, grazing, out, part * ROWS,
            min(len(out), (part + 1) * ROWS),
        )  # fmt: skip

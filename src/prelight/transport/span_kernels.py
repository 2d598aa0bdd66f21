"""What a path brings, times every function that spans its lamp's emission, summed for each pixel.

A path's contributions are few and the functions many; both are small enough to stay in the processor's nearest
cache. Samples of a pixel are added in their order: the same sums for any number of threads.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange, types

# Signatures: records as Mitsuba leaves them, in slots of one entry a path.
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)
_u4 = types.Array(types.uint32, 1, "C", readonly=True)
_i8 = types.Array(types.int64, 1, "C", readonly=True)
_f8_2 = types.Array(types.float64, 2, "C", readonly=True)


def harmonic_scales(degree: int | None) -> np.ndarray:
    """(degree+1, degree+1) K_lm, so that K · P_lm · (cos or sin) mφ is orthonormal over the sphere.

    None gives the one function 1.
    """
    if degree is None:
        return np.ones((1, 1))
    scale = np.zeros((degree + 1, degree + 1))
    for l in range(degree + 1):
        for m in range(l + 1):
            ratio = math.exp(math.lgamma(l - m + 1) - math.lgamma(l + m + 1))
            scale[l, m] = math.sqrt((2 * l + 1) / (4 * math.pi) * ratio * (1 if m == 0 else 2))
    return scale


@njit(cache=True)
def _harmonics(x, y, z, scale, out):
    """Real spherical harmonics of a unit direction, without the Condon–Shortley sign, at l(l+1)+m."""
    degree = len(scale) - 1
    cosine, sine = 1.0, 0.0  # sin^m θ · (cos mφ, sin mφ)
    start = 1.0  # P_mm without sin^m θ: (2m−1)!!
    for m in range(degree + 1):
        if m > 0:
            cosine, sine = cosine * x - sine * y, cosine * y + sine * x
            start *= 2.0 * m - 1.0
        before, here = 0.0, start
        for l in range(m, degree + 1):
            if l > m:
                before, here = here, (z * (2.0 * l - 1.0) * here - (l + m - 1.0) * before) / (l - m)
            value = scale[l, m] * here
            out[l * (l + 1) + m] = value * cosine
            if m > 0:
                out[l * (l + 1) - m] = value * sine


@njit(cache=True)
def _waves(x, out):
    """1, √2·cos 2πx, √2·sin 2πx, √2·cos 4πx, …"""
    out[0] = 1.0
    if len(out) == 1:
        return
    c, s = math.cos(2.0 * math.pi * x), math.sin(2.0 * math.pi * x)
    a, b = math.sqrt(2.0), 0.0
    for k in range(len(out) // 2):
        a, b = a * c - b * s, a * s + b * c
        out[2 * k + 1], out[2 * k + 2] = a, b


@njit(cache=True)
def _span(x, y, z, u, v, scale, harmonic, wave_u, wave_v, out):
    """All functions of a lamp, for light that leaves (u, v) in direction (x, y, z)."""
    H = len(harmonic)
    _harmonics(x, y, z, scale, harmonic)
    _waves(u, wave_u)
    _waves(v, wave_v)
    place = 0
    for a in range(len(wave_u)):
        for b in range(len(wave_v)):
            product = wave_u[a] * wave_v[b]
            for k in range(H):
                out[place + k] = product * harmonic[k]
            place += H


@njit(cache=True)
def _add_sample(i, carried, left, lanes, slots, scale, scratch, harmonic, wave_u, wave_v, value):
    """Σ over a path's contributions of colour ⊗ functions, into value (3, S)."""
    value[:] = 0
    for k in range(slots):
        at = k * lanes + i
        _span(
            left[at, 0], left[at, 1], left[at, 2], carried[at, 3], left[at, 3],
            scale, harmonic, wave_u, wave_v, scratch,
        )  # fmt: skip
        for c in range(3):
            brought = np.float64(carried[at, c])
            for s in range(len(scratch)):
                value[c, s] += brought * scratch[s]


@njit(cache=True)
def _pixel(first, samples, records, counts, scale, periods, weights, mean, second, posed, posed_second):
    carried, left = records
    lanes, S = len(counts), mean.shape[1]
    value, scratch = np.empty((3, S)), np.empty(S)
    harmonic = np.empty(len(scale) * len(scale))
    wave_u, wave_v = np.empty(2 * periods[0] + 1), np.empty(2 * periods[1] + 1)
    total, squares = np.zeros((3, S)), np.zeros(S)
    for j in range(samples):
        i = first + j
        if counts[i] == 0:
            continue
        _add_sample(i, carried, left, lanes, counts[i], scale, scratch, harmonic, wave_u, wave_v, value)
        for c in range(3):
            for s in range(S):
                total[c, s] += value[c, s]
        for s in range(S):
            grey = (value[0, s] + value[1, s] + value[2, s]) / 3.0
            squares[s] += grey * grey
        for p in range(len(weights)):
            for c in range(3):
                there = 0.0
                for s in range(S):
                    there += weights[p, s] * value[c, s]
                posed[p, c] += there
                posed_second[p, c] += there * there
    for c in range(3):
        for s in range(S):
            mean[c, s] = total[c, s] / samples
    for s in range(S):
        grey = (total[0, s] + total[1, s] + total[2, s]) / (3.0 * samples)
        second[s] = max(squares[s] / samples - grey * grey, 0.0) / max(samples - 1, 1)
    for p in range(len(weights)):
        for c in range(3):
            posed[p, c] /= samples
            spread = posed_second[p, c] / samples - posed[p, c] * posed[p, c]
            posed_second[p, c] = max(spread, 0.0) / max(samples - 1, 1)


@njit(
    [
        types.void(
            types.int64, types.UniTuple(_f4_2, 2), _u4, _f8_2, types.UniTuple(types.int64, 2), _f8_2,
            types.float32[:, :, ::1], types.float32[:, ::1], types.float64[:, :, ::1], types.float64[:, :, ::1],
        )
    ],
    parallel=True,
    cache=True,
)  # fmt: skip
def add_pixels(samples, records, counts, scale, periods, weights, mean, variance, posed, posed_variance):
    """Means and variances of pixels whose ``samples`` paths lie side by side.

    records: two of (slots·lanes, 4): red, green, blue, u; and direction, v. counts (lanes,) how many slots a path
    has filled. Written: mean (pixels, 3, S), variance (pixels, S) of the mean of the channels' mean, and for
    weights (P, S) of lamps as they will be: posed (pixels, P, 3), posed_variance alike.
    """
    for pixel in prange(len(mean)):
        _pixel(
            pixel * samples, samples, records, counts, scale, periods, weights,
            mean[pixel], variance[pixel], posed[pixel], posed_variance[pixel],
        )  # fmt: skip


@njit(cache=True)
def _splats(
    first, last, order, arrived, left, share, scale, periods, weights, image, squares, posed, posed_squares
):
    """One pixel's run of splats; ``squares`` and ``posed_squares`` grow by Σ (share · value)²."""
    particle, colour = arrived
    S = image.shape[1]
    scratch, sums, grown = np.empty(S), np.zeros((3, S)), np.zeros(S)
    harmonic = np.empty(len(scale) * len(scale))
    wave_u, wave_v = np.empty(2 * periods[0] + 1), np.empty(2 * periods[1] + 1)
    for k in range(first, last):
        r = order[k]
        i = particle[r]
        _span(
            left[i, 0], left[i, 1], left[i, 2], left[i, 3], left[i, 4],
            scale, harmonic, wave_u, wave_v, scratch,
        )  # fmt: skip
        grey = share * np.float64(colour[r, 0] + colour[r, 1] + colour[r, 2]) / 3.0
        for c in range(3):
            brought = share * np.float64(colour[r, c])
            for s in range(S):
                sums[c, s] += brought * scratch[s]
        for s in range(S):
            grown[s] += (grey * scratch[s]) ** 2
        for p in range(len(weights)):
            shape = 0.0
            for s in range(S):
                shape += weights[p, s] * scratch[s]
            for c in range(3):
                there = share * np.float64(colour[r, c]) * shape
                posed[p, c] += there
                posed_squares[p, c] += there * there
    for c in range(3):
        for s in range(S):
            image[c, s] += np.float32(sums[c, s])
    for s in range(S):
        squares[s] += np.float32(grown[s])


@njit(
    [
        types.void(
            types.UniTuple(_i8, 3), types.Tuple((_i8, _f4_2)), _f4_2, types.float64, _f8_2,
            types.UniTuple(types.int64, 2), _f8_2, types.float32[:, :, ::1], types.float32[:, ::1],
            types.float64[:, :, ::1], types.float64[:, :, ::1],
        )
    ],
    parallel=True,
    cache=True,
)  # fmt: skip
def add_splats(
    sorting, arrived, left, share, scale, periods, weights, images, variance, posed, posed_variance
):
    """Add what light-traced paths bring to the pixels they meet, in the order of the paths.

    sorting: where each pixel's run begins (groups+1,) in the order (splats,) by pixel, and the pixel (splats,);
    arrived: particle (splats,) and colour (splats, 4); left (particles, 5) direction, u, v. What grows:
    images (pixels, 3, S) by share · colour ⊗ functions, and the others as in ``add_pixels``; a path's splats in one
    pixel count as independent.
    """
    starts, order, pixel = sorting
    for g in prange(len(starts) - 1):
        first = starts[g]
        at = pixel[order[first]]
        _splats(
            first, starts[g + 1], order, arrived, left, share, scale, periods, weights,
            images[at], variance[at], posed[at], posed_variance[at],
        )  # fmt: skip

"""What a path brings, times every function that spans its lamp's emission, summed for each pixel.

A path's contributions are few and the functions many; both are small enough to stay in the processor's nearest
cache. Samples of a pixel are added in their order: the same sums for any number of threads.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange, types

# Signatures: records as Mitsuba leaves them, in slots of one entry a path.
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)
_u4 = types.Array(types.uint32, 1, "C", readonly=True)
_i8 = types.Array(types.int64, 1, "C", readonly=True)
_f8_2 = types.Array(types.float64, 2, "C", readonly=True)
_f8_3 = types.Array(types.float64, 3, "C", readonly=True)
_shape = types.Tuple((_f8_2, _f8_3, _f8_2, _i8))

SpanShape = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


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


def recurrence(degree: int | None) -> np.ndarray:
    """(degree+1, degree+1, 2) what P_lm is made with of those of the two lower l, divided out once and for all."""
    size = 0 if degree is None else degree
    found = np.zeros((size + 1, size + 1, 2))
    for m in range(size + 1):
        for l in range(m + 1, size + 1):
            found[l, m] = (2.0 * l - 1.0) / (l - m), (l + m - 1.0) / (l - m)
    return found


def span_shape(lamp: Any) -> SpanShape:
    """What the kernels know of a lamp's functions: scales and recurrence of its harmonics, functions of each axis
    of its place, and the rates and powers of these where they are not sinusoids.
    """
    terms = getattr(lamp, "terms", ())
    rates = np.array(terms, np.float64) if terms else np.zeros((0, 3))
    return harmonic_scales(lamp.degree), recurrence(lamp.degree), rates, np.array(lamp.waves)


@njit(cache=True)
def _harmonics(x, y, z, scale, step, out):
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
                before, here = here, z * step[l, m, 0] * here - step[l, m, 1] * before
            value = scale[l, m] * here
            out[l * (l + 1) + m] = value * cosine
            if m > 0:
                out[l * (l + 1) - m] = value * sine


@njit(cache=True)
def _waves(x, rates, out):
    """1, √2·cos 2πx, √2·sin 2πx, √2·cos 4πx, …; with rates (terms, 3) e^(αx)·x^k instead, k up to a power."""
    if len(rates):
        at = 0
        for term in range(len(rates)):
            value = math.exp(rates[term, 0] * x)
            c, s = math.cos(rates[term, 1] * x), math.sin(rates[term, 1] * x)
            for _ in range(int(rates[term, 2]) + 1):
                out[at] = value * c
                at += 1
                if rates[term, 1] != 0.0:
                    out[at] = value * s
                    at += 1
                value *= x
        return
    out[0] = 1.0
    if len(out) == 1:
        return
    c, s = math.cos(2.0 * math.pi * x), math.sin(2.0 * math.pi * x)
    a, b = math.sqrt(2.0), 0.0
    for k in range(len(out) // 2):
        a, b = a * c - b * s, a * s + b * c
        out[2 * k + 1], out[2 * k + 2] = a, b


@njit(cache=True)
def _room(shape):
    """Where functions are put while they are multiplied: all, harmonics, and those of three axes."""
    scale, _, _, waves = shape
    H = len(scale) * len(scale)
    return (
        np.empty(waves[0] * waves[1] * waves[2] * H), np.empty(H),
        np.empty(waves[0]), np.empty(waves[1]), np.empty(waves[2]),
    )  # fmt: skip


@njit(cache=True)
def _span(x, y, z, u, v, shape, room):
    """All functions of a lamp, for light that leaves (u, v) in direction (x, y, z); of a box, (u, v, x) in any."""
    scale, step, rates, _ = shape
    out, harmonic, wave_u, wave_v, wave_w = room
    H = len(harmonic)
    if H == 1:
        harmonic[0] = scale[0, 0]
    else:
        _harmonics(x, y, z, scale, step, harmonic)
    if len(out) == H:
        out[:] = harmonic
        return
    _waves(u, rates, wave_u)
    _waves(v, rates, wave_v)
    if len(wave_w) == 1:
        wave_w[0] = 1.0
    else:
        _waves(x, rates, wave_w)
    place = 0
    for a in range(len(wave_u)):
        for b in range(len(wave_v)):
            for c in range(len(wave_w)):
                product = wave_u[a] * wave_v[b] * wave_w[c]
                for k in range(H):
                    out[place + k] = product * harmonic[k]
                place += H


@njit(cache=True)
def _add_sample(i, carried, left, lanes, slots, shape, room, value):
    """Σ over a path's contributions of colour ⊗ functions, into value (3, S)."""
    value[:] = 0
    scratch = room[0]
    for k in range(slots):
        at = k * lanes + i
        _span(left[at, 0], left[at, 1], left[at, 2], carried[at, 3], left[at, 3], shape, room)
        for c in range(3):
            brought = np.float64(carried[at, c])
            for s in range(len(scratch)):
                value[c, s] += brought * scratch[s]


@njit(cache=True)
def _pixel(first, samples, records, counts, shape, weights, mean, second, posed, posed_second):
    carried, left = records
    lanes, S = len(counts), mean.shape[1]
    value, room = np.empty((3, S)), _room(shape)
    total, squares = np.zeros((3, S)), np.zeros(S)
    for j in range(samples):
        i = first + j
        if counts[i] == 0:
            continue
        _add_sample(i, carried, left, lanes, counts[i], shape, room, value)
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
            types.int64, types.UniTuple(_f4_2, 2), _u4, _shape, _f8_2,
            types.float32[:, :, ::1], types.float32[:, ::1], types.float64[:, :, ::1], types.float64[:, :, ::1],
        )
    ],
    parallel=True,
    cache=True,
)  # fmt: skip
def add_pixels(samples, records, counts, shape, weights, mean, variance, posed, posed_variance):
    """Means and variances of pixels whose ``samples`` paths lie side by side.

    records: two of (slots·lanes, 4): red, green, blue, u; and direction, v (of a box w, 0, 0, v). counts (lanes,)
    how many slots a path has filled. shape: ``span_shape``. Written: mean (pixels, 3, S), variance (pixels, S) of
    the mean of the channels' mean, and for weights (P, S) of lamps as they will be: posed (pixels, P, 3),
    posed_variance alike.
    """
    for pixel in prange(len(mean)):
        _pixel(
            pixel * samples, samples, records, counts, shape, weights,
            mean[pixel], variance[pixel], posed[pixel], posed_variance[pixel],
        )  # fmt: skip


@njit(cache=True)
def _splats(first, last, order, arrived, left, share, shape, weights, image, squares, posed, posed_squares):
    """One pixel's run of splats; ``squares`` and ``posed_squares`` grow by Σ (share · value)²."""
    particle, colour = arrived
    S = image.shape[1]
    room, sums, grown = _room(shape), np.zeros((3, S)), np.zeros(S)
    scratch = room[0]
    for k in range(first, last):
        r = order[k]
        i = particle[r]
        _span(left[i, 0], left[i, 1], left[i, 2], left[i, 3], left[i, 4], shape, room)
        grey = share * np.float64(colour[r, 0] + colour[r, 1] + colour[r, 2]) / 3.0
        for c in range(3):
            brought = share * np.float64(colour[r, c])
            for s in range(S):
                sums[c, s] += brought * scratch[s]
        for s in range(S):
            grown[s] += (grey * scratch[s]) ** 2
        for p in range(len(weights)):
            aimed = 0.0
            for s in range(S):
                aimed += weights[p, s] * scratch[s]
            for c in range(3):
                there = share * np.float64(colour[r, c]) * aimed
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
            types.UniTuple(_i8, 3), types.Tuple((_i8, _f4_2)), _f4_2, types.float64, _shape, _f8_2,
            types.float32[:, :, ::1], types.float32[:, ::1],
            types.float64[:, :, ::1], types.float64[:, :, ::1],
        )
    ],
    parallel=True,
    cache=True,
)  # fmt: skip
def add_splats(sorting, arrived, left, share, shape, weights, images, variance, posed, posed_variance):
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
            first, starts[g + 1], order, arrived, left, share, shape, weights,
            images[at], variance[at], posed[at], posed_variance[at],
        )  # fmt: skip

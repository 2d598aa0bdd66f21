"""A round floor: fine where shadows fall, coarse far away, its innermost lines along a square plinth."""

from __future__ import annotations

import numpy as np

from ...arrays import Float64, Int32
from .parts import Part

_ROUND_FROM = 0.55  # metres beyond the plinth's side where the rings have become circles
_SHADOWS_TO = 2.6  # metres from the middle: vertices thin out quickly beyond
_INSIDE, _OUTSIDE = -0.012, 0.003  # the rings next to the plinth's wall, metres from it


def ground(*, radius: float, half_width: float, spacing: float) -> Part:
    """A disc at y = 0 about the origin, for a square plinth of ``half_width`` aligned with the axes; metres.

    ``spacing`` is the distance of vertices beside the plinth. No triangle reaches from the open floor to the dark
    under the plinth, other than within 3 mm of its wall: the shadow at its foot neither bleeds out nor fades.
    """
    rings = [np.zeros((1, 2))]
    angles = [np.zeros(1)]
    for k, (size, step) in enumerate(_sizes(radius, half_width, spacing)):
        theta = _ring_angles(size, step, half_width, odd=k % 2 == 1)
        c, s = np.cos(theta), np.sin(theta)
        out = size / _roundness(c, s, (size - half_width) / _ROUND_FROM)
        rings.append(np.stack([out * c, out * s], axis=1))
        angles.append(theta)
    firsts = np.cumsum([0, *(len(ring) for ring in rings)])
    flat = np.concatenate(rings)
    positions = np.stack([flat[:, 0], np.zeros(len(flat)), -flat[:, 1]], axis=1)
    triangles = [_between(angles[k], angles[k + 1]) + firsts[k] for k in range(len(rings) - 1)]
    return Part(positions, np.broadcast_to([0.0, 1.0, 0.0], positions.shape), np.concatenate(triangles))


def _sizes(radius: float, half_width: float, spacing: float) -> list[tuple[float, float]]:
    """Half the width of each ring, and the distance of its vertices."""
    size, step = half_width + _OUTSIDE, spacing
    sizes = [(0.55 * half_width, 2 * step), (half_width + _INSIDE, step), (size, step)]
    while size + step < radius:
        size += step * np.sqrt(3) / 2
        wider = min(size, _SHADOWS_TO) - half_width
        step = spacing * (1 + 0.16 * wider + 4.5 * max(size - _SHADOWS_TO, 0.0))
        sizes.append((size, step))
    return [*sizes[:-1], (radius, step)]


def _ring_angles(size: float, step: float, half_width: float, *, odd: bool) -> Float64[np.ndarray, "n"]:
    """Angles of a ring's vertices: at the corners where it is square, every other ring half a step on where not."""
    count = max(3, round(2 * np.pi * size / step / 8)) * 8
    square = size < half_width + _ROUND_FROM / 2
    return (np.arange(count) + (0.5 if odd and not square else 0.0)) * (2 * np.pi / count)


def _roundness(c: np.ndarray, s: np.ndarray, along: float) -> Float64[np.ndarray, "n"]:
    """The norm whose unit line is the ring: a square's at ``along`` ≤ 0, a circle's from 1 on."""
    c, s = np.abs(c), np.abs(s)
    t = min(max(along, 0.0), 1.0)
    if t < 0.02:
        return np.maximum(c, s)
    power = 2 / (t * t * (3 - 2 * t)) ** 0.5
    larger, smaller = np.maximum(c, s), np.minimum(c, s)
    return larger * (1 + (smaller / larger) ** power) ** (1 / power)


def _between(
    inner: Float64[np.ndarray, "m"], outer: Float64[np.ndarray, "n"]
) -> Int32[np.ndarray, "triangles 3"]:
    """Triangles between two rings, inner vertices 0 to m−1 and outer from m on, each by ascending angle.

    Walks around, always taking the side whose middle comes next; a ring of one vertex makes a fan.
    """
    m, n = len(inner), len(outer)

    def middles(theta: np.ndarray) -> np.ndarray:
        return (theta + np.append(theta[1:], theta[0] + 2 * np.pi)) / 2

    if m == 1:
        k = np.arange(n)
        return np.stack([np.zeros(n, int), m + k, m + (k + 1) % n], axis=1).astype(np.int32)
    at = np.concatenate([middles(inner), middles(outer)])
    is_outer = np.arange(m + n) >= m
    is_outer = is_outer[np.lexsort((is_outer, np.round(at, 9)))]
    steps_out = np.cumsum(is_outer) - is_outer  # taken before this one
    steps_in = np.cumsum(~is_outer) - ~is_outer
    i, o = steps_in % m, m + steps_out % n
    third = np.where(is_outer, m + (steps_out + 1) % n, (steps_in + 1) % m)
    return np.stack([i, o, third], axis=1).astype(np.int32)

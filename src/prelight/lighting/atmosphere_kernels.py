"""The compiled loops of ``atmosphere``: what an eye at sea level sees of the air, from the air's tables."""

from __future__ import annotations

from math import exp, sqrt

import numpy as np
from numba import njit, types

f8 = types.float64


def _read_only(dimensions: int) -> types.Array:
    return types.Array(f8, dimensions, "C", readonly=True)


@njit(cache=True)
def _between(table, row, column, out):
    """At a place between a table's entries."""
    i, j = min(int(row), len(table) - 2), min(int(column), table.shape[1] - 2)
    s, t = row - i, column - j
    for c in range(3):
        above = table[i, j, c] * (1.0 - t) + table[i, j + 1, c] * t
        below = table[i + 1, j, c] * (1.0 - t) + table[i + 1, j + 1, c] * t
        out[c] = above * (1.0 - s) + below * s


@njit(cache=True)
def _place(value, nodes):
    """Where a value lies between rising nodes: 0 at the first, one more at each next."""
    last = len(nodes) - 1
    if value <= nodes[0]:
        return 0.0
    if value >= nodes[last]:
        return float(last)
    low, high = 0, last
    while high - low > 1:
        middle = (low + high) // 2
        if nodes[middle] <= value:
            low = middle
        else:
            high = middle
    return low + (value - nodes[low]) / (nodes[high] - nodes[low])


@njit(cache=True)
def _sunlight(table, radius, sine, ground, top, out):
    """As ``Atmosphere.transmittance``."""
    at = min(max(radius, ground), top)
    reach, whole = sqrt(at * at - ground * ground), sqrt(top * top - ground * ground)
    to_top = -at * sine + sqrt(max(top * top - at * at * (1.0 - sine * sine), 0.0))
    nearest = top - at
    x = (to_top - nearest) / max(reach + whole - nearest, 1e-9)
    _between(table, reach / whole * (len(table) - 1), min(max(x, 0.0), 1.0) * (table.shape[1] - 1), out)
    horizon = -sqrt(max(1.0 - (ground / at) ** 2, 0.0))
    up = min(max((sine - horizon) / 0.0093 + 0.5, 0.0), 1.0)
    for c in range(3):
        out[c] *= up


@njit(
    types.void(
        *[_read_only(1)] * 3, _read_only(2), _read_only(3), types.Tuple((_read_only(1), _read_only(1), _read_only(3))),
        _read_only(1), f8[:, :, :, ::1],
    ),
    cache=True, nogil=True,
)  # fmt: skip
def scattered(sines, cosines, ends, air, sun_table, often_tables, place, out):
    """out (3, e, a, 3): what air and haze scatter once and what is scattered more often, toward an eye.

    ``sines`` (e,) of the elevations looked along, ``cosines`` (e · a,) to the sun, elevation by elevation; ``ends``
    (steps + 1,) of the parts of a line of sight, 0 to 1. ``air`` (4, 3): scattering of air and of haze, extinction of
    haze, absorption of ozone, 1/km; ``sun_table`` and ``often_tables`` the atmosphere's; ``place`` (6,): radii of
    ground, top and eye, heights of air and of haze, and the sine of the sun's elevation.
    """
    ground, top, eye, air_height, haze_height, sun_sine = place
    heights, sun_sines, often = often_tables
    azimuths = len(cosines) // len(sines)
    steps = len(ends) - 1
    out[:] = 0.0
    distances, radii = np.empty(steps), np.empty(steps)
    by_air, by_haze, part = np.empty((steps, 3)), np.empty((steps, 3)), np.empty((steps, 3))
    through, lit, more = np.empty(3), np.empty(3), np.empty(3)
    for e in range(len(sines)):
        up = sines[e]
        length = -eye * up + sqrt(max(top * top - eye * eye * (1.0 - up * up), 0.0))
        through[:] = 1.0
        for k in range(steps):  # the same whatever the azimuth
            t, dt = 0.5 * (ends[k] + ends[k + 1]) * length, (ends[k + 1] - ends[k]) * length
            at = sqrt(eye * eye + t * t + 2.0 * eye * t * up)
            height = at - ground
            thin, hazy = exp(-height / air_height), exp(-height / haze_height)
            ozone = max(0.0, 1.0 - abs(height - 25.0) / 15.0)
            distances[k], radii[k] = t, at
            for c in range(3):
                by_air[k, c], by_haze[k, c] = thin * air[0, c], hazy * air[1, c]
                extinction = by_air[k, c] + hazy * air[2, c] + ozone * air[3, c]
                passed = exp(-extinction * dt)
                part[k, c] = (1.0 - passed) / max(extinction, 1e-12) * through[c]
                through[c] *= passed
        for a in range(azimuths):
            cosine = cosines[e * azimuths + a]
            for k in range(steps):
                sine = (eye * sun_sine + distances[k] * cosine) / radii[k]
                _sunlight(sun_table, radii[k], sine, ground, top, lit)
                _between(often, _place(radii[k] - ground, heights), _place(sine, sun_sines), more)
                for c in range(3):
                    here = part[k, c] * lit[c]
                    out[0, e, a, c] += by_air[k, c] * here
                    out[1, e, a, c] += by_haze[k, c] * here
                    out[2, e, a, c] += (by_air[k, c] + by_haze[k, c]) * part[k, c] * more[c]

"""Light blurred on the sphere, from cells of a cube map to cells of a finer one."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

f4 = types.float32


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


TOGETHER = 16  # cells that are passed over at once, if all of them are too far away


@njit(cache=True)
def _bound(inputs, caps, reach):
    """Of each block of cells: its middle, and the least cosine to it of directions that any of them counts for."""
    for b in range(len(caps)):
        first, last = b * TOGETHER, min(len(inputs), (b + 1) * TOGETHER)
        middle = caps[b, :3]
        middle[:] = 0
        for k in range(first, last):
            middle += inputs[k, :3]
        middle /= max(np.sqrt((middle * middle).sum()), np.float32(1e-6))
        least = np.float32(1)
        for k in range(first, last):
            least = min(least, (middle * inputs[k, :3]).sum())
        angle = np.arccos(max(least, np.float32(-1))) + reach + np.float32(1e-3)
        caps[b, 3] = np.cos(angle) if angle < np.pi else np.float32(-2)


@njit(cache=True)
def _blur_some(d, inputs, light, table, outward):
    red = green = blue = total = np.float32(0)
    last = len(table) - 1
    for k in range(len(inputs)):
        x, y, z, area = inputs[k, 0], inputs[k, 1], inputs[k, 2], inputs[k, 3]
        if outward[0] * x + outward[1] * y + outward[2] * z < 0:
            continue
        place = (np.float32(1) - (d[0] * x + d[1] * y + d[2] * z)) * outward[3]
        if place >= last:
            continue
        below = np.int32(max(place, np.float32(0)))
        part = place - below
        weight = (table[below] * (1 - part) + table[below + 1] * part) * area
        red += weight * light[k, 0]
        green += weight * light[k, 1]
        blue += weight * light[k, 2]
        total += weight
    return red, green, blue, total


@njit(cache=True)
def _blur_cell(d, inputs, light, table, outward, caps, out):
    red = green = blue = total = np.float32(0)
    for b in range(len(caps)):
        if caps[b, 0] * d[0] + caps[b, 1] * d[1] + caps[b, 2] * d[2] >= caps[b, 3]:
            first, last = b * TOGETHER, min(len(inputs), (b + 1) * TOGETHER)
            r, g, bl, t = _blur_some(d, inputs[first:last], light[first:last], table, outward)
            red, green, blue, total = red + r, green + g, blue + bl, total + t
    scale = np.float32(1) / total if total > 0 else np.float32(0)
    out[0], out[1], out[2] = red * scale, green * scale, blue * scale


@njit(
    [types.void(
        _read_only(f4, 2), _read_only(f4, 2), _read_only(f4, 2), _read_only(f4, 1), _read_only(f4, 1), f4[:, ::1],
    )],
    parallel=True,
    cache=True,
    nogil=True,
)  # fmt: skip
def blur(directions, inputs, light, table, outward, out):
    """out (n, 3): for each direction the mean of ``light`` (m, 3) weighted by ``table`` of 1 − cos of the angle.

    ``inputs`` (m, 4) are unit directions and solid angles, those that follow each other near each other; those behind
    the plane of ``outward`` do not count, whose fourth number is how many places of the table 1 − cos of 1 is.
    """
    caps = np.empty(((len(inputs) + TOGETHER - 1) // TOGETHER, 4), np.float32)
    most = np.float32(len(table) - 1) / outward[3]
    _bound(inputs, caps, np.float32(np.arccos(max(np.float32(1) - most, np.float32(-1)))))
    for part in prange((len(directions) + TOGETHER - 1) // TOGETHER):
        for k in range(part * TOGETHER, min(len(directions), (part + 1) * TOGETHER)):
            _blur_cell(directions[k], inputs, light, table, outward, caps, out[k])

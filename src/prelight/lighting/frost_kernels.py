"""Light blurred on the sphere, from cells of a cube map to cells of a finer one."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

f4 = types.float32


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


@njit(cache=True)
def _blur_cell(d, inputs, light, table, outward, out):
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
    scale = np.float32(1) / total if total > 0 else np.float32(0)
    out[0], out[1], out[2] = red * scale, green * scale, blue * scale


@njit(
    [types.void(
        _read_only(f4, 2), _read_only(f4, 2), _read_only(f4, 2), _read_only(f4, 1), _read_only(f4, 1), f4[:, ::1],
    )],
    parallel=True,
    cache=True,
)  # fmt: skip
def blur(directions, inputs, light, table, outward, out):
    """out (n, 3): for each direction the mean of ``light`` (m, 3) weighted by ``table`` of 1 − cos of the angle.

    ``inputs`` (m, 4) are unit directions and solid angles; those behind the plane of ``outward`` do not count, whose
    fourth number is how many places of the table 1 − cos of 1 is.
    """
    for k in prange(len(directions)):
        _blur_cell(directions[k], inputs, light, table, outward, out[k])

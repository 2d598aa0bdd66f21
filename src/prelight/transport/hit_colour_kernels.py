"""Looking up tints and textures where rays end."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

_i4_1 = types.Array(types.int32, 1, "C", readonly=True)
_i4_2 = types.Array(types.int32, 2, "C", readonly=True)
_i8_2 = types.Array(types.int64, 2, "C", readonly=True)
_f4_1 = types.Array(types.float32, 1, "C", readonly=True)
_f4_2 = types.Array(types.float32, 2, "C", readonly=True)
_u1_2 = types.Array(types.uint8, 2, "C", readonly=True)


@njit(cache=True)
def _lookup(texels, place, table, x, y, channel):
    """Bilinear, repeating; as ``images.textures.sample``, but of linear light."""
    start, height, width = place[0], place[1], place[2]
    x, y = (x - np.floor(x)) * width - 0.5, (y - np.floor(y)) * height - 0.5
    left, top = np.int64(np.floor(x)), np.int64(np.floor(y))
    fx, fy = x - left, y - top
    total = 0.0
    for j in range(2):
        row = start + ((top + j) % height) * width
        across = table[texels[row + left % width, channel]] * (1 - fx)
        across += table[texels[row + (left + 1) % width, channel]] * fx
        total += across * (fy if j else 1 - fy)
    return np.float32(total)


@njit(cache=True)
def _colour_row(hit, u, v, triangles, material_of, uv, tint, texels, place, table, out):
    for k in range(len(hit)):
        t = hit[k]
        if t < 0:
            continue
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        w = np.float32(1) - u[k] - v[k]
        here = place[material_of[t]]
        x = np.float64(w * uv[a, 0] + u[k] * uv[b, 0] + v[k] * uv[c, 0])
        y = np.float64(w * uv[a, 1] + u[k] * uv[b, 1] + v[k] * uv[c, 1])
        for channel in range(out.shape[1]):
            colour = w * tint[a, channel] + u[k] * tint[b, channel] + v[k] * tint[c, channel]
            if here[0] >= 0:
                colour *= _lookup(texels, here, table, x, y, channel)
            out[k, channel] = colour


@njit(
    [
        types.void(
            _i4_2, _f4_2, _f4_2, _i4_2, _i4_1, _f4_2, _f4_2, _u1_2, _i8_2, _f4_1, types.float32[:, :, ::1]
        )
    ],
    parallel=True,
    cache=True,
)
def colour_hits(hit, u, v, triangles, material_of, uv, tint, texels, place, table, out):
    """Albedo where rays end, into out (rows, rays, channels).

    hit, u, v (rows, rays); triangles (F, 3), material_of (F,); uv (V, 2) and tint (V, channels) of vertices; texels
    (n, 3) bytes of all textures, place (materials, 3) where in them a material's begins (−1 if it has none), its height
    and width; table (256,) linear light of a byte.
    """
    for row in prange(len(hit)):
        _colour_row(
            hit[row], u[row], v[row], triangles, material_of, uv, tint, texels, place, table, out[row]
        )

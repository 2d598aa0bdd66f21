"""What colour a surface has where a ray ends: its tint there times its texture, in linear light."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from ..arrays import Float32
from ..images.tonemap import srgb_decode
from ..scene.geometry import Scene
from .hemisphere import Hits

_LINEAR = srgb_decode(np.arange(256, dtype=np.uint8)).astype(np.float32)  # of a texture's bytes


class HitColour:
    """Albedo at points of the triangles of a scene, for diffuse light.

    A material that is not Lambertian reflects as if it were, with its base colour. Scenes without textures need
    none of this: there the albedo of vertices is multiplied with their light, before it is interpolated.

    Attributes
    ----------
    channels
        3; 1 where every texture and every tint is grey; 0 where there are no textures.
    """

    def __init__(self, scene: Scene) -> None:
        self._triangles = scene.triangles
        pictured = [k for k, m in enumerate(scene.materials) if m.colour_texture is not None]
        used = np.intersect1d(np.unique(scene.material_of), pictured)
        if scene.uv is None or len(used) == 0:
            self.channels = 0
            return
        self._uv = scene.uv
        tint = scene.albedo if scene.tint is None else scene.tint
        textures = {int(scene.materials[m].colour_texture): None for m in used}
        grey = _is_grey(tint) and all(_is_grey(scene.textures[k]) for k in textures)
        self.channels = 1 if grey else 3
        self._tint = np.ascontiguousarray(tint[:, : self.channels])
        self._texels, places = _packed([scene.textures[k] for k in textures])
        place_of = dict(zip(textures, places, strict=True))
        self._place = np.full((len(scene.materials), 3), -1, np.int64)
        for m in used:
            self._place[m] = place_of[int(scene.materials[m].colour_texture)]
        self._material_of = scene.material_of

    def at(self, hits: Hits) -> Float32[np.ndarray, "rows rays channels"]:
        """Albedo of each hit, 0 to 1; of no meaning where there is none."""
        out = np.zeros((*hits.triangle.shape, self.channels), np.float32)
        if self.channels:
            surface = (self._triangles, self._material_of, self._uv, self._tint)
            _colour_hits(hits.triangle, hits.u, hits.v, *surface, self._texels, self._place, _LINEAR, out)
        return out


def _is_grey(colours: np.ndarray) -> bool:
    return bool((colours[..., 0] == colours[..., 1]).all() and (colours[..., 0] == colours[..., 2]).all())


def _packed(textures: list[np.ndarray]) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
    """All texels one after another, and of each texture where it begins, its height and width."""
    places, start = [], 0
    for texture in textures:
        places.append((start, *texture.shape[:2]))
        start += texture.shape[0] * texture.shape[1]
    return np.concatenate([np.ascontiguousarray(t).reshape(-1, 3) for t in textures]), places


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
def _colour_hits(hit, u, v, triangles, material_of, uv, tint, texels, place, table, out):
    for row in prange(len(hit)):
        _colour_row(
            hit[row], u[row], v[row], triangles, material_of, uv, tint, texels, place, table, out[row]
        )

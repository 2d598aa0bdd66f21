"""What colour a surface has where a ray ends: its tint there times its texture, in linear light."""

from __future__ import annotations

import numpy as np

from ..arrays import Float32
from ..images.tonemap import srgb_decode
from ..scene.geometry import Scene
from .hemisphere import Hits
from .hit_colour_kernels import colour_hits

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
        self._triangles = np.ascontiguousarray(scene.triangles)
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
            colour_hits(hits.triangle, hits.u, hits.v, *surface, self._texels, self._place, _LINEAR, out)
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

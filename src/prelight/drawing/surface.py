"""The surface of a mesh as a picture shows it: textures at the pixel, where vertices are too few."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Albedo, Float32, MaterialOf, Texture, TextureCoordinates, UInt8, UInt16
from ..errors import InputError
from ..images.tonemap import srgb_decode
from ..material import Material
from .texture_kernels import colour_entries, halve

_BYTES = srgb_decode(np.arange(256, dtype=np.uint8))  # linear light of a texture's bytes
_LINEAR = (np.arange(65536) / np.float32(65535)).astype(np.float32)


@dataclass(frozen=True)
class Pyramid:
    """A texture and its ever smaller copies, down to one texel; a third more texels than its own."""

    texels: UInt8[np.ndarray, "height width 3"]  # sRGB-encoded, level 0
    coarser: UInt16[np.ndarray, "texels 3"]  # linear light × 65535, the levels from 1 on
    levels: np.ndarray  # (L, 3) int64: first of ``coarser``, rows, columns

    @classmethod
    def of(cls, texture: Texture) -> Pyramid:
        """From sRGB bytes (H, W, 3); means are taken of linear light."""
        texels = np.ascontiguousarray(texture).view()
        texels.flags.writeable = False  # one type for the kernels, mapped from a file or not
        sizes = [texels.shape[:2]]
        while max(sizes[-1]) > 1:
            sizes.append((max(sizes[-1][0] // 2, 1), max(sizes[-1][1] // 2, 1)))
        ends = np.cumsum([0, *(h * w for h, w in sizes[1:])])
        coarser = np.empty((ends[-1], 3), np.uint16)
        above, table = texels, _BYTES
        for (h, w), first in zip(sizes[1:], ends[:-1], strict=True):
            level = coarser[first : first + h * w].reshape(h, w, 3)
            halve(above, table, level)
            above, table = level.view(), _LINEAR
        return cls(texels, coarser, np.array([(0, *sizes[0]), *np.c_[ends[:-1], sizes[1:]]], np.int64))

    @property
    def table(self) -> Float32[np.ndarray, "256"]:
        """The linear light of its bytes."""
        return _BYTES


class Surface:
    """Which triangles wear a colour texture, where on it they lie, and what tints it.

    Share one between the views of a mesh: it keeps the textures' smaller copies.

    Parameters
    ----------
    material_of, materials
        (F,) index of each triangle's material; a triangle is textured where that has a ``colour_texture``. Give
        materials without it where the light of vertices is not irradiance (glossy ones under a fixed eye).
    uv
        (V, 2) to the right and down from the texture's first row, repeating.
    tint
        (V, 3) linear Rec.709, multiplies the texture.
    textures
        (H, W, 3) sRGB bytes.

    Raises InputError for arrays that do not belong together or coordinates that are not finite.
    """

    def __init__(
        self,
        material_of: MaterialOf,
        materials: Sequence[Material],
        *,
        uv: TextureCoordinates,
        tint: Albedo,
        textures: Sequence[Texture],
    ) -> None:
        material_of, uv, tint = np.asarray(material_of), np.asarray(uv), np.asarray(tint)
        if material_of.ndim != 1 or material_of.dtype.kind not in "iu":
            raise InputError(
                "material_of", f"shape {material_of.shape}, expected one whole number a triangle"
            )
        if material_of.size and not 0 <= material_of.min() <= material_of.max() < len(materials):
            raise InputError("material_of", f"names material {material_of.max()} of {len(materials)}")
        if uv.ndim != 2 or uv.shape[1] != 2 or not np.isfinite(uv).all():
            raise InputError("uv", f"shape {uv.shape}, expected (vertices, 2) finite numbers")
        if tint.shape != (len(uv), 3) or not np.isfinite(tint).all():
            raise InputError("tint", f"shape {tint.shape}, expected ({len(uv)}, 3) finite numbers")
        texture_of = np.array(
            [-1 if m.colour_texture is None else m.colour_texture for m in materials], np.int32
        )
        if texture_of.size and texture_of.max() >= len(textures):
            raise InputError("materials", f"name texture {texture_of.max()} of {len(textures)}")
        for k in np.unique(texture_of[texture_of >= 0]):
            shape, kind = np.shape(textures[k]), np.asarray(textures[k]).dtype
            if len(shape) != 3 or shape[2] != 3 or 0 in shape or kind != np.uint8:
                raise InputError(
                    "textures", f"number {k} is {kind} {shape}, expected (height, width, 3) bytes"
                )
        self.texture_of = texture_of[material_of] if len(texture_of) else np.empty(0, np.int32)
        self.uv = np.ascontiguousarray(uv, np.float64)
        self.tint = np.ascontiguousarray(tint, np.float32)
        self._textures = tuple(textures)

    @cached_property
    def pyramids(self) -> dict[int, Pyramid]:
        """Of the textures that a triangle wears, by their index."""
        worn = np.unique(self.texture_of)
        return {int(k): Pyramid.of(self._textures[k]) for k in worn if k >= 0}

    @property
    def is_textured(self) -> bool:
        return bool((self.texture_of >= 0).any())

    def albedo(self, q, triangles, winners, first_row, *entries: np.ndarray) -> Float32[np.ndarray, "n 3"]:
        """The albedo of a view's entries, tint included, where their triangle is textured; zero elsewhere.

        The arguments are those of ``texture_kernels.colour_entries`` down to ``seen``.
        """
        albedo = np.zeros((len(entries[-1]), 3), np.float32)
        for k, of in self.pyramids.items():
            colours = of.texels, of.table, of.coarser, of.levels
            place = q, triangles, winners, first_row, *entries, self.texture_of
            colour_entries(*place, k, self.uv, self.tint, *colours, albedo)
        return albedo

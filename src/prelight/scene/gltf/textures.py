"""Textures of a glTF file: each image read once, and where on it a surface is looked up."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ...arrays import Float64, Texture
from ...errors import InputError
from ...images.textures import read_texture
from ..mesh import UnreadableMesh, short_name
from .appearance import Sampler, TextureInfo
from .buffers import Bytes
from .document import Document

_REPEAT, _MIRROR, _NEAREST = 10497, 33648, 9728
_MOST_TEXELS = 256 << 20  # of all textures together: 768 MiB
_MOST_DAMAGED = 16  # pictures that cannot be decoded, before no more are tried


@dataclass(frozen=True)
class Mapping:
    """How a vertex's coordinates become those of a texture whose picture repeats."""

    texcoord: int  # TEXCOORD_n
    rows: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    wrap: tuple[int, int] = (_REPEAT, _REPEAT)
    size: tuple[int, int] = (1, 1)  # of the picture, where it does not repeat: width, height

    def agrees_with(self, other: Mapping) -> bool:
        """Whether both lead to the same point of a picture, whatever its size."""
        return (self.texcoord, self.rows, self.wrap) == (other.texcoord, other.rows, other.wrap)

    def apply(self, coordinates: Float64[np.ndarray, "n 2"]) -> tuple[Float64[np.ndarray, "n 2"], bool]:
        """Coordinates on the picture, and whether any beyond an edge were folded back.

        A picture that ends at its edge is looked up half a texel inside, so that nothing of its far side is seen.
        """
        rows = np.array(self.rows)
        uv = coordinates @ rows[:, :2].T + rows[:, 2]
        folded = False
        for axis, (wrap, size) in enumerate(zip(self.wrap, self.size, strict=True)):
            if wrap == _REPEAT:
                continue
            along = uv[:, axis]
            folded = folded or bool(((along < -1e-6) | (along > 1 + 1e-6)).any())
            if wrap == _MIRROR:
                along = 1 - np.abs(1 - np.mod(along, 2))
            uv[:, axis] = np.clip(along, 0.5 / size, 1 - 0.5 / size)
        return uv, folded


@dataclass
class TextureShelf:
    """The pictures that materials ask for, in the order in which they first did."""

    document: Document
    bytes_: Bytes
    pictures: list[Texture] = field(default_factory=list)
    faults: dict[str, None] = field(default_factory=dict)  # one sentence an image that could not be read
    smoothed: set[int] = field(default_factory=set)  # textures whose texels the file wants seen one by one
    _known: dict[str | int | None, int | None] = field(default_factory=dict)  # file or bufferView -> picture
    _texels: int = 0
    _damaged: int = 0

    def find(self, info: TextureInfo) -> tuple[int, Mapping] | None:
        """Index of a texture's picture and the way onto it; None, and a fault, where it cannot be read.

        Raises UnreadableMesh for a texture, image or sampler that is not there.
        """
        texture = self._entry("textures", info.index)
        sampler = Sampler() if texture.sampler is None else self._entry("samplers", texture.sampler)
        if texture.source is None:
            self._fault(f"texture {info.index} is neither PNG nor JPEG")
            return None
        image = self._entry("images", texture.source)
        source = image.bufferView if image.uri is None else image.uri
        if source not in self._known:
            self._known[source] = self._read(texture.source)
        picture = self._known[source]
        if picture is None:
            return None
        if sampler.magFilter == _NEAREST:
            self.smoothed.add(info.index)
        height, width = self.pictures[picture].shape[:2]
        wrap = (sampler.wrapS, sampler.wrapT)
        size = (width, height) if wrap != (_REPEAT, _REPEAT) else (1, 1)
        return picture, Mapping(*_transform(info), wrap, size)

    def _entry(self, kind: str, index: int):
        known = getattr(self.document, kind)
        if index >= len(known):
            raise UnreadableMesh(f"damaged glTF file: there is no entry {index}", f"/{kind}")
        return known[index]

    def _read(self, image: int) -> int | None:
        if self._texels >= _MOST_TEXELS:
            return self._fault(f"more than {_MOST_TEXELS >> 20} Mpx of textures in all")
        if self._damaged >= _MOST_DAMAGED:
            return self._fault(f"after {_MOST_DAMAGED} damaged ones no more are tried")
        try:
            name, data = self.bytes_.image(image)
        except UnreadableMesh as error:
            return self._fault(error.reason)
        try:
            picture = read_texture(data, name=short_name(name))
        except InputError as error:
            self._damaged += 1
            return self._fault(f"{error.path}: {error.reason}")
        self._texels += picture.size // 3
        self.pictures.append(picture)
        return len(self.pictures) - 1

    def _fault(self, sentence: str) -> None:
        self.faults[sentence] = None


def _transform(info: TextureInfo) -> tuple[int, tuple[tuple[float, float, float], ...]]:
    """Which coordinates, and `KHR_texture_transform` on them: scaled, then turned, then shifted.

    Turned as the extension's text and example say and three.js does: with v down, counter-clockwise as one
    looks at the picture. The GLSL in the extension's text has the opposite sign.
    """
    given = info.extensions.KHR_texture_transform
    if given is None:
        return info.texCoord, Mapping(0).rows
    texcoord = info.texCoord if given.texCoord is None else given.texCoord
    c, s = math.cos(given.rotation), math.sin(given.rotation)
    (x, y), (u, v) = given.scale, given.offset
    return texcoord, ((c * x, s * y, u), (-s * x, c * y, v))

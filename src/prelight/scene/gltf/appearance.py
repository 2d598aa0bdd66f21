"""Materials, textures and images of a glTF document, as its JSON has them.

Factors may lie outside the ranges of the specification: `materials` clips them and says so.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from .fields import Index, Pair, Part, Quad, Vector


class TextureTransform(Part):
    """`KHR_texture_transform`."""

    offset: Pair = (0.0, 0.0)
    rotation: float = 0.0
    scale: Pair = (1.0, 1.0)
    texCoord: Index | None = None


class TextureInfoExtensions(Part):
    KHR_texture_transform: TextureTransform | None = None


class TextureInfo(Part):
    """A texture and the coordinates it is looked up with."""

    index: Index
    texCoord: Index = 0
    extensions: TextureInfoExtensions = TextureInfoExtensions()


class MetallicRoughness(Part):
    """`pbrMetallicRoughness`."""

    baseColorFactor: Quad = (1.0, 1.0, 1.0, 1.0)
    baseColorTexture: TextureInfo | None = None
    metallicFactor: float = 1.0
    roughnessFactor: float = 1.0
    metallicRoughnessTexture: TextureInfo | None = None


class SpecularGlossiness(Part):
    """`KHR_materials_pbrSpecularGlossiness`, which older exporters write."""

    diffuseFactor: Quad = (1.0, 1.0, 1.0, 1.0)
    diffuseTexture: TextureInfo | None = None
    specularFactor: Vector = (1.0, 1.0, 1.0)
    glossinessFactor: float = 1.0
    specularGlossinessTexture: TextureInfo | None = None


class Ior(Part):
    ior: float = 1.5


class Specular(Part):
    specularFactor: float = 1.0
    specularTexture: TextureInfo | None = None
    specularColorFactor: Vector = (1.0, 1.0, 1.0)
    specularColorTexture: TextureInfo | None = None


class Transmission(Part):
    transmissionFactor: float = 0.0
    transmissionTexture: TextureInfo | None = None


class Clearcoat(Part):
    clearcoatFactor: float = 0.0
    clearcoatTexture: TextureInfo | None = None
    clearcoatRoughnessFactor: float = 0.0
    clearcoatRoughnessTexture: TextureInfo | None = None
    clearcoatNormalTexture: TextureInfo | None = None


class EmissiveStrength(Part):
    emissiveStrength: float = 1.0


class MaterialExtensions(Part):
    KHR_materials_pbrSpecularGlossiness: SpecularGlossiness | None = None
    KHR_materials_ior: Ior | None = None
    KHR_materials_specular: Specular | None = None
    KHR_materials_transmission: Transmission | None = None
    KHR_materials_clearcoat: Clearcoat | None = None
    KHR_materials_emissive_strength: EmissiveStrength | None = None
    KHR_materials_unlit: dict[str, Any] | None = None


class Surface(Part):
    """An entry of `materials`; all its defaults together are the material of a primitive that names none."""

    name: str = ""
    pbrMetallicRoughness: MetallicRoughness = MetallicRoughness()
    normalTexture: TextureInfo | None = None
    occlusionTexture: TextureInfo | None = None
    emissiveFactor: Vector = (0.0, 0.0, 0.0)
    emissiveTexture: TextureInfo | None = None
    alphaMode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    extensions: MaterialExtensions = MaterialExtensions()


class Texture(Part):
    """An image and how it goes on beyond its edges; without a source where an extension holds it."""

    source: Index | None = None
    sampler: Index | None = None


class Sampler(Part):
    magFilter: Literal[9728, 9729] | None = None
    wrapS: Literal[33071, 33648, 10497] = 10497  # clamp, mirror, repeat
    wrapT: Literal[33071, 33648, 10497] = 10497


class Image(Part):
    uri: str | None = None
    bufferView: Index | None = None
    mimeType: str | None = Field(default=None, max_length=100)

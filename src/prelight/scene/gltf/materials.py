"""What a diffuse bake takes from glTF materials, and what it leaves."""

from __future__ import annotations

from collections import Counter

from ..mesh import short_name
from .document import Material

_NAMED = 8


def base_colour(material: Material) -> tuple[tuple[float, ...], bool]:
    """Its linear factor (red, green, blue, alpha), and whether a texture would multiply it."""
    old, new = material.extensions.KHR_materials_pbrSpecularGlossiness, material.pbrMetallicRoughness
    if old is not None:
        return old.diffuseFactor, old.diffuseTexture is not None
    if new is not None:
        return new.baseColorFactor, new.baseColorTexture is not None
    return (1.0, 1.0, 1.0, 1.0), False


def unused_of_materials(materials: list[Material]) -> list[str]:
    """One line a textured material, the first few by name, and one line a kind for all else."""
    textured, unused = [], Counter()
    for k, material in enumerate(materials):
        factor, has_texture = base_colour(material)
        if has_texture:
            values = ",".join(f"{value:g}" for value in factor[:3])
            name = short_name(material.name or k)
            textured.append(f"material '{name}': base colour texture not read, its factor {values} used")
        rough = material.pbrMetallicRoughness
        unused["metal"] += rough is not None and (
            rough.metallicFactor > 0 or rough.metallicRoughnessTexture is not None
        )
        unused["emission"] += any(material.emissiveFactor) or material.emissiveTexture is not None
        unused["transparency"] += material.alphaMode != "OPAQUE"
    notes = textured[:_NAMED]
    if more := len(textured[_NAMED:]):
        notes.append(f"base colour textures of {more:,} more materials not read, their factors used")
    return notes + [
        f"{kind} not used by a diffuse bake (materials: {n:,})" for kind, n in unused.items() if n
    ]

"""What a surface is made of, as plain data: read from files, kept in a bake, made into BSDFs by ``rays``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from .errors import InputError

GREY = (0.8, 0.8, 0.8)  # of a surface that says nothing of its colour
STORED_TEXTURE = "stored_texture"  # in ``Material.bsdf``: {"type": "stored_texture", "index": k, "raw": bool}

# Mitsuba's surface scattering models and textures that read no file: what a bake may name.
BSDF_PLUGINS = frozenset({
    "diffuse", "dielectric", "thindielectric", "roughdielectric", "conductor", "roughconductor", "plastic",
    "roughplastic", "pplastic", "principled", "principledthin", "bumpmap", "normalmap", "blendbsdf", "mask",
    "twosided", "null", "hair", "phong", "checkerboard", "mesh_attribute", "rgb", "srgb", "spectrum", "uniform",
    STORED_TEXTURE,
})  # fmt: skip
_DEEPEST = 8
_MOST_VALUES = 4096


@dataclass(frozen=True)
class Material:
    """A surface after glTF's metallic-roughness model, or any BSDF of Mitsuba's.

    Textures are indices into the scene's; colours are linear Rec.709. A bake without an eye uses
    ``colour`` alone, as the albedo of a diffuse surface.
    """

    name: str = "material"
    colour: tuple[float, float, float] = GREY  # base colour, 0 to 1
    colour_texture: int | None = None  # multiplies ``colour``; sRGB-encoded
    roughness: float = 1.0  # perceptual, 0 to 1 (microfacet width α = roughness²)
    metallic: float = 0.0
    roughness_texture: int | None = None  # green multiplies roughness, blue metallic; linear
    specular: float = 0.0  # dielectric reflection: 0 none (Lambertian), 1 as Fresnel at ``ior``
    ior: float = 1.5  # 1 to 3
    transmission: float = 0.0  # share of what is not reflected that passes through, 0 to 1
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)  # radiance, W·sr⁻¹·m⁻² up to a common exposure
    emission_texture: int | None = None
    bsdf: Mapping[str, Any] | None = field(
        default=None
    )  # Mitsuba's, as plain data; overrides all but emission

    @property
    def is_lambertian(self) -> bool:
        """Whether light leaves it alike in all directions: then no eye need be fixed."""
        if self.bsdf is not None:
            inner = self.bsdf
            while inner.get("type") == "twosided":
                inner = next((v for v in inner.values() if isinstance(v, Mapping)), {})
            return inner.get("type") == "diffuse"
        return not (self.specular or self.metallic or self.transmission or self.clearcoat)

    @property
    def textures(self) -> tuple[int, ...]:
        """Indices of all textures it uses."""
        named = (self.colour_texture, self.roughness_texture, self.emission_texture)
        return tuple(k for k in named if k is not None) + tuple(_stored_textures(self.bsdf or {}))

    def to_dict(self) -> dict[str, Any]:
        """Its fields as plain data, for a manifest."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], *, textures: int) -> Material:
        """From untrusted data: fields, ranges, plugin names and texture indices checked. Raises InputError."""
        known = set(cls.__dataclass_fields__)
        if not isinstance(values, Mapping) or set(values) - known:
            unknown = ", ".join(sorted(map(str, set(values) - known))) if isinstance(values, Mapping) else ""
            raise InputError("material", f"unknown fields {unknown or repr(values)}")
        given = dict(values)
        for name in ("colour", "emission"):
            if name in given:
                given[name] = _numbers(name, given[name], 3, most=1.0 if name == "colour" else 1e30)
        for name, least, most in _RANGES:
            if name in given:
                (given[name],) = _numbers(name, [given[name]], 1, least=least, most=most)
        if not isinstance(given.get("name", ""), str):
            raise InputError("material", "its name is no text")
        if given.get("bsdf") is not None:
            check_bsdf(given["bsdf"])
        material = cls(**given)
        for index in material.textures:
            if type(index) is not int or not 0 <= index < textures:
                raise InputError("material", f"names texture {index!r} of {textures}")
        return material


_RANGES = (
    ("roughness", 0.0, 1.0), ("metallic", 0.0, 1.0), ("specular", 0.0, 1.0), ("ior", 1.0, 3.0),
    ("transmission", 0.0, 1.0), ("clearcoat", 0.0, 1.0), ("clearcoat_roughness", 0.0, 1.0),
)  # fmt: skip


def check_bsdf(bsdf: object) -> None:
    """Raises InputError unless ``bsdf`` is plain data naming only scattering models that read no file."""
    if not isinstance(bsdf, Mapping):
        raise InputError("bsdf", f"a {type(bsdf).__name__}, expected a table with a type")
    count, open_ = 0, [(bsdf, 1)]
    while open_:
        table, depth = open_.pop()
        if depth > _DEEPEST:
            raise InputError("bsdf", f"nested more than {_DEEPEST} deep")
        if table.get("type") not in BSDF_PLUGINS:
            raise InputError("bsdf", f"type {table.get('type')!r} is not one of Prelight's list")
        for name, value in table.items():
            count += len(value) if isinstance(value, list | tuple) else 1
            if isinstance(value, Mapping):
                open_.append((value, depth + 1))
            elif not _is_plain(value) or not isinstance(name, str) or "filename" in name:
                raise InputError("bsdf", f"{name!r} is {type(value).__name__}, expected numbers or words")
        if count > _MOST_VALUES:
            raise InputError("bsdf", f"more than {_MOST_VALUES} values")


def _is_plain(value: object) -> bool:
    if isinstance(value, list | tuple):
        return all(_is_plain(v) and not isinstance(v, list | tuple | str) for v in value)
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, str | int | bool)


def _stored_textures(bsdf: Mapping[str, Any]) -> list[Any]:
    found, open_ = [], [bsdf]
    while open_:
        table = open_.pop()
        if table.get("type") == STORED_TEXTURE:
            found.append(table.get("index"))
        open_.extend(v for v in table.values() if isinstance(v, Mapping))
    return found


def _numbers(name: str, value: object, count: int, *, least: float = 0.0, most: float) -> tuple[float, ...]:
    given = list(value) if isinstance(value, list | tuple) else []
    good = len(given) == count and all(
        isinstance(v, int | float) and not isinstance(v, bool) and least <= v <= most for v in given
    )
    if not good:
        raise InputError("material", f"{name} is {value!r}, expected {count} of {least:g} to {most:g}")
    return tuple(float(v) for v in given)

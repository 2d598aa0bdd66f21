"""The diffuse colour of a BSDF given as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...material import BSDF_PLUGINS, GREY, STORED_TEXTURE

MIDDLE = 0.5  # Mitsuba's reflectance where none is given
CONDUCTORS = ("conductor", "roughconductor")
# The property that is a model's diffuse colour.
_DIFFUSE = {
    "diffuse": "reflectance", "plastic": "diffuse_reflectance", "roughplastic": "diffuse_reflectance",
    "pplastic": "diffuse_reflectance", "principled": "base_color", "principledthin": "base_color",
}  # fmt: skip
_TEXTURES = {STORED_TEXTURE, "checkerboard", "mesh_attribute", "rgb", "srgb", "spectrum", "uniform"}
Colour = tuple[float, float, float]


def is_plain_diffuse(table: Mapping[str, Any]) -> bool:
    """Whether colour and texture say all there is: then a material needs no BSDF."""
    inner = [value for value in table.values() if isinstance(value, Mapping)]
    if table["type"] == "twosided" and len(inner) == 1:
        return is_plain_diffuse(inner[0])
    if table["type"] != "diffuse" or set(table) - {"type", "reflectance"}:
        return False
    reflectance = table.get("reflectance", MIDDLE)
    if not isinstance(reflectance, Mapping):
        return True
    return reflectance["type"] in ("rgb", "mesh_attribute") or (
        reflectance["type"] == STORED_TEXTURE and not reflectance["raw"]
    )


def albedo_of(table: Mapping[str, Any]) -> tuple[Colour, Mapping[str, Any] | None]:
    """A colour for bakes without an eye, and the texture that goes with it."""
    kind = table["type"]
    inner = [v for v in table.values() if isinstance(v, Mapping) and v["type"] in BSDF_PLUGINS - _TEXTURES]
    if kind in _DIFFUSE:
        return _colour(table.get(_DIFFUSE[kind], MIDDLE))
    if kind in CONDUCTORS:
        eta, k = (np.array(_colour(table[name])[0]) for name in ("eta", "k"))
        tint = np.array(_colour(table.get("specular_reflectance", 1.0))[0])
        red, green, blue = tint * ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
        return (float(red), float(green), float(blue)), None
    if kind == "blendbsdf" and len(inner) == 2:
        weight = float(np.mean(_colour(table.get("weight", MIDDLE))[0]))
        (first, of_first), (second, of_second) = map(albedo_of, inner)
        if of_first or of_second:
            return (first, of_first) if weight < MIDDLE else (second, of_second)
        red, green, blue = ((1 - weight) * a + weight * b for a, b in zip(first, second, strict=True))
        return (red, green, blue), None
    return albedo_of(inner[0]) if inner else (GREY, None)


def _colour(value: Any) -> tuple[Colour, Mapping[str, Any] | None]:
    """Of a number, a colour or a texture; white beside a texture or vertex colours."""
    if isinstance(value, Mapping):
        if value["type"] == STORED_TEXTURE:
            return (1.0, 1.0, 1.0), value
        if value["type"] == "checkerboard":
            dark, light = (_colour(value.get(k, d))[0] for k, d in (("color0", 0.4), ("color1", 0.2)))
            return ((dark[0] + light[0]) / 2, (dark[1] + light[1]) / 2, (dark[2] + light[2]) / 2), None
        value = value.get("value", 1.0)
    red, green, blue = (float(v) for v in np.broadcast_to(np.array(value, np.float64), 3))
    return (red, green, blue), None

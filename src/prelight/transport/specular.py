"""Which materials the gathering operator hands to photons, whole, so that no light is carried twice.

The operator takes every surface as diffuse. Of clear glass and smooth metal nothing of that is true: there it is told
that they reflect nothing, and photons carry all light that meets them. A material is the one's or the other's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..material import Material
from ..scene.geometry import Scene

_MOSTLY = 0.5  # transmission or metallic from which a material is more that than anything else
_SMOOTHEST = 0.25  # perceptual roughness up to which metal is no diffuse surface; α = 0.06
_CLEAR = frozenset({"dielectric", "thindielectric", "roughdielectric", "conductor", "null", "mask"})
_WRAPPED = frozenset({"twosided", "bumpmap", "normalmap"})
_NOBODYS = frozenset({"hair"})  # scatter as fibres do: neither as surfaces of ours nor to be met by photons


def is_specular(material: Material) -> bool:
    """Whether photons carry all light that meets this material: clear glass, smooth metal, what lets light through."""
    if material.bsdf is not None:
        return _bsdf_is_specular(material.bsdf)
    smooth_metal = material.metallic >= _MOSTLY and material.roughness <= _SMOOTHEST
    return material.transmission >= _MOSTLY or smooth_metal


def _bsdf_is_specular(bsdf: Mapping[str, Any]) -> bool:
    kind = bsdf.get("type")
    inner = [v for v in bsdf.values() if isinstance(v, Mapping) and "type" in v]
    if kind in _WRAPPED or kind == "blendbsdf":
        return any(_bsdf_is_specular(v) for v in inner)
    if kind in _CLEAR:
        return True
    if kind == "roughconductor":
        widths = [bsdf.get(name, 0.1) for name in ("alpha", "alpha_u", "alpha_v") if name in bsdf] or [0.1]
        return all(isinstance(w, int | float) and w <= _SMOOTHEST**2 for w in widths)
    if kind in ("principled", "principledthin"):
        smooth = _number(bsdf, "roughness", 0.5) <= _SMOOTHEST and _number(bsdf, "metallic", 0.0) >= _MOSTLY
        return smooth or _number(bsdf, "spec_trans", 0.0) >= _MOSTLY
    return False


def _number(bsdf: Mapping[str, Any], name: str, usual: float) -> float:
    value = bsdf.get(name, usual)
    return float(value) if isinstance(value, int | float) else usual


def specular_materials(scene: Scene) -> np.ndarray:
    """(materials,) bool: those that triangles are made of and photons carry."""
    used = np.zeros(len(scene.materials), bool)
    used[np.unique(scene.material_of)] = True
    return used & np.array([is_specular(material) for material in scene.materials], bool)


def rough_metals(scene: Scene) -> np.ndarray:
    """(materials,) bool: metal that triangles are made of and that photons do not carry, all of it metal."""
    used = np.zeros(len(scene.materials), bool)
    used[np.unique(scene.material_of)] = True
    return used & np.array([_is_metal(m) and not is_specular(m) for m in scene.materials], bool)


def _is_metal(material: Material) -> bool:
    bsdf = material.bsdf
    while bsdf is not None and bsdf.get("type") in _WRAPPED:
        bsdf = next((v for v in bsdf.values() if isinstance(v, Mapping) and "type" in v), None)
    if bsdf is not None:
        metallic = _number(bsdf, "metallic", 0.0) if bsdf.get("type") == "principled" else 0.0
        return bsdf.get("type") == "roughconductor" or metallic >= _MOSTLY
    plain = material.bsdf is None and material.roughness_texture is None
    return plain and material.metallic >= _MOSTLY


def without_specular(scene: Scene) -> Scene:
    """The scene as the operator is to see it: what photons carry is black. The scene itself where there is no such.

    A vertex that such a surface shares with another is black too.
    """
    specular = specular_materials(scene)
    if not specular.any():
        return scene
    black = np.unique(scene.triangles[specular[scene.material_of]])
    albedo = scene.albedo.copy()
    albedo[black] = 0
    tint = scene.tint
    if tint is not None:
        tint = tint.copy()
        tint[black] = 0
    return replace(scene, albedo=albedo, tint=tint)


def as_photons_see(scene: Scene) -> Scene:
    """The scene with everything Lambertian that photons do not carry whole, as the operator takes it.

    Raises InputError for a material that neither can carry.
    """
    materials = []
    for material, specular in zip(scene.materials, specular_materials(scene), strict=True):
        if material.bsdf is not None and _kinds(material.bsdf) & _NOBODYS:
            reason = "its bsdf hair scatters as fibres do, which neither photons nor gathering carry; choose another"
            raise InputError(f"material {material.name}", reason)
        plain = Material(material.name, material.colour, material.colour_texture)
        materials.append(material if specular else plain)
    return replace(scene, materials=tuple(materials))


def _kinds(bsdf: Mapping[str, Any]) -> set[str]:
    found, open_ = set(), [bsdf]
    while open_:
        table = open_.pop()
        found.add(str(table.get("type")))
        open_.extend(v for v in table.values() if isinstance(v, Mapping))
    return found

"""Objects that Mitsuba has already made, told as the plug-ins they were made from.

Mitsuba shows the parameters of an object, not all the words it was made with: a microfacet distribution or
``nonlinear`` is taken at its default.
"""

from __future__ import annotations

import re
from types import ModuleType
from typing import Any

import numpy as np

from ..mesh import UnreadableMesh
from .node import Node, is_transform

_PLUGINS = {
    "SmoothDiffuse": "diffuse", "SmoothDielectric": "dielectric", "ThinDielectric": "thindielectric",
    "RoughDielectric": "roughdielectric", "SmoothConductor": "conductor", "RoughConductor": "roughconductor",
    "SmoothPlastic": "plastic", "RoughPlastic": "roughplastic", "PolarizedPlastic": "pplastic",
    "Principled": "principled", "PrincipledThin": "principledthin", "BumpMap": "bumpmap",
    "NormalMap": "normalmap", "BlendBSDF": "blendbsdf", "MaskBSDF": "mask", "TwoSidedBRDF": "twosided",
    "Null": "null", "Hair": "hair", "Checkerboard": "checkerboard", "MeshAttribute": "mesh_attribute",
    "SRGBReflectanceSpectrum": "rgb", "UniformSpectrum": "uniform", "AreaLight": "area",
    "PerspectiveCamera": "perspective", "ThinLensCamera": "thinlens", "ShapeGroupPlugin": "shapegroup",
    "HDRFilm": "hdrfilm", "ConstantBackgroundEmitter": "constant", "EnvironmentMapEmitter": "envmap",
}  # fmt: skip
_KINDS = ("Scene", "Shape", "BSDF", "Texture", "Emitter", "Sensor", "Film")
_RENAMED = {"eta": "int_ior", "x_fov": "fov"}  # parameters not called as the properties they come from
_NEEDLESS = re.compile(r".*_sampling_rate|silhouette_sampling_weight|sampling_weight")
_KEPT = ("conductor", "roughconductor")  # whose eta is eta
_DEEPEST = 16


def node_of(mi: ModuleType, made: Any, *, name: str = "", depth: int = 0) -> Node | None:
    """The object as a node, None if it is none of a scene's; shapes keep the object itself."""
    kind = next((k for k in _KINDS if isinstance(made, getattr(mi, k))), None)
    if kind is None:
        return None
    if depth > _DEEPEST:
        raise UnreadableMesh(f"objects nested more than {_DEEPEST} deep")
    said = made.class_name()
    plugin = "bitmap" if said.startswith("BitmapTexture") else _PLUGINS.get(said, said.lower())
    children = {}
    for key, child in _parts(mi, made):
        node = node_of(mi, child, name=key, depth=depth + 1)
        if node is not None:
            children[key] = node
    if kind == "Scene":
        children = {f"{k}.{key}": child for k, (key, child) in enumerate(children.items())}
    values = {} if kind in ("Scene", "Shape") else _values(mi, made, plugin)
    if plugin == "instance":
        values = _values(mi, made, plugin) | {"shapegroup": _group_name(made)}
    identity = made.id() if hasattr(made, "id") else ""
    keep = made if kind in ("Shape", "BSDF") else None
    return Node(kind, plugin, identity or name, values, children, made=keep)


def _parts(mi: ModuleType, made: Any) -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []

    class Listing(mi.TraversalCallback):
        def put(self, name: str, value: Any, *_flags: object) -> None:
            if isinstance(value, mi.Object):
                found.append((name, value))

        put_object = put

        def put_value(self, *_value: object) -> None:
            pass

    made.traverse(Listing())
    if len(found) == 2 and made.class_name() == "TwoSidedBRDF" and found[0][1].ptr == found[1][1].ptr:
        found.pop()  # both sides are one BSDF
    if isinstance(made, mi.Shape) and made.is_emitter():
        found.append(("emitter", made.emitter()))
    return found


def _values(mi: ModuleType, made: Any, plugin: str) -> dict[str, Any]:
    """Its own parameters, under the names of the properties; those of the parts in it have a dot."""
    values = {}
    parameters = mi.traverse(made)
    for key in parameters.keys():  # noqa: SIM118
        if "." in key or _NEEDLESS.fullmatch(key):
            continue
        name = key if plugin in _KEPT else _RENAMED.get(key, key)
        values[name] = _plain(parameters[key])
    if plugin == "rgb":
        colour = values.get("value", 0.5)
        values["value"] = colour * 3 if isinstance(colour, list) and len(colour) == 1 else colour
    return values


def _plain(value: Any) -> Any:
    """A number, a list of them, or an array where it is one; transforms as they are."""
    if isinstance(value, bool | int | float | str) or is_transform(value):
        return value
    numbers = np.array(value)
    if numbers.ndim == 3:
        return numbers.astype(np.float32)
    if numbers.dtype == object or numbers.size > 4:
        return value
    return numbers.item() if numbers.size == 1 else [float(v) for v in numbers.ravel()]


def _group_name(instance: Any) -> str:
    """Mitsuba tells the group of an instance in its description alone."""
    found = re.search(r'shapegroup = \S+\[\s*name = "([^"]*)"', str(instance))
    return found.group(1) if found else ""

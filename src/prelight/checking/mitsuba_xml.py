"""Tables of plug-ins as Mitsuba's XML, and triangles as a PLY that it reads with vertex colours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..arrays import Albedo, Float64, Normals, Positions, TextureCoordinates, Triangles

Emitted = dict[str, Any]
_VERSION = "3.0.0"
_TAGS = {
    "texture": ("bitmap", "mesh_attribute", "checkerboard"),
    "emitter": ("point", "area", "envmap", "projector"),
    "shape": ("ply", "sphere", "rectangle"),
    "sensor": ("perspective",),
    "film": ("hdrfilm",),
    "rfilter": ("tent",),
    "sampler": ("independent",),
    "integrator": ("path",),
}
_TAG = {plugin: tag for tag, plugins in _TAGS.items() for plugin in plugins}


def scene_xml(children: Sequence[Emitted]) -> bytes:
    """A scene of these plug-ins."""
    root = ElementTree.Element("scene", version=_VERSION)
    for child in children:
        _plugin(root, None, child)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def _plugin(parent: ElementTree.Element, name: str | None, table: Mapping[str, Any]) -> None:
    kind = str(table["type"])
    named = {} if name is None else {"name": name}
    if kind in ("rgb", "srgb", "spectrum", "uniform"):
        value = table.get("value", table.get("color", 1.0))
        numbers = [value] if isinstance(value, int | float) else list(value)
        tag = "rgb" if kind in ("rgb", "srgb") else "spectrum"
        ElementTree.SubElement(parent, tag, named | {"value": " ".join(repr(float(x)) for x in numbers)})
        return
    element = ElementTree.SubElement(parent, _TAG.get(kind, "bsdf"), {"type": kind} | named)
    for key, value in table.items():
        if key != "type":
            _value(element, key, value)


def _value(element: ElementTree.Element, key: str, value: Any) -> None:
    if isinstance(value, Mapping):
        _plugin(element, key, value)
    elif isinstance(value, np.ndarray):
        transform = ElementTree.SubElement(element, "transform", name=key)
        ElementTree.SubElement(transform, "matrix", value=" ".join(repr(float(x)) for x in value.ravel()))
    elif isinstance(value, bool):
        ElementTree.SubElement(element, "boolean", name=key, value=str(value).lower())
    elif isinstance(value, int):
        ElementTree.SubElement(element, "integer", name=key, value=str(value))
    elif isinstance(value, float | np.floating):
        ElementTree.SubElement(element, "float", name=key, value=repr(float(value)))
    elif isinstance(value, list | tuple):
        tag = "point" if key in ("center", "position") else "vector"
        ElementTree.SubElement(element, tag, name=key, value=" ".join(repr(float(x)) for x in value))
    else:
        ElementTree.SubElement(element, "string", name=key, value=str(value))


def lookat(origin: Any, target: Any, up: Any) -> Float64[np.ndarray, "4 4"]:
    """Mitsuba's: +Z ahead, +X to the left."""
    place, ahead = np.asarray(origin, np.float64), np.subtract(target, origin).astype(np.float64)
    ahead /= np.linalg.norm(ahead)
    left = np.cross(up, ahead)
    left /= np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = left, np.cross(ahead, left), ahead, place
    return matrix


def mesh_file(
    positions: Positions,
    triangles: Triangles,
    *,
    normals: Normals,
    uv: TextureCoordinates | None,
    tint: Albedo,
) -> bytes:
    """A binary PLY; vertex colours are the attribute ``vertex_tint``."""
    columns = [("x", "y", "z"), ("nx", "ny", "nz"), ("tint_r", "tint_g", "tint_b")]
    values = [positions, normals, tint]
    if uv is not None:
        columns.append(("u", "v"))
        values.append(uv)
    names = [name for part in columns for name in part]
    head = "ply\nformat binary_little_endian 1.0\n" + f"element vertex {len(positions)}\n"
    head += "".join(f"property float {name}\n" for name in names)
    head += f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    faces = np.zeros(len(triangles), [("count", "u1"), ("corners", "<i4", (3,))])
    faces["count"], faces["corners"] = 3, triangles
    return head.encode() + np.concatenate(values, axis=1).astype("<f4").tobytes() + faces.tobytes()

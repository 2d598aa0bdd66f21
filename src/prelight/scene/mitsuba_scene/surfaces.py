"""BSDFs and area lights of a Mitsuba scene as materials."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np

from ...material import BSDF_PLUGINS, GREY, STORED_TEXTURE, Material
from ..mesh import UnreadableMesh, short_name
from .albedo import CONDUCTORS, MIDDLE, Colour, albedo_of, is_plain_diffuse
from .node import Node, essence, is_transform, load_object
from .pictures import Pictures
from .shapes import VERTEX_COLOUR, matrix_of

_DEEPEST = 6


@dataclass(frozen=True)
class Surface:
    """A material's place in the list, and what its shapes must know."""

    index: int
    to_uv: np.ndarray | None = None  # (3, 3) acts on texture coordinates
    vertex_colours: bool = False  # its colour is that of the vertices


class Surfaces:
    """The materials of a scene, one for every pair of BSDF and light that occurs."""

    def __init__(self, mi: ModuleType, unread: Counter[str]) -> None:
        self._mi, self._unread = mi, unread
        self._pictures = Pictures(mi, unread)
        self._known: dict[tuple[Node | None, Node | None], Surface] = {}
        self._to_uv: list[np.ndarray] = []
        self._attributes = 0
        self.materials: list[Material] = []

    @property
    def textures(self) -> list[np.ndarray]:
        return self._pictures.textures

    def of(self, shape: Node) -> Surface | None:
        """The material of a shape, None if it is not there to see. Raises UnreadableMesh."""
        bsdf, light = (next(iter(shape.of_kind(kind)), None) for kind in ("BSDF", "Emitter"))
        if bsdf is not None and bsdf.plugin == "null" and light is None:
            self._unread["shapes without a surface (null) left out"] += 1
            return None
        if (bsdf, light) not in self._known:
            self._to_uv, self._attributes = [], 0
            material = self._material(bsdf, light, name=_name(shape, bsdf))
            if any(not np.allclose(m, self._to_uv[0]) for m in self._to_uv[1:]):
                self._unread["materials whose textures differ in to_uv: the first counts for all"] += 1
            to_uv = self._to_uv[0] if self._to_uv and not np.allclose(self._to_uv[0], np.eye(3)) else None
            self._known[bsdf, light] = Surface(self._place_of(material), to_uv, bool(self._attributes))
        return self._known[bsdf, light]

    def _place_of(self, material: Material) -> int:
        """In the list, where materials that differ in name alone are one."""
        for k, known in enumerate(self.materials):
            if replace(material, name=known.name) == known:
                return k
        self.materials.append(material)
        return len(self.materials) - 1

    def _material(self, bsdf: Node | None, light: Node | None, *, name: str) -> Material:
        emission, emission_texture = self._emission(light) if light is not None else ((0.0, 0.0, 0.0), None)
        table: Mapping[str, Any] = {"type": "diffuse"}
        if bsdf is not None:
            _check_depth(bsdf, _DEEPEST)
            made = load_object(self._mi, bsdf)  # Mitsuba says what is wrong with it
            table = self._plain(bsdf, made)
        colour, texture = albedo_of(table)
        return Material(
            name,
            colour=self._clipped(colour),
            colour_texture=None if texture is None or texture["raw"] else texture["index"],
            emission=emission,
            emission_texture=emission_texture,
            bsdf=None if is_plain_diffuse(table) else table,
        )

    # ---- BSDFs as plain data ---------------------------------------------------------------------

    def _plain(self, node: Node, made: Any) -> dict[str, Any]:
        if node.plugin not in BSDF_PLUGINS:
            what = f"materials of type {short_name(node.plugin)}"
            self._unread[f"{what}: read as diffuse of the same colour"] += 1
            seen = {"type": "rgb", "value": list(self._seen_diffuse(made))}
            return {"type": "diffuse", "reflectance": seen}
        table: dict[str, Any] = {"type": node.plugin}
        for name, value in node.values.items():
            plain = self._value(name, value, owner=node)
            if plain is not None:
                table[name] = plain
        for name, child in node.children.items():
            if child.kind == "BSDF":
                table[name] = self._plain(child, load_object(self._mi, child))
            elif child.kind == "Texture":
                table[name] = self._texture(name, child, owner=node)
        if node.plugin in CONDUCTORS and not {"eta", "k"} <= table.keys():
            measured = self._mi.traverse(made)
            for name in ("eta", "k"):
                table[name] = _rgb(measured[f"{name}.value"])
            table.pop("material", None)
        return table

    def _value(self, name: str, value: Any, *, owner: Node) -> Any:
        """Numbers, words and colours; None for what the surface does not need to keep."""
        if isinstance(value, bool | int | float | str | dict):  # the only tables are colours
            return value
        if hasattr(value, "wavelengths"):
            return self._as_reflectance(name, value, owner=owner)
        if is_transform(value):
            return None
        if isinstance(value, list) and all(isinstance(v, int | float) for v in value):
            return value
        raise UnreadableMesh(f"{name} of {owner.plugin} is a {type(value).__name__}", owner.where)

    def _texture(self, name: str, texture: Node, *, owner: Node) -> dict[str, Any] | float:
        if texture.plugin == "bitmap":
            self._place(texture)
            index, raw = self._pictures.index(texture)
            return {"type": STORED_TEXTURE, "index": index, "raw": raw}
        if texture.plugin == "checkerboard":
            self._place(texture)
            return self._plain(texture, None)
        if texture.plugin == "mesh_attribute":
            self._attributes += 1
            if texture.values.get("name", VERTEX_COLOUR) != VERTEX_COLOUR:
                self._unread["colours of mesh attributes other than vertex_color not read: grey"] += 1
            return {"type": "mesh_attribute", "name": VERTEX_COLOUR}
        if texture.plugin == "uniform" and isinstance(texture.values.get("value"), float):
            return texture.values["value"]
        if texture.plugin in ("rgb", "srgb"):
            return self._rgb_of(texture)
        return self._as_reflectance(name, texture.as_dict(self._mi), owner=owner)

    def _rgb_of(self, texture: Node) -> dict[str, Any]:
        value = texture.values.get("value", texture.values.get("color", MIDDLE))
        colour = value["value"] if isinstance(value, dict) else value
        return {"type": "rgb", "value": [float(v) for v in np.broadcast_to(np.array(colour, np.float64), 3)]}

    def _place(self, texture: Node) -> None:
        transform = texture.values.get("to_uv")
        matrix = np.eye(3) if transform is None else _planar(transform)
        self._to_uv.append(matrix)

    def _as_reflectance(self, name: str, given: Any, *, owner: Node) -> dict[str, Any]:
        """A spectrum as Mitsuba sees it in red, green and blue."""
        unbounded = owner.plugin in CONDUCTORS and name in ("eta", "k")
        carrier = {"type": "conductor", "eta": 1.0, "k": 1.0, name: given} if unbounded else None
        carrier = carrier or {"type": "diffuse", "reflectance": given}
        key = f"{name}.value" if unbounded else "reflectance.value"
        try:
            made = self._mi.load_dict(carrier)
            parameters = self._mi.traverse(made)
            if key in parameters:
                return _rgb(parameters[key])
            return {"type": "rgb", "value": list(self._seen_diffuse(made))}
        except (RuntimeError, TypeError, ValueError) as error:
            said = f"{name} of {owner.plugin} cannot be had in red, green and blue: {essence(error)}"
            raise UnreadableMesh(said, owner.where) from None

    def _seen_diffuse(self, made: Any) -> Colour:
        """What Mitsuba says is the diffuse reflectance, in the middle of the texture; grey if it does not say."""
        import drjit as dr

        si = dr.zeros(self._mi.SurfaceInteraction3f, 1)
        si.wi, si.uv = self._mi.Vector3f(0, 0, 1), self._mi.Point2f(0.5, 0.5)
        try:
            colour = np.array(made.eval_diffuse_reflectance(si), np.float64).ravel()
        except RuntimeError:
            return GREY
        if colour.size not in (1, 3) or not np.isfinite(colour).all():
            return GREY
        return self._clipped(tuple(np.broadcast_to(colour, 3)))

    def _clipped(self, colour: Colour) -> Colour:
        if not all(0 <= c <= 1 for c in colour):
            self._unread["colours outside 0 to 1 clipped for bakes without an eye"] += 1
        red, green, blue = (min(max(float(c), 0.0), 1.0) for c in colour)
        return red, green, blue

    # ---- lights ----------------------------------------------------------------------------------

    def _emission(self, light: Node) -> tuple[Colour, int | None]:
        """Radiance of an area light."""
        given: Any = light.values.get("radiance", 1.0)
        texture = light.children.get("radiance")
        if texture is not None and texture.plugin == "bitmap":
            index, raw = self._pictures.index(texture)
            if not raw:
                return (1.0, 1.0, 1.0), index
        if texture is not None:
            given = texture.as_dict(self._mi)
        if isinstance(given, int | float):
            given = {"type": "rgb", "value": float(given)}
        if isinstance(given, dict) and given.get("type") == "rgb":
            red, green, blue = self._positive(np.broadcast_to(np.array(given["value"], np.float64), 3))
            return (red, green, blue), None
        return self._radiance_of(given), None

    def _radiance_of(self, given: Any) -> Colour:
        import drjit as dr

        try:
            light = self._mi.load_dict({"type": "constant", "radiance": given})
            si = dr.zeros(self._mi.SurfaceInteraction3f, 1)
            seen = np.array(light.eval(si), np.float64).ravel()
        except (RuntimeError, TypeError, ValueError):
            self._unread["area lights whose colour is not known in red, green and blue: taken as 1"] += 1
            return 1.0, 1.0, 1.0
        red, green, blue = self._positive(np.broadcast_to(seen, 3))
        return red, green, blue

    def _positive(self, values: np.ndarray) -> list[float]:
        if not np.isfinite(values).all() or (values < 0).any():
            self._unread["area lights of negative or infinite radiance: taken as 0"] += 1
        return [float(v) if np.isfinite(v) and v > 0 else 0.0 for v in values]


def _name(shape: Node, bsdf: Node | None) -> str:
    """The BSDF's own name, or that of the shape it was written in."""
    inline = bsdf is None or bsdf.name in ("", *shape.children) or bsdf.name.startswith("_arg_")
    return short_name((shape.name if inline else bsdf.name) or "material")


def _check_depth(node: Node, left: int) -> None:
    if left == 0:
        raise UnreadableMesh(f"a material nested more than {_DEEPEST} deep", node.where)
    for child in node.children.values():
        _check_depth(child, left - 1)


def _planar(transform: Any) -> np.ndarray:
    """The part of a transform that acts on u and v."""
    matrix = np.array(transform.matrix, np.float64)
    if matrix.size == 9:
        return matrix.reshape(3, 3)
    matrix = matrix_of(transform)
    return np.array([[*matrix[0, :2], matrix[0, 3]], [*matrix[1, :2], matrix[1, 3]], [0.0, 0.0, 1.0]])


def _rgb(values: Any) -> dict[str, Any]:
    numbers = np.array(values, np.float64).ravel()
    return {"type": "rgb", "value": [float(v) for v in np.broadcast_to(numbers, 3)]}

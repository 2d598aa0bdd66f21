"""Read a Mitsuba scene that the user trusts."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ..mesh import MeshAsRead, UnreadableMesh, check_counts, short_name
from ..variant import mitsuba
from .node import Node, essence
from .objects import node_of
from .sensors import cameras_of
from .shapes import ShapeArrays, matrix_of, shape_arrays
from .surfaces import Surface, Surfaces
from .tree import tree_of_dict, tree_of_file

_GREY = (0.5, 0.5, 0.5)


def read_mitsuba(source: Path | dict[str, Any] | object) -> MeshAsRead:
    """The triangles, materials and cameras of an XML file, a dictionary or a loaded ``mi.Scene``.

    Meshes keep their vertices; round shapes become flat facets; instances are placed. Area lights become the
    ``emission`` of their surface; other lights, media and integrators are left out and noted. Mitsuba's own
    parser reads the files, and these name plug-ins and other files: only for sources that the user trusts.

    Raises UnreadableMesh, InputError of a file that the scene names, MissingExtraError.
    """
    mi = mitsuba()
    try:
        root = _tree(mi, source)
        unread: Counter[str] = Counter()
        gathered = _Gathering(mi, root, unread).mesh()
        cameras = cameras_of(root, unread)
    except RuntimeError as error:
        raise UnreadableMesh(essence(error)) from None
    notes = tuple(f"{what} ({count:,})" for what, count in unread.items())
    return replace(gathered, cameras=cameras, notes=notes)


def _tree(mi: ModuleType, source: Path | dict[str, Any] | object) -> Node:
    if isinstance(source, Path):
        return tree_of_file(mi, source)
    if isinstance(source, dict):
        return tree_of_dict(mi, source)
    found = node_of(mi, source)
    if found is None:
        raise UnreadableMesh(f"a Mitsuba {type(source).__name__} is not a scene or a shape")
    return found


class _Gathering:
    """The shapes of a scene, one after another in the order of the file."""

    def __init__(self, mi: ModuleType, root: Node, unread: Counter[str]) -> None:
        self._mi, self._unread = mi, unread
        self._surfaces = Surfaces(mi, unread)
        self._groups = {node.name: node for node in root.of_kind("Shape") if node.plugin == "shapegroup"}
        self._loaded: dict[Node, ShapeArrays | None] = {}
        self._parts: list[tuple[ShapeArrays, Surface]] = []
        self._vertices = self._triangles = 0
        if root.kind not in ("Scene", "Shape"):
            raise UnreadableMesh(f"holds a {root.kind} alone, expected a scene or a shape")
        for child in root.children.values() if root.kind == "Scene" else [root]:
            self._take_child(child)

    def _take_child(self, child: Node) -> None:
        if child.kind == "Shape":
            self._take(child)
        elif child.kind == "Emitter":
            what = f"lights of type {short_name(child.plugin)}"
            self._unread[f"{what} not read: light is set after baking"] += 1
        elif child.kind in ("Medium", "Volume", "PhaseFunction"):
            self._unread["participating media not read"] += 1

    def _take(self, shape: Node, placed: np.ndarray | None = None, *, in_group: bool = False) -> None:
        """One shape; those in a group only where an instance places them."""
        if shape.plugin in ("shapegroup", "merge"):
            if shape.plugin == "merge" or in_group:
                for child in shape.of_kind("Shape"):
                    self._take(child, placed)
            return
        if shape.plugin == "instance":
            self._take_instance(shape, placed)
            return
        if shape.of_kind("Medium"):
            self._unread["participating media not read"] += 1
        surface = self._surfaces.of(shape)
        if surface is None:
            return
        if shape not in self._loaded:
            self._loaded[shape] = shape_arrays(self._mi, shape, self._unread)
        arrays = self._loaded[shape]
        if arrays is None or not len(arrays.triangles):
            return
        self._vertices += len(arrays.positions)
        self._triangles += len(arrays.triangles)
        check_counts(self._vertices, self._triangles)
        self._parts.append((arrays if placed is None else arrays.placed(placed), surface))

    def _take_instance(self, shape: Node, placed: np.ndarray | None) -> None:
        transform = shape.values.get("to_world")
        matrix = np.eye(4) if transform is None else matrix_of(transform)
        named = self._groups.get(str(shape.values.get("shapegroup", "")))
        for group in shape.of_kind("Shape") or ([named] if named else []):
            self._take(group, matrix if placed is None else placed @ matrix, in_group=True)

    def mesh(self) -> MeshAsRead:
        """All together. Raises UnreadableMesh if there is nothing."""
        if not self._parts:
            raise UnreadableMesh("no shapes with a surface in it")
        starts = np.cumsum([0] + [len(arrays.positions) for arrays, _ in self._parts])
        materials = self._surfaces.materials
        return MeshAsRead(
            np.concatenate([a.positions for a, _ in self._parts]),
            np.concatenate([a.triangles + s for (a, _), s in zip(self._parts, starts[:-1], strict=True)]),
            np.concatenate([a.normals for a, _ in self._parts]),
            np.concatenate([self._tint(a, s) for a, s in self._parts]),
            materials=tuple(materials),
            material_of=np.repeat(
                [s.index for _, s in self._parts], [len(a.triangles) for a, _ in self._parts]
            ),
            uv=np.concatenate([_uv(a, s) for a, s in self._parts]) if self._textured() else None,
            textures=tuple(self._surfaces.textures),
        )

    def _textured(self) -> bool:
        return any(m.textures or "checkerboard" in str(m.bsdf) for m in self._surfaces.materials)

    def _tint(self, arrays: ShapeArrays, surface: Surface) -> np.ndarray:
        colour = np.array(self._surfaces.materials[surface.index].colour)
        if surface.vertex_colours:
            colour = np.array(_GREY) if arrays.colours is None else arrays.colours
        return np.broadcast_to(colour, arrays.positions.shape)


def _uv(arrays: ShapeArrays, surface: Surface) -> np.ndarray:
    if arrays.uv is None:
        return np.zeros((len(arrays.positions), 2))
    if surface.to_uv is None:
        return arrays.uv
    return arrays.uv @ surface.to_uv[:2, :2].T + surface.to_uv[:2, 2]

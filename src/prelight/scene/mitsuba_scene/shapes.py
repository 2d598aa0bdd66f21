"""Mitsuba's shapes as arrays of triangles in the world."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np

from ...files import read_regular
from ..mesh import UnreadableMesh, check_counts
from ..normals import is_mirrored, normal_matrix
from ..ply.reading import read_ply
from . import tessellation
from .node import Node, load_object

_ROUND = {
    "Sphere": tessellation.sphere,
    "Cylinder": tessellation.cylinder,
    "Disk": tessellation.disk,
    "Rectangle": tessellation.rectangle,
}
_LARGEST_FILE = 2_000_000_000
VERTEX_COLOUR = "vertex_color"


@dataclass(frozen=True)
class ShapeArrays:
    """One shape, float64."""

    positions: np.ndarray  # (V, 3)
    triangles: np.ndarray  # (F, 3) int32
    normals: np.ndarray  # (V, 3)
    uv: np.ndarray | None  # (V, 2)
    colours: np.ndarray | None = None  # (V, 3) linear, of an attribute vertex_color

    def placed(self, matrix: np.ndarray) -> ShapeArrays:
        """Transformed once more, for an instance."""
        linear = matrix[:3, :3]
        triangles = self.triangles[:, ::-1] if is_mirrored(linear) else self.triangles
        return replace(
            self,
            positions=self.positions @ linear.T + matrix[:3, 3],
            normals=_unit(self.normals @ normal_matrix(linear).T),
            triangles=triangles,
        )


def shape_arrays(mi: ModuleType, node: Node, unread: Counter[str]) -> ShapeArrays | None:
    """The shape, None and a count in ``unread`` if it has no surface that can be lit. Raises UnreadableMesh."""
    if node.plugin == "ply" and node.made is None and isinstance(node.values.get("filename"), str):
        # Mitsuba's reader takes minutes over some damaged files.
        read_ply(read_regular(node.values["filename"], limit=_LARGEST_FILE))
    shape = load_object(mi, node, without=("BSDF", "Emitter", "Sensor", "Medium"))
    kind = shape.class_name()
    if kind in _ROUND:
        return _tessellated(mi, shape, kind, unread)
    if not isinstance(shape, mi.Mesh):
        unread[f"shapes of type {node.plugin} not read: no triangles"] += 1
        return None
    return _mesh(mi, shape)


def matrix_of(transform: Any) -> np.ndarray:
    """(4, 4) float64 of one of Mitsuba's transforms."""
    matrix = np.array(transform.matrix, np.float64)
    return matrix.reshape(4, 4)


def _tessellated(mi: ModuleType, shape: Any, kind: str, unread: Counter[str]) -> ShapeArrays:
    if kind != "Rectangle":
        unread[f"round shapes made of flat facets, {tessellation.AROUND} around"] += 1
    facets = _ROUND[kind]()
    arrays = ShapeArrays(facets.positions, facets.triangles, facets.normals, facets.uv)
    matrix = matrix_of(mi.traverse(shape)["to_world"])
    flipped = shape.has_flipped_normals()
    if kind == "Cylinder" and is_mirrored(matrix[:3, :3]):
        flipped = not flipped  # a mirrored one says the other thing than it does
    placed = arrays.placed(matrix)
    return _flipped(placed) if flipped else placed


def _mesh(mi: ModuleType, mesh: Any) -> ShapeArrays:
    parameters = mi.traverse(mesh)
    check_counts(mesh.vertex_count(), mesh.face_count())
    positions = np.array(parameters["vertex_positions"], np.float64).reshape(-1, 3)
    triangles = np.array(parameters["faces"]).astype(np.int64).reshape(-1, 3)
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(positions):
        raise UnreadableMesh(f"triangles of {mesh.id()} use vertices that are not there")
    has_uv, coloured = mesh.has_vertex_texcoords(), VERTEX_COLOUR in parameters
    uv = np.array(parameters["vertex_texcoords"], np.float64).reshape(-1, 2) if has_uv else None
    colours = (
        np.array(parameters[VERTEX_COLOUR], np.float64).reshape(len(positions), -1) if coloured else None
    )
    if colours is not None and colours.shape[1] != 3:
        colours = None
    if mesh.has_vertex_normals():
        normals = np.array(parameters["vertex_normals"], np.float64).reshape(-1, 3)
        arrays = _facing(ShapeArrays(positions, triangles.astype(np.int32), normals, uv, colours))
    else:
        arrays = _with_flat_faces(ShapeArrays(positions, triangles.astype(np.int32), positions, uv, colours))
    return _flipped(arrays) if mesh.has_flipped_normals() else arrays


def _facing(arrays: ShapeArrays) -> ShapeArrays:
    """Triangles wound counter-clockwise about their vertices' normals, which say what is outside."""
    a, b, c = (arrays.positions[arrays.triangles[:, k]] for k in range(3))
    out = arrays.normals[arrays.triangles].sum(axis=1)
    wrong = np.einsum("ij,ij->i", np.cross(b - a, c - a), out) < 0
    return replace(arrays, triangles=np.where(wrong[:, None], arrays.triangles[:, ::-1], arrays.triangles))


def _with_flat_faces(arrays: ShapeArrays) -> ShapeArrays:
    """Shaded flat: a vertex for every direction that the triangles around it face."""
    a, b, c = (arrays.positions[arrays.triangles[:, k]] for k in range(3))
    face = _unit(np.cross(b - a, c - a))
    key = np.concatenate(
        [arrays.triangles.reshape(-1, 1), np.repeat(np.rint(face * 4096), 3, axis=0).astype(np.int64)], axis=1
    )
    _, first, corner = np.unique(key, axis=0, return_index=True, return_inverse=True)
    vertex = arrays.triangles.ravel()[first]
    return ShapeArrays(
        arrays.positions[vertex],
        corner.reshape(-1, 3).astype(np.int32),
        face[first // 3],
        None if arrays.uv is None else arrays.uv[vertex],
        None if arrays.colours is None else arrays.colours[vertex],
    )


def _flipped(arrays: ShapeArrays) -> ShapeArrays:
    return replace(arrays, triangles=arrays.triangles[:, ::-1], normals=-arrays.normals)


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)

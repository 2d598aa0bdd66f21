"""An OBJ file and its MTL files as a mesh: distinct corners become vertices, in order of first use."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from ...files import Resolver
from ...material import GREY, Material
from ..mesh import MeshAsRead, UnreadableMesh, check_counts, linear_from_srgb, short_name
from .mtl import MapStatement, read_libraries
from .polygons import triangles_of
from .statements import Statements, read_statements
from .surfaces import TextureShelf, surface_of

_LARGEST_TEXT = 1_000_000_000
_MOST_MATERIALS = 20_000
_NAMED = 8


@dataclass(frozen=True)
class _Surfaces:
    """The materials that faces use, in order of first use."""

    materials: tuple[Material, ...]
    placements: list[MapStatement | None]
    textures: tuple[np.ndarray, ...]
    notes: list[str]


def read_obj(data: bytes, *, files: Resolver) -> MeshAsRead:
    """The mesh in an OBJ file; ``files`` reads its material libraries and their textures.

    A vertex is a distinct (v, vt, vn) of a material, in order of first use; texture coordinates are turned
    to v down. What is missing beside the file costs a note. Raises UnreadableMesh for what is wrong in it.
    """
    if len(data) > _LARGEST_TEXT:
        raise UnreadableMesh(
            f"{len(data) / 1e6:.0f} MB of text, at most {_LARGEST_TEXT / 1e6:.0f} MB are read"
        )
    file = read_statements(data)
    notes = list(file.notes)
    if len(file.sizes) == 0:
        raise UnreadableMesh("no faces (lines 'f' with three corners or more): a mesh is needed")
    check_counts(0, int((file.sizes - 2).sum()))
    used, material_of_face = _in_order_of_use(file.material_of)
    if len(used) > _MOST_MATERIALS:
        raise UnreadableMesh(f"{len(used):,} materials, at most {_MOST_MATERIALS:,} are read; join some")
    surfaces = _surfaces(file, used.tolist(), files)
    triangles, polygon = triangles_of(file.positions[file.corners[:, 0]], file.sizes, notes)
    first, vertex_of = _distinct(*file.corners.T, np.repeat(material_of_face, file.sizes))
    check_counts(len(first), len(triangles))
    v, vt, vn = file.corners[first].T
    material_of_vertex = np.repeat(material_of_face, file.sizes)[first]
    notes += surfaces.notes
    tint = _tint(file, v, surfaces.materials, material_of_vertex, notes)
    uv = _coordinates(file.coordinates, vt, surfaces, material_of_vertex, notes)
    return MeshAsRead(
        file.positions[v],
        vertex_of[triangles].astype(np.int32),
        _picked(file.normals, vn),
        tint,
        tuple(notes),
        surfaces.materials,
        material_of_face[polygon].astype(np.int32),
        uv,
        surfaces.textures,
    )


def _in_order_of_use(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distinct values in order of first use, and which of them each is."""
    _, first, of = np.unique(values, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return values[first[order]], rank[of]


def _distinct(*columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where each distinct row first stands, in that order, and which of them every row is."""
    label = np.zeros(len(columns[0]), np.int64)
    for column in columns:
        # Below 2³¹ labels and as many values: the product fits.
        label = np.unique(label * (int(column.max()) + 2) + column + 1, return_inverse=True)[1]
    _, first, of = np.unique(label, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return first[order], rank[of]


def _picked(rows: np.ndarray, index: np.ndarray) -> np.ndarray | None:
    """Rows by index, zero where it is -1; None if all are."""
    if (index < 0).all():
        return None
    return np.where(index[:, None] < 0, 0.0, rows[index])


def _surfaces(file: Statements, used: list[int], resolver: Resolver) -> _Surfaces:
    notes: list[str] = []
    entries = read_libraries(file.libraries, resolver, notes)
    shelf, unread = TextureShelf(resolver), Counter[str]()
    materials, placements, missing = [], [], []
    plain = GREY if file.colours is None else (1.0, 1.0, 1.0)
    for index in used:
        name = file.materials[index] if index >= 0 else "none"
        entry = entries.get(name) if index >= 0 else None
        if entry is not None:
            material, placed = surface_of(entry, shelf, unread)
        else:
            material, placed = Material(short_name(name), plain), None
            if index >= 0:
                missing.append(f"'{short_name(name)}'")
        materials.append(material)
        placements.append(placed)
    if missing:
        more = f" and {len(missing) - _NAMED:,} more" if len(missing) > _NAMED else ""
        notes.append(f"materials not described, grey used: {', '.join(missing[:_NAMED])}{more}")
    found = [f"{short_name(what)} ({n:,})" for what, n in unread.most_common() if n]
    if found:
        more = f" and {len(found) - _NAMED:,} more" if len(found) > _NAMED else ""
        notes.append(f"of materials not used: {', '.join(found[:_NAMED])}{more}")
    return _Surfaces(tuple(materials), placements, tuple(shelf.textures), notes + shelf.notes)


def _tint(
    file: Statements,
    v: np.ndarray,
    materials: tuple[Material, ...],
    material_of_vertex: np.ndarray,
    notes: list[str],
) -> np.ndarray:
    """Material colour × vertex colour; a vertex without one is white among others that have one."""
    tint = np.array([material.colour for material in materials])[material_of_vertex]
    if file.colours is None:
        return tint
    notes.append("vertex colours taken as sRGB, as displayed")
    given = file.colours[v]
    given = np.where(np.isfinite(given).all(axis=1, keepdims=True), given, 1.0)
    return tint * linear_from_srgb(np.clip(given, 0, 1))


def _coordinates(
    rows: np.ndarray,
    vt: np.ndarray,
    surfaces: _Surfaces,
    material_of_vertex: np.ndarray,
    notes: list[str],
) -> np.ndarray | None:
    """(V, 2), v down, each material's scale and offset applied; None if no texture was read."""
    if not surfaces.textures:
        return None
    uv = np.zeros((len(vt), 2)) if len(rows) == 0 else np.where(vt[:, None] < 0, 0.0, rows[vt])
    textured = np.array([bool(material.textures) for material in surfaces.materials])[material_of_vertex]
    if bare := int((textured & (vt < 0)).sum()):
        notes.append(f"vertices under a texture without coordinates: {bare:,}; (0, 0) used")
    for k, placed in enumerate(surfaces.placements):
        if placed is not None:
            here = material_of_vertex == k
            uv[here] = uv[here] * placed.scale + placed.offset
    return np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1)

"""Meshes that a caller made with trimesh, which must be installed for them to exist."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import trimesh
from trimesh.visual.material import PBRMaterial

from .mesh import DEFAULT_ALBEDO, MeshAsRead, UnreadableMesh, check_counts, linear_from_srgb
from .normals import is_mirrored, normal_matrix


def read_trimesh(source: trimesh.Trimesh | trimesh.Scene) -> MeshAsRead:
    """Vertices as they are; a scene's in the order of its graph, transformed. Raises UnreadableMesh."""
    if isinstance(source, trimesh.Trimesh):
        placed = [(source, np.eye(4))]
    else:
        graph = [source.graph[node] for node in source.graph.nodes_geometry]
        placed = [(source.geometry[name], np.asarray(matrix)) for matrix, name in graph]
    meshes = [(mesh, matrix) for mesh, matrix in placed if isinstance(mesh, trimesh.Trimesh)]
    unread = Counter({"points and curves not read": len(placed) - len(meshes)})
    if not meshes:
        raise UnreadableMesh("no triangles in it: a mesh is needed")
    check_counts(sum(len(m.vertices) for m, _ in meshes), sum(len(m.faces) for m, _ in meshes))
    positions, normals, triangles, albedo, first = [], [], [], [], 0
    for mesh, matrix in meshes:
        linear = matrix[:3, :3]
        positions.append(mesh.vertices @ linear.T + matrix[:3, 3])
        normals.append(mesh.vertex_normals @ normal_matrix(linear).T)
        triangles.append((mesh.faces[:, ::-1] if is_mirrored(linear) else mesh.faces) + first)
        albedo.append(np.broadcast_to(_albedo(mesh, unread), (len(mesh.vertices), 3)))
        first += len(mesh.vertices)
    notes = tuple(f"{what} (meshes: {count:,})" for what, count in unread.items() if count)
    return MeshAsRead(
        np.concatenate(positions),
        np.concatenate(triangles),
        np.concatenate(normals),
        np.concatenate(albedo),
        notes,
    )


def _albedo(mesh: trimesh.Trimesh, unread: Counter[str]) -> np.ndarray:
    """Linear colour, (3,) or (V, 3); counts what is not read."""
    grey = np.full(3, DEFAULT_ALBEDO)
    visual: Any = mesh.visual  # colours, a texture or nothing: told apart by their attributes
    kind = getattr(visual, "kind", None)
    if kind == "vertex":
        return linear_from_srgb(np.asarray(visual.vertex_colors)[:, :3] / 255)
    if kind == "face":
        unread["face colours not read, grey used"] += 1
        return grey
    material = getattr(visual, "material", None)
    if material is None:
        return grey
    if any(getattr(material, name, None) is not None for name in ("baseColorTexture", "image")):
        unread["base colour texture not read, its factor used"] += 1
    if isinstance(material, PBRMaterial):
        factor = material.baseColorFactor
        return np.ones(3) if factor is None else np.asarray(factor)[:3] / 255  # linear, as glTF
    return linear_from_srgb(np.asarray(material.main_color)[:3] / 255)

"""Triangles, normals and base colours of a GLB file, every node's transform applied."""

from __future__ import annotations

import numpy as np

from ..mesh import MeshAsRead, UnreadableMesh, check_counts, short_name
from ..normals import is_mirrored, normal_matrix
from .accessors import check_bounds
from .container import read_chunks
from .document import MOST_ITEMS, Document, parse_document
from .materials import unused_of_materials
from .nodes import placed_nodes
from .primitives import LocalMesh, check_primitive, read_primitive

_READ_EXTENSIONS = {"KHR_mesh_quantization", "KHR_materials_pbrSpecularGlossiness"}
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_punctual", "KHR_xmp")
_NAMED_EXTENSIONS = 8


def read_glb(data: bytes) -> MeshAsRead:
    """The default scene of a GLB file. Raises UnreadableMesh, or ValueError and its kin for damage."""
    text, binary = read_chunks(data)
    document = parse_document(text)
    _refuse_unsupported(document)
    check_bounds(document, binary)
    matrices = placed_nodes(document)
    notes = unused_of_materials(document.materials) + _notes(document)
    pieces = _pieces(document, [node for node in matrices if document.nodes[node].mesh is not None], notes)
    if not pieces:
        raise UnreadableMesh("no triangles in its default scene: a mesh is needed")
    vertices, triangles = _counts(document, pieces)
    check_counts(vertices, triangles)

    positions, normals, albedo = (np.zeros((vertices, 3), np.float32) for _ in range(3))
    corners = np.empty((triangles, 3), np.int32)
    known: dict[tuple[int, int], LocalMesh] = {}
    v, t = 0, 0
    for node, mesh, k in pieces:
        local = known.get((mesh, k))
        if local is None:
            local = known[mesh, k] = read_primitive(document, binary, document.meshes[mesh].primitives[k])
        linear, shift = matrices[node][:3, :3], matrices[node][:3, 3]
        here = slice(v, v + len(local.positions))
        positions[here] = local.positions @ linear.T + shift
        if local.normals is not None:
            normals[here] = local.normals @ normal_matrix(linear).T
        albedo[here] = local.albedo
        faces = local.triangles[:, ::-1] if is_mirrored(linear) else local.triangles
        corners[t : t + len(faces)] = faces + v
        v, t = here.stop, t + len(faces)
    given = normals if any(local.normals is not None for local in known.values()) else None
    return MeshAsRead(positions, corners, given, albedo, tuple(notes))


def _refuse_unsupported(document: Document) -> None:
    version = document.asset.version
    if not version.startswith("2."):
        raise UnreadableMesh(f"glTF version '{short_name(version)}', expected 2.0", "/asset/version")
    for name in document.extensionsRequired:
        if name not in _READ_EXTENSIONS and not name.startswith(_HARMLESS):
            what = f"needs the extension {short_name(name)}"
            raise UnreadableMesh(f"{what}, which is not read: export without it", "/extensionsRequired")


def _pieces(document: Document, nodes: list[int], notes: list[str]) -> list[tuple[int, int, int]]:
    """Node, mesh and primitive of everything that has triangles, in file order, each primitive checked."""
    pieces, checked, skipped = [], set(), 0
    for node in nodes:
        mesh = document.nodes[node].mesh or 0
        for k, primitive in enumerate(document.meshes[mesh].primitives):
            if primitive.mode < 4 or primitive.attributes.POSITION is None:
                skipped += 1
                continue
            if len(pieces) == MOST_ITEMS:
                raise UnreadableMesh(f"more than {MOST_ITEMS:,} placed primitives; join them")
            if (mesh, k) not in checked:
                check_primitive(document, primitive, f"/meshes/{mesh}/primitives/{k}")
                checked.add((mesh, k))
            pieces.append((node, mesh, k))
    if skipped:
        notes.append(f"primitives of points or lines not read: {skipped:,}")
    return pieces


def _counts(document: Document, pieces: list[tuple[int, int, int]]) -> tuple[int, int]:
    """Vertices and triangles in all, from the checked accessors."""
    vertices = triangles = 0
    for _, mesh, k in pieces:
        primitive = document.meshes[mesh].primitives[k]
        count = document.accessors[primitive.attributes.POSITION or 0].count
        corners = count if primitive.indices is None else document.accessors[primitive.indices].count
        vertices += count
        triangles += corners // 3 if primitive.mode == 4 else corners - 2
    return vertices, triangles


def _notes(document: Document) -> list[str]:
    """What the file holds that is not read: extensions, skins, morph targets."""
    unread = [name for name in document.extensionsUsed if name not in _READ_EXTENSIONS]
    notes = [f"extension {short_name(name)} not read" for name in unread[:_NAMED_EXTENSIONS]]
    if any(node.skin is not None for node in document.nodes):
        notes.append("skins not applied: the mesh stands as it was modelled")
    if any(primitive.targets for mesh in document.meshes for primitive in mesh.primitives):
        notes.append("morph targets not applied: the mesh stands as it was modelled")
    return notes

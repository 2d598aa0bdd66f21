"""A glTF file's default scene: every node's transform applied, materials, textures and cameras with it."""

from __future__ import annotations

from collections import Counter

import numpy as np

from ...files import Resolver
from ..mesh import MeshAsRead, UnreadableMesh, check_counts, short_name
from .accessors import Numbers, check_bounds
from .buffers import Bytes
from .container import check_json_size, read_chunks
from .document import Document, parse_document
from .eyes import read_cameras
from .fields import MOST_ITEMS
from .instances import count_instances, instance_matrices
from .materials import Looks
from .nodes import placed_nodes
from .placing import Arrays, Stands
from .primitives import check_primitive, count_primitive, read_primitive
from .textures import TextureShelf

_READ_EXTENSIONS = {
    "EXT_mesh_gpu_instancing", "KHR_draco_mesh_compression", "KHR_lights_punctual", "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular", "KHR_materials_transmission", "KHR_materials_unlit", "KHR_mesh_quantization",
    "KHR_node_visibility", "KHR_texture_transform",
}  # fmt: skip
# A file that requires these is read without them: they change how it looks, not where its surfaces are.
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "EXT_lights_", "KHR_xmp")
_REFUSED = {
    "KHR_draco_mesh_compression": "export without mesh compression (Draco)",
    "EXT_meshopt_compression": "export without meshopt compression (gltfpack: without -c and -cc)",
    "KHR_meshopt_compression": "export without meshopt compression (gltfpack: without -c and -cc)",
}
_NAMED_EXTENSIONS = 8


def read_glb(data: bytes, files: Resolver | None = None) -> MeshAsRead:
    """The default scene of a GLB file, which may name files in ``files``.

    Raises UnreadableMesh, or ValueError and its kin for damage.
    """
    text, binary = read_chunks(data)
    return _read(parse_document(text), binary, files)


def read_gltf(data: bytes, files: Resolver | None = None) -> MeshAsRead:
    """The default scene of a .gltf file (JSON); its buffers and images are inside it or in ``files``.

    Raises UnreadableMesh, or ValueError and its kin for damage.
    """
    check_json_size(data)
    return _read(parse_document(data), memoryview(b""), files)


def _read(document: Document, chunk: memoryview, files: Resolver | None) -> MeshAsRead:
    _refuse_unsupported(document)
    check_bounds(document)
    matrices = placed_nodes(document)
    pieces, skipped = _pieces(document, [k for k in matrices if document.nodes[k].mesh is not None])
    if not pieces:
        raise UnreadableMesh("no triangles in its default scene: a mesh is needed")
    check_counts(*_counts(document, pieces))
    bytes_ = Bytes(document, chunk, files)
    numbers = Numbers(document, bytes_)
    looks = Looks(document.materials, TextureShelf(document, bytes_))

    arrays, unclear = _placed(numbers, looks, pieces, matrices)
    notes = looks.notes() + unclear + _notes(document, matrices)
    if skipped:
        notes.append(f"primitives of points or lines not read: {skipped:,}")
    cameras = read_cameras(document, matrices, positions=arrays.positions, notes=notes)
    return MeshAsRead(
        arrays.positions, arrays.triangles, arrays.normals, arrays.tint, tuple(notes), tuple(arrays.materials),
        arrays.material_of, arrays.uv, tuple(looks.shelf.pictures), cameras,
    )  # fmt: skip


def _refuse_unsupported(document: Document) -> None:
    version = document.asset.version
    if not version.startswith("2."):
        raise UnreadableMesh(f"glTF version '{short_name(version)}', expected 2.0", "/asset/version")
    for name in document.extensionsRequired:
        if name in _REFUSED or not (name in _READ_EXTENSIONS or name.startswith(_HARMLESS)):
            remedy = _REFUSED.get(name, "export without it")
            reason = f"needs the extension {short_name(name)}, which is not read: {remedy}"
            raise UnreadableMesh(reason, "/extensionsRequired")


def _pieces(document: Document, nodes: list[int]) -> tuple[list[tuple[int, int, int]], int]:
    """Node, mesh and primitive of everything that has triangles, in file order, each primitive checked.

    And how many primitives have none.
    """
    pieces, checked, skipped = [], set(), 0
    for node in nodes:
        mesh = document.nodes[node].mesh or 0
        for k, primitive in enumerate(document.meshes[mesh].primitives):
            if primitive.mode < 4 or "POSITION" not in primitive.attributes:
                skipped += 1
                continue
            if len(pieces) == MOST_ITEMS:
                raise UnreadableMesh(f"more than {MOST_ITEMS:,} placed primitives; join them")
            if (mesh, k) not in checked:
                check_primitive(document, primitive, f"/meshes/{mesh}/primitives/{k}")
                checked.add((mesh, k))
            pieces.append((node, mesh, k))
    return pieces, skipped


def _counts(document: Document, pieces: list[tuple[int, int, int]]) -> tuple[int, int]:
    """Vertices and triangles in all, from the checked accessors."""
    vertices = triangles = 0
    for node, mesh, k in pieces:
        copies = count_instances(document, document.nodes[node], f"/nodes/{node}")
        v, f = count_primitive(document, document.meshes[mesh].primitives[k])
        vertices, triangles = vertices + copies * v, triangles + copies * f
    return vertices, triangles


def _placed(
    numbers: Numbers, looks: Looks, pieces: list[tuple[int, int, int]], matrices: dict[int, np.ndarray]
) -> tuple[Arrays, list[str]]:
    """The scene's arrays: node after node, of each its primitives, of each its instances.

    Primitives are read one at a time and written wherever they stand. Of vertices that several primitives
    share, each keeps those its triangles use.
    """
    document, stands, v, t, last = numbers.document, {}, 0, 0, -1
    for node, mesh, k in pieces:
        if node != last:
            worlds, last = instance_matrices(numbers, document.nodes[node], world=matrices[node]), node
        vertices, triangles = count_primitive(document, document.meshes[mesh].primitives[k])
        here = stands.setdefault((mesh, k), Stands())
        here.matrices.append(worlds)
        here.vertices.append(v + vertices * np.arange(len(worlds)))
        here.triangles.append(t + triangles * np.arange(len(worlds)))
        v, t = v + vertices * len(worlds), t + triangles * len(worlds)
    primitives = {key: document.meshes[key[0]].primitives[key[1]] for key in stands}
    found = {key: looks.find(primitive.material) for key, primitive in primitives.items()}
    arrays = Arrays(
        v,
        t,
        normals=any("NORMAL" in primitive.attributes for primitive in primitives.values()),
        uv=any(look.mapping for look in found.values()),
    )
    plain = folded = 0
    readers = Counter(primitive.attributes["POSITION"] for primitive in primitives.values())
    shared = np.zeros(v, bool)
    for key, primitive in primitives.items():
        local = read_primitive(numbers, primitive, found[key])
        plain += local.uv is None and found[key].mapping is not None
        folded += local.folded
        arrays.place(local, stands[key])
        if readers[primitive.attributes["POSITION"]] > 1:
            for first in np.concatenate(stands[key].vertices):
                shared[first : first + len(local.positions)] = True
    arrays.drop_unused(shared)
    notes = []
    if plain:
        notes.append(f"primitives without the coordinates of their texture drawn without it: {plain:,}")
    if folded:
        notes.append(
            f"primitives beyond the edge of a clamped or mirrored texture: {folded:,}; folded at vertices"
        )
    return arrays, notes


def _notes(document: Document, matrices: dict[int, np.ndarray]) -> list[str]:
    """What the file holds that is not read: extensions, lights, skins, morph targets, animations."""
    notes = []
    if unread := [short_name(name) for name in document.extensionsUsed if name not in _READ_EXTENSIONS]:
        more = f" and {len(unread) - _NAMED_EXTENSIONS:,} more" if len(unread) > _NAMED_EXTENSIONS else ""
        notes.append(f"extensions not read: {', '.join(unread[:_NAMED_EXTENSIONS])}{more}")
    nodes = [document.nodes[k] for k in matrices]
    if lamps := sum(node.extensions.KHR_lights_punctual is not None for node in nodes):
        notes.append(f"lights not in the bake: {lamps:,}; prelight rig lamps makes a rig of them")
    if any(node.skin is not None for node in nodes):
        notes.append("skins not applied: the mesh stands as it was modelled")
    if any(primitive.targets for mesh in document.meshes for primitive in mesh.primitives):
        notes.append("morph targets not applied: the mesh stands as it was modelled")
    if document.animations:
        notes.append(f"animations not applied: {len(document.animations):,}")
    return notes

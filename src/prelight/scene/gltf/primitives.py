"""One primitive of a glTF mesh: its triangles, normals, colours and coordinates before any node moves it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...material import Material
from ..mesh import UnreadableMesh
from .accessors import Numbers
from .document import Document, Primitive
from .materials import Look

_TRIANGLES, _FAN = 4, 6


@dataclass(frozen=True)
class LocalMesh:
    """Arrays in the coordinates of the mesh."""

    positions: np.ndarray  # (V, 3) float64
    triangles: np.ndarray  # (F, 3) int32, in range
    normals: np.ndarray | None  # (V, 3) float64, as the file has them
    tint: np.ndarray  # (3,) or (V, 3) linear
    uv: np.ndarray | None  # (V, 2) on the pictures of its material
    material: Material
    folded: bool = False  # whether coordinates beyond a picture's edge were folded back


def count_primitive(document: Document, primitive: Primitive) -> tuple[int, int]:
    """Vertices and triangles of a primitive that `check_primitive` has passed."""
    vertices = document.accessors[primitive.attributes["POSITION"]].count
    corners = vertices if primitive.indices is None else document.accessors[primitive.indices].count
    return vertices, corners // 3 if primitive.mode == _TRIANGLES else corners - 2


def check_primitive(document: Document, primitive: Primitive, where: str) -> None:
    """Raises UnreadableMesh unless what a primitive of triangles points at exists and fits together."""
    for index, known, what in (
        *((index, document.accessors, "accessor") for index in primitive.attributes.values()),
        (primitive.indices, document.accessors, "accessor"),
        (primitive.material, document.materials, "material"),
    ):
        if index is not None and index >= len(known):
            raise UnreadableMesh(f"damaged glTF file: there is no {what} {index}", where)
    position = document.accessors[primitive.attributes["POSITION"]]
    for name, index in primitive.attributes.items():
        if (other := document.accessors[index].count) != position.count:
            reason = f"{name} has {other:,} entries, POSITION {position.count:,}"
            raise UnreadableMesh(f"damaged glTF file: {reason}", f"{where}/attributes")
    if position.bufferView is None and position.sparse is None:
        draco = primitive.extensions.KHR_draco_mesh_compression is not None
        reason = "compressed with Draco, which is not read" if draco else "its positions have no data"
        raise UnreadableMesh(f"{reason}: export without mesh compression", where)
    corners = position.count if primitive.indices is None else document.accessors[primitive.indices].count
    if corners < 3 or (primitive.mode == _TRIANGLES and corners % 3):
        raise UnreadableMesh(f"damaged glTF file: {corners:,} corners do not make whole triangles", where)


def read_primitive(numbers: Numbers, primitive: Primitive, look: Look) -> LocalMesh:
    """The arrays of a primitive that `check_primitive` has passed. Raises UnreadableMesh."""
    used = primitive.attributes
    positions = numbers.read(used["POSITION"], "VEC3")
    tint = np.array(look.material.colour)
    if "COLOR_0" in used:
        tint = numbers.read(used["COLOR_0"], "VEC3", "VEC4")[:, :3] * tint
    normals = numbers.read(used["NORMAL"], "VEC3") if "NORMAL" in used else None
    corners = _corners(numbers, primitive, vertices=len(positions))
    triangles = _triangles(corners, primitive.mode)
    name = None if look.mapping is None else f"TEXCOORD_{look.mapping.texcoord}"
    if look.mapping is None or name not in used:
        return LocalMesh(positions, triangles, normals, tint, None, look.untextured)
    uv, folded = look.mapping.apply(numbers.read(used[name], "VEC2"))
    return LocalMesh(positions, triangles, normals, tint, uv, look.material, folded)


def _corners(numbers: Numbers, primitive: Primitive, *, vertices: int) -> np.ndarray:
    if primitive.indices is None:
        return np.arange(vertices, dtype=np.int32)
    where = f"/accessors/{primitive.indices}"
    corners = numbers.read(primitive.indices, "SCALAR").reshape(-1)
    if corners.dtype.kind != "u":
        raise UnreadableMesh("damaged glTF file: indices must be unsigned", where)
    if (largest := int(corners.max())) >= vertices:
        raise UnreadableMesh(f"damaged glTF file: index {largest:,} into {vertices:,} vertices", where)
    return corners.astype(np.int32)


def _triangles(corners: np.ndarray, mode: int) -> np.ndarray:
    if mode == _TRIANGLES:
        return corners.reshape(-1, 3)
    if mode == _FAN:
        return np.stack([np.broadcast_to(corners[0], len(corners) - 2), corners[1:-1], corners[2:]], axis=1)
    strip = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    strip[1::2] = strip[1::2, [1, 0, 2]]  # every other triangle of a strip runs the other way
    return strip

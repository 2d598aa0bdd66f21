"""One primitive of a glTF mesh: its triangles, normals and colours before any node moves it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mesh import UnreadableMesh
from .accessors import read_accessor
from .document import Document, Primitive
from .materials import base_colour

_TRIANGLES, _FAN = 4, 6


@dataclass(frozen=True)
class LocalMesh:
    """Arrays in the coordinates of the mesh."""

    positions: np.ndarray  # (V, 3) float64
    triangles: np.ndarray  # (F, 3) int32, in range
    normals: np.ndarray | None  # (V, 3) float64, as the file has them
    albedo: np.ndarray  # (3,) or (V, 3) linear


def check_primitive(document: Document, primitive: Primitive, where: str) -> None:
    """Raises UnreadableMesh unless what a primitive of triangles points at exists and fits together."""
    used = primitive.attributes
    accessors = [i for i in (used.POSITION, used.NORMAL, used.COLOR_0, primitive.indices) if i is not None]
    for index, known, what in (
        *((index, document.accessors, "accessor") for index in accessors),
        (primitive.material, document.materials, "material"),
    ):
        if index is not None and index >= len(known):
            raise UnreadableMesh(f"damaged GLB file: there is no {what} {index}", where)
    position = document.accessors[accessors[0]]
    for name, index in (("NORMAL", used.NORMAL), ("COLOR_0", used.COLOR_0)):
        if index is not None and (other := document.accessors[index].count) != position.count:
            reason = f"{name} has {other:,} entries, POSITION {position.count:,}"
            raise UnreadableMesh(f"damaged GLB file: {reason}", f"{where}/attributes")
    if position.bufferView is None:
        draco = primitive.extensions.KHR_draco_mesh_compression is not None
        reason = "compressed with Draco, which is not read" if draco else "its positions have no data"
        raise UnreadableMesh(f"{reason}: export without compression", where)
    corners = position.count if primitive.indices is None else document.accessors[primitive.indices].count
    if corners < 3 or (primitive.mode == _TRIANGLES and corners % 3):
        raise UnreadableMesh(f"damaged GLB file: {corners:,} corners do not make whole triangles", where)


def read_primitive(document: Document, binary: memoryview, primitive: Primitive) -> LocalMesh:
    """The arrays of a primitive that `check_primitive` has passed. Raises UnreadableMesh."""

    def vectors(index: int, *kinds: str) -> np.ndarray:
        return read_accessor(document, binary, index, kinds=kinds)

    used = primitive.attributes
    positions = vectors(used.POSITION or 0, "VEC3")
    albedo = np.ones(3)
    if primitive.material is not None:
        albedo = np.array(base_colour(document.materials[primitive.material])[0][:3])
    if used.COLOR_0 is not None:
        albedo = vectors(used.COLOR_0, "VEC3", "VEC4")[:, :3] * albedo
    normals = None if used.NORMAL is None else vectors(used.NORMAL, "VEC3")
    corners = _corners(document, binary, primitive, vertices=len(positions))
    return LocalMesh(positions, _triangles(corners, primitive.mode), normals, albedo)


def _corners(document: Document, binary: memoryview, primitive: Primitive, *, vertices: int) -> np.ndarray:
    if primitive.indices is None:
        return np.arange(vertices, dtype=np.int32)
    where = f"/accessors/{primitive.indices}"
    corners = read_accessor(document, binary, primitive.indices, kinds=("SCALAR",)).reshape(-1)
    if corners.dtype.kind != "u":
        raise UnreadableMesh("damaged GLB file: indices must be unsigned", where)
    if (largest := int(corners.max())) >= vertices:
        raise UnreadableMesh(f"damaged GLB file: index {largest:,} into {vertices:,} vertices", where)
    return corners.astype(np.int32)


def _triangles(corners: np.ndarray, mode: int) -> np.ndarray:
    if mode == _TRIANGLES:
        return corners.reshape(-1, 3)
    if mode == _FAN:
        return np.stack([np.broadcast_to(corners[0], len(corners) - 2), corners[1:-1], corners[2:]], axis=1)
    strip = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    strip[1::2] = strip[1::2, [1, 0, 2]]  # every other triangle of a strip runs the other way
    return strip

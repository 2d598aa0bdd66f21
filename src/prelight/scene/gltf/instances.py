"""Where a node's mesh stands: once, or as often as `EXT_mesh_gpu_instancing` says."""

from __future__ import annotations

import numpy as np

from ...arrays import Float64
from ..mesh import UnreadableMesh
from .accessors import Numbers
from .document import Document, Node
from .nodes import rotations

_PARTS = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}


def count_instances(document: Document, node: Node, where: str) -> int:
    """How many there are, before anything is read. Raises UnreadableMesh where the file contradicts itself."""
    given = node.extensions.EXT_mesh_gpu_instancing
    if given is None:
        return 1
    where, counts = f"{where}/extensions/EXT_mesh_gpu_instancing", set()
    for index in given.attributes.values():
        if index >= len(document.accessors):
            raise UnreadableMesh(f"damaged glTF file: there is no accessor {index}", where)
        counts.add(document.accessors[index].count)
    if len(counts) > 1:
        raise UnreadableMesh("damaged glTF file: its attributes differ in number", where)
    return counts.pop()


def instance_matrices(
    numbers: Numbers, node: Node, *, world: Float64[np.ndarray, "4 4"]
) -> Float64[np.ndarray, "instances 4 4"]:
    """World matrices of all instances: the node's, times translation · rotation · scale of each.

    `count_instances` must have passed. Raises UnreadableMesh for accessors of another type.
    """
    given = node.extensions.EXT_mesh_gpu_instancing
    if given is None:
        return world[None]
    used = given.attributes
    read = {name: numbers.read(used[name], kind) for name, kind in _PARTS.items() if name in used}
    count = numbers.document.accessors[next(iter(used.values()))].count
    own = np.tile(np.eye(4), (count, 1, 1))
    if "ROTATION" in read:
        length = np.linalg.norm(read["ROTATION"], axis=1, keepdims=True)
        if not (np.isfinite(length) & (length > 0)).all():
            where = f"/accessors/{used['ROTATION']}"
            raise UnreadableMesh("damaged glTF file: a rotation is no unit quaternion", where)
        own[:, :3, :3] = rotations(read["ROTATION"] / length)
    if "SCALE" in read:
        own[:, :3, :3] *= read["SCALE"][:, None]
    if "TRANSLATION" in read:
        own[:, :3, 3] = read["TRANSLATION"]
    return world @ own

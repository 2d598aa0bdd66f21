"""The node tree of a glTF document: which nodes stand where in the world."""

from __future__ import annotations

import math

import numpy as np

from ...arrays import Float64
from ..mesh import UnreadableMesh
from .document import Document, Node


def placed_nodes(document: Document) -> dict[int, Float64[np.ndarray, "4 4"]]:
    """World matrix of every visible node of the default scene, in the order of their indices.

    Raises UnreadableMesh unless the nodes are trees: each at most one parent, none its own ancestor.
    """
    _check_references(document)
    parent = _parents(document)
    roots = _roots(document, parent)
    placed: dict[int, np.ndarray] = {}
    waiting = [(root, np.eye(4)) for root in roots]
    while waiting:
        index, above = waiting.pop()
        if index in placed:
            raise UnreadableMesh(f"damaged glTF file: the scene holds node {index} twice", "/scenes")
        node = document.nodes[index]
        if not node.extensions.KHR_node_visibility.visible:
            continue  # and nothing below it
        world = above @ _local(node, f"/nodes/{index}")
        placed[index] = world
        waiting += [(child, world) for child in node.children]
    return dict(sorted(placed.items(), key=lambda item: item[0]))


def _check_references(document: Document) -> None:
    for k, node in enumerate(document.nodes):
        if node.mesh is not None and node.mesh >= len(document.meshes):
            raise UnreadableMesh(f"damaged glTF file: there is no mesh {node.mesh}", f"/nodes/{k}/mesh")
        if node.camera is not None and node.camera >= len(document.cameras):
            raise UnreadableMesh(f"damaged glTF file: there is no camera {node.camera}", f"/nodes/{k}/camera")


def _parents(document: Document) -> list[int]:
    """The parent of every node, -1 for a root."""
    count = len(document.nodes)
    parent = [-1] * count
    for k, node in enumerate(document.nodes):
        for child in node.children:
            if child >= count:
                raise UnreadableMesh(f"damaged glTF file: there is no node {child}", f"/nodes/{k}/children")
            if parent[child] >= 0:
                raise UnreadableMesh(
                    f"damaged glTF file: node {child} has two parents", f"/nodes/{k}/children"
                )
            parent[child] = k
    # With one parent each, whatever cannot be reached from a root goes in a circle.
    reached, waiting = 0, [k for k in range(count) if parent[k] < 0]
    while waiting:
        reached += 1
        waiting += document.nodes[waiting.pop()].children
    if reached < count:
        raise UnreadableMesh("damaged glTF file: a node is its own ancestor", "/nodes")
    return parent


def _roots(document: Document, parent: list[int]) -> list[int]:
    if not document.scenes:
        return [k for k, above in enumerate(parent) if above < 0]
    scene = document.scene or 0
    if scene >= len(document.scenes):
        raise UnreadableMesh(f"damaged glTF file: there is no scene {scene}", "/scene")
    for node in document.scenes[scene].nodes:
        if node >= len(parent) or parent[node] >= 0:
            raise UnreadableMesh(
                f"damaged glTF file: node {node} is no root of the scene", f"/scenes/{scene}/nodes"
            )
    return document.scenes[scene].nodes


def _local(node: Node, where: str) -> np.ndarray:
    """The node's own matrix, acting on columns: translation · rotation · scale, or the matrix it gives."""
    trs = (node.translation, node.rotation, node.scale)
    if node.matrix is not None:
        if any(part is not None for part in trs):
            raise UnreadableMesh(
                "damaged glTF file: it has a matrix and translation, rotation or scale", where
            )
        matrix = np.array(node.matrix).reshape(4, 4).T
        if np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-6:
            raise UnreadableMesh("damaged glTF file: its matrix is not affine", f"{where}/matrix")
        return matrix
    matrix = np.eye(4)
    if node.rotation is not None:
        length = math.hypot(*node.rotation)
        if not 0 < length < math.inf:
            raise UnreadableMesh("damaged glTF file: its rotation is no unit quaternion", f"{where}/rotation")
        matrix[:3, :3] = rotations(np.array(node.rotation) / length)
    if node.scale is not None:
        matrix[:3, :3] *= np.array(node.scale)
    matrix[:3, 3] = node.translation or (0.0, 0.0, 0.0)
    return matrix


def rotations(quaternions: Float64[np.ndarray, "... 4"]) -> Float64[np.ndarray, "... 3 3"]:
    """Matrices, acting on columns, of unit quaternions x, y, z, w."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))

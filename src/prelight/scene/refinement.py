"""Chosen edges halved, and triangles with them, so that no vertex lies within the edge of another triangle.

An edge is halved for all triangles along it, also across a seam where these share places but no vertices. With an
edge of a triangle its longest is halved, too: angles stay no less than half of what they were (Rivara, Algorithms for
refining triangular grids suitable for adaptive and multigrid techniques, 1984).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Float64, Int64
from .geometry import Scene
from .mesh import textured
from .midpoints import Midpoints

Edges = Int64[np.ndarray, "edges 2"]


class Seams:
    """Vertices by their places: edges that lie on each other are one."""

    def __init__(self, scene: Scene) -> None:
        rows = np.ascontiguousarray(scene.positions + np.float32(0))  # -0 is 0
        bits = rows.view(np.uint32).astype(np.uint64)
        _, first = np.unique(bits[:, 0] << np.uint64(32) | bits[:, 1], return_inverse=True)
        _, self.place = np.unique(first.astype(np.uint64) << np.uint64(32) | bits[:, 2], return_inverse=True)

    def keys(self, ends: Edges) -> Int64[np.ndarray, "edges"]:
        """A number for each edge, the same for those that lie on each other."""
        low, high = np.sort(self.place[ends].astype(np.int64), axis=1).T
        return low << 32 | high


def edges_of(triangles: np.ndarray) -> Edges:
    """Edges of triangles (F, 3), three each: (3·F, 2), the first between their first two corners."""
    return np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)


def unique_edges(triangles: np.ndarray) -> Edges:
    """Every pair of vertices that is an edge, once, the lower number first."""
    low, high = np.sort(edges_of(triangles), axis=1).T
    keys = np.unique(low << 32 | high)
    return np.stack([keys >> 32, keys & 0xFFFFFFFF], axis=1)


def halved(scene: Scene, chosen: Edges) -> tuple[Scene, Edges]:
    """The scene with the chosen edges halved, and those that must be with them; and the ends of each new vertex.

    Vertices keep their order, new ones follow; normals, coordinates and tints are interpolated, albedo is looked up
    in the texture anew. Parts follow where their triangle was, in its material. Places whose middle float32 does not
    know stay.
    """
    marked = _closed(scene, chosen)
    if not marked.any():
        return scene, np.empty((0, 2), np.int64)
    tint = scene.albedo if scene.tint is None else scene.tint
    vertices, count = (
        Midpoints(scene.positions, scene.normals, tint, scene.uv, longest=0.0),
        len(scene.positions),
    )
    sides = edges_of(scene.triangles)
    middle = np.full(3 * len(scene.triangles), -1, np.int64)
    middle[marked] = vertices.of(sides[marked])
    ends = np.empty((len(vertices.positions) - count, 2), np.int64)
    ends[middle[marked] - count] = sides[marked]
    triangles, parent = _parts(scene, middle.reshape(-1, 3))
    finer = replace(
        scene, positions=vertices.positions, normals=vertices.normals, triangles=triangles,
        material_of=np.ascontiguousarray(scene.material_of[parent]), uv=vertices.uv, albedo=vertices.tint, tint=None,
    )  # fmt: skip
    if scene.tint is None:
        return finer, ends
    finer = textured(finer)
    finer.albedo[:count] = scene.albedo
    return finer, ends


def _closed(scene: Scene, chosen: Edges) -> np.ndarray:
    """(3·F,) which edges of triangles are halved: the chosen, those on them, and the longest beside each of these."""
    sides, seams = edges_of(scene.triangles), Seams(scene)
    keys, number = np.unique(seams.keys(sides), return_inverse=True)
    lengths = _lengths(scene, sides).reshape(-1, 3)
    longest = 3 * np.arange(len(lengths)) + np.argmax(lengths, axis=1)
    wanted = np.isin(keys, seams.keys(chosen.astype(np.int64)))
    may = np.ones(len(keys), bool)
    may[number[~Midpoints(
        scene.positions, scene.normals, scene.albedo, None, longest=0.0
    ).are_long(sides)]] = False  # fmt: skip
    wanted &= may
    while True:
        marked = wanted[number].reshape(-1, 3).any(axis=1)
        more = np.zeros_like(wanted)
        more[number[longest[marked]]] = True
        more &= may & ~wanted
        if not more.any():
            return wanted[number]
        wanted |= more


def _lengths(scene: Scene, ends: Edges) -> Float64[np.ndarray, "edges"]:
    a, b = (scene.positions[ends[:, k]].astype(np.float64) for k in (0, 1))
    return np.linalg.norm(b - a, axis=1)


def _parts(scene: Scene, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles cut from the middle of an edge to the corner across, and the halves again; with their parents."""
    lengths = np.where(middle >= 0, _lengths(scene, edges_of(scene.triangles)).reshape(-1, 3), -1.0)
    first = np.argmax(lengths, axis=1)
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(scene.triangles.astype(np.int64), turn, axis=1).T
    ab, bc, ca = np.take_along_axis(middle, turn, axis=1).T
    whole, left, right = ab < 0, ca >= 0, bc >= 0
    found, parents = [], []
    for here, corners in (
        (whole, (a, b, c)),
        (~whole & ~left, (a, ab, c)), (~whole & left, (a, ab, ca)), (~whole & left, (ca, ab, c)),
        (~whole & ~right, (ab, b, c)), (~whole & right, (ab, b, bc)), (~whole & right, (ab, bc, c)),
    ):  # fmt: skip
        found.append(np.stack(corners, axis=1)[here])
        parents.append(np.flatnonzero(here))
    parent = np.concatenate(parents)
    order = np.argsort(parent, kind="stable")
    return np.ascontiguousarray(np.concatenate(found)[order], np.int32), parent[order]

"""Triangles split until no edge is longer than asked: receivers where a coarse mesh has none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..errors import InputError
from .geometry import Scene
from .mesh import textured
from .midpoints import Midpoints

MOST_VERTICES = 20_000_000


def subdivided(scene: Scene, longest_edge: float) -> Scene:
    """The scene with every triangle split until no edge is longer than ``longest_edge`` metres.

    Edges are halved, and halved again, until they are short enough; each does so alike for both its triangles,
    also across a seam where these share no vertices: no cracks arise. Vertices keep their order, new ones
    follow; normals, coordinates and tints are interpolated, albedo is looked up in the texture anew. Parts take
    the place of their triangle, in its material.

    A triangle with three long edges falls into four, or in two where it is very obtuse; one with two long edges
    becomes a strip, since halving a sliver again and again would make far more triangles than it needs.

    Raises InputError for a length that is no positive number or that would make more than 20 million vertices.
    """
    longest = _checked(longest_edge)
    expected = estimated_vertices(scene, longest)
    if expected > MOST_VERTICES:
        what = f"edges of at most {longest:g} m would make about {expected:.3g} vertices"
        raise InputError("subdivide", f"{what}, at most {MOST_VERTICES:,} are made; choose a longer edge")
    tint = scene.albedo if scene.tint is None else scene.tint
    vertices = Midpoints(scene.positions, scene.normals, tint, scene.uv, longest=longest)
    triangles, parent = _split_all(vertices, scene.triangles)
    made = len(vertices.positions) - len(scene.positions)
    if made == 0:
        return scene
    finer = replace(
        scene, positions=vertices.positions, normals=vertices.normals, triangles=triangles,
        material_of=np.ascontiguousarray(scene.material_of[parent]), uv=vertices.uv, albedo=vertices.tint, tint=None,
        notes=(*scene.notes, f"edges longer than {longest:g} m split: {made:,} vertices added"),
    )  # fmt: skip
    if scene.tint is None:
        return finer
    finer = textured(finer)
    finer.albedo[: len(scene.albedo)] = scene.albedo  # as they were, to the last digit
    return finer


def estimated_vertices(scene: Scene, longest_edge: float) -> float:
    """About how many vertices `subdivided` would make, itself included: from the lengths of edges alone.

    An edge is halved k times. While all three are long each round makes four triangles; then a strip along the
    two longer ones has a triangle for each of their parts.
    """
    corners = scene.positions[scene.triangles].astype(np.float64)
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    halvings = np.maximum(np.ceil(np.log2(np.maximum(lengths / longest_edge, 1))), 0)
    few, some, many = np.sort(halvings, axis=1).T
    pieces = np.exp2(2 * few) * (np.exp2(some - few) + np.exp2(many - few) - 1)
    return len(scene.positions) + float((pieces - 1).sum()) / 2


def _checked(longest_edge: float) -> float:
    if isinstance(longest_edge, bool) or not isinstance(longest_edge, int | float | np.number):
        raise InputError("subdivide", f"is {longest_edge!r}, expected a length in metres such as 0.1")
    if not (math.isfinite(longest_edge) and longest_edge > 0):
        raise InputError(
            "subdivide", f"is {longest_edge:g}, expected a length in metres above 0, such as 0.1"
        )
    return float(longest_edge)


def _split_all(vertices: Midpoints, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (F, 3) in the order of their parents, and the parent of each."""
    open_, parent = triangles.astype(np.int64), np.arange(len(triangles))
    done, parents = [], []
    while len(open_):
        ends = np.stack([open_, np.roll(open_, -1, axis=1)], axis=-1)
        long = vertices.are_long(ends.reshape(-1, 2)).reshape(-1, 3)
        count = long.sum(axis=1)
        done.append(open_[count == 0])
        parents.append(parent[count == 0])
        parts = [_halves(vertices, open_, count == 1, np.argmax(long, axis=1))]
        parts.append(_strips(vertices, open_, np.flatnonzero(count == 2), np.argmin(long, axis=1)))
        obtuse, widest = _are_obtuse(vertices.positions[open_])
        parts.append(_halves(vertices, open_, (count == 3) & obtuse, widest))
        parts.append(_quarters(vertices, open_, np.flatnonzero((count == 3) & ~obtuse)))
        open_, of = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        parent = parent[of]
    parent = np.concatenate(parents)
    order = np.argsort(parent, kind="stable")
    return np.ascontiguousarray(np.concatenate(done)[order], np.int32), parent[order]


def _are_obtuse(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether triangles (F, 3, 3) have an angle above 120 degrees, and which edge is the longest."""
    squares = ((np.roll(corners, -1, axis=1).astype(np.float64) - corners) ** 2).sum(axis=2)
    b, c, a = np.sort(squares, axis=1).T
    return a > b + c + np.sqrt(b * c), np.argmax(squares, axis=1)


def _turned(triangles: np.ndarray, first: np.ndarray) -> np.ndarray:
    """(3, n) corners a, b and c, beginning with the corner of that number."""
    return np.take_along_axis(triangles, (first[:, None] + np.arange(3)) % 3, axis=1).T


def _halves(
    vertices: Midpoints, triangles: np.ndarray, chosen: np.ndarray, edge: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The two parts of the chosen triangles, cut from the middle of an edge; and whose parts they are."""
    of = np.flatnonzero(chosen)
    a, b, c = _turned(triangles[of], edge[of])
    ab = vertices.of(np.stack([a, b], axis=1))
    return _gathered(of, (a, ab, c), (ab, b, c))


def _quarters(vertices: Midpoints, triangles: np.ndarray, of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Four parts of each triangle, all of its own shape."""
    a, b, c = triangles[of].T
    ab, bc, ca = (vertices.of(np.stack(ends, axis=1)) for ends in ((a, b), (b, c), (c, a)))
    return _gathered(of, (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))


def _gathered(of: np.ndarray, *parts: tuple[np.ndarray, ...]) -> tuple[np.ndarray, np.ndarray]:
    return np.concatenate([np.stack(part, axis=1) for part in parts]), np.tile(of, len(parts))


def _strips(
    vertices: Midpoints, triangles: np.ndarray, of: np.ndarray, short: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Triangles between the two long edges of each, from the corner where these meet to the short one."""
    apex, left, right = _turned(triangles[of], (short[of] + 2) % 3)
    sides = np.concatenate([np.stack([apex, left], axis=1), np.stack([apex, right], axis=1)])
    chain, counts = vertices.chains(sides)
    starts = np.cumsum(counts + 1) - counts - 1
    shapes, shape = np.unique(counts.reshape(2, -1), axis=1, return_inverse=True)
    found, owners = [np.empty((0, 3), np.int64)], [np.empty(0, np.int64)]
    for k, (m, n) in enumerate(shapes.T.tolist()):
        here = np.flatnonzero(shape.ravel() == k)
        points = [
            chain[starts[here + side * len(of), None] + np.arange(parts + 1)]
            for side, parts in ((0, m), (1, n))
        ]
        # Of the two ways to cut, the one whose last diagonal is shorter.
        diagonals = [(points[0][:, m], points[1][:, n - 1]), (points[0][:, m - 1], points[1][:, n])]
        first, second = (
            np.linalg.norm(vertices.positions[p] - vertices.positions[q], axis=1) for p, q in diagonals
        )
        for left_first, rows in ((True, first <= second), (False, first > second)):
            local = np.concatenate(points, axis=1)[rows]
            found.append(local[:, _zigzag(m, n, left_first=left_first)].reshape(-1, 3))
            owners.append(np.repeat(of[here[rows]], m + n - 1))
    return np.concatenate(found), np.concatenate(owners)


def _zigzag(m: int, n: int, *, left_first: bool) -> np.ndarray:
    """(m + n - 1, 3) triangles between points 0 to m on the left and m + 1 to m + n + 1 on the right.

    Both sides have two parts at least; they begin in the apex (0 and m + 1) and keep step.
    """
    triangles, i, j = [(0, 1, m + 2)], 1, 1
    while i < m or j < n:
        ahead = (i + 1) * n - (j + 1) * m
        step_left = j == n or (i < m and (ahead < 0 or (ahead == 0 and left_first)))
        triangles.append((i, i + 1, m + 1 + j) if step_left else (i, m + 2 + j, m + 1 + j))
        i, j = (i + 1, j) if step_left else (i, j + 1)
    return np.array(triangles)

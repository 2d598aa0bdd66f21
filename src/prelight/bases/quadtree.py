"""Quadtrees over the faces of a cube map, for any resolution R.

A node is a row ``(face, row, column, height, width)`` of an int32 array. The children of a node of
odd size are of unequal size, never empty. Leaves are always kept in *Z-order* (the order of a
depth-first walk), so that together they are the whole tree: the leaves of any node are consecutive,
and where they begin follows from the texels that the leaves before them cover.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from ..arrays import Int32
from .cube_map import FACES

Nodes = Int32[np.ndarray, "nodes 5"]


def roots(resolution: int) -> Nodes:
    """The six faces, whole."""
    nodes = np.zeros((len(FACES), 5), np.int32)
    nodes[:, 0] = np.arange(len(FACES))
    nodes[:, 3:] = resolution
    return nodes


def texel_counts(nodes: Nodes) -> np.ndarray:
    """Texels in each node, int64."""
    return nodes[:, 3].astype(np.int64) * nodes[:, 4]


def split(nodes: Nodes) -> tuple[Nodes, np.ndarray]:
    """Children of all nodes in Z-order, and for each child the index of its parent."""
    face, row, column, height, width = nodes.T
    top, left = (height + 1) // 2, (width + 1) // 2
    children = np.empty((len(nodes), 4, 5), np.int32)
    children[:, :, 0] = face[:, None]
    for quarter, (lower, right) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        children[:, quarter, 1] = row + lower * top
        children[:, quarter, 2] = column + right * left
        children[:, quarter, 3] = height - top if lower else top
        children[:, quarter, 4] = width - left if right else left
    kept = (children[:, :, 3] > 0) & (children[:, :, 4] > 0)
    return children[kept], np.nonzero(kept)[0]


def sample_texels(nodes: Nodes, samples_per_side: int, resolution: int) -> np.ndarray:
    """The environment lights that stand for each node (paper, section 4.1).

    s×s texels spread over the node with its outermost texels among them, or all of its texels
    where it has fewer than s². int64 (nodes, s²) of face·R² + row·R + column, −1 where unused.
    """
    s = samples_per_side
    face, row, column, height, width = (x.astype(np.int64)[:, None] for x in nodes.T)
    steps = np.linspace(0.0, 1.0, s) if s > 1 else np.array([0.5])
    rows = np.rint(steps[None, :] * (height - 1)).astype(np.int64)
    columns = np.rint(steps[None, :] * (width - 1)).astype(np.int64)
    inside = rows[:, :, None] * resolution + columns[:, None, :]
    repeated = np.zeros(inside.shape, bool)
    repeated[:, 1:, :] |= (rows[:, 1:] == rows[:, :-1])[:, :, None]
    repeated[:, :, 1:] |= (columns[:, 1:] == columns[:, :-1])[:, None, :]
    inside = np.where(repeated, -1, inside).reshape(len(nodes), s * s)

    small = (height * width < s * s)[:, 0]
    if small.any():
        counter = np.arange(s * s)[None, :]
        h, w = height[small], width[small]
        every = (counter // w) * resolution + counter % w
        inside[small] = np.where(counter < h * w, every, -1)
    origin = (face * resolution + row) * resolution + column
    return np.where(inside >= 0, inside + origin, -1)


@dataclass(frozen=True)
class LeafCover:
    """Leaves in Z-order that cover the cube from its start, up to all of it."""

    leaves: Nodes
    resolution: int

    @cached_property
    def _ends(self) -> np.ndarray:
        return np.cumsum(texel_counts(self.leaves))

    @property
    def is_complete(self) -> bool:
        return len(self.leaves) > 0 and int(self._ends[-1]) == len(FACES) * self.resolution**2

    @property
    def is_whole_tree(self) -> bool:
        """Whether these are the leaves of six quadtrees in Z-order, none missing: what every walk down relies on."""
        nodes, matched = roots(self.resolution), 0
        first = np.arange(len(FACES), dtype=np.int64) * self.resolution**2
        while len(nodes):
            index = np.searchsorted(self._ends, first, side="right")
            if (index == len(self.leaves)).any():
                return False
            there = self.leaves[index]
            is_leaf = (there == nodes).all(axis=1)
            begins_here = self._ends[index] - texel_counts(there) == first
            if not (begins_here & (is_leaf | (texel_counts(there) < texel_counts(nodes)))).all():
                return False
            matched += int(is_leaf.sum())
            inner, first = nodes[~is_leaf], first[~is_leaf]
            nodes, parent = split(inner)
            before = np.cumsum(texel_counts(nodes)) - texel_counts(nodes)
            opening = np.searchsorted(parent, np.arange(len(inner)))
            first = first[parent] + before - before[opening][parent] if len(nodes) else first[:0]
        return matched == len(self.leaves)

    def uncovered(self) -> tuple[Nodes, Nodes]:
        """The nodes still to be examined, in Z-order, and their parents (a face is its own parent).

        A node that is covered in part must have been split, so it is split again without a test.
        """
        covered = int(self._ends[-1]) if len(self.leaves) else 0
        nodes = parents = roots(self.resolution)
        while True:
            ends = np.cumsum(texel_counts(nodes))
            starts = ends - texel_counts(nodes)
            partly = (starts < covered) & (ends > covered)
            if not partly.any():
                remaining = starts >= covered
                return nodes[remaining], parents[remaining]
            where = int(np.flatnonzero(partly)[0])
            children, _ = split(nodes[where : where + 1])
            own = np.repeat(nodes[where : where + 1], len(children), axis=0)
            nodes, parents = (
                np.concatenate([old[:where], new, old[where + 1 :]])
                for old, new in ((nodes, children), (parents, own))
            )

    def intersecting(self, face: int, rows: slice, columns: slice) -> np.ndarray:
        """Indices, ascending, of the leaves that a rectangle of texels touches (section 5.2)."""
        found = np.empty(len(self.leaves), np.int64)
        count = _descend(
            self._ends, self.resolution, face, rows.start, rows.stop, columns.start, columns.stop, found
        )
        return found[:count]


@njit(cache=True)
def _descend(ends, resolution, face, top, bottom, left, right, found):  # noqa: PLR0913  (compiled)
    """Walk down from a face to the leaves inside; a node is a leaf if the leaf at its first texel is as large."""
    stack = np.empty((64, 5), np.int64)  # row, column, height, width, texels before
    stack[0] = (0, 0, resolution, resolution, face * resolution * resolution)
    depth, count = 1, 0
    while depth:
        depth -= 1
        row, column, height, width, first = stack[depth]
        if row >= bottom or row + height <= top or column >= right or column + width <= left:
            continue
        leaf = np.searchsorted(ends, first, side="right")
        begins = ends[leaf - 1] if leaf else 0
        if ends[leaf] - begins == height * width:
            found[count] = leaf
            count += 1
            continue
        upper, west = (height + 1) // 2, (width + 1) // 2
        after = first + height * width
        for quarter in range(3, -1, -1):  # the last one first, so that they are popped in Z-order
            h = height - upper if quarter // 2 else upper
            w = width - west if quarter % 2 else west
            if h > 0 and w > 0:
                after -= h * w
                stack[depth] = (row + quarter // 2 * upper, column + quarter % 2 * west, h, w, after)
                depth += 1
    return count

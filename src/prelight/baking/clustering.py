"""Clustering environment lights (paper, section 4): which lights may share a transfer vector.

The quadtree of each face is walked in Z-order, a block of open nodes at a time. Every decision rests
on a node's own samples alone, so the result does not depend on the size of the blocks, on memory, or
on where an interrupted walk went on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Normals, UInt8
from ..bases.cube_map import mean_directions, texel_directions
from ..bases.quadtree import LeafCover, Nodes, sample_texels, split
from ..transport.direct import quantized_means, squared_distances
from ..transport.visibility import MAX_LANES, Visibility


@dataclass(frozen=True)
class ClusterTest:
    """When lights are one cluster: what the tree depends on."""

    resolution: int  # R
    tolerance: (
        float  # τ: the RMS over receivers of T_C − T_l stays below it for all samples l (Eq. 11, τ = ε√N)
    )
    samples_per_side: int  # s


@dataclass(frozen=True)
class Clusters:
    """Consecutive leaves, their transfer vectors as bytes, and what they cost."""

    leaves: Nodes  # (C, 5)
    columns: UInt8[np.ndarray, "clusters receivers"]  # receivers in storage order
    scale: Float32[np.ndarray, "clusters"]
    rays: np.ndarray  # (C,) traced lanes, int64; a split node's are counted with its first leaf


@dataclass(frozen=True)
class Progress:
    """Where the walk stands after a block."""

    texels_done: int  # covered by leaves
    nodes_tested: int
    rays: int  # traced so far, active lanes
    lanes: int  # receiver-directions, masked ones included


class _SampleStore:
    """Visibility of the environment lights that some open node still needs (section 4.2)."""

    def __init__(self, visibility: Visibility, resolution: int, lanes: int) -> None:
        self._visibility, self._resolution, self._lanes = visibility, resolution, lanes
        self._texels = np.zeros(0, np.int64)  # sorted
        self._bits = np.zeros((0, -(-visibility.receivers // 8)), np.uint8)
        self._rays = np.zeros(0, np.int64)
        self.lanes_traced = 0

    def rows_of(self, texels: np.ndarray) -> np.ndarray:
        """Row of each texel in ``bits``, −1 where the texel is −1; traces those not yet known."""
        wanted = np.unique(texels[texels >= 0])
        missing = np.setdiff1d(wanted, self._texels, assume_unique=True)
        if len(missing):
            bits, rays = self._visibility.trace(
                texel_directions(missing, self._resolution), lanes=self._lanes
            )
            self.lanes_traced += len(missing) * self._visibility.receivers
            texels_known = np.concatenate([self._texels, missing])
            order = np.argsort(texels_known)
            self._texels = texels_known[order]
            self._bits = np.concatenate([self._bits, bits])[order]
            self._rays = np.concatenate([self._rays, rays])[order]
        rows = np.searchsorted(self._texels, texels)
        return np.where(texels >= 0, rows, -1).astype(np.int32)

    @property
    def bits(self) -> np.ndarray:
        return self._bits

    def rays_of(self, rows: np.ndarray, new: np.ndarray) -> np.ndarray:
        """Traced lanes of each node's samples that its parent did not have."""
        return np.where(new, self._rays[rows], 0).sum(axis=1)

    def keep(self, texels: np.ndarray) -> None:
        """Forget all lights but these: the others have found their cluster."""
        kept = np.isin(self._texels, texels)
        self._texels, self._bits, self._rays = self._texels[kept], self._bits[kept], self._rays[kept]


def cluster_lights(
    visibility: Visibility,
    normals: Normals,
    test: ClusterTest,
    *,
    covered: Nodes,
    block: int,
    lanes: int = MAX_LANES,
) -> Iterator[tuple[Clusters, Progress]]:
    """Leaves in Z-order after ``covered``, as many at a time as a block of nodes has settled.

    Parameters
    ----------
    visibility, normals
        The receivers in storage order.
    covered
        Leaves found earlier; the walk goes on behind them.
    block, lanes
        Open nodes examined and rays traced at a time; they bound memory and do not change the result.
    """
    resolution, samples_per_side = test.resolution, test.samples_per_side
    store = _SampleStore(visibility, resolution, lanes)
    by_axis = np.ascontiguousarray(normals.T)
    nodes, parents = LeafCover(covered, resolution).uncovered()
    is_leaf = np.zeros(len(nodes), bool)
    carried = np.zeros(len(nodes), np.int64)  # rays of ancestors, paid by their first leaf
    held: dict[int, tuple[np.ndarray, float]] = {}  # first texel of a leaf -> its column and scale
    tested = rays = 0
    limit = test.tolerance**2 * visibility.receivers

    while len(nodes):
        # ---- 4.1 select samples, 4.2 their transfer vectors -----------------------------------
        open_nodes = np.flatnonzero(~is_leaf)[:block]
        texels = sample_texels(nodes[open_nodes], samples_per_side, resolution)
        rows = store.rows_of(texels)
        d = texel_directions(np.maximum(texels, 0).ravel(), resolution).reshape(*texels.shape, 3)
        new = (texels >= 0) & ~_in_parent(
            texels, parents[open_nodes], nodes[open_nodes], samples_per_side, resolution
        )
        cost = store.rays_of(rows, new)
        carried[open_nodes] += cost
        rays += int(cost.sum())
        tested += len(open_nodes)

        # ---- 4.3 clustering test (Eq. 11) -----------------------------------------------------
        distance = np.empty(rows.shape, np.float64)
        squared_distances(store.bits, rows, d, by_axis, distance)
        similar = distance.max(axis=1) < limit
        similar |= (texels >= 0).sum(axis=1) == 1  # a single light is a cluster whatever rounding says

        # ---- Eq. 10: the clusters' own vectors ------------------------------------------------
        accepted = open_nodes[similar]
        columns = np.empty((len(accepted), visibility.receivers), np.uint8)
        scale = np.empty(len(accepted), np.float32)
        D_C = mean_directions(nodes[accepted], resolution).astype(np.float32)
        quantized_means(store.bits, rows[similar], d[similar], D_C, by_axis, columns, scale)
        for key, column, s in zip(_first_texels(nodes[accepted], resolution), columns, scale, strict=True):
            held[int(key)] = (column, s)
        is_leaf[accepted] = True

        # ---- quadrisect the others in place ---------------------------------------------------
        nodes, parents, is_leaf, carried = _quadrisected(
            nodes, parents, is_leaf, carried, open_nodes[~similar]
        )
        settled = len(nodes) if is_leaf.all() else int(np.argmin(is_leaf))
        keys = [int(k) for k in _first_texels(nodes[:settled], resolution)]
        taken = [held.pop(key) for key in keys]
        found = Clusters(
            nodes[:settled],
            np.stack([c for c, _ in taken]) if taken else np.zeros((0, visibility.receivers), np.uint8),
            np.array([s for _, s in taken], np.float32),
            carried[:settled],
        )
        nodes, parents = nodes[settled:], parents[settled:]
        is_leaf, carried = is_leaf[settled:], carried[settled:]
        store.keep(sample_texels(nodes[~is_leaf], samples_per_side, resolution))
        done = 6 * resolution**2 - int(_texels_left(nodes))
        yield found, Progress(done, tested, rays, store.lanes_traced)


def _texels_left(nodes: Nodes) -> int:
    return int((nodes[:, 3].astype(np.int64) * nodes[:, 4]).sum())


def _first_texels(nodes: Nodes, resolution: int) -> np.ndarray:
    face, row, column = nodes[:, 0].astype(np.int64), nodes[:, 1], nodes[:, 2]
    return (face * resolution + row) * resolution + column


def _in_parent(
    texels: np.ndarray, parents: Nodes, nodes: Nodes, samples_per_side: int, resolution: int
) -> np.ndarray:
    """Which samples the parent had already: traced once and reused."""
    had = sample_texels(parents, samples_per_side, resolution)
    had[(parents == nodes).all(axis=1)] = -2  # a face has no parent
    return (texels[:, :, None] == had[:, None, :]).any(axis=2)


def _quadrisected(nodes, parents, is_leaf, carried, opened):
    """The walk with the children of ``opened`` in their places; the first child inherits the cost."""
    children, parent = split(nodes[opened])
    counts = np.ones(len(nodes), np.int64)
    counts[opened] = np.bincount(parent, minlength=len(opened))
    origin = np.repeat(np.arange(len(nodes)), counts)
    is_child = np.isin(origin, opened)
    new_nodes, new_parents = nodes[origin], parents[origin]
    new_nodes[is_child] = children
    new_parents[is_child] = nodes[opened][parent]
    first = np.ones(len(origin), bool)
    first[1:] = origin[1:] != origin[:-1]
    return new_nodes, new_parents, is_leaf[origin], np.where(first, carried[origin], 0)

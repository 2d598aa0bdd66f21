"""Clustering environment lights (paper, section 4): which lights may share a transfer vector.

The quadtree of each face is walked in Z-order, a block of open nodes at a time. Every decision rests
on a node's own samples alone, so the result does not depend on the size of the blocks, on memory, or
on where an interrupted walk went on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, UInt8
from ..bases.cube_map import mean_directions, texel_directions
from ..bases.quadtree import LeafCover, Nodes, sample_texels, split
from ..transport.transfer import Transfer
from .sun_paths import TOLERANCE_SHARE, SunPaths


@dataclass(frozen=True)
class ClusterTest:
    """When lights are one cluster: what the tree depends on."""

    resolution: int  # R
    tolerance: (
        float  # τ: the RMS over receivers of T_C − T_l stays below it for all samples l (Eq. 11, τ = ε√N)
    )
    samples_per_side: int  # s
    sun: SunPaths | None = None  # where it stands the tree is finer

    def limits(self, nodes: Nodes, receivers: int) -> Float64[np.ndarray, "nodes"]:
        """What ‖T_C − T_l‖² of the samples of each node must stay below."""
        share = np.ones(len(nodes))
        if self.sun is not None:
            share[self.sun.meet(nodes, self.resolution)] = TOLERANCE_SHARE
        return (share * self.tolerance) ** 2 * receivers


@dataclass(frozen=True)
class Clusters:
    """Consecutive leaves, their transfer vectors as bytes, and what they cost."""

    leaves: Nodes  # (C, 5)
    columns: UInt8[np.ndarray, "clusters channels receivers"]  # receivers in storage order
    scale: Float32[np.ndarray, "clusters channels"]
    rays: np.ndarray  # (C,) int64; a split node's are counted with its first leaf


@dataclass(frozen=True)
class Progress:
    """Where the walk stands after a block."""

    texels_done: int  # covered by leaves
    nodes_tested: int
    rays: int  # traced so far, active lanes
    lanes: int  # receiver-directions, those without a ray included


class _SampleStore:
    """Rows of the environment lights that some open node still needs (section 4.2).

    Rows keep their place while they are needed, so that nothing is copied; a place that falls free is the
    next to be used. Memory never touched costs nothing: the pool begins large.
    """

    def __init__(self, transfer: Transfer, resolution: int, *, lanes: int, capacity: int) -> None:
        self._transfer, self._resolution, self._lanes = transfer, resolution, lanes
        self._texels = np.zeros(0, np.int64)  # known, sorted
        self._places = np.zeros(0, np.int32)  # of each in the pool
        self._rays = np.zeros(capacity, np.int32)  # by place
        self._free = np.arange(capacity, dtype=np.int32)  # ascending
        self.rows = np.empty((0, 0), np.uint8)  # what rows are is known with the first
        self.lanes_traced = 0

    def places_of(self, texels: np.ndarray) -> np.ndarray:
        """Row of each texel in ``rows``, −1 where the texel is −1; traces those not yet known."""
        wanted = np.unique(texels[texels >= 0])
        missing = np.setdiff1d(wanted, self._texels, assume_unique=True)
        if len(missing):
            rows, rays = self._transfer.trace(texel_directions(missing, self._resolution), lanes=self._lanes)
            self.lanes_traced += len(missing) * self._transfer.receivers
            self._insert(missing, rows, rays)
        known = np.searchsorted(self._texels, texels)
        places = self._places[np.minimum(known, len(self._places) - 1)]
        return np.where(texels >= 0, places, -1).astype(np.int32)

    def _insert(self, texels: np.ndarray, rows: np.ndarray, rays: np.ndarray) -> None:
        if not len(self.rows):
            self.rows = np.empty((len(self._rays), *rows.shape[1:]), rows.dtype)
        if (lacking := len(texels) - len(self._free)) > 0:
            size = len(self._rays)
            more = max(lacking, size // 2)
            self._free = np.concatenate([self._free, np.arange(size, size + more, dtype=np.int32)])
            self._rays = np.concatenate([self._rays, np.zeros(more, np.int32)])
            grown = np.empty((size + more, *self.rows.shape[1:]), self.rows.dtype)
            grown[:size] = self.rows
            self.rows = grown
        places, self._free = self._free[: len(texels)], self._free[len(texels) :]
        self.rows[places], self._rays[places] = rows, rays
        at = np.searchsorted(self._texels, texels)
        self._texels = np.insert(self._texels, at, texels)
        self._places = np.insert(self._places, at, places)

    def rays_of(self, places: np.ndarray, new: np.ndarray) -> np.ndarray:
        """Traced rays of each node's samples that its parent did not have."""
        return np.where(new, self._rays[places], 0).sum(axis=1, dtype=np.int64)

    def keep(self, texels: np.ndarray) -> None:
        """Forget all lights but these: the others have found their cluster."""
        kept = np.isin(self._texels, texels)
        self._free = np.union1d(self._free, self._places[~kept])
        self._texels, self._places = self._texels[kept], self._places[kept]


def cluster_lights(
    transfer: Transfer, test: ClusterTest, *, covered: Nodes, block: int, lanes: int
) -> Iterator[tuple[Clusters, Progress]]:
    """Leaves in Z-order after ``covered``, as many at a time as a block of nodes has settled.

    Parameters
    ----------
    transfer
        The receivers, in storage order.
    covered
        Leaves found earlier; the walk goes on behind them.
    block, lanes
        Open nodes examined and rays traced at a time; they bound memory and do not change the result.
    """
    resolution, samples_per_side = test.resolution, test.samples_per_side
    store = _SampleStore(transfer, resolution, lanes=lanes, capacity=rows_at_once(block, samples_per_side))
    nodes, parents = LeafCover(covered, resolution).uncovered()
    is_leaf = np.zeros(len(nodes), bool)
    carried = np.zeros(len(nodes), np.int64)  # rays of ancestors, paid by their first leaf
    held: dict[int, tuple[np.ndarray, np.ndarray]] = {}  # first texel of a leaf -> its columns and scales
    tested = rays = 0

    while len(nodes):
        # ---- 4.1 select samples, 4.2 their transfer vectors -----------------------------------
        open_nodes = np.flatnonzero(~is_leaf)[:block]
        texels = sample_texels(nodes[open_nodes], samples_per_side, resolution)
        places = store.places_of(texels)
        d = texel_directions(np.maximum(texels, 0).ravel(), resolution).reshape(*texels.shape, 3)
        new = (texels >= 0) & ~_in_parent(
            texels, parents[open_nodes], nodes[open_nodes], samples_per_side, resolution
        )
        cost = store.rays_of(places, new)
        carried[open_nodes] += cost
        rays += int(cost.sum())
        tested += len(open_nodes)

        # ---- 4.3 clustering test (Eq. 11) -----------------------------------------------------
        distance = transfer.squared_distances(store.rows, places, d)
        similar = distance.max(axis=1) < test.limits(nodes[open_nodes], transfer.receivers)
        similar |= (texels >= 0).sum(axis=1) == 1  # a single light is a cluster whatever rounding says

        # ---- Eq. 10: the clusters' own vectors ------------------------------------------------
        accepted = open_nodes[similar]
        D_C = mean_directions(nodes[accepted], resolution).astype(np.float32)
        columns, scale = transfer.quantized_means(store.rows, places[similar], d[similar], D_C)
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
            np.stack([c for c, _ in taken]) if taken else np.empty((0, *columns.shape[1:]), np.uint8),
            np.stack([s for _, s in taken]) if taken else np.empty((0, transfer.channels), np.float32),
            carried[:settled],
        )
        nodes, parents = nodes[settled:], parents[settled:]
        is_leaf, carried = is_leaf[settled:], carried[settled:]
        store.keep(sample_texels(nodes[~is_leaf], samples_per_side, resolution))
        done = 6 * resolution**2 - int(_texels_left(nodes))
        yield found, Progress(done, tested, rays, store.lanes_traced)


def rows_at_once(block: int, samples_per_side: int) -> int:
    """Rows that a walk needs at a time, about: all samples of a block, and those its open neighbours share."""
    return block * samples_per_side**2 + 4 * (block + 64)


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

"""The light of every cluster of every zone, from one pass over the cube.

The clusters of all zones are nodes of the same quadtrees. Those without another inside, the *atoms*, are the
finest common division of the cube: their texels are summed once, whatever the number of zones, and light moves
up to the nodes around them. Sums of nodes are never differences of larger ones: no light is exactly no light.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from ..arrays import CubeMap, Float64, Int32, Int64
from ..bases.cube_map import AXIS, FACES, U, V, solid_angles
from ..bases.quadtree import texel_counts
from ..lighting.regions import Cap
from .disc_kernels import weigh_disc
from .layer import EnvironmentLayer
from .light_kernels import (
    BOX,
    difference,
    gather_changes,
    light_again,
    light_everywhere,
    weigh_clusters,
)

Weights = tuple[Int64[np.ndarray, "nodes"], Float64[np.ndarray, "nodes channels"]]  # 3, or 1: alike in all
Changes = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # of ``gather_changes``


class LightTree:
    """Nodes that are a cluster of some zone, or one of ``cells``, in pre-order, and their light (n, 3) now, float64.

    ``cells`` are all leaves of whole quadtrees too, in Z-order; ``cell_nodes`` says which nodes they are.
    """

    def __init__(self, layer: EnvironmentLayer, cells: Int32[np.ndarray, "cells 5"] | None = None) -> None:
        self._layer, R = layer, layer.resolution
        self._omega = solid_angles(R)
        rectangles, starts, clusters = layer.rectangles, layer.starts, len(layer.rectangles)
        if cells is not None:
            rectangles = np.concatenate([rectangles, cells])
            starts = np.append(starts, len(rectangles))
        counts = texel_counts(rectangles)
        first = np.cumsum(counts) - counts
        first -= np.repeat(first[starts[:-1]], np.diff(starts))  # of each zone's own walk
        most = len(FACES) * R * R
        keys, example, node = np.unique(
            first * most + (most - counts), return_index=True, return_inverse=True
        )
        first, ends = first[example], first[example] + counts[example]
        self.nodes: Int32[np.ndarray, "nodes 5"] = np.ascontiguousarray(rectangles[example])
        self.after: Int64[np.ndarray, "nodes"] = np.searchsorted(first, ends).astype(np.int64)
        self._faces = np.searchsorted(first, np.arange(len(FACES) + 1) * R * R).astype(np.int64)
        self._node_of: Int64[np.ndarray, "slots"] = np.zeros(len(layer.scales), np.int64)
        node, self.cell_nodes = node[:clusters], node[clusters:]
        self._node_of[layer.slots] = node
        self._starts = np.searchsorted(np.sort(node), np.arange(len(keys) + 1)).astype(np.int64)
        self._clusters = np.diff(self._starts)
        self._slots = layer.slots[np.argsort(node, kind="stable")]
        atoms = self.after == np.arange(len(keys)) + 1
        self._texels = np.where(atoms, ends - first, 0)
        self._is_top = self._outermost()
        self._boxes, self._angles = self._around(), self._solid_angles()
        self._shares = self._even_shares(numba.get_num_threads())
        for table in (
            self.nodes,
            self.after,
            self._faces,
            self._node_of,
            self._starts,
            self._slots,
            self._shares,
        ):
            table.flags.writeable = False
        self.light: Float64[np.ndarray, "nodes 3"] = np.zeros((len(keys), 3))
        self._found = np.empty(len(keys), np.int64)
        self._change = np.empty((len(keys), 3))
        self._scratch, self._weights = np.zeros((2, len(keys), 1))

    def __len__(self) -> int:
        return len(self.nodes)

    def _around(self) -> Int32[np.ndarray, "boxes 4"]:
        """Rows and columns of 32 nodes each: first, last + 1; in the last box there may be fewer."""
        _, row, column, height, width = self.nodes.T
        starts = np.arange(0, len(self.nodes), BOX)
        sides = [
            function.reduceat(values, starts)
            for function, values in (
                (np.minimum, row), (np.maximum, row + height), (np.minimum, column), (np.maximum, column + width)
            )
        ]  # fmt: skip
        return np.ascontiguousarray(np.stack(sides, axis=1), np.int32)

    def _solid_angles(self) -> Float64[np.ndarray, "nodes"]:
        """Each by its corners (``bases.cube_map``), as the discs' integrals are found."""
        _, row, column, height, width = self.nodes.T
        step = 2.0 / self._layer.resolution
        u, v = np.stack([column, column + width]) * step - 1.0, np.stack([row, row + height]) * step - 1.0
        area = np.arctan2(u[:, None] * v, np.sqrt(u[:, None] ** 2 + v**2 + 1.0))
        return area[1, 1] - area[0, 1] - area[1, 0] + area[0, 0]

    def _outermost(self) -> np.ndarray:
        """Which nodes are inside no other: those that together are the whole cube."""
        change = np.zeros(len(self.after) + 1, np.int64)
        inner = np.flatnonzero(self.after > np.arange(len(self.after)) + 1)
        np.add.at(change, inner + 1, 1)
        np.add.at(change, self.after[inner], -1)
        return np.cumsum(change[:-1]) == 0

    def _even_shares(self, threads: int) -> Int64[np.ndarray, "threads+1"]:
        done = np.cumsum(self._texels)
        shares = np.searchsorted(done, done[-1] * np.arange(threads + 1) // threads, side="left")
        shares[0], shares[-1] = 0, len(done)
        return shares.astype(np.int64)

    def total(self, nodes: np.ndarray | None = None, light: np.ndarray | None = None) -> float:
        """Of all light, over all channels; or of what changes of some nodes make of it."""
        if nodes is None or light is None:
            return float(self.light[self._is_top].sum())
        return float(light[self._is_top[nodes]].sum())

    def light_all(self, cube: CubeMap) -> tuple[np.ndarray, np.ndarray]:
        """Light of the whole cube: the nodes whose light changed, ascending, and by how much."""
        before = self.light.copy()
        light_everywhere(cube, self._omega, self.nodes, self.after, self._shares, self.light)
        change = self.light - before
        changed = np.flatnonzero(change.any(axis=1))
        return changed, change[changed]

    def light_part(
        self, cube: CubeMap, face: int, place: tuple[int, int, int, int]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The same where only texels (top, left, bottom, right) of a face have changed."""
        n = light_again(
            cube, self._omega, self.nodes, self.after, self._boxes, self._faces[face], self._faces[face + 1],
            np.array(place, np.int64), self.light, self._found, self._change,
        )  # fmt: skip
        return self._found[:n], self._change[:n]

    def weights_of(self, disc: Cap) -> Weights:
        """Nodes that a disc touches, ascending, and ∫ share dω there, (n, 1)."""
        n = weigh_disc(
            _frame(disc.direction), disc.depths, U, V, AXIS, self._layer.resolution,
            self.nodes, self.after, self._boxes, self._faces, self._angles, self._scratch, self._found, self._weights,
        )  # fmt: skip
        return self._found[:n].copy(), self._weights[:n].copy()

    def gather(self, *lights: Weights) -> Changes:
        """What changes of nodes, ascending, of each light are to the clusters; see ``gather_changes``."""
        nodes, change = lights[0] if len(lights) == 1 else map(np.concatenate, zip(*lights, strict=True))
        owners = np.cumsum([0, *(len(of_light) for of_light, _ in lights)])
        return gather_changes(
            self._layer.tiles.zones, owners, nodes, change, self._starts, self._slots, self._layer.scales
        )

    def difference(self, weights: Weights, before: Weights) -> Weights:
        """Where the weights of a light are others than before, and by how much."""
        return difference(*weights, *before)

    def clusters_of(self, nodes: np.ndarray) -> int:
        """How many clusters, in all zones, these nodes are."""
        return int(self._clusters[nodes].sum())

    def weigh(self) -> tuple[np.ndarray, np.ndarray]:
        """Weights (slots, 3) float32 of a full relight, and bits (panels,) of the tiles that have any."""
        weights = np.empty(self._layer.scales.shape, np.float32)
        lit = np.empty(len(self._layer.tiles.addresses), np.uint16)
        weigh_clusters(self.light, self._node_of, self._layer.scales, weights, lit)
        return weights, lit


def _frame(direction: tuple[float, float, float]) -> Float64[np.ndarray, "3 3"]:
    """Rows: two directions across a unit one, and itself; right-handed."""
    x, y, z = direction
    if abs(y) < 0.9:  # across: (0, 1, 0) × direction
        length = math.hypot(x, z)
        a = (z / length, 0.0, -x / length)
    else:  # direction × (1, 0, 0)
        length = math.hypot(y, z)
        a = (0.0, z / length, -y / length)
    b = (y * a[2] - z * a[1], z * a[0] - x * a[2], x * a[1] - y * a[0])
    return np.array((a, b, (x, y, z)))

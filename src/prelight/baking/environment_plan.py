"""What an environment bake will cost, before it is paid: a pilot bake for a few receivers.

The test of Eq. 11 is a mean over receivers, so a random sample of them finds nearly the same
clusters; rays, bytes and seconds follow in proportion, with speeds measured on this machine.
"""

from __future__ import annotations

import math
import os
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..bases.cube_map import MAX_RESOLUTION, mean_directions, texel_directions
from ..encoding.sparse_tiles import GROUP, PANEL, TILE, groups_of
from ..errors import InputError
from ..scene.geometry import Scene
from ..transport.direct import quantized_means, squared_distances
from ..transport.ordering import receiver_order
from ..transport.visibility import BYTES_PER_LANE, MAX_LANES, Visibility
from .clustering import ClusterTest, cluster_lights

MOST_CLUSTERS = 4_000_000  # what the manifest of a bake can list
DEFAULT_TOLERANCE = 0.0135  # the Bunny of the paper at ε = 5e-5
_PROCESS_BYTES = 290_000_000  # Python, the renderer and its compiler, measured
_BYTES_PER_TRIANGLE = 200  # of the renderer's tree, measured
_BYTES_PER_NODE = 6  # a receiver: sample bits, transfer vector, its copies
_PANEL_COPIES = 2.5
_LEAST_MEMORY = 500_000_000
_USED_SHARE = 0.9  # of the memory allowed: the figures above are measured, not guaranteed


@dataclass(frozen=True)
class EnvironmentSettings:
    """What to bake.

    Parameters
    ----------
    resolution
        R: the environment is a cube map of 6·R·R lights; 1 to 4096.
    tolerance
        τ, the RMS over receivers, in units of transfer (a fully lit receiver facing the light has
        1/π), by which a light may differ from its cluster. Default 0.0135.
    epsilon
        The paper's ε = τ/√N instead of ``tolerance``; give one of the two.
    samples_per_side
        s: s×s sample lights for each node of the quadtree; 2 to 9.
    memory
        Bytes the process may use; default half of this machine's.
    """

    resolution: int = 256
    tolerance: float | None = None
    epsilon: float | None = None
    samples_per_side: int = 3
    memory: int | None = None

    def __post_init__(self) -> None:
        if not (isinstance(self.resolution, int) and 1 <= self.resolution <= MAX_RESOLUTION):
            raise InputError(
                "resolution", f"{self.resolution!r}, expected a whole number from 1 to {MAX_RESOLUTION}"
            )
        if not (isinstance(self.samples_per_side, int) and 2 <= self.samples_per_side <= 9):
            raise InputError(
                "samples-per-side", f"{self.samples_per_side!r}, expected a whole number from 2 to 9"
            )
        if self.tolerance is not None and self.epsilon is not None:
            raise InputError(
                "tolerance", "give --tolerance or --epsilon, not both: tolerance = epsilon·√receivers"
            )
        for name in ("tolerance", "epsilon"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and 0 < value <= 1):
                raise InputError(name, f"{value!r}, expected a number above 0 and at most 1")
        if self.memory is not None and self.memory < _LEAST_MEMORY:
            raise InputError(
                "memory", f"{self.memory / 1e9:.2f} GB, a bake needs at least {_LEAST_MEMORY / 1e9} GB"
            )

    def tolerance_for(self, receivers: int) -> float:
        """τ for this number of receivers."""
        if self.epsilon is not None:
            return self.epsilon * math.sqrt(receivers)
        return DEFAULT_TOLERANCE if self.tolerance is None else self.tolerance

    def test_for(self, receivers: int) -> ClusterTest:
        """The clustering test for this number of receivers."""
        return ClusterTest(self.resolution, self.tolerance_for(receivers), self.samples_per_side)


@dataclass(frozen=True)
class EnvironmentPlan:
    """An estimate, and how the work is cut to stay within memory."""

    settings: EnvironmentSettings
    receivers: int
    triangles: int
    tolerance: float
    clusters: int
    rays: int  # active lanes
    receiver_directions: int  # masked lanes included
    seconds: float
    memory: int  # bytes, peak of the process
    bytes: int  # on disk
    lanes: int  # of a launch
    block: int  # nodes examined at a time

    def summary(self) -> dict:
        """What ``--dry-run --json`` prints."""
        names = ("receivers", "triangles", "tolerance", "clusters", "rays", "seconds", "memory", "bytes")
        return {"resolution": self.settings.resolution} | {name: getattr(self, name) for name in names}


def machine_memory() -> int:
    """Bytes of memory of this machine."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def plan_environment(scene: Scene, settings: EnvironmentSettings, *, seed: int = 0) -> EnvironmentPlan:
    """Estimate a bake, typically within ten percent; costs a few percent of it."""
    R = len(scene.positions)
    lanes, block, peak = _cut(scene, settings)
    order = receiver_order(scene.positions, scene.normals)
    positions, normals = scene.positions[order], scene.normals[order]
    rng = np.random.default_rng(np.random.SeedSequence([seed, 1]))

    pilot = min(R, max(400, min(2000, R // 40)))
    edges = np.linspace(0, R, pilot + 1).astype(np.int64)
    chosen = rng.integers(edges[:-1], edges[1:])  # one from each stretch of the order: neighbours see alike
    few = Visibility(scene.positions, scene.triangles, origins=positions[chosen], normals=normals[chosen])
    leaves, rays, lanes_traced, nodes = [], 0, 0, 0
    for group, progress in cluster_lights(
        few,
        normals[chosen],
        settings.test_for(R),
        covered=np.zeros((0, 5), np.int32),
        block=4096,
        lanes=lanes,
    ):
        leaves.append(group.leaves)
        rays, lanes_traced, nodes = progress.rays, progress.lanes, progress.nodes_tested
    found = np.concatenate(leaves)
    if len(found) > MOST_CLUSTERS:
        reason = (
            f"{settings.tolerance_for(R):g} needs about {len(found):,} clusters, {MOST_CLUSTERS:,} at most"
        )
        raise InputError("tolerance", reason + "; choose a larger one or a smaller --resolution")

    scale = R / pilot
    all_ = Visibility(scene.positions, scene.triangles, origins=positions, normals=normals)
    trace_seconds, node_seconds = _speeds(all_, normals, found, settings)
    tiles = _tile_share(scene, order, found, settings, rng)
    panels = -(-len(found) // PANEL)
    stored = tiles * -(-len(found) // TILE) * groups_of(R) * TILE * GROUP
    size = int(stored) + panels * (2 * groups_of(R) + 24 * PANEL) + R * 40 + len(scene.triangles) * 12
    seconds = lanes_traced * scale * trace_seconds + nodes * node_seconds + size / 400e6 + panels * 0.02
    return EnvironmentPlan(
        settings=settings,
        receivers=R,
        triangles=len(scene.triangles),
        tolerance=settings.tolerance_for(R),
        clusters=len(found),
        rays=int(rays * scale),
        receiver_directions=int(lanes_traced * scale),
        seconds=seconds,
        memory=peak,
        bytes=size,
        lanes=lanes,
        block=block,
    )


def _cut(scene: Scene, settings: EnvironmentSettings) -> tuple[int, int, int]:
    """Lanes of a launch, nodes of a block, and the peak they lead to."""
    R, F, s2 = len(scene.positions), len(scene.triangles), settings.samples_per_side**2
    memory = settings.memory or machine_memory() // 2
    fixed = _PROCESS_BYTES + F * _BYTES_PER_TRIANGLE + R * (120 + PANEL * _PANEL_COPIES)
    left = _USED_SHARE * memory - fixed
    if left < BYTES_PER_LANE * R + 8 * _BYTES_PER_NODE * R or left <= 0:
        least = (fixed + (BYTES_PER_LANE + 8 * _BYTES_PER_NODE) * R) / _USED_SHARE / 1e9 + 0.05
        reason = f"{memory / 1e9:.1f} GB is not enough for {R:,} receivers; at least {least:.1f} GB is"
        raise InputError("memory", reason)
    lanes = int(min(MAX_LANES, max(R, left // 2 // BYTES_PER_LANE)))
    block = int(min(left // 2 // (_BYTES_PER_NODE * R), max(8, 2 * lanes // (R * s2)), 4096))
    block = max(1, block)
    return (
        lanes,
        block,
        int(fixed + min(lanes, block * s2 * R) * BYTES_PER_LANE + block * _BYTES_PER_NODE * R),
    )


def _speeds(visibility: Visibility, normals: np.ndarray, leaves: np.ndarray, settings: EnvironmentSettings):
    """Seconds for a receiver-direction and for the arithmetic of a node, measured on a few leaves."""
    s2 = settings.samples_per_side**2
    count = max(2, min(16, 2_000_000 // (visibility.receivers * s2) + 2))
    few = leaves[np.linspace(0, len(leaves) - 1, min(count, len(leaves))).astype(int)]
    D = mean_directions(few, settings.resolution).astype(np.float32)
    d = np.repeat(D / np.linalg.norm(D, axis=1, keepdims=True), s2, axis=0)
    bits, _ = visibility.trace(d)
    traced = statistics.median(_seconds(lambda: visibility.trace(d)) for _ in range(3))
    rows = np.arange(len(d), dtype=np.int32).reshape(len(few), s2)
    by_axis = np.ascontiguousarray(normals.T)
    columns, scale = np.empty((len(few), visibility.receivers), np.uint8), np.empty(len(few), np.float32)

    def compute() -> None:
        squared_distances(bits, rows, d.reshape(-1, s2, 3), by_axis, np.empty(rows.shape))
        quantized_means(bits, rows, d.reshape(-1, s2, 3), D, by_axis, columns, scale)

    computed = statistics.median(_seconds(compute) for _ in range(3))
    return traced / (len(d) * visibility.receivers), computed / len(few)


def _seconds(act: Callable[[], object]) -> float:
    started = time.perf_counter()
    act()
    return time.perf_counter() - started


def _tile_share(
    scene: Scene, order: np.ndarray, leaves: np.ndarray, settings: EnvironmentSettings, rng
) -> float:
    """Share of tiles that are not all zero, from whole groups of receivers and each leaf's centre."""
    groups = len(order) // GROUP
    if groups == 0:
        return 1.0
    chosen = np.sort(rng.choice(groups, min(groups, 96), replace=False))
    receivers = order[(chosen[:, None] * GROUP + np.arange(GROUP)).ravel()]
    view = Visibility(
        scene.positions, scene.triangles, origins=scene.positions[receivers], normals=scene.normals[receivers]
    )
    R = settings.resolution
    face, row, column, height, width = leaves.astype(np.int64).T
    centres = texel_directions((face * R + row + height // 2) * R + column + width // 2, R)
    bits, _ = view.trace(centres)
    seen = bits.reshape(len(leaves), len(chosen), GROUP // 8).any(axis=2)
    starts = np.arange(0, len(leaves), TILE)
    return float(np.logical_or.reduceat(seen, starts, axis=0).mean())

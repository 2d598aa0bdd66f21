"""What an environment bake will cost, before it is paid: a pilot bake for a few receivers of some zones.

The test of Eq. 11 is a mean over receivers, so a random sample of them finds nearly the same
clusters; rays, bytes and seconds follow in proportion, with speeds measured on this machine.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field

import numpy as np

from ..bases.cube_map import mean_directions, texel_directions
from ..bases.quadtree import Nodes
from ..encoding.sparse_tiles import GROUP, PANEL, TILE, panels_of_parcel
from ..errors import InputError
from ..scene.geometry import Scene
from ..transport import viewed, visibility
from ..transport.transfer import Transfer
from .bounced_plan import BouncedPlan, plan_bounced
from .clustering import cluster_lights, rows_at_once
from .environment_settings import EnvironmentSettings
from .exitant import ExitantPlan, plan_exitant
from .layer_receivers import LayerReceivers
from .zones import DARK, DIFFUSE, Zone

MOST_PARCELS = 10_000  # what the manifest of a bake can list
_PROCESS_BYTES = 290_000_000  # Python, the renderer and its compiler, measured
_BYTES_PER_TRIANGLE = 200  # of the renderer's tree, measured
_BYTES_PER_ROW = 120  # of receivers and their copies
_BYTES_PER_POINT = 200  # of a surface as an eye sees it
_COPIES_OF_COLUMNS = 4  # of an element found, until it is written
_PANEL_COPIES = 2.5
_USED_SHARE = 0.9  # of the memory allowed: the figures above are measured, not guaranteed
_PILOT_ZONES = 24
_PILOT_RECEIVERS = 160  # of a zone, at least


@dataclass(frozen=True)
class Cut:
    """How the work on a zone is cut to stay within memory."""

    lanes: int  # of a launch
    block: int  # nodes examined at a time


@dataclass(frozen=True)
class EnvironmentPlan:
    """An estimate, and how the work is cut to stay within memory."""

    settings: EnvironmentSettings
    receivers: int
    triangles: int
    zones: int
    tolerance: float
    clusters: int  # of all zones
    rays: int  # active lanes
    receiver_directions: int  # those without a ray included
    seconds: float
    memory: int  # bytes, peak of the process
    bytes: int  # on disk
    cuts: tuple[Cut, ...]  # one a zone
    bounced: BouncedPlan = field(default_factory=BouncedPlan)  # in the figures above
    glossy: ExitantPlan = field(default_factory=ExitantPlan)  # likewise

    def summary(self) -> dict:
        """What ``--dry-run --json`` prints."""
        names = ("receivers", "triangles", "zones", "tolerance", "clusters", "rays", "seconds", "memory")
        figures = {name: getattr(self, name) for name in (*names, "bytes")}
        bounced = {f"bounced_{name}": getattr(self.bounced, name) for name in ("rays", "seconds", "bytes")}
        sun = {} if self.settings.sun is None else {"sun_paths": self.settings.sun.said}
        glossy = asdict(self.glossy) if self.glossy.rows else {}
        glossy = {f"glossy_{name}": value for name, value in glossy.items()}
        return {"resolution": self.settings.resolution} | sun | figures | bounced | glossy


def machine_memory() -> int:
    """Bytes of memory of this machine."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def plan_environment(scene: Scene, settings: EnvironmentSettings, *, seed: int = 0) -> EnvironmentPlan:
    """Estimate a bake, typically within ten percent; costs a few percent of it."""
    layer = LayerReceivers(scene, settings)
    zones = layer.zones
    cuts, peak = _cuts(layer)
    bounced = plan_bounced(layer, settings.memory or machine_memory() // 2)
    glossy = plan_exitant(scene, settings.glossy_order)
    rng = np.random.default_rng(np.random.SeedSequence([seed, 1]))
    speeds: dict[str, _Speed] = {}
    known: dict[int, _Estimate] = {}
    for z in np.unique(np.linspace(0, len(zones) - 1, min(len(zones), _PILOT_ZONES)).round().astype(int)):
        estimate, leaves = _pilot(layer, zones[z], cuts[z], rng)
        known[int(z)] = estimate
        if zones[z].kind not in speeds:
            speeds[zones[z].kind] = _speed(layer.transfer(zones[z]), leaves, settings)
    total = [known.get(z) or _like(zone, zones, known) for z, zone in enumerate(zones)]
    clusters = sum(e.clusters for e in total)
    parcels = sum(-(-e.clusters // _parcel(zone)) for e, zone in zip(total, zones, strict=True))
    if parcels > MOST_PARCELS:
        reason = f"{settings.tolerance_for(layer.count):g} needs about {clusters:,.0f} clusters in"
        reason += (
            f" {parcels:,.0f} files, {MOST_PARCELS:,} at most; choose a larger one or a smaller --resolution"
        )
        raise InputError("tolerance", reason)
    size = int(sum(e.bytes for e in total)) + layer.count * 40 + len(scene.triangles) * 16
    seconds = size / 400e6
    for estimate, zone in zip(total, zones, strict=True):
        speed = speeds.get(zone.kind, next(iter(speeds.values())))
        seconds += estimate.lanes * speed.lane + estimate.nodes * len(zone.rows) * speed.node
    return EnvironmentPlan(
        settings=settings,
        receivers=layer.count,
        triangles=len(scene.triangles),
        zones=len(zones),
        tolerance=settings.tolerance_for(layer.count),
        clusters=round(clusters),
        rays=int(sum(e.rays for e in total)) + bounced.rays + glossy.rays,
        receiver_directions=int(sum(e.lanes for e in total)),
        seconds=float(seconds + 0.02 * parcels) + bounced.seconds + glossy.seconds,
        memory=max(peak, bounced.memory),
        bytes=size + bounced.bytes + glossy.bytes,
        cuts=tuple(cuts),
        bounced=bounced,
        glossy=glossy,
    )


def _parcel(zone: Zone) -> int:
    """Clusters of a parcel."""
    return PANEL * int(panels_of_parcel(zone.groups, zone.channels))


def _cuts(layer: LayerReceivers) -> tuple[list[Cut], int]:
    """Lanes of a launch and nodes of a block for every zone, and the peak they lead to."""
    settings, F = layer.settings, len(layer.scene.triangles)
    memory = settings.memory or machine_memory() // 2
    cuts, peak = [], 0
    s2 = settings.samples_per_side**2
    for zone in layer.zones:
        R = len(zone.rows)
        element = zone.channels * R
        fixed = _PROCESS_BYTES + F * _BYTES_PER_TRIANGLE + layer.count * _BYTES_PER_ROW
        fixed += _parcel(zone) * zone.groups * GROUP * zone.channels * _PANEL_COPIES
        row = R / 8 if zone.kind == DIFFUSE else 4 * element
        node = (
            s2 + rows_at_once(1024, settings.samples_per_side) / 1024
        ) * row + _COPIES_OF_COLUMNS * element
        kind = visibility if zone.kind == DIFFUSE else viewed
        lane, points = kind.BYTES_PER_LANE, R * (settings.pixel_samples if layer.is_picture else 1)
        fixed += points * _BYTES_PER_POINT * (kind is viewed)
        fixed += points * (viewed.BYTES_PER_POINT if kind is viewed else 0)
        left = _USED_SHARE * memory - fixed
        if left < lane * points + 8 * node or left <= 0:
            least = (fixed + lane * points + 8 * node) / _USED_SHARE / 1e9 + 0.05
            reason = f"{memory / 1e9:.1f} GB is not enough for {layer.count:,} receivers; at least {least:.1f} GB is"
            raise InputError("memory", reason)
        lanes = int(min(kind.MAX_LANES, max(points, left // 2 // lane)))
        block = max(1, int(min(left // 2 // node, max(8, 2 * lanes // (points * s2)), 4096)))
        cuts.append(Cut(lanes, block))
        peak = max(peak, int(fixed + min(lanes, block * s2 * points) * lane + block * node))
    return cuts, peak


@dataclass(frozen=True)
class _Estimate:
    """Of one zone."""

    clusters: float
    rays: float
    lanes: float
    nodes: float
    bytes: float


@dataclass(frozen=True)
class _Speed:
    lane: float  # seconds for a receiver-direction
    node: float  # seconds for a receiver of a node: the arithmetic of Eqs. 10 and 11


def _pilot(layer: LayerReceivers, zone: Zone, cut: Cut, rng: np.random.Generator) -> tuple[_Estimate, Nodes]:
    """Bake a few receivers of a zone, in memory.

    A mean over few receivers is uncertain, which splits some nodes that the mean over all would not.
    """
    R = len(zone.rows)
    share = max(1000, min(3000, layer.count // 25)) // len(layer.zones)
    pilot = min(R, max(share, _PILOT_RECEIVERS))
    edges = np.linspace(0, R, pilot + 1).astype(np.int64)
    chosen = rng.integers(edges[:-1], edges[1:])  # one from each stretch of the order: neighbours see alike
    leaves, rays, lanes, nodes = [], 0, 0, 0
    for group, progress in cluster_lights(
        layer.transfer(zone, zone.rows[chosen]),
        layer.settings.test_for(layer.count),
        covered=np.zeros((0, 5), np.int32),
        block=max(cut.block, min(4096, cut.block * R // pilot)),
        lanes=cut.lanes,
    ):
        leaves.append(group.leaves)
        rays, lanes, nodes = progress.rays, progress.lanes, progress.nodes_tested
    found = np.concatenate(leaves)
    panels = -(-len(found) // PANEL)
    groups = zone.groups * zone.channels
    tiles = _tile_share(layer, zone, found, rng) * -(-len(found) // TILE) * groups
    size = tiles * TILE * GROUP + panels * (2 * groups + (20 + 4 * zone.channels) * PANEL)
    return _Estimate(len(found), rays * R / pilot, lanes * R / pilot, nodes, size), found


def _like(zone: Zone, zones: list[Zone], known: dict[int, _Estimate]) -> _Estimate:
    """An estimate for a zone without a pilot, from those of its kind."""
    alike = [(e, zones[z]) for z, e in known.items() if zones[z].kind == zone.kind] or [
        (e, zones[z]) for z, e in known.items()
    ]
    of = {}
    for name in ("clusters", "rays", "lanes", "nodes", "bytes"):
        by_receiver = name in ("rays", "lanes", "bytes")
        values = [getattr(e, name) * (len(zone.rows) / len(z.rows) if by_receiver else 1) for e, z in alike]
        of[name] = float(np.mean(values))
    return _Estimate(**of)


def _speed(transfer: Transfer, leaves: Nodes, settings: EnvironmentSettings) -> _Speed:
    """Measured on a few leaves."""
    s2 = settings.samples_per_side**2
    count = min(1024, 2_000_000 // (transfer.receivers * s2) + 2)
    few = leaves[np.linspace(0, len(leaves) - 1, min(count, len(leaves))).astype(int)]
    D = mean_directions(few, settings.resolution).astype(np.float32)
    d = np.repeat(D / np.linalg.norm(D, axis=1, keepdims=True), s2, axis=0)
    rows, _ = transfer.trace(d, lanes=visibility.MAX_LANES)
    traced = statistics.median(
        _seconds(lambda: transfer.trace(d, lanes=visibility.MAX_LANES)) for _ in range(3)
    )
    places = np.arange(len(d), dtype=np.int32).reshape(len(few), s2)

    def compute() -> None:
        transfer.squared_distances(rows, places, d.reshape(-1, s2, 3))
        transfer.quantized_means(rows, places, d.reshape(-1, s2, 3), D)

    computed = statistics.median(_seconds(compute) for _ in range(3))
    return _Speed(traced / (len(d) * transfer.receivers), computed / (len(few) * transfer.receivers))


def _seconds(act: Callable[[], object]) -> float:
    started = time.perf_counter()
    act()
    return time.perf_counter() - started


def _tile_share(layer: LayerReceivers, zone: Zone, leaves: Nodes, rng: np.random.Generator) -> float:
    """Share of tiles that are not all zero, from whole groups of receivers and each leaf's centre."""
    groups = len(zone.rows) // GROUP
    if groups == 0 or zone.kind == DARK:
        return float(groups == 0)
    most = max(4, 96 // len(layer.zones))
    chosen = np.sort(rng.choice(groups, min(groups, most), replace=False))
    rows = zone.rows[(chosen[:, None] * GROUP + np.arange(GROUP)).ravel()]
    transfer, R = layer.transfer(zone, rows), layer.settings.resolution
    face, row, column, height, width = leaves.astype(np.int64).T
    centres = texel_directions((face * R + row + height // 2) * R + column + width // 2, R)
    seen = np.empty((len(leaves), transfer.channels, len(chosen)), bool)
    step = max(1, 4_000_000 // (transfer.channels * transfer.receivers))
    for start in range(0, len(leaves), step):
        d = centres[start : start + step]
        T = transfer.values(transfer.trace(d, lanes=visibility.MAX_LANES)[0], d)
        kept = (T.max(axis=2, keepdims=True) <= 510 * T) & (T > 0)  # what is less becomes byte 0
        seen[start : start + step] = kept.reshape(len(d), T.shape[1], len(chosen), GROUP).any(axis=3)
    starts = np.arange(0, len(leaves), TILE)
    return float(np.logical_or.reduceat(seen, starts, axis=0).mean())

"""What the bounced light of a layer will cost, from a few receivers' rays."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from ..arrays import Positions
from ..bases.quadtree import Nodes
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..scene.geometry import Scene
from ..transport.gathering_kernels import count_entries
from ..transport.hemisphere import HemisphereRays
from ..transport.metal_rays import MOST_BYTES, MetalRays, MirroredHits
from ..transport.photon_mapping import PhotonMap
from ..transport.photon_sources import SkySource
from ..transport.photon_tracing import BATCH, CAUSTIC
from .bounced import COLUMNS, MIXTURES, MOST_MODES
from .caustics import BOUNCED_SHARE, CELLS_AT_ONCE, followed_metals
from .first_bounce import BYTES_PER_ENTRY, BYTES_PER_VERTEX, MOST_ENTRIES
from .layer_receivers import LayerReceivers
from .light_cells import ASKED_AT_ONCE, DIRECTIONS, light_cells
from .zones import VIEWED

_PROCESS_BYTES = 330_000_000  # Python, the renderer and its compiler, measured
_BYTES_PER_TRIANGLE = 200  # of the renderer's tree
_SOLVER_COPIES = 22  # of the columns that are solved together
_RAYS_AT_ONCE = 1 << 22
_BYTES_PER_RAY = 60  # of a tile of the operator
_BYTES_PER_COLOUR = 110  # of a ray, where each brings a colour of its own
_SKY_COPIES = 2.5  # of what metal mirrors of it
_USED_SHARE = 0.9
_STRETCHES, _TRIED_RAYS = 5, 1 << 18  # whose hits are tried
_PRODUCTS = 8  # that solving takes
_ENTRY_COLUMNS = 2.5e9  # a second, of the products, measured on two cores
_USUAL_MODES = 0.6  # of the most
_KEPT, _KEPT_SHARE = (
    10.0,
    0.6,
)  # of the operator's n entries of a row 10·√n, measured in rooms and in the open

_BYTES_PER_PHOTON = 200  # that has landed, the tree over them and what they weigh
_SECONDS_PER_LANDED = 2e-6  # of a photon, measured: the tree and the sums
_PHOTON_RAYS = 4  # that one is, about
_PHOTON_ENTRIES, _CAUSTIC_ENTRIES, _BYTES_PER_CAUSTIC = 4, 200, 3  # of a landed photon, of a vertex, on disk


@dataclass(frozen=True)
class BouncedPlan:
    """An estimate; nothing where light does not bounce."""

    rays: int = 0
    seconds: float = 0.0
    memory: int = 0  # bytes, peak of the process
    bytes: int = 0  # on disk
    entries: int = 0
    photons: int = 0  # of the whole sky, for caustics
    photon_seconds: float = 0.0
    operator_bytes: int = 0  # what the operator may take; beyond it tiles are traced again in each product


def plan_bounced(layer: LayerReceivers, memory: int) -> BouncedPlan:
    """Raises InputError where ``memory`` bytes are not enough."""
    settings, scene = layer.settings, layer.scene
    if settings.bounces == 0:
        return BouncedPlan()
    V, N, cells = len(scene.positions), layer.count, light_cells(settings.resolution)
    viewed = sum(len(zone.rows) for zone in layer.zones if zone.kind == VIEWED)
    coloured = bool(scene.textures) or layer.metals is not None  # entries
    grey = not viewed and not coloured and bool((scene.albedo == scene.albedo[:, :1]).all())
    C = 1 if grey else 3
    tried = _tried(scene, _rays_of(layer, cells))
    per_row, ray_seconds, entries = tried.entries, tried.seconds, int(tried.entries * V)
    wanted = entries * (8 if not coloured else 4 + 4 * C) + 8 * V

    fixed = _PROCESS_BYTES + len(scene.triangles) * _BYTES_PER_TRIANGLE
    per_ray = _BYTES_PER_RAY + (0 if layer.metals is None else _BYTES_PER_COLOUR)
    fixed += min(_RAYS_AT_ONCE, V * settings.gather_rays) * per_ray
    fixed += int(V * tried.sky_bytes * _SKY_COPIES) + (0 if layer.metals is None else MOST_BYTES)
    fixed += min(ASKED_AT_ONCE, V * DIRECTIONS) * 12
    fixed += V * (C * 4 * (2 * MIXTURES + _SOLVER_COPIES * COLUMNS) + DIRECTIONS // 8) + N * MIXTURES * 12
    keeps_first = not viewed and N == V
    kept = min(MOST_ENTRIES, _KEPT * per_row**0.5, _KEPT_SHARE * per_row)
    first = int(V * (BYTES_PER_VERTEX + BYTES_PER_ENTRY * kept)) if keeps_first else 0
    fixed += 2 * first
    photons = _plan_photons(layer)
    fixed += photons.memory
    left = int(_USED_SHARE * memory - fixed)
    if left < 0:
        least = fixed / _USED_SHARE / 1e9 + 0.05
        reason = f"{memory / 1e9:.1f} GB is not enough for the bounced light of {V:,} vertices;"
        raise InputError("memory", f"{reason} at least {least:.1f} GB is, or --bounces 0")

    gathered = V * settings.gather_rays
    rays = gathered + int(V * tried.sent_on) + V * DIRECTIONS // 2 + 2 * viewed * settings.gather_rays
    products = _PRODUCTS if settings.bounces is None else min(settings.bounces, _PRODUCTS)
    passes = 2 * -(-MIXTURES // COLUMNS) * products
    seconds = rays * ray_seconds + 2.0 * entries * MIXTURES * C * products / _ENTRY_COLUMNS
    if wanted > left:
        seconds += passes * (1 - left / wanted) * gathered * ray_seconds
    modes = int(MOST_MODES * _USUAL_MODES)
    size = modes * (N + (0 if viewed else C * V) + 4 * C * len(cells)) + first
    return BouncedPlan(
        rays=rays + photons.rays,
        seconds=float(seconds) + photons.seconds,
        memory=int(fixed + min(wanted, left)),
        bytes=size + photons.bytes,
        photons=photons.count,
        photon_seconds=photons.seconds,
        entries=entries,
        operator_bytes=left,
    )


def tried_rows(
    scene: Scene, occluders: Occluders, origins: Positions, *, gather_rays: int
) -> tuple[float, float]:
    """Entries of a row of the operator, and seconds a ray, from some receivers of the scene."""
    rays = HemisphereRays(occluders, scene, origins=origins, normals=scene.normals, rays=gather_rays)
    tried = _tried(scene, rays)
    return tried.entries, tried.seconds


@dataclass(frozen=True)
class _Tried:
    """Of a row of the operator, the mean of some."""

    entries: float
    seconds: float  # a ray, with those that metal sends on
    sent_on: float  # rays
    sky_bytes: float  # of the sky by way of metal


def _rays_of(layer: LayerReceivers, cells: Nodes) -> HemisphereRays:
    scene, rays, metals = layer.scene, layer.settings.gather_rays, followed_metals(layer, cells)
    origins, normals = layer.origins, scene.normals
    if metals is None:
        return HemisphereRays(layer.occluders, scene, origins=origins, normals=normals, rays=rays)
    return MetalRays(layer.occluders, scene, metals, origins=origins, normals=normals, rays=rays)


def _tried(scene: Scene, rays: HemisphereRays) -> _Tried:
    V = len(scene.positions)
    count = min(max(1, _TRIED_RAYS // rays.rays), V)
    counts = np.empty(count, np.int64)
    found, took, by_metal = [], [], []
    for first in np.linspace(0, V - count, _STRETCHES).astype(int):
        began = time.perf_counter()
        hits = rays.trace(int(first), count)
        count_entries(np.ascontiguousarray(scene.triangles), hits.triangle, counts, V)
        took.append(time.perf_counter() - began)
        found.append(counts.mean())
        if isinstance(hits, MirroredHits):
            by_metal.append((hits.to_sky.rays / count, hits.to_sky.bytes / count))
    sent_on, sky_bytes = np.mean(by_metal, axis=0) if by_metal else (0.0, 0.0)
    seconds = min(took) / (count * rays.rays)
    return _Tried(float(np.mean(found)), seconds, float(sent_on), float(sky_bytes))


@dataclass(frozen=True)
class _Photons:
    """What caustics will cost."""

    count: int = 0
    rays: int = 0
    seconds: float = 0.0
    memory: int = 0
    bytes: int = 0


def _plan_photons(layer: LayerReceivers) -> _Photons:
    """From two batches, the first of which compiles."""
    if not layer.photons:
        return _Photons()
    trial = PhotonMap(layer.scene, layer.occluders, SkySource(), ways=CAUSTIC)
    trial.batch(0)
    began = time.perf_counter()
    landed = len(trial.batch(1))
    seconds = (time.perf_counter() - began) * layer.photons / BATCH * (1 + BOUNCED_SHARE)
    kept = layer.photons * landed / BATCH
    entries = min(_PHOTON_ENTRIES * kept, _CAUSTIC_ENTRIES * len(layer.scene.positions))
    return _Photons(
        count=layer.photons,
        rays=int(_PHOTON_RAYS * layer.photons),
        seconds=float(seconds + kept * _SECONDS_PER_LANDED),
        memory=int(kept * _BYTES_PER_PHOTON) + CELLS_AT_ONCE,
        bytes=int(entries * _BYTES_PER_CAUSTIC),
    )

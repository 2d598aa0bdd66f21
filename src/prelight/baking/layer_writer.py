"""An environment layer on disk: zone after zone, in parcels of whole panels, as clusters are found."""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from ..bases.quadtree import LeafCover
from ..encoding.sparse_tiles import GROUP, PANEL, TILE, encode_panel, panels_of_parcel
from ..scene.geometry import Scene
from ..storage.chunks import ArraySpec, ChunkRecord
from ..storage.journal import BakeWriter
from ..storage.manifest import FORMAT, VERSION, CameraRecord, LayerRecord, Manifest, SceneRecord
from .bounced import BouncedLight
from .bounced_writer import write_bounced
from .clustering import cluster_lights
from .environment_plan import EnvironmentPlan
from .environment_settings import PIXELS, EnvironmentSettings
from .exitant import write_exitant
from .layer_receivers import LayerReceivers
from .zones import DIFFUSE, Zone

LAYER = "layers/environment"
Report = Callable[[float, float, int], None]  # fraction done, seconds left, clusters so far


class LayerWriter:
    """Turns the clusters of every zone into chunks on disk, and these into a manifest."""

    def __init__(
        self, receivers: LayerReceivers, plan: EnvironmentPlan, writer: BakeWriter, report: Report | None
    ) -> None:
        self.receivers, self.plan, self.writer = receivers, plan, writer
        self.scene, self.settings = receivers.scene, receivers.settings
        self.report = report or (lambda *_: None)
        self.test = self.settings.test_for(receivers.count)
        self.last_parcel = self.started = time.perf_counter()
        self.rays_before = self.rays_done = sum(e["rays"] for e in writer.entries)
        self.clusters = sum(len(e["leaves"]) for e in self.parcels)
        self.glossy: dict[str, Any] = {}
        self.glossy_rays = 0
        self.chunks: dict[str, ChunkRecord] = {}
        self.arrays: dict[str, ArraySpec] = {}

    @property
    def parcels(self) -> list[dict[str, Any]]:
        """The journal's lines of parcels; the last line of all is that of bounced light."""
        return [e for e in self.writer.entries if "zone" in e]

    @property
    def bounced(self) -> dict[str, Any] | None:
        """The journal's line of bounced light, if it is done."""
        return next((e for e in self.writer.entries if "bounced" in e), None)

    def run(self) -> Manifest:
        """Bake what the journal does not have yet."""
        for z, zone in enumerate(self.receivers.zones):
            kept = [np.array(e["leaves"], np.int32) for e in self.parcels if e["zone"] == z]
            leaves = np.concatenate(kept) if kept else np.zeros((0, 5), np.int32)
            cover = LeafCover(leaves, self.settings.resolution)
            if not cover.is_complete:
                self._bake_after(z, zone, cover)
        if self.settings.bounces != 0 and self.bounced is None:
            self._bounce()
        self.report(1.0, 0.0, self.clusters)
        return self._manifest()

    def _bake_after(self, z: int, zone: Zone, cover: LeafCover) -> None:
        """Cluster the lights of a zone after those that earlier parcels cover, and write parcels."""
        cut, size = self.plan.cuts[z], int(panels_of_parcel(zone.groups, zone.channels)) * PANEL
        found = cluster_lights(
            self.receivers.transfer(zone), self.test, covered=cover.leaves, block=cut.block, lanes=cut.lanes
        )
        pending: list[tuple] = []
        rays = 0
        for group, progress in found:
            pending.extend(zip(group.leaves, group.columns, group.scale, group.rays, strict=True))
            self.clusters += len(group.leaves)
            self.rays_done += progress.rays - rays
            rays = progress.rays
            while len(pending) >= size:
                self._write_parcel(z, pending[:size])
                del pending[:size]
            self._tell()
        if pending:
            self._write_parcel(z, pending)

    def _bounce(self) -> None:
        """Light that has bounced, of the whole layer at once: made anew if it was interrupted."""
        plan, began = self.plan, time.perf_counter()
        direct = 1 - plan.bounced.seconds / max(plan.seconds, 1e-9)

        def told(share: float) -> None:
            elapsed = time.perf_counter() - began
            left = elapsed * (1 - share) / share if share > 0.01 else plan.bounced.seconds
            self.report(min(0.99, direct + (1 - direct) * share), left, self.clusters)

        light = BouncedLight(
            self.receivers, rays=self.settings.gather_rays, most=self.settings.bounces,
            memory=plan.bounced.operator_bytes, report=told,
        )  # fmt: skip
        lanes = min(cut.lanes for cut in plan.cuts)
        line = write_bounced(self.writer, f"{LAYER}/bounced", light.found(lanes=lanes), self.receivers.zones)
        self.writer.append(line | {"seconds": time.perf_counter() - began})

    def _tell(self) -> None:
        plan = self.plan
        planned, seconds = max(plan.rays - plan.bounced.rays, 1), max(plan.seconds, 1e-9)
        share = (self.rays_done - self.rays_before) / max(planned - self.rays_before, 1)
        elapsed, later = time.perf_counter() - self.started, plan.bounced.seconds
        left = elapsed * (1 - min(share, 0.99)) / min(share, 0.99) if share > 0 else seconds - later
        done = min(0.99, self.rays_done / planned) * (1 - later / seconds)
        self.report(min(done, 0.99), left + later, self.clusters)

    def _write_parcel(self, z: int, clusters: list[tuple]) -> None:
        """Four chunks, then the journal's line that says they are whole."""
        leaves, columns, scales, rays = (np.stack(x) for x in zip(*clusters, strict=True))
        tiles, present = _encoded(columns)
        q = len(self.parcels)
        written = {}
        parts = {"tiles": tiles, "present": present, "rectangles": leaves, "scales": scales}
        for name, values in parts.items():
            key, record = self.writer.write_chunk(
                f"{LAYER}/{name}/{q:05d}", (0,) * values.ndim, values, _whole(values)
            )
            written[key] = record.model_dump()
        self.writer.append(
            {
                "zone": z,
                "leaves": leaves.tolist(),
                "rays": int(rays.sum()),
                "tiles": len(tiles),
                "nonzero": int(np.count_nonzero(columns)),
                "seconds": time.perf_counter() - self.last_parcel,  # not published
                "chunks": written,
            }
        )
        self.last_parcel = time.perf_counter()

    def _write_glossy(self) -> None:
        """Gloss for any eye, where it is wanted: of seconds, so that the journal need not know it."""
        if (part := self.receivers.glossy) is None:
            return
        written = write_exitant(self.writer, f"{LAYER}/glossy", part)
        self.arrays |= {name: ArraySpec(**spec) for name, spec in written["arrays"].items()}
        self.chunks |= {key: ChunkRecord(**record) for key, record in written["chunks"].items()}
        self.glossy, self.glossy_rays = written["statistics"], written["rays"]

    def _write_whole(self, name: str, values: np.ndarray) -> None:
        self.arrays[name] = _whole(values)
        key, record = self.writer.write_chunk(name, (0,) * values.ndim, values, self.arrays[name])
        self.chunks[key] = record

    def _name_parcels(self) -> None:
        """Array specifications and chunk records of all that the journal has."""
        for q, entry in enumerate(self.parcels):
            zone, clusters = self.receivers.zones[entry["zone"]], len(entry["leaves"])
            panels = -(-clusters // PANEL)
            for name, shape, dtype in (
                ("tiles", [entry["tiles"], TILE, GROUP], "uint8"),
                ("present", [panels, zone.groups * zone.channels], "uint16"),
                ("rectangles", [clusters, 5], "int32"),
                ("scales", [clusters, zone.channels], "float32"),
            ):
                spec = ArraySpec(shape=shape, dtype=dtype, chunk_shape=shape)
                self.arrays[f"{LAYER}/{name}/{q:05d}"] = spec
            self.chunks |= {key: ChunkRecord(**record) for key, record in entry["chunks"].items()}
        if (bounced := self.bounced) is not None:
            self.arrays |= {name: ArraySpec(**spec) for name, spec in bounced["arrays"].items()}
            self.chunks |= {key: ChunkRecord(**record) for key, record in bounced["chunks"].items()}

    def _manifest(self) -> Manifest:
        scene, zones = self.scene, self.receivers.zones
        for name in ("positions", "normals", "albedo", "triangles", "material_of", "uv", "tint"):
            if (values := getattr(scene, name)) is not None:
                self._write_whole(f"scene/{name}", values)
        for k, texture in enumerate(scene.textures):
            self._write_whole(f"scene/textures/{k:05d}", texture)
        if self.receivers.settings.bounces != 0 and any(zone.kind == DIFFUSE for zone in zones):
            self._write_whole(f"{LAYER}/origins", self.receivers.origins)
        self._write_whole(f"{LAYER}/order", np.concatenate([zone.stored_rows() for zone in zones]))
        found = np.zeros((len(zones), 2), np.int32)  # clusters, parcels
        for entry in self.parcels:
            found[entry["zone"]] += (len(entry["leaves"]), 1)
        shapes = np.array([(zone.groups, zone.channels) for zone in zones], np.int32)
        self._write_whole(f"{LAYER}/zones", np.concatenate([shapes, found], axis=1))
        self._name_parcels()
        self._write_glossy()
        return Manifest(
            format=FORMAT,
            version=VERSION,
            settings=identity(self.receivers),
            scene=_scene_record(scene, self.receivers.notes),
            layers={"environment": self._layer_record(found[:, 0])},
            arrays=self.arrays,
            chunks=self.chunks,
            software=software(),
        )

    def _layer_record(self, clusters: np.ndarray) -> LayerRecord:
        zones, entries, settings = self.receivers.zones, self.parcels, self.settings
        bounced = self.bounced
        elements = sum(int(c) * z.channels * len(z.rows) for c, z in zip(clusters, zones, strict=True))
        is_viewed = any(zone.channels == 3 for zone in zones)
        eye = self.receivers.eye
        camera = CameraRecord(name=eye[0], view=_plain(eye[1].to_dict())) if eye and is_viewed else None
        parameters: dict[str, Any] = {
            "resolution": settings.resolution,
            "tolerance": self.test.tolerance,
            "epsilon": self.test.tolerance / self.receivers.count**0.5,
            "samples_per_side": settings.samples_per_side,
            "receivers": settings.receivers,
            "zones": len(zones),
            **_sun(settings),
            **_bounces(settings),
            **_photons(self.receivers),
            **_glossy(settings, has_any=bool(self.glossy)),
        }
        if settings.receivers == PIXELS:
            parameters |= {
                "width": settings.width, "height": settings.height, "samples": settings.pixel_samples
            }  # fmt: skip
        return LayerRecord(
            kind="environment",
            basis_lights=6 * settings.resolution**2,
            coefficients=int(clusters.sum()),
            rays=sum(e["rays"] for e in self.writer.entries) + self.glossy_rays,
            camera=camera,
            parameters=parameters,
            statistics={
                "nonzero_share": sum(e["nonzero"] for e in entries) / elements,
                "tiles": sum(e["tiles"] for e in entries),
                **({} if bounced is None else bounced["bounced"]),
                **self.glossy,
            },
        )


def _encoded(columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tiles of panel after panel, and presence (panels, channels·groups)."""
    panels = [encode_panel(columns[start : start + PANEL]) for start in range(0, len(columns), PANEL)]
    tiles = np.concatenate([t for t, _ in panels])
    if not len(tiles):
        tiles = np.zeros((1, TILE, GROUP), np.uint8)  # an array has no empty shape
    return tiles, np.stack([p for _, p in panels])


def identity(receivers: LayerReceivers) -> dict[str, int | float | str | None]:
    """Everything the bytes of the bake depend on."""
    settings: EnvironmentSettings = receivers.settings
    eye = receivers.eye
    picture = (settings.width, settings.height, settings.pixel_samples)
    is_picture = settings.receivers == PIXELS
    return {
        "kind": "environment",
        "scene": receivers.scene.digest,
        "receivers": settings.receivers,
        "rows": receivers.count,
        "resolution": settings.resolution,
        "tolerance": settings.tolerance_for(receivers.count),
        "samples_per_side": settings.samples_per_side,
        "zones": settings.zones,
        "camera": json.dumps(eye[1].to_dict(), sort_keys=True) if eye else None,
        "picture": f"{picture[0]}x{picture[1]}, {picture[2]} samples" if is_picture else None,
        **_sun(settings),
        **_bounces(settings),
        **_photons(receivers),
        **_glossy(settings),
        **software(),
    }


def _sun(settings: EnvironmentSettings) -> dict[str, float | str]:
    return {} if settings.sun is None else {"sun_paths": settings.sun.said}


def _photons(receivers: LayerReceivers) -> dict[str, int]:
    return {"photons": receivers.photons} if receivers.photons else {}


def _glossy(settings: EnvironmentSettings, *, has_any: bool = True) -> dict[str, int]:
    return {"glossy_order": settings.glossy_order} if settings.glossy_order and has_any else {}


def _bounces(settings: EnvironmentSettings) -> dict[str, int | str]:
    if settings.bounces == 0:
        return {"bounces": 0}
    return {"bounces": settings.bounces or "all", "gather_rays": settings.gather_rays}


def software() -> dict[str, str]:
    """Versions of what makes the bytes, and the processor's family."""

    def installed(name: str) -> str:
        try:
            return version(name)
        except PackageNotFoundError:
            return "not installed"

    names = ("prelight", "mitsuba", "drjit", "numba", "numpy")
    return {name: installed(name) for name in names} | {"machine": platform.machine()}


def _scene_record(scene: Scene, notes: Sequence[str]) -> SceneRecord:
    return SceneRecord(
        name=scene.name,
        digest=scene.digest,
        cameras=[CameraRecord(name=n, view=_plain(c.to_dict())) for n, c in scene.cameras.items()],
        notes=[*scene.notes, *notes],
        materials=[_plain(material.to_dict()) for material in scene.materials],
    )


def _plain(value: Any) -> Any:
    """Tuples as lists, as JSON gives them back."""
    if isinstance(value, Mapping):
        return {name: _plain(inner) for name, inner in value.items()}
    return [_plain(inner) for inner in value] if isinstance(value, list | tuple) else value


def _whole(values: np.ndarray) -> ArraySpec:
    """An array in one chunk."""
    return ArraySpec(shape=list(values.shape), dtype=values.dtype.name, chunk_shape=list(values.shape))

"""The environment bake: any environment map as clustered environment lights, one byte an element.

Johan and Nishita, "Clustering Environment Lights for an Efficient All-Frequency Relighting". Diffuse
vertices, free viewpoint (the paper's geometry relighting): section 4 is ``clustering``, the layer
is written panel by panel as clusters are found, in an order that does not depend on how.
"""

from __future__ import annotations

import platform
import shutil
import time
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from ..bases.quadtree import LeafCover
from ..encoding.sparse_tiles import GROUP, PANEL, TILE, encode_panel, groups_of
from ..errors import InterruptedBakeError, OutputError
from ..scene.geometry import Scene
from ..storage.bake import Bake
from ..storage.chunks import ArraySpec, ChunkRecord
from ..storage.journal import BakeWriter, partial_folder, refuse_target
from ..storage.manifest import FORMAT, VERSION, CameraRecord, LayerRecord, Manifest, SceneRecord
from ..transport.ordering import receiver_order
from ..transport.visibility import Visibility
from .clustering import cluster_lights
from .environment_plan import EnvironmentPlan, EnvironmentSettings, plan_environment

LAYER = "layers/environment"
_DISK_MARGIN = 1.1  # the plan is an estimate
Report = Callable[[float, float, int], None]  # fraction done, seconds left, clusters so far


def bake_environment(  # noqa: PLR0913  (the settings, one by one, for notebooks)
    scene: Scene,
    path: str | Path,
    *,
    resolution: int = 256,
    tolerance: float | None = None,
    epsilon: float | None = None,
    samples_per_side: int = 3,
    memory: int | None = None,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Bake ``scene`` for any environment into the new folder ``path``.

    Parameters
    ----------
    resolution, tolerance, epsilon, samples_per_side, memory
        See EnvironmentSettings.
    resume, force
        Go on with an interrupted bake of the same settings; replace what is there.
    report
        Called after each block of work with the fraction done, the seconds left and the clusters found.

    Raises
    ------
    InputError
        Settings out of range, or a partial bake of other settings.
    OutputError
        ``path`` exists, the disk is full or cannot be written; what was done can be resumed.
    InterruptedBakeError
        Stopped by Ctrl-C; what was done can be resumed.
    MissingExtraError
        Mitsuba or its LLVM is not installed.
    """
    settings = EnvironmentSettings(resolution, tolerance, epsilon, samples_per_side, memory)
    refuse_target(Path(path), force=force)
    plan = plan_environment(scene, settings)
    return bake_planned(scene, path, plan=plan, resume=resume, force=force, report=report)


def bake_planned(
    scene: Scene,
    path: str | Path,
    *,
    plan: EnvironmentPlan,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Carry out a plan of the same scene; otherwise as ``bake_environment``."""
    settings = plan.settings
    _check_disk(Path(path), plan)
    writer = BakeWriter(Path(path), settings=_identity(scene, settings), resume=resume, force=force)
    started, earlier = time.perf_counter(), sum(entry.get("seconds", 0.0) for entry in writer.entries)
    try:
        manifest = writer.complete or _LayerWriter(scene, settings, plan, writer, report).run()
        writer.publish(manifest)
    except KeyboardInterrupt as stop:
        kept = sum(len(entry["leaves"]) for entry in writer.entries)
        reason = f"stopped with {kept:,} clusters kept; run the same command with --resume to go on"
        raise InterruptedBakeError(path, reason) from stop
    finally:
        writer.close()
    bake = Bake.open(path)
    bake.note_seconds(earlier + time.perf_counter() - started)
    return bake


def _check_disk(path: Path, plan: EnvironmentPlan) -> None:
    """Raises OutputError if the bake will not fit: better before hours of rays than after."""
    try:
        free = shutil.disk_usage(path.absolute().parent).free
        kept = sum(file.stat().st_size for file in partial_folder(path).rglob("*") if file.is_file())
    except (OSError, ValueError):
        return  # what is wrong with the folder is said where it is written to
    if free + kept < _DISK_MARGIN * plan.bytes:
        reason = f"about {plan.bytes / 1e6:,.0f} MB will be written and {free / 1e6:,.0f} MB are free"
        raise OutputError(path, reason + "; free some space or choose another disk")


def _identity(scene: Scene, settings: EnvironmentSettings) -> dict:
    """Everything the bytes of the bake depend on."""
    return {
        "kind": "environment",
        "scene": scene.digest,
        "receivers": len(scene.positions),
        "resolution": settings.resolution,
        "tolerance": settings.tolerance_for(len(scene.positions)),
        "samples_per_side": settings.samples_per_side,
        **_software(),
    }


def _software() -> dict[str, str]:
    def installed(name: str) -> str:
        try:
            return version(name)
        except PackageNotFoundError:
            return "not installed"

    names = ("prelight", "mitsuba", "drjit", "numba", "numpy")
    return {name: installed(name) for name in names} | {"machine": platform.machine()}


class _LayerWriter:
    """Turns the stream of clusters into panels on disk."""

    def __init__(
        self,
        scene: Scene,
        settings: EnvironmentSettings,
        plan: EnvironmentPlan,
        writer: BakeWriter,
        report: Report | None,
    ) -> None:
        self.scene, self.settings, self.plan, self.writer = scene, settings, plan, writer
        self.report = report or (lambda *_: None)
        self.receivers = len(scene.positions)
        self.last_panel = time.perf_counter()
        self.order = receiver_order(scene.positions, scene.normals)
        self.chunks: dict[str, ChunkRecord] = {}
        self.arrays: dict[str, ArraySpec] = {}

    def run(self) -> Manifest:
        entries = self.writer.entries
        leaves = [np.array(e["leaves"], np.int32) for e in entries]
        cover = LeafCover(
            np.concatenate(leaves) if leaves else np.zeros((0, 5), np.int32), self.settings.resolution
        )
        if not cover.is_complete:
            self._bake_after(cover)
        return self._manifest()

    def _bake_after(self, cover: LeafCover) -> None:
        """Cluster the lights after those that earlier panels cover, and write panels."""
        scene, order = self.scene, self.order
        normals = scene.normals[order]
        visibility = Visibility(
            scene.positions, scene.triangles, origins=scene.positions[order], normals=normals
        )
        found = cluster_lights(
            visibility,
            normals,
            self.settings.test_for(self.receivers),
            covered=cover.leaves,
            block=self.plan.block,
            lanes=self.plan.lanes,
        )
        started, before = time.perf_counter(), sum(e["rays"] for e in self.writer.entries)
        clusters = len(cover.leaves)
        pending: list[tuple] = []
        for group, progress in found:
            clusters += len(group.leaves)
            pending.extend(zip(group.leaves, group.columns, group.scale, group.rays, strict=True))
            while len(pending) >= PANEL:
                self._write_panel(pending[:PANEL])
                del pending[:PANEL]
            done = min(0.99, (before + progress.rays) / max(self.plan.rays, 1))
            share = min(0.99, progress.rays / max(self.plan.rays - before, 1))
            elapsed = time.perf_counter() - started
            self.report(done, elapsed * (1 - share) / share if share else self.plan.seconds, clusters)
        if pending:
            self._write_panel(pending)
        self.report(1.0, 0.0, clusters)

    def _write_panel(self, clusters: list[tuple]) -> None:
        """Four chunks, then the journal's line that says they are whole."""
        leaves, columns, scales, rays = (np.stack(x) for x in zip(*clusters, strict=True))
        tiles, present = encode_panel(columns)
        if not len(tiles):
            tiles = np.zeros((1, TILE, GROUP), np.uint8)  # an array has no empty shape
        p = len(self.writer.entries)
        specs = self._panel_specs(p + 1)
        written = dict(
            [
                self.writer.write_chunk(f"{LAYER}/tiles/{p:05d}", (0, 0, 0), tiles, _whole(tiles)),
                self.writer.write_chunk(f"{LAYER}/present", (p, 0), present[None], specs["present"]),
                self.writer.write_chunk(f"{LAYER}/rectangles", (p, 0), leaves, specs["rectangles"]),
                self.writer.write_chunk(f"{LAYER}/scales", (p,), scales, specs["scales"]),
            ]
        )
        entry = {
            "leaves": leaves.tolist(),
            "rays": int(rays.sum()),
            "tiles": len(tiles),
            "nonzero": int(np.count_nonzero(columns)),
            "seconds": time.perf_counter() - self.last_panel,  # in the journal alone, which is not published
            "chunks": {key: record.model_dump() for key, record in written.items()},
        }
        self.writer.append(entry)
        self.last_panel = time.perf_counter()

    def _panel_specs(self, panels: int, clusters: int | None = None) -> dict[str, ArraySpec]:
        clusters = clusters or panels * PANEL
        groups = groups_of(self.receivers)
        return {
            "present": ArraySpec(shape=[panels, groups], dtype="uint16", chunk_shape=[1, groups]),
            "rectangles": ArraySpec(shape=[clusters, 5], dtype="int32", chunk_shape=[PANEL, 5]),
            "scales": ArraySpec(shape=[clusters], dtype="float32", chunk_shape=[PANEL]),
        }

    def _write_whole(self, name: str, values: np.ndarray) -> None:
        self.arrays[name] = _whole(values)
        key, record = self.writer.write_chunk(name, (0,) * values.ndim, values, self.arrays[name])
        self.chunks[key] = record

    def _manifest(self) -> Manifest:
        scene, entries = self.scene, self.writer.entries
        for name in ("positions", "normals", "albedo", "triangles", "material_of", "uv", "tint"):
            if (values := getattr(scene, name)) is not None:
                self._write_whole(f"scene/{name}", values)
        for k, texture in enumerate(scene.textures):
            self._write_whole(f"scene/textures/{k:05d}", texture)
        self._write_whole(f"{LAYER}/order", self.order)
        clusters = sum(len(e["leaves"]) for e in entries)
        for name, spec in self._panel_specs(len(entries), clusters).items():
            self.arrays[f"{LAYER}/{name}"] = spec
        for p, entry in enumerate(entries):
            shape = [entry["tiles"], TILE, GROUP]
            self.arrays[f"{LAYER}/tiles/{p:05d}"] = ArraySpec(shape=shape, dtype="uint8", chunk_shape=shape)
            self.chunks |= {key: ChunkRecord(**record) for key, record in entry["chunks"].items()}
        tolerance = self.settings.tolerance_for(self.receivers)
        layer = LayerRecord(
            kind="environment",
            basis_lights=6 * self.settings.resolution**2,
            coefficients=clusters,
            rays=sum(e["rays"] for e in entries),
            parameters={
                "resolution": self.settings.resolution,
                "tolerance": tolerance,
                "epsilon": tolerance / self.receivers**0.5,
                "samples_per_side": self.settings.samples_per_side,
            },
            statistics={
                "nonzero_share": sum(e["nonzero"] for e in entries) / (clusters * self.receivers),
                "tiles": sum(e["tiles"] for e in entries),
            },
        )
        return Manifest(
            format=FORMAT,
            version=VERSION,
            settings=_identity(scene, self.settings),
            scene=SceneRecord(
                name=scene.name,
                digest=scene.digest,
                cameras=[CameraRecord(name=n, view=_plain(c.to_dict())) for n, c in scene.cameras.items()],
                notes=list(scene.notes),
                materials=[_plain(material.to_dict()) for material in scene.materials],
            ),
            layers={"environment": layer},
            arrays=self.arrays,
            chunks=self.chunks,
            software=_software(),
        )


def _plain(fields: Mapping) -> dict:
    """Tuples as lists, as JSON gives them back."""
    plain = {}
    for name, value in fields.items():
        plain[name] = (
            _plain(value)
            if isinstance(value, Mapping)
            else list(value)
            if isinstance(value, tuple)
            else value
        )
    return plain


def _whole(values: np.ndarray) -> ArraySpec:
    """An array in one chunk."""
    return ArraySpec(shape=list(values.shape), dtype=values.dtype.name, chunk_shape=list(values.shape))

"""Baking steerable lamps under one eye: basis images in one pass of tracing each, then principal components.

Strips of pixels and rounds of paths from the lamp are kept as they are done, so that a stopped bake goes on; the
finished bake keeps components alone.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..encoding.octahedral import encoded_directions, encoded_places
from ..encoding.principal_components import (
    Components,
    Images,
    Keep,
    basis_lights,
    gram,
    no_components,
    principal_components,
    to_bytes,
)
from ..errors import InputError
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from ..storage.bake import Bake
from ..storage.chunks import ChunkRecord
from ..storage.journal import BakeWriter, refuse_target
from ..storage.manifest import FORMAT, VERSION, CameraRecord, LayerRecord, Manifest
from ..transport.basis_images import BasisTracer
from ..transport.deep_buffer import deep_samples
from ..transport.steered_lamps import SteeredBox, SteeredPanel
from .carrying_out import carry_out, check_disk
from .layer_writer import software
from .scene_arrays import WrittenArrays, plain, scene_record, whole
from .span_images import Chunk, Evened, SpanImages
from .steerable_plan import SteerablePlan, plan_steerable, strip_pixels
from .steerable_settings import BakedLamp, SteerableSettings

Report = Callable[[float], None]  # share done
SpanOf = Callable[[BakedLamp], Any]  # `Images`, or an array of that shape

_LOOK = 1 << 22  # numbers at a time
_ROUND = 256  # batches of paths from the lamp that are kept together


def bake_steerable(
    scene: Scene,
    path: str | Path,
    *,
    settings: SteerableSettings,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Bake lamps that are steered afterwards into the new folder ``path``.

    Parameters
    ----------
    settings
        Lamps, eye, size and quality.
    resume, force
        Go on with an interrupted bake of the same settings; replace what is there.
    report
        Hears the share done, 0 to 1.

    Raises
    ------
    InputError
        Settings out of range, more memory than allowed, or a partial bake of other settings.
    OutputError
        ``path`` exists, the disk is full or cannot be written; what was done can be resumed.
    InterruptedBakeError
        Stopped by Ctrl-C; what was done can be resumed.
    MissingExtraError
        Mitsuba or its LLVM is not installed.
    """
    refuse_target(Path(path), force=force)
    plan = plan_steerable(scene, settings)
    return bake_planned(scene, path, plan=plan, resume=resume, force=force, report=report)


def bake_planned(
    scene: Scene,
    path: str | Path,
    *,
    plan: SteerablePlan,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Carry out a plan of the same scene; otherwise as ``bake_steerable``."""
    settings = plan.settings

    def make(writer: BakeWriter) -> Manifest:
        tracing = _Tracing(scene, settings, writer, report or (lambda *_: None))
        told = tracing.statistics, tracing.left_out
        try:
            return finished(scene, settings, writer, tracing.span, told=told)
        except InputError:  # the same settings would end here again: nothing to resume
            shutil.rmtree(writer.partial, ignore_errors=True)
            raise

    check_disk(Path(path), plan.bytes + plan.scratch)
    return carry_out(
        Path(path), make, identity=identity(scene, settings), kept=lambda entries: f"{len(entries)} parts",
        resume=resume, force=force,
    )  # fmt: skip


class _Tracing:
    """Traces what the journal does not have yet, lamp by lamp."""

    def __init__(self, scene: Scene, settings: SteerableSettings, writer: BakeWriter, report: Report) -> None:
        self.scene, self.settings, self.writer, self.report = scene, settings, writer, report
        self.surfaces = SurfaceScene(scene)
        _, self.camera = settings.eye_in(scene)
        self.statistics: dict[str, dict[str, float]] = {}
        self.left_out: dict[str, str] = {}
        self._kept = {(e["lamp"], e["part"], e["number"]): e for e in writer.entries}

    def span(self, lamp: BakedLamp) -> SpanImages:
        """The span images of a lamp, on disk."""
        tracer = BasisTracer(
            self.scene, lamp.lamp, self.camera, settings=self.settings.images, surfaces=self.surfaces
        )
        pixels = self.settings.images.pixels
        step = strip_pixels(lamp, self.settings.images.samples)
        firsts = list(range(0, pixels, step))
        rounds = -(-tracer.batches // _ROUND)
        strips, noise, lit = [], 0.0, 0
        for k, first in enumerate(firsts):
            entry = self._kept.get((lamp.name, "eye", k)) or self._strip(lamp, tracer, k, first, step)
            strips.append(_chunk(entry, first))
            noise, lit = noise + entry["noise"], lit + entry["lit"]
            self._tell(lamp, 0.9 * (k + 1) / len(firsts))
        additions = []
        for k in range(rounds):
            entry = self._kept.get((lamp.name, "lamp", k)) or self._round(lamp, tracer, k)
            additions.append(_chunk(entry, 0))
            self._tell(lamp, 0.9 + 0.1 * (k + 1) / rounds)
        self.statistics[lamp.name] = {"noise": noise / max(lit, 1)}
        self.left_out[lamp.name] = "; ".join(tracer.left_out)
        return SpanImages(
            self.writer.partial,
            strips,
            additions,
            functions=lamp.lamp.functions,
            pixels=pixels,
            chosen=lamp.traced,
        )

    def _tell(self, lamp: BakedLamp, share: float) -> None:
        self.report((self.settings.lamps.index(lamp) + share) / len(self.settings.lamps))

    def _strip(self, lamp: BakedLamp, tracer: BasisTracer, k: int, first: int, step: int) -> dict[str, Any]:
        began = time.perf_counter()
        rows = tracer.pixels(first, min(step, self.settings.images.pixels - first))
        images = np.ascontiguousarray(rows.images.transpose(2, 0, 1))
        grey = images[0].mean(axis=1, dtype=np.float64)
        seen = np.abs(grey) > 0
        relative = np.sqrt(rows.variance[seen, 0], dtype=np.float64) / np.abs(grey[seen])
        figures = {"noise": float(np.minimum(relative, 1.0).sum()), "lit": int(seen.sum())}
        return self._keep(lamp, "eye", k, images, figures, began)

    def _round(self, lamp: BakedLamp, tracer: BasisTracer, k: int) -> dict[str, Any]:
        began = time.perf_counter()
        total = tracer.nothing()
        for batch in range(k * _ROUND, min((k + 1) * _ROUND, tracer.batches)):
            tracer.add_batch(batch, total)
        return self._keep(lamp, "lamp", k, np.ascontiguousarray(total.images.transpose(2, 0, 1)), {}, began)

    def _keep(
        self, lamp: BakedLamp, part: str, k: int, images: np.ndarray, figures: dict[str, float], began: float
    ) -> dict[str, Any]:
        """A chunk that the finished bake will not have, and the journal's line about it."""
        name = f"tracing/{lamp.name}/{part}/{k:05d}"
        key, record = self.writer.write_chunk(name, (0, 0, 0), images, whole(images))
        entry = {
            "lamp": lamp.name, "part": part, "number": k, "chunks": {key: record.model_dump()},
            "seconds": time.perf_counter() - began, **figures,
        }  # fmt: skip
        self.writer.append(entry)
        return entry


def finished(
    scene: Scene,
    settings: SteerableSettings,
    writer: BakeWriter,
    span: SpanOf,
    *,
    told: tuple[dict[str, dict[str, float]], dict[str, str]],
) -> Manifest:
    """Components of every lamp's span images, written, and the manifest of it all.

    ``told`` by the tracing of each lamp: its statistics, and what is in no image.
    """
    written, layers = WrittenArrays(writer), {}
    name, camera = settings.eye_in(scene)
    eye = CameraRecord(name=name, view=plain(camera.to_dict()))
    written.write_scene(scene)
    for lamp in settings.lamps:
        images = span(lamp)
        components = _components(images, lamp, settings)
        if settings.deep:
            _write_deep(written, f"layers/{lamp.name}", scene, lamp, settings)
        _write_components(written, f"layers/{lamp.name}", components, images)
        own = told[0].get(lamp.name, {}), told[1].get(lamp.name, "")
        layers[lamp.name] = _record(lamp, settings, components, eye, *own)
    return Manifest(
        format=FORMAT,
        version=VERSION,
        settings=identity(scene, settings),
        scene=scene_record(scene),
        layers=layers,
        arrays=written.arrays,
        chunks=written.chunks,
        software=software(),
    )


def _components(images: Images, lamp: BakedLamp, settings: SteerableSettings) -> Components:
    """What to keep. Raises InputError for a lamp that lights nothing the eye sees."""
    basis, keep = lamp.basis, settings.keep
    if _dark(images):
        if settings.deep:  # direct light is kept apart, and there is no other
            return no_components(basis)
        what = (
            "lights nothing that the eye sees: is it inside something, turned away, or out of sight? "
            "Move it, or look from elsewhere"
        )
        raise InputError(f"lamp {lamp.name}", what)
    if not isinstance(keep, Keep):
        return basis_lights(basis)
    return principal_components(gram(Evened(images, basis)), basis, keep=keep)


def _dark(images: Images) -> bool:
    """Whether all images are black."""
    strip = max(1, _LOOK // (3 * images.shape[0]))
    return not any(np.any(images[:, p : p + strip]) for p in range(0, images.shape[1], strip))


def _write_components(written: WrittenArrays, at: str, components: Components, images: Images) -> None:
    planes = to_bytes(components, components.images(images))
    written.write(f"{at}/bytes", planes.bytes)
    written.write(f"{at}/scales", planes.scales)
    written.write(f"{at}/image_of", planes.image_of)
    written.write(f"{at}/salience", planes.salience.astype(np.float32))
    if len(planes.bright):  # an array has no empty shape
        written.write(f"{at}/bright", planes.bright)
        written.write(f"{at}/bright_values", planes.bright_values)
    written.write(f"{at}/mixing", components.mixing.astype(np.float32))
    written.write(f"{at}/singular_values", components.singular_values.astype(np.float32))


def _write_deep(
    written: WrittenArrays, at: str, scene: Scene, lamp: BakedLamp, settings: SteerableSettings
) -> None:
    """What reaches each sub-pixel directly."""
    own, (_, camera) = lamp.lamp, settings.eye_in(scene)
    assert not isinstance(own, SteeredBox)  # SteerableSettings
    found = deep_samples(SurfaceScene(scene), own, camera, settings=settings.images, samples=settings.deep)
    if not len(found.colours):  # an array has no empty shape
        return
    written.write(f"{at}/deep_starts", found.starts)
    written.write(f"{at}/deep_colours", found.colours)
    written.write(f"{at}/deep_directions", encoded_directions(found.directions))
    if isinstance(own, SteeredPanel):
        written.write(f"{at}/deep_places", encoded_places(found.places, found.aimed))


def _record(
    lamp: BakedLamp,
    settings: SteerableSettings,
    components: Components,
    eye: CameraRecord,
    statistics: dict[str, float],
    left_out: str,
) -> LayerRecord:
    images, singular = settings.images, components.singular_values
    return LayerRecord(
        kind="steerable",
        basis_lights=lamp.basis.lights,
        coefficients=components.kept,
        rays=images.pixels * (images.samples + images.particles),
        camera=eye,
        parameters={
            "width": images.width, "height": images.height, "samples": images.samples, "depth": images.depth,
            "light_paths": images.particles, "deep": settings.deep, "seed": images.seed, "keep": settings.keep_text(),
            "basis": lamp.basis_text(), "place": json.dumps(lamp.place(), sort_keys=True),
            "lamp": json.dumps(lamp.lamp.to_dict(), sort_keys=True), "left_out": left_out,
        },
        statistics={
            "functions": lamp.basis.functions,
            "largest_norm": float(lamp.basis.largest_norm),
            "kept_share": float(singular[: components.kept].sum() / singular.sum()) if singular.any() else 1.0,
            "components_error": float(components.error),
            **statistics,
        },
    )  # fmt: skip


def identity(scene: Scene, settings: SteerableSettings) -> dict[str, int | float | str | None]:
    """Everything that the bytes of the bake depend on."""
    images = settings.images
    lamps = [{"name": one.name, "parity": one.parity, **one.lamp.to_dict()} for one in settings.lamps]
    return {
        "kind": "steerable",
        "scene": scene.digest,
        "lamps": json.dumps(lamps, sort_keys=True),
        "camera": json.dumps(settings.eye_in(scene)[1].to_dict(), sort_keys=True),
        "picture": f"{images.width}x{images.height}, {images.samples} samples, depth {images.depth}",
        "light_paths": images.particles,
        "paths": f"{'indirect' if images.indirect_only else 'all'}, by chance {images.by_chance}",
        "seed": images.seed,
        "deep": settings.deep,
        "keep": settings.keep_text(),
        **software(),
    }


def _chunk(entry: dict[str, Any], first: int) -> Chunk:
    ((key, record),) = entry["chunks"].items()
    return key, ChunkRecord(**record), first

"""What a steerable bake will cost, before it is paid: a few tiles of every lamp's pixels, traced on this machine."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from ..encoding.principal_components import Keep
from ..errors import InputError
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from ..transport.basis_images import LANES, BasisTracer
from ..transport.seen_in_glass import MOST_HITS
from .environment_plan import machine_memory
from .steerable_settings import BakedLamp, SteerableSettings

_PROCESS_BYTES = 420_000_000  # Python, the renderer and its compiler, and the records of a launch; measured
_BYTES_PER_TRIANGLE = 260  # of the renderer's trees
_PILOT_TILES = 3
_CHAIN = 0.33  # what a chain of mirrors takes, of a path from the eye
_BYTES_PER_DEEP = 100  # of a sample whose first bounce is kept apart, while it is written
_DEEP_ON_DISK = 16
_USUAL_SHARE = 0.35  # of the basis lights that the paper's rule keeps: 12 of 36, 20 of 81, 50 of 400
_BYTES_PER_HIT = 250  # of a place that the eye sees in mirrors or through glass
_STRIP_BYTES = 16_000_000


@dataclass(frozen=True)
class SteerablePlan:
    """An estimate for all lamps together."""

    settings: SteerableSettings
    triangles: int
    basis_images: int
    components: int  # a guess where the rule depends on the pictures
    paths: int  # from the eye and from the lamps
    seconds: float
    bytes: int  # on disk when done
    scratch: int  # more on disk while baking
    memory: int  # bytes, peak of the process
    notes: tuple[str, ...]  # what no path finds

    def summary(self) -> dict[str, float | int | list[str]]:
        """What ``--dry-run --json`` prints."""
        names = ("triangles", "basis_images", "components", "paths", "seconds", "bytes", "scratch", "memory")
        return {name: getattr(self, name) for name in names} | {"notes": list(self.notes)}


def strip_pixels(lamp: BakedLamp, samples: int) -> int:
    """Pixels of a strip: whole launches, about 16 MB of images."""
    launch = max(1, LANES // samples)
    wanted = _STRIP_BYTES // (12 * lamp.lamp.functions)
    return launch * max(1, wanted // launch)


def memory_needed(settings: SteerableSettings, triangles: int) -> int:
    """Peak bytes of the process: pictures of all functions while paths from the lamp are added, or components."""
    pixels = settings.images.pixels
    most = 0
    for lamp in settings.lamps:
        functions, lights = lamp.lamp.functions, lamp.basis.functions  # as many lights, but found in no time
        from_lamp = 28 * functions * pixels + _BYTES_PER_HIT * min(16 * pixels, MOST_HITS)
        from_lamp = from_lamp if settings.images.particles else 0
        kept = _components(settings, lights)
        encoding = kept * pixels * (12 + 6) + 3 * 256_000_000
        matrices = 8 * 6 * lights * functions
        deep = _BYTES_PER_DEEP * settings.deep * pixels
        most = max(most, from_lamp, encoding, matrices, deep)
    return _PROCESS_BYTES + _BYTES_PER_TRIANGLE * triangles + most


def check_memory(settings: SteerableSettings, triangles: int) -> int:
    """The need, or InputError where it is more than is allowed: told before any work."""
    allowed = settings.memory or machine_memory() // 2
    needed = memory_needed(settings, triangles)
    if needed > allowed:
        what = (
            f"{settings.images.width}×{settings.images.height} pixels times so many basis images take "
            f"{needed / 1e9:.1f} GB, {allowed / 1e9:.1f} GB are allowed; a smaller picture, a lower degree, fewer "
            "periods, fewer --deep samples, or more --memory"
        )
        raise InputError("memory", what)
    return needed


def plan_steerable(scene: Scene, settings: SteerableSettings) -> SteerablePlan:
    """Trace a few pixels for every lamp, and scale.

    Raises
    ------
    InputError
        A lamp far outside the scene, a camera it does not know, more memory than allowed.
    MissingExtraError
        Mitsuba or its LLVM is not installed.
    """
    settings.check_in(scene)
    memory = check_memory(settings, len(scene.triangles))
    _, camera = settings.eye_in(scene)
    images, surfaces = settings.images, SurfaceScene(scene)
    seconds, paths, notes = 0.0, 0, []
    for lamp in settings.lamps:
        tracer = BasisTracer(scene, lamp.lamp, camera, settings=images, surfaces=surfaces)
        chains = tracer.leave_mirrored()
        launch = max(1, LANES // images.samples)
        launches = math.ceil(images.pixels / launch)
        from_eye = launches * _pace(lambda k, t=tracer, n=launch: _pilot(t, k, n, images.pixels), launches)
        seconds += from_eye * (1 + _CHAIN * chains / (images.pixels * images.samples))
        paths += images.pixels * images.samples + chains
        if tracer.batches:
            nothing = tracer.nothing()
            seconds += tracer.batches * _pace(
                lambda k, t=tracer, n=nothing: t.add_batch(k, n), tracer.batches
            )
            paths += images.pixels * images.particles
        notes += [f"{lamp.name}: not in the pictures: {what}" for what in tracer.left_out]
    kept = [_components(settings, lamp.basis.functions) for lamp in settings.lamps]
    functions = sum(lamp.lamp.functions for lamp in settings.lamps)
    return SteerablePlan(
        settings, len(scene.triangles), sum(lamp.basis.functions for lamp in settings.lamps), sum(kept), paths, seconds,
        bytes=int(sum(1.07 * 3 * 1.3 * k * images.pixels for k in kept)) + 150 * len(scene.triangles)
        + _DEEP_ON_DISK * settings.deep * images.pixels * len(settings.lamps),
        scratch=12 * functions * images.pixels * (2 if images.particles else 1),
        memory=memory, notes=tuple(notes),
    )  # fmt: skip


def _pilot(tracer: BasisTracer, k: int, launch: int, pixels: int) -> None:
    """A launch of pixels somewhere in the picture."""
    launches = max(1, pixels // launch)
    first = (2 * k + 1) * launches // (2 * _PILOT_TILES) * launch
    tracer.pixels(min(first, max(0, pixels - launch)), min(launch, pixels))


def _pace(work: Callable[[int], None], most: int) -> float:
    """Seconds for one, after the first, which compiles."""
    work(0)
    count = min(_PILOT_TILES, most)
    started = time.perf_counter()
    for k in range(count):
        work(k)
    return (time.perf_counter() - started) / count


def _components(settings: SteerableSettings, lights: int) -> int:
    keep = settings.keep
    if keep == "all":
        return lights
    if isinstance(keep, Keep) and keep.count is not None:
        return keep.count
    return max(1, round(_USUAL_SHARE * lights))

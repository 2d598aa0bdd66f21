"""All basis images of a lamp from one pass of tracing (Teo, Simoncelli and Heeger 1997, section 3).

The paper renders the scene once for each basis light. Here each path is traced once, remembers how its light left the
lamp, and is added to the image of every function that spans the lamp's emission.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Float32, Float64
from ..camera import Camera
from ..errors import InputError
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from .span_kernels import add_pixels, add_splats, span_shape
from .steered_lamps import SteeredBox, SteeredLamp, SteeredPanel, SteeredSky

if TYPE_CHECKING:
    from .mirrored_lamp import MirroredLamp

Report = Callable[[float], None]

LANES = 1 << 17  # paths of a launch
MOST_SAMPLES = 1 << 16  # a pixel
_PARTICLES = 1 << 15
_WIDE = 0.1  # of a scene's diagonal, a panel's side
_EYE, _LAMP, _SEEN, _MIRRORED = 1, 2, 3, 4  # stages of randomness


@dataclass(frozen=True)
class ImageSettings:
    """How basis images are traced.

    Parameters
    ----------
    width, height
        Pixels; 1 to 2048 each.
    samples
        Paths from the eye through each pixel, 2 to 65536.
    particles
        Paths from the lamp for each pixel of the picture, 0 to 65536; none are traced where no mirror or glass is. A
        sixteenth of the samples is as noisy where light is brightest behind glass as the rest, and less elsewhere.
    depth
        The most edges of a path, 2 to 64: 2 is direct light.
    indirect_only
        Leave direct light out.
    by_chance
        Light through glass or off a mirror that the eye sees in a mirror or through glass is met by chance, if the
        lamp has some size: exact, but bright specks. Else it is smoothed over about a pixel.
    seed
        Of all randomness.
    """

    width: int = 256
    height: int = 256
    samples: int = 256
    particles: int = 16
    depth: int = 12
    indirect_only: bool = False
    by_chance: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        for name, least, most in (
            ("width", 1, 2048), ("height", 1, 2048), ("samples", 2, MOST_SAMPLES), ("particles", 0, MOST_SAMPLES),
            ("depth", 2, 64), ("seed", 0, 2**31 - 1),
        ):  # fmt: skip
            value = getattr(self, name)
            if not (isinstance(value, int) and not isinstance(value, bool) and least <= value <= most):
                said = "light paths" if name == "particles" else name
                raise InputError(said, f"{value!r}, expected a whole number from {least} to {most}")

    @property
    def pixels(self) -> int:
        return self.width * self.height


@dataclass(frozen=True)
class TracedRows:
    """Some pixels' part of the basis images that paths from the eye make."""

    images: Float32[np.ndarray, "pixels 3 functions"]
    variance: Float32[np.ndarray, "pixels functions"]  # of the mean of the three channels
    posed: Float64[np.ndarray, "pixels poses 3"] = field(repr=False)
    posed_variance: Float64[np.ndarray, "pixels poses 3"] = field(repr=False)


class BasisTracer:
    """Traces the basis images of one lamp, pixels by pixels, so that a bake can stop between.

    Parameters
    ----------
    scene
        What is lit.
    lamp
        By what; its ``functions`` S are the images.
    camera
        The fixed eye.
    settings
        See ImageSettings.
    surfaces
        Of the scene, if there already.

    Attributes
    ----------
    traces_from_lamp
        Whether the lamp meets mirrors or glass, so that paths are traced from it too.
    left_out
        What kinds of paths are in no image, in words; empty if none.
    """

    def __init__(
        self,
        scene: Scene,
        lamp: SteeredLamp,
        camera: Camera,
        *,
        settings: ImageSettings,
        surfaces: SurfaceScene | None = None,
    ) -> None:
        from .box_paths import paths_of
        from .eye_paths import PathRules
        from .light_tracing import LightPaths
        from .mirrored_lamp import mirrored_lamp

        self.lamp, self.settings = lamp, settings
        surfaces = surfaces or SurfaceScene(scene)
        least = 3 if settings.indirect_only else 1
        frame = {"width": settings.width, "height": settings.height}
        wide = _is_wide(lamp, scene)  # paths from the eye find it, whatever they meet
        rules = PathRules(settings.depth, least, False, settings.by_chance or wide)
        self._light = None
        if (
            surfaces.delta.any()
            and settings.particles
            and not (wide or isinstance(lamp, SteeredBox | SteeredSky))
        ):
            light = LightPaths(surfaces, lamp, camera, rules=rules, **frame)
            self._light = light if light.finds_any else None
            if self._light is not None and not rules.by_chance:
                light.see(settings.samples, seed=stage_seed(settings.seed, _SEEN, 0))
        rules = PathRules(settings.depth, least, self._light is not None, rules.by_chance)
        self._eye = paths_of(surfaces, lamp, camera, rules=rules, **frame)
        self._mirrored = None
        if not wide:
            self._mirrored = mirrored_lamp(
                surfaces, lamp, camera, size=(settings.width, settings.height), rules=rules,
                samples=settings.samples, seed=stage_seed(settings.seed, _MIRRORED, 0),
            )  # fmt: skip
        self._image: tuple[np.ndarray, TracedRows] | None = None  # of some weights
        if self._mirrored is not None:
            self._eye.leave_mirrored(self._mirrored.pixels)
        self._shape = span_shape(lamp)
        self.left_out = () if wide else _left_out(surfaces, lamp, settings, from_lamp=self.traces_from_lamp)

    @property
    def traces_from_lamp(self) -> bool:
        return self._light is not None

    def leave_mirrored(self) -> int:
        """Leave the lamp's own image out from now on, for a trial; how many chains of mirrors it would have taken."""
        chains = 0 if self._mirrored is None else len(self._mirrored.pixels) * self._mirrored.samples
        self._mirrored = None
        return chains

    def pixels(
        self, first: int, count: int, *, weights: Float64[np.ndarray, "poses functions"] | None = None
    ) -> TracedRows:
        """Pixels ``first`` to ``first + count`` as paths from the eye make them: the same however they are cut.

        ``weights`` (P, S) of lamps as they will be: then ``posed`` are their pictures, with the variance that no
        sum of the images' variances tells.
        """
        S, samples = self.lamp.functions, self.settings.samples
        chosen = np.zeros((0, S)) if weights is None else np.ascontiguousarray(weights, np.float64)
        images = np.empty((count, 3, S), np.float32)
        variance = np.empty((count, S), np.float32)
        posed, posed_variance = np.zeros((2, count, len(chosen), 3))
        step = max(1, LANES // samples)
        first_tile, last_tile = first // step, -(-(first + count) // step)
        for tile in range(first_tile, last_tile):  # of fixed places, so that seeds do not depend on the cut
            at, end = tile * step, min((tile + 1) * step, self.settings.pixels)
            records = self._eye.trace(
                at, end - at, samples=samples, seed=stage_seed(self.settings.seed, _EYE, tile)
            )
            mean, own = np.empty((end - at, 3, S), np.float32), np.empty((end - at, S), np.float32)
            pose, pose_own = np.zeros((2, end - at, len(chosen), 3))
            add_pixels(
                samples, (records.carried, records.left), records.counts, self._shape, chosen,
                mean, own, pose, pose_own,
            )  # fmt: skip
            self._add_mirrored(at, chosen, TracedRows(mean, own, pose, pose_own))
            kept = slice(max(at, first), min(end, first + count))
            here, there = (slice(kept.start - k, kept.stop - k) for k in (first, at))
            images[here], variance[here] = mean[there], own[there]
            posed[here], posed_variance[here] = pose[there], pose_own[there]
        return TracedRows(images, variance, posed, posed_variance)

    def _add_mirrored(
        self, first: int, weights: Float64[np.ndarray, "poses functions"], rows: TracedRows
    ) -> None:
        """Add the lamp's own image in mirrors to rows of pixels from ``first`` on."""
        if self._mirrored is None:
            return
        if self._image is None or not np.array_equal(self._image[0], weights):
            self._image = weights, self._mirrored_rows(self._mirrored, weights)
        pixels, image = self._mirrored.pixels, self._image[1]
        part = slice(*np.searchsorted(pixels, [first, first + len(rows.images)]))
        here = pixels[part] - first
        rows.images[here] += image.images[part]
        rows.variance[here] += image.variance[part]
        rows.posed[here] += image.posed[part]
        rows.posed_variance[here] += image.posed_variance[part]

    def _mirrored_rows(
        self, mirrored: MirroredLamp, weights: Float64[np.ndarray, "poses functions"]
    ) -> TracedRows:
        """The lamp's own image, of the pixels that show mirrors: at once, for few launches are much faster."""
        S, count = self.lamp.functions, len(mirrored.pixels)
        mean, own = np.empty((count, 3, S), np.float32), np.empty((count, S), np.float32)
        pose, pose_own = np.zeros((2, count, len(weights), 3))
        for k in range(0, count, mirrored.at_once):
            some = slice(k, min(k + mirrored.at_once, count))
            records = mirrored.trace(
                mirrored.pixels[some], seed=stage_seed(self.settings.seed, _MIRRORED, 1 + k)
            )
            add_pixels(
                mirrored.samples, (records.carried, records.left), records.counts, self._shape, weights,
                mean[some], own[some], pose[some], pose_own[some],
            )  # fmt: skip
        return TracedRows(mean, own, pose, pose_own)

    def nothing(self, *, poses: int = 0) -> TracedRows:
        """Pictures of all pixels to which nothing has come yet."""
        P, S = self.settings.pixels, self.lamp.functions
        posed, posed_variance = np.zeros((2, P, poses, 3))
        return TracedRows(
            np.zeros((P, 3, S), np.float32), np.zeros((P, S), np.float32), posed, posed_variance
        )

    @property
    def batches(self) -> int:
        """Of paths from the lamp."""
        return 0 if self._light is None else -(-self.settings.particles * self.settings.pixels // _PARTICLES)

    def add_batch(
        self, batch: int, total: TracedRows, *, weights: Float64[np.ndarray, "poses functions"] | None = None
    ) -> None:
        """Add a batch of paths from the lamp to pictures of all pixels; all ``batches`` make the whole."""
        light = self._light
        if light is None:
            return
        share = 1.0 / (self.batches * _PARTICLES)  # whole batches, so that nothing is compiled twice
        splats = light.trace(_PARTICLES, seed=stage_seed(self.settings.seed, _LAMP, batch))
        if not len(splats.pixel):
            return
        order = np.argsort(splats.pixel, kind="stable")
        starts = np.flatnonzero(np.diff(splats.pixel[order], prepend=-1, append=-1))
        chosen = np.zeros((0, self.lamp.functions)) if weights is None else weights
        add_splats(
            (starts, order, splats.pixel), (splats.particle, splats.colour), splats.left, share, self._shape,
            np.ascontiguousarray(chosen, np.float64), total.images, total.variance, total.posed, total.posed_variance,
        )  # fmt: skip


@dataclass(frozen=True)
class BasisImages:
    """The images of all functions that span a lamp's emission."""

    images: Float32[np.ndarray, "functions height width 3"]
    variance: Float32[np.ndarray, "functions height width"]  # of the mean of the channels
    left_out: tuple[str, ...]


def basis_images(
    scene: Scene,
    lamp: SteeredLamp,
    camera: Camera,
    *,
    settings: ImageSettings,
    surfaces: SurfaceScene | None = None,
    report: Report | None = None,
) -> BasisImages:
    """All basis images of a lamp, in memory.

    Raises InputError for settings out of range, MissingExtraError without Mitsuba. ``report`` hears the share done.
    """
    tracer = BasisTracer(scene, lamp, camera, settings=settings, surfaces=surfaces)
    H, W = settings.height, settings.width
    images = np.empty((settings.pixels, 3, lamp.functions), np.float32)
    variance = np.empty((settings.pixels, lamp.functions), np.float32)
    rows_at_once = max(1, math.ceil(LANES / (settings.samples * W)))
    for row in range(0, H, rows_at_once):
        part = slice(row * W, min(row + rows_at_once, H) * W)
        rows = tracer.pixels(part.start, part.stop - part.start)
        images[part], variance[part] = rows.images, rows.variance
        if report is not None:
            report(0.9 * part.stop / settings.pixels)
    caught = TracedRows(images, variance, *np.zeros((2, settings.pixels, 0, 3)))
    for batch in range(tracer.batches):
        tracer.add_batch(batch, caught)
    if report is not None:
        report(1.0)
    return BasisImages(
        np.ascontiguousarray(images.reshape(H, W, 3, -1).transpose(3, 0, 1, 2)),
        np.ascontiguousarray(variance.reshape(H, W, -1).transpose(2, 0, 1)),
        tracer.left_out,
    )


def _is_wide(lamp: SteeredLamp, scene: Scene) -> bool:
    """Whether a lamp is so large that paths from the eye meet it over mirrors with less noise than those from it."""
    if not isinstance(lamp, SteeredPanel):
        return isinstance(lamp, SteeredBox | SteeredSky)
    used = scene.positions[scene.triangles.ravel()]
    return lamp.area > (_WIDE * float(np.linalg.norm(np.ptp(used, axis=0)))) ** 2


def _left_out(
    surfaces: SurfaceScene, lamp: SteeredLamp, settings: ImageSettings, *, from_lamp: bool
) -> tuple[str, ...]:
    """Which paths are in no image."""
    found = []
    if not surfaces.delta.any():
        return ()
    if lamp.is_point:
        found.append("the lamp itself in mirrors (a point has no image; give it a radius)")
        if not from_lamp:
            found.append(
                "its light through glass or off mirrors onto other surfaces (no paths from the lamp)"
            )
    if not from_lamp and (lamp.is_point or not settings.by_chance):
        found.append("its light through glass or off mirrors onto what is seen in a mirror or through glass")
    return tuple(found)


def stage_seed(seed: int, stage: int, tile: int) -> int:
    """A seed for each stage and tile."""
    sequence = np.random.SeedSequence((seed, stage, tile))
    return int(sequence.generate_state(1)[0] >> 1)

"""A relit bake against the truth at its own receivers: exact integration, or Mitsuba's path tracer."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ..arrays import CubeMap, Float64, Int32, Radiance
from ..baking.environment_settings import PIXELS, EnvironmentSettings
from ..baking.layer_receivers import LayerReceivers
from ..camera import Camera
from ..drawing.figures import Shown, difference_picture, enlarged, panels, readable_factor
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..rays.surfaces import SurfaceScene
from ..relighting.relighter import Relighter
from ..scene.baked import scene_of
from ..storage.manifest import LayerRecord
from ..transport.exact import integrate
from ..transport.eye import vertex_points
from ..transport.path_traced_light import LightWithVariance, LitScene, as_diffuse
from ..transport.path_tracing import path_traced_radiance, path_traced_view
from ..transport.vantage import vantage_points
from .comparison import compare

Share = Callable[[float], None]
_PANEL = 320  # pixels, that small pictures are enlarged to
_ALLOWED = 0.01  # of the largest reference: what a bake may lose before a value counts as rejected


def bounces_of(layer: LayerRecord) -> int | None:
    """How often light bounces in a layer: None for as often as it matters, 0 where it is direct alone."""
    said = layer.parameters.get("bounces", 0)
    return None if said == "all" else int(said)  # ty: ignore[invalid-argument-type]


def settings_of(layer: LayerRecord) -> EnvironmentSettings:
    """What a layer was baked with. Raises InputError where its manifest says something that cannot be."""
    said: dict[str, Any] = layer.parameters
    eye = None if layer.camera is None else Camera.from_dict(layer.camera.view)
    pixels = said.get("receivers") == PIXELS
    size = (
        {"width": said["width"], "height": said["height"], "pixel_samples": said["samples"]} if pixels else {}
    )
    return EnvironmentSettings(
        said["resolution"],
        said["tolerance"],
        samples_per_side=said["samples_per_side"],
        receivers=said["receivers"],
        camera=eye,
        zones=said["zones"],
        bounces=bounces_of(layer),
        **({"gather_rays": said["gather_rays"]} if "gather_rays" in said else {}),
        **size,
    )


class Comparison:
    """The receivers of a relit layer, or some of them, beside their reference.

    Parameters
    ----------
    light
        The bake, as it is lit now.
    count, seed
        How many receivers, chosen at random among those that light can reach; 0 for all.
    eye
        Where a layer with gloss is looked at from; without it its diffuse part is compared.
    """

    def __init__(
        self, light: Relighter, *, count: int = 1000, seed: int = 0, eye: Camera | None = None
    ) -> None:
        self.light = light
        self._eye = eye if light.has_gloss else None
        record = light.bake.layers[light.layer_name]
        self.bounces = bounces_of(record)
        self.receivers = LayerReceivers(scene_of(light.bake), settings_of(record))
        if self.receivers.is_picture:
            possible = np.flatnonzero(self.receivers.points.coverage > 0)
        else:
            possible = np.flatnonzero(self._can_be_seen())
        if not len(possible):
            raise InputError(light.bake.path, "no receiver that light can reach: nothing to compare")
        if 0 < count < len(possible):
            possible = np.random.default_rng([seed, 11]).choice(possible, count, replace=False)
        self.rows: Int32[np.ndarray, "chosen"] = np.sort(possible).astype(np.int32)
        self._radiance = light.radiance  # what is compared
        if self._eye is not None:
            self._radiance = self._radiance + light.glossy(self._eye.eye)
        self.reference: Radiance | None = None
        self.made_by = "reference"

    def _can_be_seen(self) -> np.ndarray:
        """Of vertices: those with a normal; of glossy ones under an eye those that face it."""
        receivers = self.light.bake.receivers
        there = receivers.normals.any(axis=1)
        if self._eye is not None:
            toward = np.asarray(self._eye.eye, np.float32) - receivers.positions
            there = there & ((receivers.normals * toward).sum(axis=1) > 0)
        return np.asarray(there)

    def choose_seen(self, camera: Camera, *, width: int, height: int) -> None:
        """All receivers that count in a picture: the corners of triangles that the camera sees; all pixels."""
        if self.receivers.is_picture:
            self.rows = np.flatnonzero(self.receivers.points.coverage > 0).astype(np.int32)
            return
        seen = self.light.view(camera, width=width, height=height).triangles_seen
        if not len(seen):
            raise InputError("camera", "sees nothing of the scene; choose another")
        corners = np.unique(self.light.bake.triangles[seen])
        self.rows = corners[self._can_be_seen()[corners]].astype(np.int32)

    def run(self, *, samples: int | None, seed: int = 0, report: Share | None = None) -> dict[str, Any]:
        """The figures of ``prelight compare --json``; exact integration where ``samples`` is None."""
        started = time.perf_counter()
        cube = self.light.environment.cube(self.light.resolution)
        if samples is None:
            reference, variance = self._exact(cube, report), None
        else:
            reference, variance = self._traced(cube, samples, seed, report)
        seconds = time.perf_counter() - started
        self.reference = reference.astype(np.float32)
        self.made_by = "exact integration" if samples is None else f"path tracer, {samples:,} samples"
        if samples is None and (self.bounces != 0 or self._eye is not None):
            self._radiance = self._direct_alone()
        mine = self._radiance[self.rows]
        tolerance = _ALLOWED * float(reference.max())
        figures = compare(mine, reference, variance, tolerance=tolerance)
        return {
            "receivers": len(self.rows),
            "reference": "exact" if samples is None else "path tracer",
            "samples": samples,
            "bounces": 0 if samples is None else "all" if self.bounces is None else self.bounces,
            **figures.to_dict(reference_seconds=seconds),
        }

    def _direct_alone(self) -> Radiance:
        """Of the bake, without light that has bounced: all that exact integration knows."""
        light = self.light
        alone = Relighter(light.bake, layer=light.layer_name, trace_strong=light.trace_strong, bounced=False)
        alone.environment = light.environment
        return alone.radiance

    def _parts(self):
        """Rows of each zone that are wanted, and their places among the wanted."""
        place = np.full(self.receivers.count, -1)
        place[self.rows] = np.arange(len(self.rows))
        for zone in self.receivers.zones:
            wanted = zone.rows[place[zone.rows] >= 0]
            if len(wanted):
                yield zone, wanted, place[wanted]

    def _exact(self, cube: CubeMap, report: Share | None) -> Float64[np.ndarray, "chosen 3"]:
        out, done = np.zeros((len(self.rows), 3)), 0
        for zone, rows, places in self._parts():

            def heard(share: float, before: int = done, here: int = len(rows)) -> None:
                if report is not None:
                    report((before + share * here) / len(self.rows))

            values = integrate(self.receivers.transfer(zone, rows), cube, report=heard)
            albedo = self.light.bake.receivers.albedo[rows] if zone.channels == 1 else 1.0
            out[places] = values * albedo
            done += len(rows)
        return out

    def _traced(self, cube: CubeMap, samples: int, seed: int, report: Share | None):
        scene = self.receivers.scene
        if self._eye is not None:
            return path_traced_view(
                SurfaceScene(scene), vertex_points(scene, self._eye.eye),
                cube=cube, receivers=self.rows, bounces=self.bounces, samples=samples, seed=seed, report=report,
            )  # fmt: skip
        if self.receivers.eye is None:
            albedo = scene.albedo[self.rows].astype(np.float64)
            if self.bounces != 0:
                found = self._light(cube, samples, seed, report)
                return found.total * albedo, found.total_variance * albedo**2
            mean, variance = path_traced_radiance(
                scene.positions, scene.triangles, scene.normals,
                receivers=self.rows, cube=cube, samples=samples, seed=seed, report=report,
            )  # fmt: skip
            return mean * albedo, variance * albedo**2
        return path_traced_view(
            SurfaceScene(scene), self.receivers.points,  # materials as they are, not as wide as the lights
            cube=cube, receivers=self.rows, bounces=self.bounces, samples=samples, seed=seed, report=report,
        )  # fmt: skip

    def _light(self, cube: CubeMap, samples: int, seed: int, report: Share | None) -> LightWithVariance:
        """With bounces between surfaces that are all diffuse, as in a bake without an eye."""
        scene = self.receivers.scene
        stand = vantage_points(scene, Occluders(scene.positions, scene.triangles))
        lit = LitScene(as_diffuse(scene), sky=cube)
        return lit.light(
            self.rows, origins=stand, bounces=self.bounces, samples=samples, seed=seed, report=report
        )

    def picture(self, camera: Camera, *, width: int, height: int, emphasis: float | None) -> Shown:
        """Bake, reference and their difference beside each other; after ``choose_seen`` and ``run``.

        ``emphasis`` amplifies the difference; by itself so that all but the worst five hundredth can be told apart.
        """
        assert self.reference is not None
        truth = self._radiance.copy()
        truth[self.rows] = self.reference
        ours, theirs = (
            self.light.picture_of(radiance, camera, width=width, height=height)
            for radiance in (self._radiance, truth)
        )
        stops = theirs.stops("auto")
        white = 2.0**-stops
        factor = emphasis or readable_factor(white, ours.linear, theirs.linear)
        shown = [enlarged(picture.display(exposure=stops), at_least=_PANEL) for picture in (ours, theirs)]
        linear = [enlarged(picture.linear, at_least=_PANEL) for picture in (ours, theirs)]
        difference = difference_picture(*linear, factor=factor, white=white)
        return panels([*shown, difference], ["baked and relit", self.made_by, "difference"])

"""A relit picture of steerable lamps against Mitsuba's path tracer at the same pixels, under the real lights."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..arrays import Float64
from ..drawing.figures import Shown, difference_picture, enlarged, panels, readable_factor
from ..drawing.pixels import pixel_picture
from ..errors import DamagedBakeError, InputError
from ..lighting.panel import Panel
from ..lighting.spot import Spot
from ..rays.surfaces import SurfaceScene
from ..relighting.steerable_bake import SteerableBake
from ..scene.baked import scene_of
from ..transport.steered_lamps import SteeredBox, SteeredLamp, lamp_from_dict
from ..transport.steered_reference import path_traced_picture
from .comparison import compare
from .steered_emission import emission_of

_ALLOWED = 0.01  # of the largest reference: what a bake may lose before a value counts as rejected
_PANEL = 320  # pixels, that small pictures are enlarged to


class LampComparison:
    """All pixels of a steerable bake, as it is relit, beside their reference.

    Parameters
    ----------
    light
        The bake.
    lights
        What lights it.

    Raises
    ------
    InputError
        A light that no layer is for, or in a box of light: Mitsuba's path tracer knows no such.
    DamagedBakeError
        A layer does not say what was traced.
    """

    def __init__(self, light: SteerableBake, lights: Sequence[Spot | Panel]) -> None:
        light.light(lights)
        self._radiance, self.size = np.maximum(light.radiance, 0.0), light.size
        self._bake, self._camera = light.bake, light.camera
        self._surfaces = SurfaceScene(scene_of(light.bake))
        self._lit: list[tuple[SteeredLamp, Any, int]] = []
        left_out = set()
        for name, layer in light.live.layers.items():
            own = [one for one in lights if light.live.layer_of(one).name == name]
            if not own:
                continue
            lamp, depth = self._described(name)
            if isinstance(lamp, SteeredBox):
                raise InputError(
                    name, "a box of light has no reference: Mitsuba's path tracer knows no such lamp"
                )
            if lamp.is_point:
                raise InputError(name, "a lamp without size has no reference; bake it with --lamp-radius")
            self._lit.append((lamp, emission_of(own, layer, mi=self._surfaces.mi), depth))
            left_out |= {str(light.bake.layers[name].parameters.get("left_out", ""))}
        self.left_out = "; ".join(sorted(left_out - {""}))
        self.reference: Float64[np.ndarray, "pixels 3"] | None = None
        self.samples = 0

    def _described(self, name: str) -> tuple[SteeredLamp, int]:
        said = self._bake.layers[name].parameters
        try:
            return lamp_from_dict(json.loads(str(said["lamp"]))), int(said["depth"])  # ty: ignore
        except (InputError, KeyError, TypeError, ValueError, RecursionError) as error:
            raise DamagedBakeError(
                self._bake.path, f"the lamp of layer {name!r} is not described: {error}"
            ) from None

    def run(
        self, *, samples: int, seed: int = 0, report: Callable[[float], None] | None = None
    ) -> dict[str, Any]:
        """The figures of ``prelight compare --json``."""
        started, (width, height) = time.perf_counter(), self.size
        mean, variance = np.zeros((2, width * height, 3))
        for n, (lamp, emission, depth) in enumerate(self._lit):
            picture, noise = path_traced_picture(
                self._surfaces, lamp, self._camera, emission=emission, width=width, height=height,
                samples=samples, depth=depth, seed=seed + n,
            )  # fmt: skip
            mean += picture.reshape(-1, 3)
            variance += noise.reshape(-1, 3)
            if report is not None:
                report((n + 1) / len(self._lit))
        self.reference, self.samples = mean, samples
        figures = compare(self._radiance, mean, variance, tolerance=_ALLOWED * float(mean.max(initial=0.0)))
        return {
            "receivers": width * height,
            "reference": "path tracer",
            "samples": samples,
            "bounces": "all",
            "left_out": self.left_out,
            **figures.to_dict(reference_seconds=time.perf_counter() - started),
        }

    def picture(self, *, emphasis: float | None) -> Shown:
        """Bake, reference and their difference beside each other; after ``run``."""
        assert self.reference is not None
        covered = np.ones(self.size[::-1], np.float32)
        ours = pixel_picture(self._radiance.astype(np.float32), covered)
        theirs = pixel_picture(self.reference.astype(np.float32), covered)
        stops = theirs.stops("auto")
        white = 2.0**-stops
        factor = emphasis or readable_factor(white, ours.linear, theirs.linear)
        shown = [enlarged(one.display(exposure=stops), at_least=_PANEL) for one in (ours, theirs)]
        linear = [enlarged(one.linear, at_least=_PANEL) for one in (ours, theirs)]
        difference = difference_picture(*linear, factor=factor, white=white)
        made_by = f"path tracer, {self.samples:,} samples"
        return panels([*shown, difference], ["baked and relit", made_by, "difference"])

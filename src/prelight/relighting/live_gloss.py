"""The gloss of an environment layer under the light that falls on it now, found when somebody looks."""

from __future__ import annotations

import time

import numpy as np

from ..arrays import CubeMap, Float32, Radiance, Triangles
from ..drawing.view import View
from ..lighting.quantities import Triple
from .exitant import Coefficients, Exitant, Lights, on_cells
from .pixel_gloss import pixel_gloss
from .strong_lights import StrongLights
from .traced import TracedLights


class LiveGloss:
    """What glossy vertices of a layer send toward any eye.

    Attributes
    ----------
    exitant
        The vertices, and what they are made of.
    milliseconds
        That the last change of light took; 0 before the first look.
    """

    def __init__(self, exitant: Exitant, tracer: TracedLights) -> None:
        self.exitant, self._tracer = exitant, tracer
        self._coefficients: Coefficients | None = None
        self._lit: Lights | None = None
        self.milliseconds = 0.0

    def forget(self) -> None:
        """The light has changed."""
        self._coefficients = None

    def toward(
        self, eye: Triple, *, cubes: list[CubeMap], strong: StrongLights, irradiance: Radiance
    ) -> Radiance:
        """(V, 3) to add to albedo × ``irradiance`` for all light that leaves toward ``eye``.

        ``cubes``: radiance of the sky, without the ``strong`` lights, which are traced. Asked of light that has not
        changed, these are not looked at.
        """
        coefficients = self._found(cubes, strong, irradiance)
        return self.exitant.toward(eye, coefficients, irradiance, lights=self._lit)

    def drawn(
        self,
        view: View,
        triangles: Triangles,
        *,
        eye: Triple,
        cubes: list[CubeMap],
        strong: StrongLights,
        irradiance: Radiance,
    ) -> Float32[np.ndarray, "height width 3"]:
        """The same as a picture to add, pixel by pixel."""
        coefficients = self._found(cubes, strong, irradiance)
        matt = self.exitant.added(np.zeros((len(self.exitant.rows), 3), np.float32), irradiance)
        shine = pixel_gloss(
            view, self.exitant, triangles, eye=eye, coefficients=coefficients, lights=self._lit
        )
        return view.draw(matt).linear + shine

    def _found(self, cubes: list[CubeMap], strong: StrongLights, irradiance: Radiance) -> Coefficients:
        if self._coefficients is None:
            began = time.perf_counter()
            sky = sum((on_cells(cube) for cube in cubes[1:]), on_cells(cubes[0]))
            self._lit = self._lights(strong) if len(strong) else None
            self._coefficients = self.exitant.coefficients(sky=sky, surfaces=irradiance)
            self.milliseconds = (time.perf_counter() - began) * 1e3
        return self._coefficients

    def _lights(self, strong: StrongLights) -> Lights:
        rows = self.exitant.rows
        seen = self._tracer.visible(strong, rows)
        d = np.broadcast_to(strong.directions, (len(rows), *strong.directions.shape))
        energy = (seen.T[:, :, None] * strong.energy).astype(np.float32)
        return np.ascontiguousarray(d, np.float32), energy

"""The gloss of a layer under the light that falls on it now, found when somebody looks."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Int32, Radiance, Triangles
from ..drawing.view import View
from ..lighting.quantities import Triple
from ..receivers import Receivers
from .exitant import CellLight, Coefficients, Exitant, Lights
from .pixel_gloss import LightsAt, pixel_gloss


@dataclass(frozen=True)
class Falling:
    """Light that gloss mirrors; all but ``irradiance`` is found when it is asked for.

    Attributes
    ----------
    irradiance
        (V, 3) irradiance / π of all bounces: what surfaces are seen by, and what the matt part answers to.
    sky
        What ``Exitant.coefficients`` takes: ∫ L dω of cells, without what is among ``lights``.
    lights
        Single lights as the layer's glossy rows get them; None where there are none.
    lights_at
        The same at other places, for pictures.
    """

    irradiance: Radiance
    sky: Callable[[], CellLight | None]
    lights: Callable[[Int32[np.ndarray, "rows"]], Lights | None]
    lights_at: LightsAt | None = None


class LiveGloss:
    """What glossy vertices of a layer send toward any eye.

    Attributes
    ----------
    exitant
        The vertices, and what they are made of.
    milliseconds
        That the last change of light took; 0 before the first look.
    """

    def __init__(self, exitant: Exitant, receivers: Receivers) -> None:
        self.exitant, self._receivers = exitant, receivers
        self._coefficients: Coefficients | None = None
        self._lit: Lights | None = None
        self.milliseconds = 0.0

    def forget(self) -> None:
        """The light has changed."""
        self._coefficients = None

    def toward(self, eye: Triple, falling: Falling) -> Radiance:
        """(V, 3) to add to albedo × irradiance for all light that leaves toward ``eye``.

        Asked of light that has not changed, of ``falling`` the irradiance alone is looked at.
        """
        coefficients = self._found(falling)
        return self.exitant.toward(eye, coefficients, falling.irradiance, lights=self._lit)

    def drawn(
        self, view: View, triangles: Triangles, *, eye: Triple, falling: Falling, fine: bool
    ) -> Float32[np.ndarray, "height width 3"]:
        """The same as a picture to add, pixel by pixel; ``fine``: shadows of single lights too."""
        coefficients = self._found(falling)
        matt = self.exitant.added(np.zeros((len(self.exitant.rows), 3), np.float32), falling.irradiance)
        at = (falling.lights_at, self._receivers) if fine and falling.lights_at is not None else None
        shine = pixel_gloss(
            view, self.exitant, triangles, eye=eye, coefficients=coefficients, lights=self._lit, lights_at=at
        )
        return view.draw(matt).linear + shine

    def _found(self, falling: Falling) -> Coefficients:
        if self._coefficients is None:
            began = time.perf_counter()
            self._lit = falling.lights(self.exitant.rows)
            self._coefficients = self.exitant.coefficients(sky=falling.sky(), surfaces=falling.irradiance)
            self.milliseconds = (time.perf_counter() - began) * 1e3
        return self._coefficients

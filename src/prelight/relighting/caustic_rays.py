"""Caustics of strong lights by photons of their own, traced when relighting: as sharp as the light, not as its cell.

It needs the renderer, as glass and mirrors are its BSDFs; without it a sun's caustic is as wide as a cell of light.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..arrays import Radiance
from ..errors import MissingExtraError, PrelightError
from ..rays.mitsuba import Occluders
from ..scene.baked import scene_of
from ..storage.bake import Bake
from ..transport.photon_mapping import PhotonMap
from ..transport.photon_sources import SunSource
from ..transport.photon_tracing import CAUSTIC
from .strong_lights import StrongLights

PHOTONS = 1 << 19
_NARROWEST_DEG = 0.05


class TracedCaustics:
    """What glass and mirrors send of strong lights to the vertices of a bake.

    Parameters
    ----------
    bake
        Its scene is traced.
    resolution
        R of the texels that rectangles of lights are of.
    """

    def __init__(self, bake: Bake, resolution: int) -> None:
        self._bake, self._resolution = bake, resolution
        self._missing = False

    def __call__(self, lights: StrongLights) -> Radiance | None:
        """(vertices, 3) irradiance / π; None where the renderer is missing, or a light cannot be traced."""
        if self._missing or not lights.energy.any():
            return None
        try:
            scene, occluders = self._scene
            lit = lights.energy.any(axis=1)
            source = SunSource(
                lights.directions[lit], lights.energy[lit].astype(np.float32), self._radius_deg(lights)
            )
            photons = PhotonMap(scene, occluders, source, ways=CAUSTIC)
            photons.more(PHOTONS)
        except MissingExtraError:
            self._missing = True
            return None
        except PrelightError:
            return None
        return photons.light(lambda p: np.ones((len(p), 1), np.float32)).light[:, 0]

    @cached_property
    def _scene(self) -> tuple:
        scene = scene_of(self._bake)
        return scene, Occluders(scene.positions, scene.triangles)

    def _radius_deg(self, lights: StrongLights) -> float:
        """Of a disc as large as the texels of one light."""
        texels = float((lights.rectangles[:, 3] * lights.rectangles[:, 4]).mean())
        return max(_NARROWEST_DEG, float(np.degrees(2 / self._resolution * np.sqrt(texels / np.pi))))

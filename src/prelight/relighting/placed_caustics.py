"""What glass and mirrors send on of lamps and panels: photons of their own, traced when they are lit or moved.

It needs the renderer, as glass and mirrors are its BSDFs; without it they only cast shadows.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..arrays import Radiance
from ..errors import MissingExtraError
from ..lighting.placed_lights import Lamp, PlacedLight
from ..storage.bake import Bake

_PHOTONS = 1 << 15  # for each shadow ray
_MOST = 1 << 22


class PlacedCaustics:
    """Caustics at a bake's vertices."""

    def __init__(self, bake: Bake) -> None:
        self._bake = bake

    @cached_property
    def is_there(self) -> bool:
        """Whether the renderer is."""
        try:
            return self._light is not None
        except MissingExtraError:
            return False

    def of(self, light: PlacedLight, *, shadow_rays: int) -> Radiance:
        """(V, 3) irradiance / π of a light of colour 1, by as many photons as its shadows are fine."""
        photons = min(_PHOTONS * shadow_rays, _MOST)
        if isinstance(light, Lamp):
            sent = self._light.of_ball(np.array(light.position), light.radius, photons=photons)
            if light.beam.distribution is not None and len(sent):
                shape = np.maximum(light.beam.distribution.along(sent.direction @ light.axes), 0.0)
                sent.power[...] *= shape.astype(np.float32)
        else:
            sent = self._light.of_panel(light.corners, photons=photons)
        return self._light.at_vertices(sent)

    @cached_property
    def _light(self):
        from ..rays.mitsuba import Occluders
        from ..scene.baked import scene_of
        from ..transport.caustic_light import CausticLight

        scene = scene_of(self._bake)
        return CausticLight(scene, Occluders(scene.positions, scene.triangles))

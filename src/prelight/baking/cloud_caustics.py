"""Caustics of a cloud's lights: what clear glass and mirrors send of each to each vertex, by photons of its own."""

from __future__ import annotations

import numpy as np

from ..arrays import Float32, Float64
from ..scene.geometry import Scene
from ..transport.lamps import SphereLamps
from ..transport.photon_density import LitSurface, PhotonDensity
from ..transport.photon_mapping import PhotonMap
from ..transport.photon_sources import SphereSource
from ..transport.photon_tracing import BOUNCED_CAUSTIC, CAUSTIC
from ..transport.specular import without_specular
from .cloud_plan import BOUNCED_SHARE, COLUMNS, CloudPlan

_NEAREST = 200  # of one light; a kernel is the same for all lights of a part
_REACH = {CAUSTIC: 4.0, BOUNCED_CAUSTIC: 12.0}  # edges of the mesh
_VERTICES = 1 << 12  # at a time


def bouncing(plan: CloudPlan) -> Scene:
    """The scene as light bounces in it: what photons carry is black."""
    return without_specular(plan.scene) if plan.photons else plan.scene


class CloudCaustics:
    """Caustics of lights of 1 W/sr.

    Attributes
    ----------
    photons
        Of each light, straight and after a bounce.
    """

    def __init__(self, plan: CloudPlan) -> None:
        self.photons = plan.photons
        self._plan, self._surface = plan, LitSurface(plan.scene)

    def of(self, places: Float64[np.ndarray, "lights 3"]) -> Float32[np.ndarray, "vertices lights 3"]:
        """Irradiance / π at the vertices of what glass and mirrors sent at last, straight or after other bounces."""
        count, V = len(places), len(self._plan.scene.positions)
        lamps = SphereLamps(
            np.asarray(places, np.float32), np.full(count, self._plan.settings.radius, np.float32),
            np.full((count, 3), 4 * np.pi, np.float32),
        )  # fmt: skip
        out = np.zeros((V, count, 3), np.float32)
        for way, share in ((CAUSTIC, 1.0), (BOUNCED_CAUSTIC, BOUNCED_SHARE)):
            sent = PhotonMap(
                self._plan.scene, self._plan.ground.occluders, SphereSource(lamps, is_placed=False), ways=way
            )
            sent.more(max(1, int(self.photons * share * count)))
            photons = sent.photons
            if not len(photons):
                continue
            density = PhotonDensity(
                self._surface, photons, nearest=_NEAREST * min(count, COLUMNS), widest=_REACH[way]
            )
            values = photons.power / np.float32(np.pi * photons.emitted)
            for first in range(0, V, _VERTICES):
                rows = slice(first, min(first + _VERTICES, V))
                out[rows] += density.in_cells(values, photons.light, count, rows=rows)
        return out

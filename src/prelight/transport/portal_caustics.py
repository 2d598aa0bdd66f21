"""Caustics of light that comes in through portals, of every spherical harmonic of each, by one map of photons.

Photons leave the panes on both sides, with the cosine there; those behind which something stands, which for one of the
sides is the room itself, come from nowhere and are dropped.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Float32, Int32
from ..bases import spherical_harmonics
from ..rays.mitsuba import Occluders
from ..scene.geometry import Scene
from .photon_mapping import PhotonMap
from .photon_sources import TriangleSource
from .photon_tracing import BOUNCED_CAUSTIC, CAUSTIC, Photons

Report = Callable[[float], None]
_SHARE = 0.25  # of the photons, beside them, for light that bounced before


class PortalCaustics:
    """What glass and mirrors in a room send of its portals' light.

    Parameters
    ----------
    scene, occluders
        The room without the portals' glass, and the renderer's scene of the same triangles. With what bounces go, the
        gathering operator is to be traced on ``specular.without_specular(scene)``.
    corners, portal_of
        ``(T, 3, 3)`` triangles of the portals, either way round, and the portal that each is part of.
    photons
        Of all portals together; more go on with ``more``.

    Attributes
    ----------
    is_dark
        There is no glass or mirror: ``harmonics`` are 0.
    """

    def __init__(
        self,
        scene: Scene,
        occluders: Occluders,
        corners: Float32[np.ndarray, "triangles 3 3"],
        portal_of: Int32[np.ndarray, "triangles"],
        *,
        photons: int,
        seed: int = 0,
        report: Report | None = None,
    ) -> None:
        both = np.ascontiguousarray(np.concatenate([corners, corners[:, ::-1]]), np.float32)
        source = TriangleSource(
            both, np.ones((len(both), 3), np.float32), np.tile(portal_of, 2).astype(np.int32), beyond=True
        )
        self._maps = {
            way: PhotonMap(scene, occluders, source, ways=way, seed=seed)
            for way in (CAUSTIC, BOUNCED_CAUSTIC)
        }
        self.more(photons, report=report)

    @property
    def is_dark(self) -> bool:
        return not self._maps[CAUSTIC].emitted

    def more(self, photons: int, *, report: Report | None = None) -> None:
        """So many more photons, in whole batches."""
        self._maps[CAUSTIC].more(photons, report=report)
        self._maps[BOUNCED_CAUSTIC].more(max(1, int(photons * _SHARE)))

    def harmonics(
        self, portal: int, functions: slice, *, order: int
    ) -> Float32[np.ndarray, "vertices functions 3"]:
        """Irradiance / π at vertices, before albedo, of some of the harmonics of one portal, up to ``order``.

        A harmonic is the radiance beyond the portal, as a function of the direction toward the outside. All photons
        serve every one of them; of panes that stand one behind the other each sends light.
        """

        def weighed(photons: Photons) -> np.ndarray:
            values = spherical_harmonics.evaluate(order, -photons.direction)[:, functions]
            return (values * (photons.light == portal)[:, None]).astype(np.float32)

        first, second = (of_way.light(weighed) for of_way in self._maps.values())
        return (first + second).light

"""What suns bring through the clear glass of a room: at its vertices, around them, and at any point of a picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Float32, Float64, Int32, Normals, Positions, Radiance
from ..lighting.disc import Disc
from ..lighting.quantities import Triple
from ..storage.bake import Bake
from .portal_sun_caustics import PortalSunCaustics
from .portal_suns import PortalSuns
from .portals_layer import PortalsLayer

_AT_ONCE = 1 << 19  # points of a picture


class Sunlight:
    """The discs seen through each portal now, and what its panes let through; a ``PointLit``.

    Parameters
    ----------
    suns
        Rays of the room.
    portal_of_pane
        ``(N,)``.
    vertices
        How many.
    """

    def __init__(self, suns: PortalSuns, portal_of_pane: Int32[np.ndarray, "panes"], vertices: int) -> None:
        self._suns, self._portal_of_pane, self._vertices = suns, portal_of_pane, vertices
        self._colours: dict[tuple, tuple[Disc, Float64[np.ndarray, "panes 3"]]] = {}
        self._roughly = False

    @property
    def sends_on(self) -> bool:
        """Whether what glass and mirrors in the room send on is found by rays too."""
        return self._suns.sends_on

    @property
    def is_on(self) -> bool:
        """Whether there is a disc that is seen through clear glass."""
        return bool(self._colours)

    def follow(
        self,
        discs_of_portal: Sequence[tuple[Disc, ...]],
        of_pane: Float32[np.ndarray, "panes 3"],
        *,
        roughly: bool = False,
    ) -> None:
        """Take the discs of every portal that has clear glass, and what panes let through now.

        ``roughly``: while a hand drags, suns that are new are found by few rays.
        """
        self._colours = {}
        self._roughly = roughly
        for portal, discs in enumerate(discs_of_portal):
            own = self._portal_of_pane == portal
            for disc in discs:
                key = (disc.direction, disc.radius_deg, disc.softness)
                _, colours = self._colours.setdefault(key, (disc, np.zeros((len(of_pane), 3))))
                colours[own] += of_pane[own] * disc.total

    @property
    def at_vertices(self) -> Radiance:
        """(V, 3) irradiance / π."""
        return self._all(False)

    @property
    def around_vertices(self) -> Radiance:
        """The same of all that falls around them, for what bounces: nothing between vertices is lost."""
        return self._all(True)

    @property
    def lamp_light(self) -> Radiance:
        """Of ``at_vertices``, what ``lamp_light_at`` finds anywhere."""
        total = np.zeros((self._vertices, 3), np.float32)
        for disc, colours in self._colours.values():
            self._suns.sharp(disc).onto(total, colours)
        return total

    def of_discs(self) -> list[tuple[Triple, Radiance]]:
        """Each disc's direction, and what it brings to the vertices."""
        found = []
        for disc, colours in self._colours.values():
            found.append((disc.direction, np.zeros((self._vertices, 3), np.float32)))
            self._suns.sharp(disc).onto(found[-1][1], colours)
        return found

    def of_discs_at(
        self, points: Positions, normals: Normals, *, shadow_rays: int
    ) -> list[tuple[Triple, Radiance]]:
        """The same at points of surfaces."""
        found = []
        for disc, colours in self._colours.values():
            found.append((disc.direction, np.zeros((len(points), 3), np.float32)))
            self._suns.at(disc, points, normals, most=shadow_rays).onto(found[-1][1], colours)
        return found

    def lamp_light_at(self, points: Positions, normals: Normals, *, shadow_rays: int) -> Radiance:
        """(n, 3) irradiance / π at points of surfaces, with at most so many rays from each to each disc."""
        total = np.zeros((len(points), 3), np.float32)
        for first in range(0, len(points), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            for disc, colours in self._colours.values():
                self._suns.at(disc, points[part], normals[part], most=shadow_rays).onto(total[part], colours)
        return total

    def _all(self, spread: bool) -> Radiance:
        total = np.zeros((self._vertices, 3), np.float32)
        for disc, colours in self._colours.values():
            rough = self._roughly and not self._suns.knows(disc)
            self._suns.unit(disc, spread=spread, roughly=rough).onto(total, colours)
        return total

    @property
    def is_rough(self) -> bool:
        """Whether some sun is found by few rays now."""
        return self._roughly and not all(self._suns.knows(disc) for disc, _ in self._colours.values())


def sunlight_of(bake: Bake, layer: PortalsLayer) -> Sunlight | None:
    """None where the bake has not what rays to suns need."""
    if layer.openings is None:
        return None
    normals = bake.receivers.normals.copy()
    normals[layer.glass] = 0
    own, sent_on = layer.openings, None
    if layer.pane_caustic is not None and layer.pane_caustic.any():
        sent_on = PortalSunCaustics(
            bake, normals=normals, corners=own.corners, pane_of=own.pane_of, glass=own.glass,
            pane_caustic=layer.pane_caustic,
        )  # fmt: skip
    suns = PortalSuns(
        own, positions=bake.receivers.positions, triangles=bake.triangles, normals=normals, sent_on=sent_on
    )
    return Sunlight(suns, layer.portal_of_pane, len(bake.receivers))

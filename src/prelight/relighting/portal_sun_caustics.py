"""What glass and mirrors in a room send on of a sun that comes through its portals, by photons traced at run time.

A cell of a portal's cube map is some degrees wide, a sun half of one: its caustic by the baked rows is as blurred. It
needs the renderer, as glass and mirrors are its BSDFs; without it the baked rows stand in.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Float32, Int32, Normals, UInt8
from ..errors import MissingExtraError
from ..lighting.disc import Disc
from ..scene.geometry import Scene
from ..storage.bake import Bake

PHOTONS = 1 << 19
_NARROWEST_DEG = 0.05


class PortalSunCaustics:
    """Photons of suns, aimed at what bends them.

    Parameters
    ----------
    bake
        Its scene is traced, without the portals' glass.
    normals
        ``(V, 3)`` of receivers, 0 for those of the portals' glass.
    corners, pane_of
        The portals' triangles and their panes.
    glass
        The scene's triangles that are the portals' glass.
    pane_caustic
        Which panes hold what is sent on: as many as the others, or three for each, a colour each.
    """

    def __init__(
        self,
        bake: Bake,
        *,
        normals: Normals,
        corners: Float32[np.ndarray, "triangles 3 3"],
        pane_of: Int32[np.ndarray, "triangles"],
        glass: Int32[np.ndarray, "some"],
        pane_caustic: UInt8[np.ndarray, "panes"],
    ) -> None:
        self._bake, self._normals, self._corners, self._pane_of = bake, normals, corners, pane_of
        self._glass = glass
        self._panes = int((pane_caustic == 0).sum())
        self._colours = (len(pane_caustic) - self._panes) // self._panes

    @cached_property
    def is_there(self) -> bool:
        """Whether there is something that sends light on, and the renderer to follow it with."""
        try:
            return self._colours > 0 and self._room is not None
        except MissingExtraError:
            return False

    def brought(
        self, disc: Disc
    ) -> tuple[Int32[np.ndarray, "n"], Int32[np.ndarray, "n"], Float32[np.ndarray, "n"]]:
        """Receivers, caustic panes and irradiance / π, of a disc of total one."""
        from ..transport.photon_density import LitSurface, PhotonDensity
        from ..transport.photon_mapping import PhotonMap
        from ..transport.photon_sources import SunSource
        from ..transport.photon_tracing import CAUSTIC

        scene, occluders, _ = self._room
        toward = np.array([disc.direction], np.float32)
        source = SunSource(toward, np.ones((1, 3), np.float32), max(disc.radius_deg, _NARROWEST_DEG))
        traced = PhotonMap(scene, occluders, source, ways=CAUSTIC)
        traced.more(PHOTONS)
        photons = traced.photons
        pane = self._pane_along(photons.origin, photons.direction)
        photons = photons.taken(np.flatnonzero(pane >= 0))
        pane = pane[pane >= 0]
        if not len(photons):
            return np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0, np.float32)
        density = PhotonDensity(LitSurface(scene), photons)
        starts, which, kernel = density.pairs(np.arange(len(scene.positions)))
        receiver = np.repeat(np.arange(len(scene.positions)), np.diff(starts))
        pairs, place = np.unique(receiver * self._panes + pane[which], return_inverse=True)
        power = photons.power[which, : self._colours] / np.float32(np.pi * photons.emitted)
        weight = [
            np.bincount(place.ravel(), kernel * power[:, c], minlength=len(pairs))
            for c in range(self._colours)
        ]
        receiver, of = np.divmod(pairs, self._panes)
        of = self._panes + of[:, None] * self._colours + np.arange(self._colours)
        return (
            np.repeat(receiver, self._colours).astype(np.int32),
            of.ravel().astype(np.int32),
            np.stack(weight, axis=1).ravel().astype(np.float32),
        )

    def _pane_along(self, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """The first pane that photons come through; −1 where it is none."""
        _, occluders, panes = self._room
        mi = occluders.mi
        o, d = (
            kind(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in values.T))
            for kind, values in ((mi.Point3f, origin), (mi.Vector3f, direction))
        )
        hit = panes.ray_intersect_preliminary(mi.Ray3f(o, d))
        found = self._pane_of[np.minimum(np.array(hit.prim_index), len(self._pane_of) - 1)]
        return np.where(np.array(hit.is_valid()), found, -1)

    @cached_property
    def _room(self) -> tuple[Scene, Any, Any]:
        """The scene without the portals' glass, the renderer's of it, and the renderer's of the portals alone."""
        from ..rays.mitsuba import Occluders, triangle_scene
        from ..scene.baked import scene_of

        scene = scene_of(self._bake)
        kept = np.ones(len(scene.triangles), bool)
        kept[self._glass] = False
        scene = replace(
            scene, triangles=np.ascontiguousarray(scene.triangles[kept]), material_of=scene.material_of[kept],
            normals=self._normals,
        )  # fmt: skip
        corners = np.ascontiguousarray(self._corners.reshape(-1, 3), np.float32)
        _, panes = triangle_scene(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))
        return scene, Occluders(scene.positions, scene.triangles), panes

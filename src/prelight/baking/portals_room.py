"""A scene as portals see it: without its glass, and with what can be said of the portals before light is traced."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Int32, Normals, Positions
from ..errors import InputError
from ..rays.mitsuba import Occluders, triangle_scene
from ..scene.geometry import Scene
from ..scene.portals import Portals, find_portals
from ..transport.ordering import receiver_order
from ..transport.portal_caustics import PortalCaustics
from ..transport.portal_light import PortalRays
from ..transport.portal_openness import Openness, portal_openness, through_others
from ..transport.reveals import beyond_glass
from ..transport.seen_cells import Glazing
from ..transport.specular import specular_materials, without_specular
from ..transport.vantage import vantage_points
from .environment_settings import PHOTONS
from .exitant import ExitantPart
from .portals_settings import PortalsSettings

_CLOSED = 0.0  # share of free rays on the open side: light cannot leave
_OUTSIDE = 0.9  # share of free rays on either side: the room is not around it
_WITHIN = 0.98  # share of free rays through other portals: what is not flat, as panes are, stands in the room
_MOST_LAYERS = 4  # panes that a ray from a glossy vertex may pass
_THROUGH_TWO = 1e-3  # share of free rays through another pane: rays then count for the last one


class PortalsRoom:
    """The scene of a bake of portals.

    Attributes
    ----------
    scene
        As given, and ``open`` without the portals' glass: what light bounces in. Vertices of glass alone have no
        normals there, and stay dark.
    portals
        Through which light can come.

    Raises InputError where there is none.
    """

    def __init__(self, scene: Scene, settings: PortalsSettings) -> None:
        self.scene, self.settings = scene, settings
        self._found = find_portals(scene, settings.wish)
        self.portals, self.notes = self._checked(self._found)
        self.open = without_triangles(scene, self.portals.glass)

    @cached_property
    def occluders(self) -> Occluders:
        """Everything but the portals' glass."""
        return Occluders(self.open.positions, self.open.triangles)

    @cached_property
    def openness(self) -> Openness:
        return portal_openness(self.occluders, self.portals, glass=self._glass)

    @cached_property
    def origins(self) -> Positions:
        """Where rays of the receivers begin; not in a corner between a wall and a portal either."""
        return self._standing[0]

    @property
    def beyond(self) -> Int32[np.ndarray, "receivers"]:
        """The pane that receivers outside are seen through, in a window's reveal; −1 of all that are inside."""
        return self._standing[1]

    @cached_property
    def _standing(self) -> tuple[Positions, Int32[np.ndarray, "receivers"]]:
        whole, count = _closed(self.open, self.portals), len(self.open.positions)
        inside = vantage_points(whole, Occluders(whole.positions, whole.triangles))[:count]
        outside = vantage_points(self.open, self.occluders)
        normals = self.open.normals
        beyond = beyond_glass(self.occluders, self.portals, self._glass, origins=outside, normals=normals)
        return np.where((beyond >= 0)[:, None], outside, inside), beyond

    @cached_property
    def order(self) -> Int32[np.ndarray, "receivers"]:
        """In which receivers are traced: neighbours that see alike together."""
        return receiver_order(self.open.positions, self.open.normals)

    @cached_property
    def rays(self) -> PortalRays:
        """Of the receivers in that order."""
        settings = self.settings
        return self.rays_from(
            self.origins[self.order],
            self.open.normals[self.order],
            resolution=settings.cube,
            rays=settings.rays,
            beyond=self.beyond[self.order],
        )

    def rays_from(
        self,
        origins: Positions,
        normals: Normals,
        *,
        resolution: int,
        rays: int,
        alike: bool = False,
        beyond: Int32[np.ndarray, "receivers"] | None = None,
    ) -> PortalRays:
        """Of any receivers; ``alike`` to the same points for all of them, ``beyond`` as the attribute."""
        return PortalRays(
            self.occluders, self.portals, origins=origins, normals=normals, resolution=resolution, rays=rays,
            seed=self.settings.seed, glass=self._glass, layered=self.openness.behind > _THROUGH_TWO, alike=alike,
            beyond=beyond,
        )  # fmt: skip

    @cached_property
    def photons(self) -> int:
        """That are traced for caustics: none where no material needs them."""
        wanted = PHOTONS if self.settings.photons is None else self.settings.photons
        return wanted if specular_materials(self.open).any() else 0

    @cached_property
    def caustics(self) -> PortalCaustics | None:
        """What glass and mirrors in the room send of what comes in; traced when first asked for."""
        if not self.photons:
            return None
        layered = self.openness.behind > _THROUGH_TWO
        return PortalCaustics(
            self.open, self.occluders, self.portals.corners, self.portals.pane_of, photons=self.photons,
            glass=self._glass if layered else None, seed=self.settings.seed,
        )  # fmt: skip

    @cached_property
    def gloss(self) -> ExitantPart | None:
        """What glossy vertices see, and through which pane the sky; None where that is not wanted."""
        if not (order := self.settings.glossy_order):
            return None
        layers = _MOST_LAYERS if self.openness.behind > _THROUGH_TWO else 1
        glazing = Glazing(self._glass, self.portals.pane_of.astype(np.int32), layers)
        seed = self.settings.seed
        return ExitantPart.of(
            self.open, self.occluders, order=order, origins=self.origins, glazing=glazing, seed=seed
        )

    @cached_property
    def bouncing(self) -> Scene:
        """``open`` as light bounces in it: what photons carry is black, and gloss sends on all that it reflects."""
        room = self.open if self.gloss is None else self.gloss.bouncing(self.open)
        return without_specular(room) if self.photons else room

    @cached_property
    def _glass(self) -> Any:
        corners = self.portals.corners.reshape(-1, 3)
        return triangle_scene(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))[1]

    def _checked(self, portals: Portals) -> tuple[Portals, tuple[str, ...]]:
        """Portals without those that are none; raises InputError for one that was asked for, and if none is left."""
        bare = without_triangles(self.scene, portals.glass)
        occluders = Occluders(bare.positions, bare.triangles)
        found = portal_openness(occluders, portals)
        closed, outside = found.free[:, 0] <= _CLOSED, found.free[:, 1] >= _OUTSIDE
        round_ = np.flatnonzero(~found.outward.any(axis=1) & ~closed & ~outside)
        within = np.zeros_like(closed)
        within[round_] = through_others(occluders, portals, round_) >= _WITHIN
        none = closed | outside | within
        if not none.any():
            return portals, ()
        wrong = int(np.flatnonzero(none)[0])
        why = "it lies outside: the sky is on both of its sides"
        if closed[wrong] or within[wrong]:
            why = "light cannot leave through it" if closed[wrong] else "it stands in the room, behind others"
        asked = bool(self.settings.wish.materials) or self.settings.wish.file is not None
        if asked or none.all():
            what = f"{why}; a portal is an opening between the room and the sky"
            raise InputError(f"portal {portals.names[wrong]}", what)
        names = [portals.names[p] for p in np.flatnonzero(none)[:4]]
        more = int(none.sum()) - len(names)
        note = f"glass that is no portal: {', '.join(names)}" + (f" and {more} more" if more else "")
        return portals.keeping(np.flatnonzero(~none)), (note,)


def without_triangles(scene: Scene, left_out: np.ndarray) -> Scene:
    """The scene without some triangles; vertices that only they use get no normal, so they send no rays."""
    kept = np.ones(len(scene.triangles), bool)
    kept[left_out] = False
    if not kept.any():
        raise InputError(scene.name, "is nothing but glass; portals want a room around them")
    triangles = np.ascontiguousarray(scene.triangles[kept])
    used = np.zeros(len(scene.positions), bool)
    used[triangles.ravel()] = True
    normals = np.where(used[:, None], scene.normals, np.float32(0)).astype(np.float32)
    return replace(scene, triangles=triangles, material_of=scene.material_of[kept], normals=normals)


def _closed(scene: Scene, portals: Portals) -> Scene:
    """The open scene with its portals as surfaces, whether they were glass or polygons."""
    corners = portals.corners.reshape(-1, 3)
    a, b, c = np.moveaxis(portals.corners.astype(np.float64), 1, 0)
    across = np.cross(b - a, c - a)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    more = np.arange(len(corners), dtype=np.int32).reshape(-1, 3) + len(scene.positions)
    return Scene(
        scene.name,
        np.concatenate([scene.positions, corners]).astype(np.float32),
        np.concatenate([scene.normals, np.repeat(across, 3, axis=0)]).astype(np.float32),
        np.concatenate([scene.triangles, more]).astype(np.int32),
        np.concatenate([scene.albedo, np.zeros_like(corners)]).astype(np.float32),
    )

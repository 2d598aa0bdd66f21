"""A scene as portals see it: without its glass, and with what can be said of the portals before light is traced."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Int32, Positions
from ..errors import InputError
from ..rays.mitsuba import Occluders, triangle_scene
from ..scene.geometry import Scene
from ..scene.portals import Portals, find_portals
from ..transport.ordering import receiver_order
from ..transport.portal_light import PortalRays
from ..transport.portal_openness import Openness, portal_openness
from ..transport.vantage import vantage_points
from .portals_settings import PortalsSettings

_CLOSED = 0.0  # share of free rays on the open side: light cannot leave
_OUTSIDE = 0.995  # share of free rays on either side: nothing of the room is near
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
        whole, count = _closed(self.open, self.portals), len(self.open.positions)
        return vantage_points(whole, Occluders(whole.positions, whole.triangles))[:count]

    @cached_property
    def order(self) -> Int32[np.ndarray, "receivers"]:
        """In which receivers are traced: neighbours that see alike together."""
        return receiver_order(self.open.positions, self.open.normals)

    @cached_property
    def rays(self) -> PortalRays:
        """Of the receivers in that order."""
        settings = self.settings
        return PortalRays(
            self.occluders, self.portals, origins=self.origins[self.order], normals=self.open.normals[self.order],
            resolution=settings.cube, rays=settings.rays, seed=settings.seed,
            glass=self._glass, layered=self.openness.behind > _THROUGH_TWO,
        )  # fmt: skip

    @cached_property
    def _glass(self) -> Any:
        corners = self.portals.corners.reshape(-1, 3)
        return triangle_scene(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))[1]

    def _checked(self, portals: Portals) -> tuple[Portals, tuple[str, ...]]:
        """Portals without those that are none; raises InputError for one that was asked for, and if none is left."""
        bare = without_triangles(self.scene, portals.glass)
        found = portal_openness(Occluders(bare.positions, bare.triangles), portals)
        closed, outside = found.free[:, 0] <= _CLOSED, found.free[:, 1] >= _OUTSIDE
        if not (closed | outside).any():
            return portals, ()
        wrong = int(np.flatnonzero(closed | outside)[0])
        why = (
            "light cannot leave through it"
            if closed[wrong]
            else "it lies outside: the sky is on both of its sides"
        )
        asked = bool(self.settings.wish.materials) or self.settings.wish.file is not None
        if asked or (closed | outside).all():
            what = f"{why}; a portal is an opening between the room and the sky"
            raise InputError(f"portal {portals.names[wrong]}", what)
        names = [portals.names[p] for p in np.flatnonzero(closed | outside)[:4]]
        more = int((closed | outside).sum()) - len(names)
        note = f"glass that is no portal, left opaque: {', '.join(names)}" + (
            f" and {more} more" if more else ""
        )
        return portals.keeping(np.flatnonzero(~(closed | outside))), (note,)


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

"""Direct light of lamps and panels at the vertices: in closed form where nothing is in the way, by rays where it is."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from ..arrays import Float32, Int32, Normals, Positions, Radiance
from ..errors import InputError
from ..lighting.placed_lights import Lamp, PlacedLight, PlacedPanel
from ..storage.bake import Bake
from .form_factor_kernels import of_ball, of_panel
from .light_rays import light_rays

SHADOW_RAYS = 16  # to each light that is not a point
MOST_SHADOW_RAYS = 4096
_FEW = 4  # rays to a ball that is smaller than the mesh's own edges
_SOLID = 0.9  # share of backs around a light that is inside a solid
_AHEAD = 2e-4  # of the scene, in front of a panel: where it is looked around


class PlacedDirect:
    """Direct irradiance / π at a bake's vertices.

    Parameters
    ----------
    origins
        (V, 3) where the vertices' rays begin.
    shadow_rays
        From each vertex to each light, a whole number from 1 to 4096; one to points.

    Raises
    ------
    InputError, MissingExtraError
        Another number; the renderer is not installed.
    """

    def __init__(self, bake: Bake, origins: Positions, *, shadow_rays: int = SHADOW_RAYS) -> None:
        if type(shadow_rays) is not int or not 1 <= shadow_rays <= MOST_SHADOW_RAYS:
            raise InputError("shadow-rays", f"{shadow_rays!r}, expected 1 to {MOST_SHADOW_RAYS}")
        receivers = bake.receivers
        self.shadow_rays = shadow_rays
        self._normals: Normals = receivers.normals
        self._rays = light_rays(bake, origins)
        self._points: Positions = self._rays.points
        self._edge = _usual_edge(receivers.positions, bake.triangles)
        self._extent = float(np.ptp(receivers.positions, axis=0).max())

    def elsewhere(self, points: Positions, normals: Normals, *, shadow_rays: int) -> PlacedDirect:
        """The same at other points (n, 3) of surfaces, with unit normals."""
        other = copy(self)
        other._normals, other._rays = normals, self._rays.elsewhere(points, normals)
        other._points, other._edge, other.shadow_rays = other._rays.points, 0.0, shadow_rays
        return other

    def with_rays(self, shadow_rays: int) -> PlacedDirect:
        """The same with another number of shadow rays."""
        other = copy(self)
        other.shadow_rays = shadow_rays
        return other

    def of(self, light: PlacedLight) -> Radiance:
        """(V, 3) of a light of colour 1; a copy."""
        return self._of_lamp(light) if isinstance(light, Lamp) else self._of_panel(light)

    @property
    def points(self) -> Positions:
        """(V, 3) where rays begin."""
        return self._points

    @property
    def extent(self) -> float:
        """Of the scene, metres."""
        return self._extent

    def share_of_ball(
        self, rows: Int32[np.ndarray, "rows"], centre: np.ndarray, radius: float, *, rays: int
    ) -> Float32[np.ndarray, "rows"]:
        """The share of a ball's light that some vertices get, above and below their horizons alike."""
        return self._rays.of_ball(rows, centre, radius, rays=1 if radius == 0 else rays)

    def share_of_direction(
        self, rows: Int32[np.ndarray, "rows"], d: np.ndarray
    ) -> Float32[np.ndarray, "rows"]:
        """1 where some vertices see a light infinitely far away, 0 where not."""
        return self._rays.of_direction(rows, d)

    def is_inside(self, light: PlacedLight) -> bool:
        """Whether a light is inside a solid, which then keeps its light."""
        ahead = light.normal * (_AHEAD * self._extent) if isinstance(light, PlacedPanel) else 0.0
        return self._rays.share_of_backs(np.array(light.position) + ahead) >= _SOLID

    def _of_lamp(self, lamp: Lamp) -> Radiance:
        seen, along = np.empty(len(self._points), np.float32), np.empty((len(self._points), 3))
        centre, axes = np.array(lamp.position), np.ascontiguousarray(lamp.axes)
        of_ball(self._points, self._normals, centre, axes, lamp.radius, seen, along)
        rows = np.flatnonzero(seen > 0).astype(np.int32)
        out = np.zeros((len(seen), 3), np.float32)
        shape = np.ones((1, 1), np.float32)
        if lamp.beam.distribution is not None:
            shape = np.maximum(lamp.beam.distribution.along(along[rows]), 0.0).astype(np.float32)
            lit = (shape > 0).any(axis=1)
            rows, shape = rows[lit], shape[lit]
        if not len(rows):
            return out
        rays = _FEW if lamp.radius < self._edge else self.shadow_rays
        share = self._rays.of_ball(rows, centre, lamp.radius, rays=min(rays, self.shadow_rays))
        out[rows] = shape * (seen[rows] * share)[:, None]
        return out

    def _of_panel(self, panel: PlacedPanel) -> Radiance:
        seen, corners = np.empty(len(self._points), np.float32), panel.corners
        of_panel(self._points, self._normals, corners, panel.normal, seen)
        rows: Int32[np.ndarray, "lit"] = np.flatnonzero(seen > 0).astype(np.int32)
        out = np.zeros((len(seen), 3), np.float32)
        if len(rows):
            share = self._rays.of_panel(rows, corners, rays=self.shadow_rays)
            out[rows] = (seen[rows] * share)[:, None]
        return out

    def of_direction(self, direction: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """(V,) of a light infinitely far away whose irradiance across it is 1; of some vertices, if not of all."""
        normals = self._normals if rows is None else self._normals[rows]
        cosine = np.maximum(normals @ np.asarray(direction, np.float32), 0)
        lit = np.flatnonzero(cosine > 0).astype(np.int32)
        out = np.zeros(len(cosine), np.float32)
        if len(lit):
            share = self._rays.of_direction(lit if rows is None else rows[lit], direction)
            out[lit] = cosine[lit] * share / np.float32(np.pi)
        return out


def white(light: PlacedLight) -> PlacedLight:
    """The same of colour 1 and without a name: what its direct and bounced light depend on."""
    return replace(light, beam=replace(light.beam, intensity=(1.0, 1.0, 1.0)), name=None)


def _usual_edge(positions: Positions, triangles: np.ndarray) -> float:
    """The median edge of the mesh, metres."""
    a, b = positions[triangles[:, 0]], positions[triangles[:, 1]]
    return float(np.median(np.linalg.norm(a - b, axis=1))) if len(triangles) else 0.0

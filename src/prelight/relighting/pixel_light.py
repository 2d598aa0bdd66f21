"""Direct light of lamps where pixels see the scene, so that a picture's shadows are finer than the mesh."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..arrays import Float32, Int32, Normals, Positions, Radiance, Triangles
from ..drawing.picture import Picture
from ..drawing.view import View
from ..receivers import Receivers

SHADOW_RAYS = 32  # from each triangle in each pixel


class PointLit(Protocol):
    """A layer that can say the direct light of its lamps anywhere."""

    @property
    def lamp_light(self) -> Radiance:
        """(V, 3) at the vertices, irradiance / π."""
        ...

    def lamp_light_at(self, points: Positions, normals: Normals, *, shadow_rays: int) -> Radiance:
        """(n, 3) at points of surfaces."""
        ...


def lit_at_pixels(
    view: View, picture: Picture, layer: PointLit, receivers: Receivers, triangles: Triangles
) -> Picture:
    """A picture drawn without ``layer.lamp_light``, with that light found for each pixel."""
    points, normals = places_of(view, receivers, triangles)
    light = layer.lamp_light_at(points, normals, shadow_rays=SHADOW_RAYS)
    return view.lit(picture, light, receivers.albedo)


def places_of(
    view: View, receivers: Receivers, triangles: Triangles
) -> tuple[Float32[np.ndarray, "n 3"], Float32[np.ndarray, "n 3"]]:
    """Points that pixels see, one for each triangle in each, and the normals there.

    Points are lifted to where the surface would be if it were as smooth as its normals say: else the edges of
    triangles show where light only grazes (Hanika, Hacking the shadow terminator, Ray Tracing Gems II, 2021).
    """
    seen, weights = view.places
    share = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)
    return smooth_places(triangles[seen], share, receivers.positions, receivers.normals)


def smooth_places(
    corners: Int32[np.ndarray, "n 3"],
    share: Float32[np.ndarray, "n 3"],
    positions: Positions,
    normals: Normals,
) -> tuple[Float32[np.ndarray, "n 3"], Float32[np.ndarray, "n 3"]]:
    """Points of triangles, lifted as ``places_of`` says, and the normals there; ``share`` adds up to 1."""
    points = np.zeros((len(corners), 3), np.float32)
    facing = np.zeros_like(points)
    for k in range(3):
        points += share[:, k : k + 1] * positions[corners[:, k]]
        facing += share[:, k : k + 1] * normals[corners[:, k]]
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-12)
    lifted = points.copy()
    for k in range(3):
        own = normals[corners[:, k]]
        below = np.minimum(np.einsum("ij,ij->i", points - positions[corners[:, k]], own), 0)
        lifted -= (share[:, k] * below)[:, None] * own
    return lifted, facing

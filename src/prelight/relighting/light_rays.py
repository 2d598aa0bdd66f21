"""The renderer at run time: what of a light each vertex sees, many rays at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Directions, Positions, UInt8
from ..errors import MissingExtraError
from ..storage.bake import Bake

if TYPE_CHECKING:
    from ..rays.plain_light_rays import PlainLightRays
    from ..transport.light_rays import LightRays


def light_rays(bake: Bake, origins: Positions) -> LightRays | PlainLightRays:
    """Rays of a bake's vertices, which begin at ``origins``: the renderer's, or without one those of ``rays.plain``."""
    try:
        from ..rays.mitsuba import Occluders
        from ..scene.baked import scene_of
        from ..transport.light_rays import LightRays

        scene = scene_of(bake)
        return LightRays(scene, Occluders(scene.positions, scene.triangles), origins)
    except MissingExtraError:
        from ..rays.plain_light_rays import PlainLightRays

        seen = bake.receivers
        return PlainLightRays(seen.positions, bake.triangles, normals=seen.normals, origins=origins)


def sky_bits(bake: Bake, origins: Positions, directions: Directions) -> UInt8[np.ndarray, "directions bytes"]:
    """Which vertices see the sky in which directions, vertex i in bit i mod 8 of byte i div 8."""
    receivers = bake.receivers
    try:
        from ..rays.mitsuba import Occluders
        from ..transport.visibility import Visibility

        occluders = Occluders(receivers.positions, bake.triangles)
        return Visibility(occluders, origins=origins, normals=receivers.normals).trace(directions)[0]
    except MissingExtraError:
        from ..rays.plain import PlainOccluders, PlainVisibility

        plain = PlainOccluders(receivers.positions, bake.triangles)
        return PlainVisibility(plain, origins=origins, normals=receivers.normals).trace(directions)[0]

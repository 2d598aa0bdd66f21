"""Lights with a place as Mitsuba's emitters: what a transfer layer is held against."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InputError
from ..lighting.distributions import Power
from ..lighting.placed_lights import PlacedLight, PlacedPanel
from ..transport.steered_lamps import SteeredSpot
from ..transport.steered_reference import steered_emitter


def emitter_of(mi: Any, light: PlacedLight) -> Any:
    """Balls that shine evenly or by a power of the cosine, and panels.

    A panel lets pass what meets it from elsewhere, as in a transfer layer; a ball is black, and small. Raises
    InputError for points with a shape and for measured shapes, which Mitsuba has not.
    """
    if isinstance(light, PlacedPanel):
        return _panel(mi, light)
    shape, radius = light.beam.distribution, light.radius
    if shape is None and radius == 0:
        intensity = {"type": "rgb", "value": [float(x) for x in light.colour]}
        return {"type": "point", "position": list(light.position), "intensity": intensity}
    if shape is None:
        radiance = {"type": "rgb", "value": [float(x) / (np.pi * radius**2) for x in light.colour]}
        black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
        ball = {"type": "sphere", "center": list(light.position), "radius": float(radius), "bsdf": black}
        return ball | {"emitter": {"type": "area", "radiance": radiance}}
    if not isinstance(shape, Power) or radius == 0:
        raise InputError("reference", "knows balls with a power of the cosine, and none of these lights")
    axis, power, colour = light.axes[:, 2], shape.power, light.colour

    def emission(mi: Any, direction: Any, u: Any, v: Any) -> Any:
        import drjit as dr

        del u, v
        along = sum(direction[k] * float(axis[k]) for k in range(3))
        value = dr.power(dr.maximum(0.5 + 0.5 * along, 0), power)
        return mi.Color3f(*(value * float(c) for c in colour))

    return steered_emitter(mi, SteeredSpot(light.position, 0, float(radius)), emission)


def _panel(mi: Any, panel: PlacedPanel) -> dict[str, Any]:
    corners = panel.corners
    across, up = corners[1] - corners[0], corners[3] - corners[0]
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = across / 2, up / 2, panel.normal
    matrix[:3, 3] = panel.position
    radiance = {"type": "rgb", "value": [float(x) for x in panel.colour]}
    # No bsdf null: Mitsuba's path forgets what a ray has met that goes on through it and then leaves the scene.
    nothing = {"type": "dielectric", "int_ior": 1.0, "ext_ior": 1.0}
    return {
        "type": "rectangle", "to_world": mi.ScalarTransform4f(matrix), "bsdf": nothing,
        "emitter": {"type": "area", "radiance": radiance},
    }  # fmt: skip

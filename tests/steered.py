"""A small room with a mirror and glass for tests of steerable lamps, and a lamp that fits."""

from __future__ import annotations

import numpy as np

from prelight.camera import Camera
from prelight.material import Material
from prelight.scene.geometry import Scene
from prelight.scene.stock.chessmen import ball
from prelight.scene.stock.parts import rectangle, scene_of

EYE = Camera((0.3, 1.0, 3.0), (0.0, 0.4, 0.0), vertical_fov_deg=32)
LAMP_AT = (0.7, 1.4, 0.9)
_WHITE = Material("white", (0.7, 0.68, 0.62))
_RED = Material("red", (0.6, 0.1, 0.08))
_MIRROR = Material("mirror", bsdf={"type": "conductor", "material": "none"})
_GLASS = Material("glass", bsdf={"type": "dielectric", "int_ior": 1.5})


def room(*, mirror: bool = False, glass: bool = False) -> Scene:
    """A floor and two walls, open to the eye, with a ball of each that is asked for."""
    x, y, z = np.eye(3)
    parts = [
        (rectangle(np.array([-1, 0, 1.0]), 2 * x, -2 * z, cells=(4, 4)), _WHITE),
        (rectangle(np.array([-1, 0, -1.0]), 2 * x, 1.6 * y, cells=(4, 4)), _WHITE),
        (rectangle(np.array([-1, 0, 1.0]), -2 * z, 1.6 * y, cells=(4, 4)), _RED),
    ]
    if mirror:
        parts.append((ball(0.25, 0.5).moved((-0.45, 0.01, -0.2)), _MIRROR))
    if glass:
        parts.append((ball(0.25, 0.5).moved((0.3, 0.03, 0.1)), _GLASS))
    return scene_of("room", parts, cameras={"front": EYE})

"""A terracotta band that winds twice round into itself, on a plinth: the face of the project."""

from __future__ import annotations

import numpy as np

from ...camera import Camera
from ...errors import InputError
from ...material import Material
from ..geometry import Scene
from .band import Band
from .ground import ground
from .parts import Part, scene_of
from .plinth import plinth

# Linear Rec.709.
TERRACOTTA = (0.55, 0.25, 0.135)
PLASTER = (0.66, 0.645, 0.62)
STONE = (0.31, 0.30, 0.285)

HEIGHT = 1.25  # of the body, metres
PLINTH_HEIGHT = 0.80
HALF_WIDTH = 0.24  # of the plinth
CHAMFER = 0.006
FLOOR_RADIUS = 12.0
GAP = 0.005  # below body and plinth: rays begin 3.4 mm off a surface, and must not begin inside another
BODY_TURN_DEG = -26.0  # towards the key light, which the stock environments have on the left
PLINTH_TURN_DEG = -25.0

CAMERAS = {
    "front": Camera(eye=(0.0, 1.60, 5.4), target=(0.16, 1.06, 0.0), vertical_fov_deg=26.0),
    "close": Camera(eye=(-1.3, 1.85, 3.0), target=(0.05, 1.38, 0.0), vertical_fov_deg=27.0),
}


def winding_band() -> Band:
    """Two rounds about one centre, the outer broad and open, the inner narrow; one full turn on the way.

    In units of its own: about 1.5 high.
    """

    def curve(u: np.ndarray) -> np.ndarray:
        radius = 0.39 + 0.18 * np.cos(u)
        round_ = 2 * u - 0.5
        return np.stack(
            [-radius * np.sin(round_), -1.16 * radius * np.cos(round_), 0.17 * np.sin(u)], axis=-1
        )

    return Band(
        curve=curve,
        half_width=lambda u: 0.135 + 0.065 * np.cos(u),
        half_thickness=lambda u: 0.043 + 0.018 * np.cos(u),
        angle=lambda u: -(0.6 + u + 0.4 * np.sin(u)),
    )


def sculpture(*, detail: float = 1.0) -> Scene:
    """The sculpture, its plinth and a round floor of 12 m; about 30,000 · detail² vertices.

    ``detail`` from 0.2 to 4. Raises InputError beyond.
    """
    if not 0.2 <= detail <= 4:
        raise InputError("detail", f"{detail}, expected 0.2 to 4")
    body = _standing(winding_band().part(along=round(360 * detail), around=2 * round(18 * detail)))
    cells = max(4, round(20 * detail))
    base = plinth(half_width=HALF_WIDTH, height=PLINTH_HEIGHT, chamfer=CHAMFER, gap=GAP, cells=(cells, cells))
    floor = ground(radius=FLOOR_RADIUS, half_width=HALF_WIDTH, spacing=0.038 / detail)
    parts = [
        (body, Material("terracotta", TERRACOTTA)),
        (base.turned(PLINTH_TURN_DEG), Material("plaster", PLASTER)),
        (floor.turned(PLINTH_TURN_DEG), Material("stone", STONE)),
    ]
    return scene_of("sculpture" if detail >= 1 else "sculpture-small", parts, cameras=CAMERAS)


def _standing(body: Part) -> Part:
    """Scaled to its height, its lowest point in the middle of the plinth, just above it."""
    body = body.scaled(HEIGHT / np.ptp(body.positions[:, 1])).turned(BODY_TURN_DEG)
    foot = body.positions[body.positions[:, 1].argmin()]
    return body.moved(tuple(np.array([0.0, PLINTH_HEIGHT + GAP, 0.0]) - foot))

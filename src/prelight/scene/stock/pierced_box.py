"""A box with a hole in its left wall, open in front: a lamp that goes in by the hole changes everything at once."""

from __future__ import annotations

import numpy as np

from ...camera import Camera
from ...errors import InputError
from ...material import Material
from ..geometry import Scene
from .blocks import block_faces
from .cornell import GREEN, RED, WHITE
from .parts import rectangle, scene_of
from .plinth import plinth

GROUND = Material("ground", (0.42, 0.40, 0.37))
OUTSIDE = Material("outside of the box", (0.60, 0.57, 0.52))

HALF, THICK = 0.5, 0.05  # of the room, and its walls, metres
HOLE_Y, HOLE_Z = (0.40, 0.72), (-0.20, 0.12)  # of the opening in the left wall
GAP = 0.002
BLOCK_AT, BLOCK_TURN_DEG = (0.14, -0.12), 24.0

CAMERAS = {
    "front": Camera(eye=(-0.35, 0.72, 2.75), target=(-0.12, 0.47, 0.0), vertical_fov_deg=32.0),
    "close": Camera(eye=(0.30, 0.55, 1.05), target=(-0.30, 0.42, -0.20), vertical_fov_deg=52.0),
}


def pierced_box(*, detail: float = 1.0) -> Scene:
    """The box, a block in it, the ground on which it stands; about 13,000 vertices at 1.

    ``detail`` from 0.2 to 4. Raises InputError beyond.
    """
    if not 0.2 <= detail <= 4:
        raise InputError("detail", f"{detail}, expected 0.2 to 4")
    outer = HALF + THICK
    x = np.array([-outer, -HALF, HALF, outer])
    y = np.array([0.0, THICK, THICK + HOLE_Y[0], THICK + HOLE_Y[1], THICK + 2 * HALF, 2 * outer])
    z = np.array([-outer, -HALF, HOLE_Z[0], HOLE_Z[1], HALF])
    solid = np.ones((3, 5, 4), bool)
    solid[1, 1:4, 1:] = False  # the room
    solid[0, 2, 2] = False  # the hole

    def paint(axis: int, side: int, cell: tuple[int, int, int]) -> Material:
        i, j, k = cell
        if axis == 0 and 1 <= j <= 3 and k > 0 and i == 0 and side > 0:
            return RED
        if axis == 0 and 1 <= j <= 3 and k > 0 and i == 2 and side < 0:
            return GREEN
        room_side = (axis == 1 and i == 1 and k > 0 and (j == 0) == (side > 0)) or (
            axis == 2 and i == 1 and k == 0 and side > 0 and 1 <= j <= 3
        )
        return WHITE if room_side or _faces_hole(axis, side, cell) else OUTSIDE

    step = 0.036 / detail
    parts = block_faces(solid, (x, y + GAP, z), step=step, paint=paint)
    cells = max(4, round(9 * detail))
    block = plinth(half_width=0.13, height=0.42, chamfer=0.004, gap=0.0, cells=(cells, 2 * cells))
    parts.append((block.turned(BLOCK_TURN_DEG).moved((BLOCK_AT[0], THICK + 2 * GAP, BLOCK_AT[1])), WHITE))
    wide = max(6, round(3.0 / (2.2 * step)))
    parts.append(
        (
            rectangle(np.array([-1.9, 0, -1.1]), 2.4 * np.eye(3)[2], 3.0 * np.eye(3)[0], cells=(wide, wide)),
            GROUND,
        )
    )
    return scene_of("pierced-box" if detail >= 1 else "pierced-box-small", parts, cameras=CAMERAS)


def _faces_hole(axis: int, side: int, cell: tuple[int, int, int]) -> bool:
    """Whether a face of the left wall's cell looks into the hole, cell (0, 2, 2)."""
    beyond = list(cell)
    beyond[axis] += side
    return beyond == [0, 2, 2]

"""A Cornell box of our own: red and green walls, two blocks, a lamp; a model on a round table, open in front.

Its measures are ours, in the spirit of the room that Goral et al. (1984) built to compare pictures with.
"""

from __future__ import annotations

import numpy as np

from ...camera import Camera
from ...errors import InputError
from ...material import Material
from ..geometry import Scene
from .floor_plots import Plot, floor_around
from .ground import ground
from .parts import Part, rectangle, scene_of, sheet, together
from .plinth import plinth

# Linear Rec.709.
WHITE = Material("white", (0.73, 0.72, 0.69))
RED = Material("red", (0.58, 0.065, 0.05))
GREEN = Material("green", (0.13, 0.44, 0.11))
WOOD = Material("table", (0.34, 0.225, 0.145))
SHELL = Material("shell", (0.60, 0.57, 0.52))
LAMP = Material("lamp", (0.78, 0.78, 0.78), emission=(17.0, 13.4, 9.2))

HALF = 0.5  # of the room's width and height, metres
WALL = 0.03  # its thickness
OUTER = HALF + WALL  # half of the box's width; the room is open at z = OUTER
BLOCK = 0.15  # half of both blocks' width
TALL_AT, TALL_TURN_DEG = (-0.185, -0.17), 17.0  # x and z
SHORT_AT, SHORT_TURN_DEG = (0.185, 0.15), -18.0
TABLE_RADIUS = 1.5
GAP = 0.0015  # rays begin 0.35 mm off a surface, and must not begin inside another

CAMERAS = {
    "front": Camera(eye=(0.0, 0.68, 3.1), target=(0.0, 0.497, 0.0), vertical_fov_deg=26.5),
    "close": Camera(eye=(-0.26, 0.60, 0.98), target=(0.06, 0.36, -0.2), vertical_fov_deg=50.0),
}
X, Y, Z = np.eye(3)


def cornell(*, detail: float = 1.0) -> Scene:
    """The box, its blocks, its lamp and the table under it; about 20,000 · detail² vertices.

    ``detail`` from 0.2 to 4. Raises InputError beyond.
    """
    if not 0.2 <= detail <= 4:
        raise InputError("detail", f"{detail}, expected 0.2 to 4")
    cells = max(8, round(38 * detail))
    floor = GAP + WALL  # the room's
    middle = (floor + HALF) * Y
    block = max(4, round(17 * detail))
    tall = plinth(half_width=BLOCK, height=0.60, chamfer=0.004, gap=GAP, cells=(block, 2 * block))
    short = plinth(half_width=BLOCK, height=0.30, chamfer=0.004, gap=GAP, cells=(block, block))
    lamp = rectangle(np.array([-0.13, 0, -0.10]), 0.26 * X, 0.20 * Z, cells=(6, 6))
    parts = [
        (_floor(spacing=1.15 * 2 * HALF / cells).moved((0.0, floor, 0.0)), WHITE),
        (_wall(-Y, -X, middle, cells=cells), WHITE),
        (_wall(Z, X, middle, cells=cells), WHITE),
        (_wall(X, -Z, middle, cells=cells), RED),
        (_wall(-X, Z, middle, cells=cells), GREEN),
        (tall.turned(TALL_TURN_DEG).moved((TALL_AT[0], floor, TALL_AT[1])), WHITE),
        (short.turned(SHORT_TURN_DEG).moved((SHORT_AT[0], floor, SHORT_AT[1])), WHITE),
        (lamp.moved((0.0, floor + 2 * HALF - 0.003, 0.0)), LAMP),
        (_shell(middle, cells=max(4, cells // 5)), SHELL),
        (ground(radius=TABLE_RADIUS, half_width=OUTER, spacing=0.038 / detail), WOOD),
    ]
    return scene_of("cornell" if detail >= 1 else "cornell-small", parts, cameras=CAMERAS)


def _floor(*, spacing: float) -> Part:
    """In two plots, one around each block, which meet along a line midway between them."""
    corners = np.array([(-1.0, 1.0), (-1.0, -OUTER), (1.0, -OUTER), (1.0, 1.0)])
    corners[:, 0] *= HALF - GAP
    corners[[0, 3], 1] = HALF - GAP
    room = Plot(corners, hems=(True, False, True, True))
    tall, short = (np.array([x, -z]) for x, z in (TALL_AT, SHORT_AT))
    middle, between = (tall + short) / 2, short - tall
    seam = np.array([-between[1], between[0]])  # the tall block is on its left
    plots = [
        floor_around(
            room.cut(middle, along), middle=at, half_width=BLOCK, turn_deg=turn, spacing=spacing, hem=2 * GAP
        )
        for along, at, turn in ((seam, TALL_AT, TALL_TURN_DEG), (-seam, SHORT_AT, SHORT_TURN_DEG))
    ]
    return together(plots)


def _wall(normal: np.ndarray, right: np.ndarray, middle: np.ndarray, *, cells: int) -> Part:
    """One inner side of the room, looking along ``normal``; it ends at the open front.

    Elsewhere its last vertices stand GAP before the next wall, and a strip goes on into that wall's thickness: light
    finds no way through, no receiver lies on an edge, and what is dark inside the wall shows for 1.5 mm.
    """
    up = np.cross(normal, right)
    lines = []
    for axis in (right, up):
        low, high = -HALF, HALF
        if abs(axis[2]) > 0.5:  # from the back to the front
            low, high = (-HALF, OUTER) if axis[2] > 0 else (-OUTER, HALF)
        inner = np.linspace(low + GAP, high - GAP, cells + 1)
        if high == OUTER:
            inner = np.append(inner[:-1], OUTER)
        if low == -OUTER:
            inner = np.append(-OUTER, inner[1:])
        before, after = [low - GAP] * (low > -OUTER), [high + GAP] * (high < OUTER)
        lines.append(np.concatenate([before, inner, after]))
    return sheet(middle - HALF * normal, right, up, s=lines[0], t=lines[1])


def _shell(middle: np.ndarray, *, cells: int) -> Part:
    """The outside of the box and the rim around its opening."""
    sides = []
    for normal, right in ((Y, X), (-Y, -X), (-Z, -X), (X, -Z), (-X, Z)):
        up = np.cross(normal, right)
        corner = middle + OUTER * (normal - right - up)
        sides.append(rectangle(corner, 2 * OUTER * right, 2 * OUTER * up, cells=(cells, cells)))
    for right, up in ((X, Y), (Y, -X), (-X, -Y), (-Y, X)):  # each strip to the end on its right
        corner = middle + OUTER * Z - HALF * right - OUTER * up
        sides.append(rectangle(corner, (HALF + OUTER) * right, WALL * up, cells=(2 * cells, 1)))
    return together(sides)

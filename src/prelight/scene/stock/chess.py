"""A still life with chessmen, one of glass, a mirror ball and a coloured wall: for lights that are steered.

In the spirit of the figures of Teo, Simoncelli and Heeger (1997); its shapes and measures are ours.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...arrays import Texture
from ...camera import Camera
from ...errors import InputError
from ...images.tonemap import srgb_encode
from ...material import Material
from ..geometry import Scene
from .chessmen import BISHOP, PAWN, QUEEN, ROOK, ball, turned
from .parts import Part, rectangle, scene_of
from .plinth import slab

# Linear Rec.709.
MAPLE, WALNUT = (0.62, 0.43, 0.245), (0.115, 0.048, 0.022)
BOARD = Material("board", (1.0, 1.0, 1.0), colour_texture=0, roughness=0.42, specular=0.6)
RIM = Material("rim", (0.075, 0.030, 0.014), roughness=0.42, specular=0.6)
IVORY = Material("ivory", (0.74, 0.66, 0.50), roughness=0.32, specular=1.0)
EBONY = Material("ebony", (0.030, 0.024, 0.021), roughness=0.26, specular=1.0)
GLASS = Material("glass", (0.85, 0.85, 0.85), bsdf={"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0})
MIRROR = Material(
    "mirror", (0.85, 0.85, 0.85),
    bsdf={
        "type": "conductor", "material": "none", "specular_reflectance": {"type": "rgb", "value": [0.93, 0.92, 0.90]},
    },
)  # fmt: skip
CLOTH = Material("cloth", (0.40, 0.37, 0.33))
WALL = Material("wall", (0.60, 0.585, 0.55))
RED = Material("red wall", (0.56, 0.105, 0.06))
DIM = Material("dim wall", (0.20, 0.21, 0.23))

SQUARE = 0.07  # metres
HALF = 4 * SQUARE
THICK, FRAME = 0.022, 0.03
GAP = 0.0006  # rays begin 0.3 mm off a surface, and must not begin inside another
TURN_DEG = -24.0  # of the board
BACK, LEFT = -0.56, -0.52  # where the walls are
ROOM, CEILING = 2.3, 1.7

CAMERAS = {
    "front": Camera(eye=(0.40, 0.60, 1.34), target=(-0.01, 0.075, 0.0), vertical_fov_deg=26.5),
    "close": Camera(eye=(0.30, 0.27, 0.72), target=(0.02, 0.085, -0.02), vertical_fov_deg=25.0),
}
SPOT_AT = (0.50, 0.78, 0.46)  # where a spot shows the scene well
PANEL = (
    (-0.45, 0.95, -0.45),
    (1.0, 0.0, 0.0),
    (0.0, 0.0, 1.0),
)  # corner and sides of one overhead, facing down

# What stands on which square (column, row from the front), columns −4 to 3 and rows 0 to 7.
_MEN = (
    (QUEEN, GLASS, -2, 1), (BISHOP, IVORY, -3, 4), (ROOK, IVORY, -3, 6), (PAWN, IVORY, 1, 0), (PAWN, IVORY, -1, 0),
    (PAWN, EBONY, 2, 3), (BISHOP, EBONY, 1, 5), (PAWN, EBONY, -2, 6), (ROOK, EBONY, 3, 6), (PAWN, GLASS, 3, 1),
)  # fmt: skip
_BALL_AT, _BALL_RADIUS = (-0.5, 3.5), 0.062  # where four squares meet


def chess(*, detail: float = 1.0) -> Scene:
    """The chessmen; about 22,000 · detail² vertices. ``detail`` from 0.2 to 4. Raises InputError beyond."""
    if not 0.2 <= detail <= 4:
        raise InputError("detail", f"{detail}, expected 0.2 to 4")
    parts = [*_board(detail), *_men(detail), *_room(detail)]
    name = "steerable" if detail >= 1 else "steerable-small"
    return scene_of(name, parts, cameras=CAMERAS, textures=(_squares(),))


def _men(detail: float) -> list[tuple[Part, Material]]:
    placed = []
    for shape, of, column, row in _MEN:
        part = turned(shape, detail, fine=1.5 if of is GLASS else 1.0)
        placed.append((_on_board(part, column + 0.5, row + 0.5), of))
    column, row = _BALL_AT
    placed.append((_on_board(ball(_BALL_RADIUS, detail), column + 0.5, row + 0.5), MIRROR))
    return placed


def _on_board(part: Part, column: float, row: float) -> Part:
    lowest = part.positions[:, 1].min()
    here = (column * SQUARE, THICK + 2 * GAP - lowest, HALF - row * SQUARE)
    return part.moved(here).turned(TURN_DEG)


def _board(detail: float) -> list[tuple[Part, Material]]:
    """A frame, and the squares on it: a sheet just above, so that the wood's edge is not drawn over the squares."""
    side = HALF + FRAME
    cells = max(4, round(20 * detail))
    frame = slab(half=(side, side), height=THICK, chamfer=0.003, gap=GAP, cells=(cells, cells, 2))
    x, _, z = np.eye(3)
    squares = rectangle(
        np.array([-HALF, THICK + GAP, HALF]), 2 * HALF * x, -2 * HALF * z, cells=(2 * cells, 2 * cells)
    )
    uv = (squares.positions[:, [0, 2]] + HALF) / (2 * HALF)
    return [(frame.turned(TURN_DEG), RIM), (replace(squares, uv=uv).turned(TURN_DEG), BOARD)]


def _room(detail: float) -> list[tuple[Part, Material]]:
    """Table, walls and ceiling, each a little longer than the room: light finds no gap between them."""
    x, y, z = np.eye(3)
    cells = max(6, round(30 * detail)), max(6, round(30 * detail))
    over, few = 0.01, (4, 4)
    corner = np.array([LEFT - over, 0, BACK - over])
    wide, high, deep = (ROOM + 2 * over) * x, (CEILING + 2 * over) * y, (ROOM + 2 * over) * z
    low = corner - over * y
    table = rectangle(corner + deep, wide, -deep, cells=cells)
    back = rectangle(low + over * z, wide, high, cells=cells)
    left = rectangle(low + over * x, high, deep, cells=cells)
    right = rectangle(low + (ROOM + over) * x + deep, high, -deep, cells=few)
    front = rectangle(low + (ROOM + over) * z + wide, -wide, high, cells=few)
    ceiling = rectangle(corner + CEILING * y, wide, deep, cells=few)
    dim = [(part, DIM) for part in (right, front, ceiling)]
    return [(table, CLOTH), (back, WALL), (left, RED), *dim]


def _squares(side: int = 512) -> Texture:
    """Sixty-four squares with some grain, along x in the light ones and along z in the dark."""
    at = (np.arange(side) + 0.5) / side
    v, u = np.meshgrid(at, at, indexing="ij")
    column, row = np.floor(8 * u), np.floor(8 * v)
    dark = (column + row) % 2 == 0
    own = np.modf(np.sin(12.9898 * column + 78.233 * row + 1.0) * 43758.5453)[0]  # of each square
    along = np.where(dark, v, u) * 8 + 3.7 * own
    across = np.where(dark, u, v) * 8 + 5.1 * own
    wander = 0.10 * np.sin(2.1 * along + 9 * own) + 0.04 * np.sin(5.3 * along)
    grain = 0.5 + 0.5 * np.sin(2 * np.pi * (2.6 * (across + wander) + own))
    fine = 0.5 + 0.5 * np.sin(2 * np.pi * (17.0 * (across + 0.3 * wander)) + 3 * np.sin(1.3 * along))
    tone = 1 - 0.20 * grain**2 - 0.08 * fine - 0.10 * np.abs(own)
    linear = np.where(dark[..., None], WALNUT, MAPLE) * tone[..., None]
    return np.rint(srgb_encode(linear) * 255).astype(np.uint8)

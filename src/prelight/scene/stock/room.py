"""A room with one window, for light that bounces: an ochre wall, oak boards, a vase, a stool, a shelf of fruit."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ...arrays import Float64
from ...camera import Camera
from ...errors import InputError
from ...material import Material
from ..geometry import Scene
from .floor_plots import Plot, floor_around
from .parts import Part, scene_of, sheet, together
from .patterns import oak
from .plinth import plinth, slab
from .revolved import Profile
from .still_life import LEMON_SHAPE, ORANGE_SHAPE, VASE

# Linear Rec.709; all Lambertian.
PLASTER = Material("plaster", (0.76, 0.745, 0.71))
OCHRE = Material("ochre wall", (0.62, 0.30, 0.085))
BOARDS = Material("boards", (1.0, 1.0, 1.0), colour_texture=0)
STONE = Material("stone", (0.66, 0.64, 0.60))
TEAL = Material("teal glaze", (0.035, 0.19, 0.205))
CORAL = Material("coral stool", (0.66, 0.135, 0.085))
SHELF = Material("shelf", (0.24, 0.14, 0.075))
ORANGE = Material("orange", (0.74, 0.29, 0.03))
LEMON = Material("lemon", (0.76, 0.57, 0.07))
INDIGO = Material("indigo canvas", (0.045, 0.085, 0.26))
OUTSIDE = Material("outside", (0.5, 0.5, 0.5))

HALF_WIDTH, HALF_DEPTH, HEIGHT = 2.1, 2.4, 2.7  # of the room, metres
WALL = 0.20  # its walls' thickness
WINDOW = ((-1.25, 0.55), (0.80, 2.20))  # z and y of the opening in the left wall
PLINTH_AT, PLINTH_TURN_DEG, PLINTH_HALF, PLINTH_HEIGHT = (0.55, -1.05), 24.0, 0.24, 0.82  # x and z
STOOL_AT, STOOL_TURN_DEG, STOOL_HALF, STOOL_HEIGHT = (-0.70, -0.25), -20.0, 0.25, 0.42
GAP = 0.003  # rays begin 0.8 mm off a surface, and must not begin inside another
PLANK = 1.6  # metres of the floor for a texture
X, Y, Z = np.eye(3)

CAMERAS = {
    "front": Camera(eye=(-0.05, 1.42, 2.30), target=(0.18, 1.12, -2.0), vertical_fov_deg=58.0),
    "close": Camera(eye=(-0.95, 1.45, 0.75), target=(0.75, 0.92, -1.4), vertical_fov_deg=46.0),
}


def room(*, detail: float = 1.0) -> Scene:
    """The room, its shell and what stands in it; about 29,000 · detail² vertices.

    ``detail`` from 0.2 to 4. Raises InputError beyond.
    """
    if not 0.2 <= detail <= 4:
        raise InputError("detail", f"{detail}, expected 0.2 to 4")
    step = 0.069 / detail
    low, high = np.array([-HALF_WIDTH, 0.0, -HALF_DEPTH]), np.array([HALF_WIDTH, HEIGHT, HALF_DEPTH])
    right, left = _wall(low, high, X, step=step), _wall(low, high, -X, step=step)
    back, front = _wall(low, high, -Z, step=step), _wall(low, high, Z, step=step)
    parts = [
        (_floor(step), BOARDS),
        (_wall(low, high, Y, step=1.15 * step), PLASTER),
        (right, OCHRE),
        (together([left, back, front]), PLASTER),
        (_reveal(step), PLASTER),
        *_things(detail),
        (_shell(low - WALL, high + WALL, step=6 * step), OUTSIDE),
    ]
    return scene_of("room" if detail >= 1 else "room-small", parts, cameras=CAMERAS, textures=(oak(),))


def _ticks(
    low: float, high: float, *, step: float, through: tuple[float, ...] = ()
) -> Float64[np.ndarray, "n"]:
    """From ``low`` to ``high`` in steps of about ``step``, some places among them."""
    places = [low, *through, high]
    pieces = [np.linspace(a, b, max(1, round((b - a) / step)), endpoint=False) for a, b in pairwise(places)]
    return np.append(np.concatenate(pieces), high)


def _axes(out: np.ndarray, *, outside: bool) -> tuple[int, int, int]:
    """The axis of a wall, and the two along it in the order in which they turn to the side that is seen."""
    k = int(np.argmax(np.abs(out)))
    first, second = (k + 1) % 3, (k + 2) % 3  # first × second = +k
    return (k, first, second) if (out[k] > 0) == outside else (k, second, first)


def _wall(low: np.ndarray, high: np.ndarray, out: np.ndarray, *, step: float, outside: bool = False) -> Part:
    """The side of a box toward ``out``, seen from within; the left one has the window's opening."""
    k, first, second = _axes(out, outside=outside)
    holes = {2: WINDOW[0], 1: WINDOW[1]} if out[0] < 0 else {}
    s, t = (_ticks(low[a], high[a], step=step, through=holes.get(a, ())) for a in (first, second))
    corner = np.zeros(3)
    corner[k] = high[k] if out[k] > 0 else low[k]
    whole = sheet(corner, np.eye(3)[first], np.eye(3)[second], s=s, t=t)
    return whole if not holes else _opened(whole)


def _opened(wall: Part) -> Part:
    """Without the triangles in the window, and without the vertices that only they use."""
    middle = wall.positions[wall.triangles].mean(axis=1)
    (z0, z1), (y0, y1) = WINDOW
    inside = (middle[:, 2] > z0) & (middle[:, 2] < z1) & (middle[:, 1] > y0) & (middle[:, 1] < y1)
    used, triangles = np.unique(wall.triangles[~inside], return_inverse=True)
    return Part(wall.positions[used], wall.normals[used], triangles.reshape(-1, 3).astype(np.int32))


def _reveal(step: float) -> Part:
    """The four sides of the opening through the wall."""
    (z0, z1), (y0, y1) = WINDOW
    low, high = np.array([-HALF_WIDTH - WALL, y0, z0]), np.array([-HALF_WIDTH, y1, z1])
    sides = []
    for out in (Y, -Y, Z, -Z):
        k, first, second = _axes(out, outside=False)
        s, t = (
            _ticks(low[a], high[a], step=min(step, WALL / 4) if a == 0 else step) for a in (first, second)
        )
        corner = np.zeros(3)
        corner[k] = high[k] if out[k] > 0 else low[k]
        sides.append(sheet(corner, np.eye(3)[first], np.eye(3)[second], s=s, t=t))
    return together(sides)


def _shell(low: np.ndarray, high: np.ndarray, *, step: float) -> Part:
    """The outside, so that no light finds a way into the walls."""
    return together([_wall(low, high, out, step=step, outside=True) for out in (X, -X, Y, -Y, Z, -Z)])


def _floor(step: float) -> Part:
    """In two plots, one around each block, which meet along a line midway between them."""
    corners = np.array([(-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)]) * (HALF_WIDTH, HALF_DEPTH)
    whole = Plot(corners, hems=(False, False, False, False))
    first, second = (np.array([x, -z]) for x, z in (PLINTH_AT, STOOL_AT))
    middle, between = (first + second) / 2, second - first
    seam = np.array([-between[1], between[0]])  # the plinth is on its left
    blocks = (
        (seam, PLINTH_AT, PLINTH_HALF, PLINTH_TURN_DEG),
        (-seam, STOOL_AT, STOOL_HALF, STOOL_TURN_DEG),
    )
    plots = [
        floor_around(
            whole.cut(middle, along), middle=at, half_width=half, turn_deg=turn, spacing=1.35 * step, hem=0.0
        )
        for along, at, half, turn in blocks
    ]
    floor = together(plots)
    return replace(floor, uv=floor.positions[:, [2, 0]] / PLANK)


def _things(detail: float) -> list[tuple[Part, Material]]:
    cells = max(3, round(11 * detail))
    stone = plinth(
        half_width=PLINTH_HALF,
        height=PLINTH_HEIGHT,
        chamfer=0.006,
        gap=GAP,
        cells=(cells, round(1.7 * cells)),
    )
    stool = plinth(half_width=STOOL_HALF, height=STOOL_HEIGHT, chamfer=0.012, gap=GAP, cells=(cells, cells))
    vase = VASE.part(along=max(12, round(60 * detail)), around=2 * max(5, round(26 * detail))).scaled(1.5)
    x, z = PLINTH_AT
    long = max(8, round(30 * detail)), max(3, round(6 * detail)), 1
    shelf = slab(half=(0.62, 0.11), height=0.035, chamfer=0.003, gap=0.0, cells=long)
    canvas = slab(
        half=(0.52, 0.37), height=0.03, chamfer=0.003, gap=0.0, cells=(round(1.5 * cells), cells, 1)
    )
    canvas = replace(canvas, positions=canvas.positions[:, [1, 0, 2]] * (-1, 1, 1))  # on the right wall
    canvas = replace(canvas, normals=canvas.normals[:, [1, 0, 2]] * (-1, 1, 1))
    at_shelf = -0.95, 1.26, -HALF_DEPTH + GAP + 0.11
    return [
        (stone.turned(PLINTH_TURN_DEG).moved((x, 0.0, z)), STONE),
        (vase.moved((x, PLINTH_HEIGHT + GAP - vase.positions[:, 1].min(), z)), TEAL),
        (stool.turned(STOOL_TURN_DEG).moved((STOOL_AT[0], 0.0, STOOL_AT[1])), CORAL),
        (shelf.moved(at_shelf), SHELF),
        (canvas.moved((HALF_WIDTH - GAP, 1.55, -0.55)), INDIGO),
        *(
            (_set_down(shape, detail, (at_shelf[0] + dx, at_shelf[1] + 0.035, at_shelf[2]), tip=tip), of)
            for shape, dx, tip, of in (
                (ORANGE_SHAPE, -0.34, 25.0, ORANGE),
                (LEMON_SHAPE, -0.12, 80.0, LEMON),
                (ORANGE_SHAPE, 0.30, -40.0, ORANGE),
            )
        ),
    ]


def _set_down(shape: Profile, detail: float, at: tuple[float, float, float], *, tip: float) -> Part:
    """A fruit, larger than life, its lowest point GAP above ``at``."""
    part = shape.part(along=max(6, round(20 * detail)), around=2 * max(4, round(12 * detail)))
    part = part.scaled(1.9).tipped(tip)
    return part.moved((at[0], at[1] + GAP - part.positions[:, 1].min(), at[2]))

"""A chapel to be lit through its windows: a nave under a barrel vault, arcades, aisles, clear and stained glass."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ...camera import Camera
from ...errors import InputError
from ...material import Material
from ..geometry import Scene
from .boxes import box
from .masonry import paving
from .openings import Opening, Wall, arch_steps, drawn, of_grid, ticks
from .parts import Part, scene_of, together
from .plinth import slab
from .revolved import Profile

# Linear Rec.709; all but the glass Lambertian.
LIMEWASH = Material("limewash", (0.80, 0.77, 0.70))
VAULT = Material("vault", (0.80, 0.785, 0.74))
STONE = Material("stone", (0.63, 0.56, 0.46))
FLOOR = Material("paving", (1.0, 1.0, 1.0), colour_texture=0)
OAK = Material("oak", (0.30, 0.165, 0.075))
DOOR = Material("door", (0.20, 0.105, 0.05))
OUTSIDE = Material("outside", (0.55, 0.52, 0.47))


def _glass(name: str, colour: tuple[float, float, float]) -> Material:
    return Material(f"{name} glass", colour, roughness=0.0, specular=1.0, ior=1.5, transmission=1.0)


CLEAR = _glass("clear", (0.96, 0.97, 0.96))
STAINED = {
    "red": _glass("red", (0.80, 0.05, 0.045)),
    "blue": _glass("blue", (0.045, 0.12, 0.78)),
    "amber": _glass("amber", (0.95, 0.60, 0.08)),
    "green": _glass("green", (0.07, 0.52, 0.16)),
}

NAVE, ARCADE, AISLE, WALL = (
    2.2,
    0.38,
    4.2,
    0.5,
)  # half the nave, an arcade's thickness, half of all, the walls'
BAYS, BAY = 5, 3.0
HALF_LENGTH = BAYS * BAY / 2
SPRING, VAULT_SPRING, CEILING = 2.5, 4.6, 4.2  # of the arcades, the vault; the aisles' ceilings
TOP, BOTTOM = 7.15, -0.2  # of the outside
GAP = 0.003
TILE = 2.4  # metres of the floor for a texture
X, Y, Z = np.eye(3)

ARCH = Opening(0.0, 1.2, SPRING, SPRING)
WINDOW = Opening(0.0, 0.5, 1.25, 2.65)
ROSE = Opening(0.0, 0.85, 4.85, 4.85, "circle")
LANCETS = (
    Opening(-1.15, 0.34, 1.5, 3.05, "pointed"),
    Opening(0.0, 0.40, 1.5, 3.65, "pointed"),
    Opening(1.15, 0.34, 1.5, 3.05, "pointed"),
)
COLUMN = Profile((
    (0.0, 0.0), (0.30, 0.0), (0.31, 0.0), (0.315, 0.07), (0.30, 0.12), (0.235, 0.17), (0.215, 0.28), (0.21, 0.6),
    (0.20, 1.3), (0.19, 2.0), (0.20, 2.12), (0.21, 2.16), (0.20, 2.2), (0.26, 2.34), (0.31, 2.44), (0.315, 2.5),
    (0.315, 2.5), (0.0, 2.5),
))  # fmt: skip

CAMERAS = {
    "front": Camera(eye=(-0.62, 1.72, 7.0), target=(0.25, 2.2, -4.0), vertical_fov_deg=62.0),
    "close": Camera(eye=(0.7, 1.6, -1.2), target=(-0.15, 2.35, -7.5), vertical_fov_deg=52.0),
}


def chapel(*, detail: float = 1.0, glass: bool = True) -> Scene:
    """The chapel with its shell; about 52,000 · detail² vertices. The altar is at −Z, most windows look to ±X.

    ``glass``: with the panes, each colour a material of its own; without them the windows are open. ``detail`` from
    0.2 to 4. Raises InputError beyond.
    """
    if not 0.2 <= detail <= 4:
        raise InputError("detail", f"{detail}, expected 0.2 to 4")
    step = 0.27 / detail
    panes: list[tuple[Part, Material]] = []
    parts = [
        (_paved(0.40 * step), FLOOR),
        (together([_side(sign, step) for sign in (-1.0, 1.0)]), LIMEWASH),
        (together([_altar_wall(step), _rose_wall(step)]), LIMEWASH),
        (together([_aisle_ceiling(sign, step) for sign in (-1.0, 1.0)]), LIMEWASH),
        (together([_arcade(sign, step) for sign in (-1.0, 1.0)]), LIMEWASH),
        (_vault(step), VAULT),
        (_ribs(step), STONE),
        (_columns(detail), STONE),
        (together([_reveals(step)]), STONE),
        *_furniture(detail),
        (_shell(5 * step), OUTSIDE),
    ]
    if glass:
        panes = _panes()
    small = "" if detail >= 1 else "-small"
    name = ("portals" if glass else "chapel-open") + small
    return scene_of(name, [*parts, *panes], cameras=CAMERAS, textures=(paving(),))


def _inner_side(sign: float) -> Wall:
    """The aisle's wall at sign · AISLE, seen from within; s runs from one end of the chapel to the other."""
    return Wall((sign * AISLE, 0.0, -sign * HALF_LENGTH), (0.0, 0.0, sign))


def _outer_side(sign: float) -> Wall:
    return Wall((sign * (AISLE + WALL), 0.0, sign * HALF_LENGTH), (0.0, 0.0, -sign))


def _middles() -> list[float]:
    """Of the bays, along a side."""
    return [BAY * (k + 0.5) for k in range(BAYS)]


def _side(sign: float, step: float) -> Part:
    wall = _inner_side(sign)
    bays = [
        replace(WINDOW, middle=m).around(wall, (m - BAY / 2, m + BAY / 2), (0.0, CEILING), step=step)
        for m in _middles()
    ]
    return together(bays)


def _end(sign: float, depth: float = 0.0) -> Wall:
    """The end wall at sign · HALF_LENGTH, seen from within, s = 0 in the middle; ``depth``: its outside."""
    if depth:
        return Wall((0.0, 0.0, sign * (HALF_LENGTH + depth)), (sign, 0.0, 0.0))
    return Wall((0.0, 0.0, sign * HALF_LENGTH), (-sign, 0.0, 0.0))


def _opened_end(
    wall: Wall, openings: tuple[Opening, ...], height: tuple[float, float], *, half: float, step: float
) -> Part:
    """A wall with openings side by side, each in a strip of its own."""
    margin = 0.58
    edges = [openings[0].middle - openings[0].half_width - margin]
    edges += [0.5 * (a.middle + b.middle) for a, b in pairwise(openings)]
    edges.append(openings[-1].middle + openings[-1].half_width + margin)
    y = ticks(*height, step=step)
    parts = [
        wall.rectangle(ticks(-half, edges[0], step=step), y),
        wall.rectangle(ticks(edges[-1], half, step=step), y),
    ]
    for opening, low, high in zip(openings, edges, edges[1:], strict=False):
        parts.append(opening.around(wall, (low, high), height, step=step))
    return together(parts)


def _altar_wall(step: float) -> Part:
    return _opened_end(_end(-1.0), LANCETS, (0.0, VAULT_SPRING + NAVE + 0.1), half=AISLE, step=step)


def _rose_wall(step: float) -> Part:
    return _opened_end(_end(1.0), (ROSE,), (0.0, VAULT_SPRING + NAVE + 0.1), half=AISLE, step=step)


def _aisle_ceiling(sign: float, step: float) -> Part:
    low, high = sorted((sign * (NAVE + ARCADE), sign * AISLE))
    s, z = ticks(low, high, step=step), ticks(-HALF_LENGTH, HALF_LENGTH, step=step)
    return _level(s, z, CEILING, -Y)


def _level(x: np.ndarray, z: np.ndarray, y: float, normal: np.ndarray) -> Part:
    """A flat part at one height."""
    grid = np.stack(np.broadcast_arrays(x[None, :], y, z[:, None]), axis=-1)
    return of_grid(grid, np.broadcast_to(normal, grid.shape))


def _paved(step: float) -> Part:
    s, z = ticks(-AISLE, AISLE, step=step), ticks(-HALF_LENGTH, HALF_LENGTH, step=step)
    floor = _level(s, z, 0.0, Y)
    return replace(floor, uv=floor.positions[:, [0, 2]] / TILE)


def _arcade(sign: float, step: float) -> Part:
    """Round arches from column to column: the face to the nave, that to the aisle, and what is seen from below."""
    to_nave = Wall((sign * NAVE, 0.0, -sign * HALF_LENGTH), (0.0, 0.0, sign))
    to_aisle = Wall((sign * (NAVE + ARCADE), 0.0, sign * HALF_LENGTH), (0.0, 0.0, -sign))
    parts, rows = [], max(2, round(ARCADE / step))
    for m in _middles():
        arch, span = replace(ARCH, middle=m), (m - BAY / 2, m + BAY / 2)
        parts.append(arch.around(to_nave, span, (SPRING, VAULT_SPRING), step=step))
        parts.append(arch.around(to_aisle, span, (SPRING, CEILING), step=step))
        s = arch.across(arch_steps(arch, step))
        line = np.stack([s, arch.high(s)], axis=1)[::-1]
        parts.append(drawn(to_nave, line, depth=ARCADE, rows=rows))
        for low, high in ((span[0], s[0]), (s[-1], span[1])):
            foot = ticks(low, high, step=step)[::-1]
            parts.append(
                drawn(to_nave, np.stack([foot, np.full_like(foot, SPRING)], axis=1), depth=ARCADE, rows=rows)
            )
    return together(parts)


def _tunnel(radius: float, z: np.ndarray, *, around: int) -> Part:
    """Half a tube along z, seen from within."""
    theta = np.linspace(0.0, np.pi, around + 1)
    circle = np.stack([np.cos(theta), np.sin(theta), np.zeros_like(theta)], axis=-1)
    middle = np.array([0.0, VAULT_SPRING, 0.0])
    grid = middle + radius * circle[None] + z[:, None, None] * Z
    return of_grid(grid, np.broadcast_to(-circle, grid.shape))


def _vault(step: float) -> Part:
    around = 2 * max(6, round(np.pi * NAVE / step / 2))
    return _tunnel(NAVE, ticks(-HALF_LENGTH, HALF_LENGTH, step=step), around=around)


def _ribs(step: float) -> Part:
    """Arches that cross the vault above the columns."""
    around, half, deep = 2 * max(6, round(np.pi * NAVE / step / 2)), 0.16, 0.11
    theta = np.linspace(0.0, np.pi, around + 1)
    circle = np.stack([np.cos(theta), np.sin(theta), np.zeros_like(theta)], axis=-1)
    parts = []
    for k in range(1, BAYS):
        z = k * BAY - HALF_LENGTH
        parts.append(_tunnel(NAVE - deep, np.array([z - half, z + half]), around=around))
        for side in (-1.0, 1.0):
            rings = np.stack([r * circle for r in (NAVE - deep, NAVE)])
            grid = rings + np.array([0.0, VAULT_SPRING, z + side * half])
            parts.append(of_grid(grid, np.broadcast_to(side * Z, grid.shape)))
        for sign in (-1.0, 1.0):  # their feet
            low, high = sorted((sign * NAVE, sign * (NAVE - deep)))
            parts.append(_level(np.array([low, high]), np.array([z - half, z + half]), VAULT_SPRING, -Y))
    return together(parts)


def _columns(detail: float) -> Part:
    body = COLUMN.part(along=max(14, round(34 * detail)), around=2 * max(4, round(11 * detail)))
    body = replace(body, positions=body.positions * (1.0, 1.0 - 2 * GAP / SPRING, 1.0) + GAP * Y)
    places = [
        (sign * (NAVE + ARCADE / 2), 0.0, k * BAY - HALF_LENGTH)
        for sign in (-1.0, 1.0)
        for k in range(1, BAYS)
    ]
    return together([body.moved(place) for place in places])


def _reveals(step: float) -> Part:
    parts = [
        replace(WINDOW, middle=m).reveal(_inner_side(sign), depth=WALL, step=step)
        for sign in (-1.0, 1.0)
        for m in _middles()
    ]
    parts += [lancet.reveal(_end(-1.0), depth=WALL, step=step) for lancet in LANCETS]
    return together([*parts, ROSE.reveal(_end(1.0), depth=WALL, step=step)])


def _shell(step: float) -> Part:
    """The outside, with the same openings, so that no light finds a way into the walls."""
    half, ends = AISLE + WALL, HALF_LENGTH + WALL
    low, high = BOTTOM, TOP
    parts = []
    for sign in (-1.0, 1.0):
        wall = _outer_side(sign)
        for m in _middles():
            window = replace(WINDOW, middle=m)
            parts.append(window.around(wall, (m - BAY / 2, m + BAY / 2), (low, high), step=step))
        length = 2 * HALF_LENGTH
        y = ticks(low, high, step=step)
        parts += [
            wall.rectangle(np.array([-WALL, 0.0]), y),
            wall.rectangle(np.array([length, length + WALL]), y),
        ]
    mirrored = tuple(replace(lancet, middle=-lancet.middle) for lancet in reversed(LANCETS))
    parts.append(_opened_end(_end(-1.0, WALL), mirrored, (low, high), half=half, step=step))
    parts.append(_opened_end(_end(1.0, WALL), (ROSE,), (low, high), half=half, step=step))
    s, z = ticks(-half, half, step=step), ticks(-ends, ends, step=step)
    return together([*parts, _level(s, z, high, Y), _level(s, z, low, -Y)])


def _panes() -> list[tuple[Part, Material]]:
    """Flat sheets in the middle of the walls' thickness, none sharing a vertex with another colour."""
    found: dict[str, list[Part]] = {}

    def put(name: str, part: Part) -> None:
        found.setdefault(name, []).append(part)

    for sign in (-1.0, 1.0):
        for k, m in enumerate(_middles()):
            window, wall = replace(WINDOW, middle=m), _inner_side(sign)
            if sign > 0 and k % 2:
                _stain(put, window.pane(wall, depth=WALL / 2, cells=(9, 4)), wall, _leaded)
            else:
                put("clear", _sheet(window.pane(wall, depth=WALL / 2, cells=(1, 12)), wall))
    for lancet in LANCETS:
        _stain(put, lancet.pane(_end(-1.0), depth=WALL / 2, cells=(15, 6)), _end(-1.0), _lancet)
    wall = _end(1.0)
    for r, (inner, outer) in enumerate(((0.0, 0.26), (0.26, 0.58), (0.58, ROSE.half_width))):
        for k in range(12):
            turn = 2 * np.pi * (k + np.linspace(0.0, 1.0, 4)) / 12
            rings = [
                np.stack([q * np.cos(turn), ROSE.spring + q * np.sin(turn)], axis=1) for q in (inner, outer)
            ]
            put(_rose(r, k), _sheet(wall.at(np.stack(rings), WALL / 2), wall))
    glass = {"clear": CLEAR} | STAINED
    return [(together(parts), glass[name]) for name, parts in found.items()]


def _sheet(grid: np.ndarray, wall: Wall) -> Part:
    return of_grid(grid, np.broadcast_to(wall.normal, grid.shape))


def _stain(put, grid: np.ndarray, wall: Wall, colour) -> None:
    """Each cell of a grid in its colour."""
    rows, columns = grid.shape[0] - 1, grid.shape[1] - 1
    for i in range(rows):
        for j in range(columns):
            put(colour(i / (rows - 1), j, columns, i), _sheet(grid[i : i + 2, j : j + 2], wall))


def _leaded(share: float, j: int, columns: int, i: int) -> str:
    """A window of the aisle: amber between blue edges, a red band."""
    if j in (0, columns - 1):
        return "blue" if i % 2 else "green"
    return "red" if 0.35 < share < 0.65 else "amber"


def _lancet(share: float, j: int, columns: int, i: int) -> str:
    """Behind the altar: a blue ground, a climbing figure of red and amber."""
    if j in (0, columns - 1):
        return "red" if i % 3 == 0 else "blue"
    off = abs(j - (columns - 1) / 2)
    wave = (i + 2 * int(off)) % 5
    return ("amber", "red", "blue", "blue", "green")[wave] if off < 2 else "blue"


def _rose(ring: int, k: int) -> str:
    return (("amber",), ("red", "blue"), ("blue", "amber", "blue", "green"))[ring][k % (1, 2, 4)[ring]]


def _furniture(detail: float) -> list[tuple[Part, Material]]:
    n, fine = max(2, round(7 * detail)), 0.21 / detail
    pew = together([
        box((-0.75, 0.42, -0.21), (0.75, 0.465, 0.21), step=fine),
        box((-0.75, 0.46, 0.217), (0.75, 0.93, 0.253), step=fine),
        *(box((x - 0.028, GAP, -0.23), (x + 0.028, 0.90, 0.29), step=fine) for x in (-0.78, 0.78)),
    ])  # fmt: skip
    pews = [pew.moved((sign * 1.16, 0.0, z)) for sign in (-1, 1) for z in np.arange(-1.6, 5.4, 1.12)]
    dais = slab(half=(1.95, 1.35), height=0.16, chamfer=0.01, gap=GAP, cells=(5 * n, 4 * n, 1))
    altar = slab(half=(0.85, 0.36), height=0.98, chamfer=0.012, gap=GAP, cells=(3 * n, n, 2 * n))
    door = slab(half=(0.75, 0.03), height=2.35, chamfer=0.006, gap=GAP, cells=(2 * n, 1, 4 * n))
    return [
        (together(pews), OAK),
        (together([dais.moved((0, 0, -6.0)), altar.moved((0, 0.16, -6.35))]), STONE),
        (door.moved((0, 0, HALF_LENGTH - 0.036)), DOOR),
    ]

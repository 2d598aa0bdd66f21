"""A small town to look out at: streets, houses with gables, a church, trees, lamps.

The ground is y = 0; streets run along x and z. Right of the middle of a street is where one drives.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...camera import Camera
from ...errors import InputError
from ...material import Material
from ..geometry import Scene
from ..normals import vertex_normals
from .boxes import box, wheel
from .openings import of_grid
from .parts import Part, scene_of, together
from .revolved import Profile

# Linear Rec.709.
GRASS = Material("grass", (0.085, 0.15, 0.035))
ASPHALT = Material("asphalt", (0.085, 0.085, 0.09))
PAVEMENT = Material("pavement", (0.36, 0.34, 0.31))
LINE = Material("line", (0.72, 0.72, 0.70))
WALLS = tuple(
    Material(f"plaster {k}", colour)
    for k, colour in enumerate((
        (0.74, 0.66, 0.50), (0.70, 0.40, 0.24), (0.76, 0.74, 0.70), (0.42, 0.50, 0.55), (0.66, 0.52, 0.24),
        (0.56, 0.22, 0.16),
    ))
)  # fmt: skip
ROOFS = (Material("tiles", (0.42, 0.13, 0.065)), Material("slate", (0.10, 0.105, 0.12)))
PANES = Material("panes", (0.035, 0.045, 0.06))
WOOD = Material("wood", (0.12, 0.065, 0.03))
LEAVES = tuple(
    Material(f"leaves {k}", colour)
    for k, colour in enumerate(((0.075, 0.15, 0.03), (0.11, 0.18, 0.035), (0.05, 0.11, 0.035)))
)
IRON = Material("iron", (0.04, 0.045, 0.045))
STONE = Material("church", (0.62, 0.57, 0.48))

PITCH, HALF_ROAD, KERB = 40.0, 3.5, 1.8  # between the middles of streets; metres
STREETS = (-60.0, -20.0, 20.0, 60.0)
EDGE = 78.0
_SEED = 5
CROWN = Profile((
    (0.0, 0.0), (0.5, -0.02), (0.9, 0.25), (1.02, 0.75), (0.85, 1.35), (0.62, 1.85), (0.35, 2.25), (0.0, 2.4),
))  # fmt: skip

CAMERAS = {
    "front": Camera(eye=(21.8, 1.6, 57.0), target=(19.5, 3.2, -10.0), vertical_fov_deg=50.0),
    "close": Camera(eye=(96.0, 78.0, 118.0), target=(0.0, 0.0, 4.0), vertical_fov_deg=36.0),
}


def town(*, trees: int = 150, detail: float = 1.0) -> Scene:
    """The town; about 50,000 triangles, and with a ``detail`` of 4 some 700,000: its trees have more leaves then.

    Raises InputError unless trees are 0 to 5,000 and detail is 0.3 to 8.
    """
    if not 0 <= trees <= 5_000:
        raise InputError("trees", f"{trees}, expected 0 to 5000")
    if not 0.3 <= detail <= 8:
        raise InputError("detail", f"{detail}, expected 0.3 to 8")
    rng = np.random.default_rng(_SEED)
    found: dict[str, tuple[Material, list[Part]]] = {}

    def put(part: Part, material: Material) -> None:
        found.setdefault(material.name, (material, []))[1].append(part)

    _streets(put)
    blocks = [0.5 * (a + b) for a, b in pairwise(STREETS)]
    for x in blocks:
        for z in blocks:
            if x == z == 0.0:
                _church(put)
            else:
                _houses(put, rng, (x, z))
    _lamps(put)
    _trees(put, rng, trees, detail)
    parts = [(together(pieces), material) for material, pieces in found.values()]
    return scene_of("town", parts, cameras=CAMERAS)


def _flat(low: tuple[float, float], high: tuple[float, float], y: float) -> Part:
    x, z = (np.linspace(a, b, max(2, 1 + round((b - a) / 8.0))) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.broadcast_arrays(x[None, :], y, z[:, None]), axis=-1)
    return of_grid(grid, np.broadcast_to((0.0, 1.0, 0.0), grid.shape))


def _streets(put) -> None:
    put(_flat((-260.0, -260.0), (260.0, 260.0), -0.03), GRASS)
    for at in STREETS:
        put(_flat((at - HALF_ROAD, -EDGE), (at + HALF_ROAD, EDGE), 0.0), ASPHALT)
        put(_flat((-EDGE, at - HALF_ROAD), (EDGE, at + HALF_ROAD), 0.002), ASPHALT)
        for along in np.arange(-EDGE + 2, EDGE - 2, 6.0):
            if min(abs(along + 1.5 - other) for other in STREETS) > HALF_ROAD + 2:
                put(_flat((at - 0.07, along), (at + 0.07, along + 3.0), 0.006), LINE)
                put(_flat((along, at - 0.07), (along + 3.0, at + 0.07), 0.006), LINE)
    half = PITCH / 2 - HALF_ROAD
    for a, b in pairwise(STREETS):
        for c, d in pairwise(STREETS):
            x, z = 0.5 * (a + b), 0.5 * (c + d)
            for low, high in (
                ((-half, -half), (half, KERB - half)), ((-half, half - KERB), (half, half)),
                ((-half, KERB - half), (KERB - half, half - KERB)), ((half - KERB, KERB - half), (half, half - KERB)),
            ):  # fmt: skip
                put(box((x + low[0], -0.05, z + low[1]), (x + high[0], 0.12, z + high[1])), PAVEMENT)


def _houses(put, rng: np.random.Generator, middle: tuple[float, float]) -> None:
    """Along the four sides of a block, their fronts to the pavement."""
    reach = PITCH / 2 - HALF_ROAD - KERB
    for turn in range(4):
        at = -reach
        while at < reach - 9.0:
            width, deep = rng.uniform(6.5, 9.0), rng.uniform(6.5, 8.0)
            floors = int(rng.integers(2, 4))
            wall, roof = WALLS[rng.integers(len(WALLS))], ROOFS[int(rng.uniform() < 0.3)]
            house = _house(width, deep, floors)
            for part, material in zip(house, (wall, roof, PANES, WOOD), strict=True):
                placed = part.moved((at + width / 2, 0.0, reach - deep / 2 - rng.uniform(0.2, 0.21)))
                put(placed.turned(90.0 * turn).moved((middle[0], 0.0, middle[1])), material)
            at += width + rng.uniform(0.6, 4.0)


def _house(width: float, deep: float, floors: int) -> tuple[Part, Part, Part, Part]:
    """Walls, roof, panes and door of a house over the origin, its front toward +Z."""
    tall, rise, w, d = 2.9 * floors + 0.3, 0.55 * deep / 2 + 0.6, width / 2, deep / 2
    body = box((-w, -0.1, -d), (w, tall, d))
    gables, slopes = [], []
    for sign in (-1.0, 1.0):
        corners = np.array([[(sign * w, tall, -d), (sign * w, tall, d)], [(sign * w, tall + rise, 0.0)] * 2])
        gables.append(of_grid(corners, np.broadcast_to((sign, 0.0, 0.0), corners.shape)))
        over, eave = 0.35, 0.35 * rise / d
        edge = np.array([
            [(-w - over, tall - eave, sign * (d + over)), (w + over, tall - eave, sign * (d + over))],
            [(-w - over, tall + rise, 0.0), (w + over, tall + rise, 0.0)],
        ])  # fmt: skip
        normal = np.array([0.0, d, sign * rise]) / np.hypot(d, rise)
        slopes.append(of_grid(edge, np.broadcast_to(normal, edge.shape)))
    chimney = box((w - 1.5, tall, -0.9), (w - 0.9, tall + rise + 0.9, -0.3))
    panes = []
    count = max(2, round(width / 2.6))
    for floor in range(floors):
        for k in range(count):
            x, y = width * ((k + 0.5) / count - 0.5), 2.9 * floor + 1.0
            if floor or k:
                panes.append(box((x - 0.5, y, d - 0.05), (x + 0.5, y + 1.35, d + 0.03)))
            panes.append(box((x - 0.5, y, -d - 0.03), (x + 0.5, y + 1.35, 0.05 - d)))
    x = width * (0.5 / count - 0.5)
    door = box((x - 0.55, 0.0, d - 0.05), (x + 0.55, 2.2, d + 0.04))
    return together([body, *gables, chimney]), together(slopes), together(panes), door


def _church(put) -> None:
    put(box((-5.0, -0.1, -13.0), (5.0, 8.5, 8.0)), STONE)
    put(box((-3.0, -0.1, 7.0), (3.0, 19.0, 13.0)), STONE)
    for sign in (-1.0, 1.0):
        edge = np.array([
            [(sign * 5.4, 8.3, -13.3), (sign * 5.4, 8.3, 8.0)], [(0.0, 13.5, -13.3), (0.0, 13.5, 8.0)],
        ])  # fmt: skip
        normal = np.array([sign * 5.2, 5.4, 0.0]) / np.hypot(5.2, 5.4)
        put(of_grid(edge, np.broadcast_to(normal, edge.shape)), ROOFS[1])
    gable = np.array([[(-5.0, 8.5, -13.0), (5.0, 8.5, -13.0)], [(0.0, 13.3, -13.0)] * 2])
    put(of_grid(gable, np.broadcast_to((0.0, 0.0, -1.0), gable.shape)), STONE)
    corners = np.array([(-3.2, -3.2), (3.2, -3.2), (3.2, 3.2), (-3.2, 3.2)])
    for k in range(4):
        (a, b), (c, d) = corners[k], corners[(k + 1) % 4]
        side = np.array([[(a, 19.0, 10 + b), (c, 19.0, 10 + d)], [(0.0, 28.0, 10.0)] * 2])
        normal = np.array([a + c, 2.3, b + d])
        put(of_grid(side, np.broadcast_to(normal / np.linalg.norm(normal), side.shape)), ROOFS[1])
    for sign in (-1.0, 1.0):
        for z in (-10.0, -6.5, -3.0, 0.5, 4.0):
            put(box((sign * 5.0 - 0.04, 2.4, z - 0.5), (sign * 5.0 + 0.04, 6.4, z + 0.5)), PANES)
    put(box((-1.1, 0.0, 12.9), (1.1, 3.4, 13.06)), WOOD)


def _lamps(put) -> None:
    post = wheel(0.06, 4.6, around=6)
    positions = post.positions[:, [1, 0, 2]] * (1, 1, 1) + (0.0, 2.3, 0.0)
    upright = Part(positions, post.normals[:, [1, 0, 2]], post.triangles[:, [0, 2, 1]])
    for street in STREETS:
        for along in np.arange(-50.0, 60.0, 20.0):
            for side in (-1.0, 1.0):
                x, z = street + side * (HALF_ROAD + 0.5), along + 10.0 * (side > 0)
                put(upright.moved((x, 0.0, z)), IRON)
                put(box((x - 0.16, 4.55, z - 0.16), (x + 0.16, 4.95, z + 0.16)), IRON)


def _trees(put, rng: np.random.Generator, count: int, detail: float) -> None:
    crowns = [
        CROWN.part(along=max(5, round(7 * detail)), around=2 * max(3, round(5 * detail))) for _ in LEAVES
    ]
    for k in range(count):
        x, z = _free_place(rng, k)
        size, tall = rng.uniform(1.5, 2.6), rng.uniform(1.6, 2.6)
        kind = int(rng.integers(len(LEAVES)))
        lump = rng.uniform(-0.08, 0.08, (len(crowns[kind].positions), 1))
        crown = crowns[kind]
        positions = crown.positions * (1.0 + lump) * size
        normals = vertex_normals(positions.astype(np.float32), crown.triangles).astype(np.float64)
        ragged = Part(positions, normals, crown.triangles)
        put(ragged.turned(rng.uniform(0.0, 360.0)).moved((x, tall, z)), LEAVES[kind])
        trunk = box((x - 0.13, -0.1, z - 0.13), (x + 0.13, tall + 0.3, z + 0.13))
        put(trunk, WOOD)


def _free_place(rng: np.random.Generator, k: int) -> tuple[float, float]:
    """In a garden, around the church, or beyond the last street."""
    if k % 3 == 0:  # outside, in a ring
        turn, far = rng.uniform(0.0, 2 * np.pi), rng.uniform(90.0, 150.0)
        return far * np.cos(turn), far * np.sin(turn)
    x, z = rng.choice([-40.0, 0.0, 40.0], 2)
    if x == z == 0.0:
        side = rng.choice([-1.0, 1.0])
        return side * rng.uniform(8.5, 12.5), rng.uniform(-13.0, 13.0)
    return x + rng.uniform(-4.0, 4.0), z + rng.uniform(-4.0, 4.0)

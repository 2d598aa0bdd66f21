"""A maze without a roof, for lamps that are moved through it: light finds its way around many corners."""

from __future__ import annotations

import numpy as np

from ...camera import Camera
from ...errors import InputError
from ...material import Material
from ..geometry import Scene
from .blocks import block_faces
from .parts import scene_of

# Linear Rec.709; all Lambertian.
CHALK = Material("chalk", (0.74, 0.72, 0.68))
TERRACOTTA = Material("terracotta", (0.62, 0.26, 0.13))
SLATE = Material("blue slate", (0.13, 0.25, 0.46))
SAND = Material("sand floor", (0.60, 0.53, 0.41))

CORRIDOR, WALL, HEIGHT = 0.50, 0.10, 0.45  # metres
CELLS = 7
_SEED = 3
_LOOPS = 2  # walls taken out of the tree, so that there are ways round

CAMERAS = {
    "front": Camera(eye=(2.2, 5.6, 6.0), target=(2.15, 0.0, 2.32), vertical_fov_deg=38.0),
    "close": Camera(eye=(0.35, 0.33, 3.35), target=(0.35, 0.22, 1.2), vertical_fov_deg=62.0),
}


def maze_plan(cells: int = CELLS, *, seed: int = _SEED) -> np.ndarray:
    """(2n + 1, 2n + 1) bool: where walls stand. A spanning tree of n × n cells, and a few ways more."""
    chance = np.random.default_rng(seed)
    wall = np.ones((2 * cells + 1, 2 * cells + 1), bool)
    way = [(0, 0)]
    wall[1, 1] = False
    while way:
        x, z = way[-1]
        open_to = [
            (x + dx, z + dz)
            for dx, dz in ((1, 0), (-1, 0), (0, 1), (0, -1))
            if 0 <= x + dx < cells and 0 <= z + dz < cells and wall[2 * (x + dx) + 1, 2 * (z + dz) + 1]
        ]
        if not open_to:
            way.pop()
            continue
        u, v = open_to[chance.integers(len(open_to))]
        wall[2 * u + 1, 2 * v + 1] = wall[x + u + 1, z + v + 1] = False
        way.append((u, v))
    inner = [(i, j) for i in range(1, 2 * cells) for j in range(1, 2 * cells) if (i + j) % 2 and wall[i, j]]
    for k in chance.permutation(len(inner))[:_LOOPS]:
        wall[inner[k]] = False
    return wall


def maze(*, detail: float = 1.0) -> Scene:
    """The maze on its floor; about 28,000 vertices at 1.

    ``detail`` from 0.2 to 4. Raises InputError beyond.
    """
    if not 0.2 <= detail <= 4:
        raise InputError("detail", f"{detail}, expected 0.2 to 4")
    plan = maze_plan()
    widths = np.where(np.arange(len(plan)) % 2, CORRIDOR, WALL)
    across = np.concatenate([[0.0], np.cumsum(widths)])
    # Two storeys: the floor's slab below, walls above it.
    solid = np.stack([np.ones_like(plan), plan], axis=1)
    lines = (across, np.array([-WALL, 0.0, HEIGHT]), across)

    def paint(axis: int, side: int, cell: tuple[int, int, int]) -> Material:
        x, y, z = cell
        if y == 0:
            return SAND
        if axis == 1:
            return CHALK
        if x + (axis == 0) * side < 4 and z > 7:
            return TERRACOTTA
        return SLATE if x > 8 and z < 6 else CHALK

    parts = block_faces(solid, lines, step=0.063 / detail, paint=paint)
    return scene_of("maze" if detail >= 1 else "maze-small", parts, cameras=CAMERAS)

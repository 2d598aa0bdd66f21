"""The paper's box with a bunny, its windows of two sizes, and the cathedral."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from prelight.camera import Camera
from prelight.material import Material
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene

BUNNY = (
    "bun_zipper_res2.ply"  # 16,301 triangles: with all 69,451 the paper's 69,410 would leave none for walls
)
SIDE = 3.0  # metres, of the box
GLASS = 1  # its material of the pane
LARGE, SMALL = 1.5, 0.375  # sides of its window: a sixteenth of the area
HERE = Path(__file__).parent
EYE = Camera(eye=(2.85, 1.6, 2.2), target=(0.6, 1.15, 1.3), vertical_fov_deg=75.0)


def _grid(
    corner, first, second, *, cells: int | tuple[int, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    m, n = (cells, cells) if isinstance(cells, int) else cells
    corner, first, second = (np.array(v, np.float64) for v in (corner, first, second))
    i, j = (x.ravel()[:, None] / k for x, k in zip(np.indices((m + 1, n + 1)), (m, n), strict=True))
    normal = np.cross(first, second)
    a = (np.arange(m)[:, None] * (n + 1) + np.arange(n)).ravel()
    b, c, d = a + n + 1, a + n + 2, a + 1
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    places = corner + i * first + j * second
    return places, np.tile(normal / np.linalg.norm(normal), (len(places), 1)), triangles


def _window_wall(size: float, *, cells: int) -> tuple[list, tuple]:
    """The wall at x = 0 in four parts around its window, and the pane."""
    low, high, S = (SIDE - size) / 2, (SIDE + size) / 2, SIDE
    spans = [(0, S, 0, low), (0, S, high, S), (0, low, low, high), (high, S, low, high)]  # y0 y1 z0 z1
    per = cells / S
    parts = [
        _grid(
            (0, y0, z0), (0, y1 - y0, 0), (0, 0, z1 - z0),
            cells=(max(4, round((y1 - y0) * per)), max(4, round((z1 - z0) * per))),
        )
        for y0, y1, z0, z1 in spans
    ]  # fmt: skip
    return parts, _grid((0, low, low), (0, high - low, 0), (0, 0, high - low), cells=4)


def box(data: Path, *, window: float = LARGE, cells: int = 68, bunny: str = BUNNY) -> Scene:
    """Red and green walls, a bunny of 1.3 m (a file, or none), a pane of glass in the wall at x = 0."""
    S = SIDE
    wall, pane = _window_wall(window, cells=cells)
    grey, red, green, white = (0.7, 0.7, 0.7), (0.65, 0.08, 0.07), (0.12, 0.48, 0.10), (0.8, 0.8, 0.78)
    parts = [
        *((part, grey, "wall") for part in wall),
        (_grid((0, 0, 0), (0, 0, S), (S, 0, 0), cells=cells), grey, "wall"),
        (_grid((0, S, 0), (S, 0, 0), (0, 0, S), cells=cells), grey, "wall"),
        (_grid((S, 0, 0), (0, 0, S), (0, S, 0), cells=cells), grey, "wall"),
        (_grid((0, 0, 0), (S, 0, 0), (0, S, 0), cells=cells), red, "wall"),
        (_grid((0, 0, S), (0, S, 0), (S, 0, 0), cells=cells), green, "wall"),
        (pane, (1.0, 1.0, 1.0), "glass"),
    ]
    if bunny:
        made = load_scene(data / "bunny" / bunny)
        scale = 1.3 / float(np.ptp(made.positions, axis=0).max())
        places = made.positions.astype(np.float64) * scale
        low, high = places.min(axis=0), places.max(axis=0)
        places += np.array([1.5, 0.003, 1.5]) - [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]
        parts.append(((places, made.normals, made.triangles), white, "bunny"))
    materials = (
        Material("wall"),
        Material("glass", (1.0, 1.0, 1.0), transmission=1.0, specular=1.0),
        Material("bunny"),
    )
    names = ["wall", "glass", "bunny"]
    first = np.cumsum([0] + [len(p[0][0]) for p in parts])
    return Scene(
        "box",
        np.concatenate([p[0][0] for p in parts]).astype(np.float32),
        np.concatenate([p[0][1] for p in parts]).astype(np.float32),
        np.concatenate([p[0][2] + k for p, k in zip(parts, first, strict=False)]).astype(np.int32),
        np.concatenate([np.tile(np.float32(p[1]), (len(p[0][0]), 1)) for p in parts]),
        cameras={"front": EYE},
        materials=materials,
        material_of=np.repeat([names.index(p[2]) for p in parts], [len(p[0][2]) for p in parts]).astype(
            np.int32
        ),
    )


def sibenik(data: Path, *, subdivide: float | None = None) -> Scene:
    """The cathedral; subdivided to the paper's number of triangles if said."""
    return load_scene(data / "sibenik" / "sibenik.obj", subdivide=subdivide)

"""Closed rooms of separate walls: vertices on the edges between them are there twice or three times."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from prelight.scene.geometry import Scene

SIZE = (4.0, 3.0, 5.0)  # metres


def rectangle(corner, first, second, *, cells: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, normals and triangles of a grid of cells × cells that faces along first × second."""
    corner, first, second = (np.array(v, np.float64) for v in (corner, first, second))
    i, j = (x.ravel()[:, None] / cells for x in np.indices((cells + 1, cells + 1)))
    positions = corner + i * first + j * second
    normal = np.cross(first, second)
    a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    b, c, d = a + cells + 1, a + cells + 2, a + 1
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return positions, np.tile(normal / np.linalg.norm(normal), (len(positions), 1)), triangles


def scene_of_rectangles(*parts: tuple, albedo=0.5) -> Scene:
    """Each part with vertices of its own."""
    first = np.cumsum([0] + [len(p) for p, _, _ in parts])
    positions, normals = (np.concatenate([part[k] for part in parts]).astype(np.float32) for k in (0, 1))
    triangles = np.concatenate([t + k for (_, _, t), k in zip(parts, first, strict=False)])
    colours = np.broadcast_to(np.float32(albedo), positions.shape).copy()
    return Scene("rectangles", positions, normals, np.ascontiguousarray(triangles, np.int32), colours)


def room(cells: int = 8, *, albedo=0.5, sink: float = 0.0, more: tuple = ()) -> Scene:
    """Floor, ceiling and four walls, seen from inside. Walls reach ``sink`` metres below the floor."""
    X, Y, Z = SIZE
    low, high = -sink, Y + sink
    sides = (
        ((0, 0, 0), (0, 0, Z), (X, 0, 0)),
        ((0, Y, 0), (X, 0, 0), (0, 0, Z)),
        ((0, low, 0), (0, high, 0), (0, 0, Z)),
        ((X, low, 0), (0, 0, Z), (0, high, 0)),
        ((0, low, 0), (X, 0, 0), (0, high, 0)),
        ((0, low, Z), (0, high, 0), (X, 0, 0)),
    )
    return scene_of_rectangles(*(rectangle(*side, cells=cells) for side in sides), *more, albedo=albedo)


def box(low, high, *, cells: int = 3) -> tuple:
    """Six rectangles that face outward."""
    low, high = np.float64(low), np.float64(high)
    x, y, z = np.diag(high - low)
    sides = [(low, z, y), (low + x, y, z), (low, x, z), (low + y, z, x), (low, y, x), (low + z, x, y)]
    return tuple(rectangle(*side, cells=cells) for side in sides)


def coloured(scene: Scene, albedo: tuple[float, float, float]) -> Scene:
    return replace(scene, albedo=np.tile(np.float32(albedo), (len(scene.positions), 1)))

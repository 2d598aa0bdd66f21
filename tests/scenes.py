"""Small scenes that tests share; made here, in code."""

from __future__ import annotations

import numpy as np

from prelight.scene.geometry import Scene
from prelight.scene.normals import vertex_normals


def grid(side: int, *, size: float = 2.0, height: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A horizontal square of side×side vertices, facing up."""
    line = np.linspace(-size / 2, size / 2, side)
    x, z = np.meshgrid(line, line)
    positions = np.stack([x, np.full_like(x, height), z], axis=-1).reshape(-1, 3)
    corner = np.arange(side * (side - 1)).reshape(side - 1, side)[:, :-1].ravel()
    first = np.stack([corner, corner + side, corner + 1], axis=-1)
    second = np.stack([corner + 1, corner + side, corner + side + 1], axis=-1)
    return positions.astype(np.float32), np.concatenate([first, second]).astype(np.int32)


def sphere(rings: int, *, radius: float = 0.4, centre=(0.0, 0.6, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    """A latitude-longitude sphere with its poles as rings of coincident vertices left out."""
    theta = np.linspace(0.02, np.pi - 0.02, rings)
    phi = np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    unit = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=-1).reshape(-1, 3)
    n = 2 * rings
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(n), indexing="ij")
    a, b, c, d = i * n + j, i * n + (j + 1) % n, (i + 1) * n + j, (i + 1) * n + (j + 1) % n
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([b, d, c], -1).reshape(-1, 3)])
    return (unit * radius + centre).astype(np.float32), faces.astype(np.int32)


def scene_of(*parts: tuple[np.ndarray, np.ndarray], name: str = "test", albedo: float = 0.8) -> Scene:
    """Parts as one scene, normals from the triangles."""
    offset, positions, triangles = 0, [], []
    for vertices, faces in parts:
        positions.append(vertices)
        triangles.append(faces + offset)
        offset += len(vertices)
    p, t = np.concatenate(positions), np.concatenate(triangles).astype(np.int32)
    normals = vertex_normals(p, t).astype(np.float32)
    return Scene(name, p, normals, t, np.full(p.shape, albedo, np.float32))


def plane(side: int = 12, **options) -> Scene:
    return scene_of(grid(side), name="plane", **options)


def ball_on_floor(*, side: int = 25, rings: int = 14) -> Scene:
    return scene_of(sphere(rings), grid(side, size=3.0), name="ball")

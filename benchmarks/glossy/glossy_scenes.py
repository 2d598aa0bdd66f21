"""A glossy object under a sky, and one in a room; five eyes around each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import prelight as pl
from prelight.material import Material
from prelight.scene.geometry import Scene
from prelight.scene.refinement import edges_of, halved
from prelight.scene.stock import room as rooms

EYES = 5
PHONG = {
    "type": "phong", "exponent": 10.0,
    "diffuse_reflectance": {"type": "rgb", "value": [0.22, 0.08, 0.05]},
    "specular_reflectance": {"type": "rgb", "value": [0.5, 0.5, 0.5]},
}  # fmt: skip
CONDUCTOR = {
    "type": "roughconductor", "alpha": 0.2, "distribution": "ggx",
    "eta": {"type": "rgb", "value": [0.143, 0.375, 1.442]}, "k": {"type": "rgb", "value": [3.983, 2.386, 1.603]},
}  # fmt: skip
MATERIALS = {
    "phong": Material("phong 10", (0.22, 0.08, 0.05), bsdf=PHONG),
    "conductor": Material("rough gold", (0.9, 0.65, 0.35), bsdf=CONDUCTOR),
    "lacquer": Material("lacquer", (0.35, 0.02, 0.02), roughness=0.45, specular=1.0),
}


@dataclass(frozen=True)
class Looked:
    """A scene, the material that is looked at, and from where."""

    scene: Scene
    glossy: int
    eyes: list[pl.Camera]
    openings: np.ndarray | None = None  # (K, 3, 3) of a room: where the reference looks for light


def under_a_sky(data: Path, kind: str, *, detail: float) -> Looked:
    """The bunny, or without data folder or at little detail a ball, on a floor."""
    bunny = data / "bunny" / "bun_zipper.ply"
    if detail >= 1 and bunny.is_file():
        scene = pl.load_scene(bunny, floor=3.0)
        object_ = np.arange(len(scene.positions)) < 35_947
    else:
        scene, object_ = ball_on_floor(max(12, int(96 * detail)))
    return _made(scene, object_, kind)


def in_a_room(data: Path, kind: str, *, detail: float, foot: float = 0.0) -> Looked:
    """The vase on its plinth, in the room with one window; ``foot``: longest edges beneath it, metres; 0: its own."""
    del data
    scene = rooms.room(detail=detail)
    m = next(k for k, material in enumerate(scene.materials) if material.name == rooms.TEAL.name)
    materials = list(scene.materials)
    materials[m] = MATERIALS[kind]
    on = scene.material_of_vertex == m
    albedo, tint = scene.albedo.copy(), (scene.albedo if scene.tint is None else scene.tint).copy()
    albedo[on] = tint[on] = MATERIALS[kind].colour
    made = replace(
        scene, materials=tuple(materials), albedo=albedo, tint=None if scene.tint is None else tint
    )
    if foot:
        made = _finer_below(made, on, foot)
        on = made.material_of_vertex == m
    (z0, z1), (y0, y1) = rooms.WINDOW
    window = [[-rooms.HALF_WIDTH - rooms.WALL, y0, z0], [0, y1 - y0, 0], [0, 0, z1 - z0]]
    return Looked(made, m, _around(made.positions[on], distance=1.9, up=0.25), np.array([window]))


def _finer_below(scene: Scene, object_: np.ndarray, edge: float) -> Scene:
    """What an object stands on, as wide about it as it is tall, in edges up to ``edge`` and a third."""
    own = scene.positions[object_]
    middle, low = (own.min(axis=0) + own.max(axis=0)) / 2, own[:, 1].min()
    while True:
        corners = scene.positions[scene.triangles]
        level = (np.abs(corners[:, :, 1] - low) < 0.01) & (scene.normals[scene.triangles, 1] > 0.9)
        aside = np.linalg.norm((corners.mean(axis=1) - middle)[:, [0, 2]], axis=1)
        ends = edges_of(scene.triangles[level.all(axis=1) & (aside < 0.5 * np.ptp(own[:, 1]))])
        long = (
            np.linalg.norm(scene.positions[ends[:, 0]] - scene.positions[ends[:, 1]], axis=1) > 4 / 3 * edge
        )
        if not long.any():
            return scene
        scene, _ = halved(scene, np.unique(np.sort(ends[long], axis=1), axis=0))


def ball_on_floor(rings: int) -> tuple[Scene, np.ndarray]:
    """A ball of 2·rings² vertices just above a floor of 25², and which vertices are its."""
    theta = np.linspace(0.02, np.pi - 0.02, rings)
    phi = np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    unit = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=-1).reshape(-1, 3)
    n = 2 * rings
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(n), indexing="ij")
    a, b, c, d = i * n + j, i * n + (j + 1) % n, (i + 1) * n + j, (i + 1) * n + (j + 1) % n
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([b, d, c], -1).reshape(-1, 3)])
    line = np.linspace(-1.5, 1.5, 25)
    x, z = np.meshgrid(line, line)
    floor = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    corner = np.arange(25 * 24).reshape(24, 25)[:, :-1].ravel() + len(unit)
    ground = np.concatenate([
        np.stack([corner, corner + 25, corner + 1], -1), np.stack([corner + 1, corner + 25, corner + 26], -1)
    ])  # fmt: skip
    positions = np.concatenate([unit * 0.4 + (0, 0.42, 0), floor]).astype(np.float32)
    normals = np.concatenate([unit, np.tile([0.0, 1.0, 0.0], (len(floor), 1))]).astype(np.float32)
    triangles = np.concatenate([faces, ground]).astype(np.int32)
    albedo = np.full(positions.shape, 0.6, np.float32)
    return Scene("ball", positions, normals, triangles, albedo), np.arange(len(positions)) < len(unit)


def _made(scene: Scene, object_: np.ndarray, kind: str) -> Looked:
    glossy = MATERIALS[kind]
    of = object_[scene.triangles].all(axis=1).astype(np.int32)
    albedo = np.where(object_[:, None], np.float32(glossy.colour), np.float32(0.6)).astype(np.float32)
    matt = Material("floor", (0.6, 0.6, 0.6))
    made = replace(
        scene, materials=(matt, glossy), material_of=of, albedo=albedo, tint=None, uv=None, textures=()
    )
    return Looked(made, 1, _around(scene.positions[object_], distance=3.0, up=0.8))


def _around(object_: np.ndarray, *, distance: float, up: float) -> list[pl.Camera]:
    """Eyes on a circle about an object; ``distance`` and ``up`` in its largest extents."""
    middle = (object_.min(axis=0) + object_.max(axis=0)) / 2
    size = float(np.ptp(object_, axis=0).max())
    eyes = []
    for k in range(EYES):
        angle = 2 * np.pi * k / EYES + 0.35
        away = np.array([np.cos(angle) * distance, up, np.sin(angle) * distance]) * size
        fov = 2 * np.degrees(np.arctan(0.62 / np.hypot(distance, up)))
        eyes.append(
            pl.Camera(eye=tuple(middle + away), target=tuple(map(float, middle)), vertical_fov_deg=float(fov))
        )
    return eyes

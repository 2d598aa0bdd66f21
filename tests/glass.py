"""Glass and mirrors on diffuse floors: what caustics are tested on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from prelight.material import Material
from prelight.scene.geometry import Scene

from .rooms import box, rectangle, room, scene_of_rectangles
from .scenes import sphere

GLASS = Material("glass", (1.0, 1.0, 1.0), bsdf={"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0})
GREEN_GLASS = Material(
    "green glass", (1.0, 1.0, 1.0),
    bsdf={
        "type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0,
        "specular_transmittance": {"type": "rgb", "value": [0.2, 0.9, 0.3]},
    },
)  # fmt: skip
FLOOR = Material("floor", (0.5, 0.5, 0.5))


def joined(diffuse: Scene, positions, normals, triangles, material: Material, *, albedo=1.0) -> Scene:
    """A diffuse scene and a body of another material in it."""
    first = len(diffuse.positions)
    return replace(
        diffuse,
        positions=np.concatenate([diffuse.positions, np.float32(positions)]),
        normals=np.concatenate([diffuse.normals, np.float32(normals)]),
        triangles=np.concatenate([diffuse.triangles, np.int32(triangles) + first]),
        albedo=np.concatenate([diffuse.albedo, np.full((len(positions), 3), albedo, np.float32)]),
        materials=(FLOOR, material),
        material_of=np.repeat(np.int32([0, 1]), [len(diffuse.triangles), len(triangles)]),
    )


def ball(*, radius: float, centre, rings: int = 48) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A closed sphere with its own normals: (positions, normals, triangles), seen from outside."""
    unit, faces = sphere(rings, radius=1.0, centre=(0.0, 0.0, 0.0))
    caps = []
    n = 2 * rings
    for pole, ring, turned in ((len(unit), 0, False), (len(unit) + 1, (rings - 1) * n, True)):
        a, b = ring + np.arange(n), ring + (np.arange(n) + 1) % n
        caps.append(np.stack([np.full(n, pole), *((b, a) if not turned else (a, b))], axis=1))
    unit = np.concatenate([unit, np.float32([[0, 1, 0], [0, -1, 0]])])
    faces = np.concatenate([faces, *caps]).astype(np.int32)
    across = np.cross(unit[faces[:, 1]] - unit[faces[:, 0]], unit[faces[:, 2]] - unit[faces[:, 0]])
    inward = (across * unit[faces].sum(axis=1)).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return unit * np.float32(radius) + np.float32(centre), unit, faces


def floor(*, size: float = 2.0, cells: int = 40) -> Scene:
    corner = (-size / 2, 0, -size / 2)
    return scene_of_rectangles(rectangle(corner, (0, 0, size), (size, 0, 0), cells=cells))


def ball_above_floor(*, material: Material = GLASS, cells: int = 40, rings: int = 48) -> Scene:
    return joined(floor(cells=cells), *ball(radius=0.3, centre=(0, 0.5, 0), rings=rings), material)


def ball_in_room(*, material: Material = GLASS, cells: int = 10, albedo=0.5) -> Scene:
    return joined(room(cells, albedo=albedo), *ball(radius=0.4, centre=(2, 0.7, 2.5), rings=24), material)


def slab_above_floor(*, thickness: float = 0.2, width: float = 1.0) -> Scene:
    """A pane lying 0.5 m above a floor, its middle above the floor's."""
    parts = box((-width / 2, 0.5, -width / 2), (width / 2, 0.5 + thickness, width / 2), cells=1)
    pane = scene_of_rectangles(*parts)
    return joined(floor(), pane.positions, pane.normals, pane.triangles, GLASS)

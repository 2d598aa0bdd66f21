"""Make gloss.png: python docs/pictures/gloss.py FOLDER, where the bake is kept, some minutes of work.

A vase of Phong 10 in the small room at sunset, one bake, from three eyes; below each what the path tracer makes of it.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

import prelight as pl
from prelight.camera import Camera
from prelight.drawing.picture import Picture
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.rays.surfaces import SurfaceScene
from prelight.scene.geometry import Scene
from prelight.scene.stock import room as rooms
from prelight.transport.eye import seen_points
from prelight.transport.path_tracing import path_traced_view

SIDE, SAMPLES, POINTS = 320, 720, 9
COPPER = {
    "type": "phong", "exponent": 10.0,
    "diffuse_reflectance": {"type": "rgb", "value": [0.22, 0.08, 0.05]},
    "specular_reflectance": {"type": "rgb", "value": [0.5, 0.5, 0.5]},
}  # fmt: skip
GLOSSY = Material("copper glaze", (0.22, 0.08, 0.05), bsdf=COPPER)
AZIMUTHS = (1.61, 4.12, 5.38)  # of the eyes about the vase, radians


def scene_and_eyes() -> tuple[Scene, list[Camera]]:
    scene = rooms.room(detail=0.5)
    m = next(k for k, material in enumerate(scene.materials) if material.name == rooms.TEAL.name)
    materials = [GLOSSY if k == m else material for k, material in enumerate(scene.materials)]
    on = scene.material_of_vertex == m
    albedo = np.where(on[:, None], np.float32(GLOSSY.colour), scene.albedo)
    tint = None if scene.tint is None else np.where(on[:, None], np.float32(GLOSSY.colour), scene.tint)
    vase = scene.positions[on]
    middle, size = (vase.min(axis=0) + vase.max(axis=0)) / 2, float(np.ptp(vase, axis=0).max())
    away = [size * np.array([1.9 * np.cos(a), 0.25, 1.9 * np.sin(a)]) for a in AZIMUTHS]
    eyes = [
        Camera(
            eye=tuple((middle + d).tolist()), target=tuple(map(float, middle)), vertical_fov_deg=48.0
        )
        for d in away
    ]  # fmt: skip
    return replace(scene, materials=tuple(materials), albedo=albedo, tint=tint), eyes


def main() -> None:
    folder = Path(sys.argv[1])
    scene, eyes = scene_and_eyes()
    path = folder / "gloss.prelight"
    bake = (
        pl.Bake.open(path)
        if path.exists()
        else pl.bake_environment(scene, path, resolution=64, tolerance=0.004, glossy_order=8)
    )
    light = pl.Relighter(bake)
    light.environment = pl.Environment.open("stock:sunset")
    cube = light.environment.cube(light.resolution)
    occluders, surfaces = Occluders(scene.positions, scene.triangles), SurfaceScene(scene)
    pairs = []
    for k, eye in enumerate(eyes):
        ours = light.picture(eye, width=SIDE, height=SIDE, background=None)
        points = seen_points(occluders, eye, width=SIDE, height=SIDE, samples=POINTS)
        mean, _ = path_traced_view(surfaces, points, cube=cube, bounces=None, samples=SAMPLES, seed=k)
        pairs.append(
            (ours, Picture(mean.reshape(SIDE, SIDE, 3).astype(np.float32), np.ones((SIDE, SIDE), np.float32)))
        )
    save(pairs, Path(__file__).with_name("gloss.png"))


def save(pairs: list[tuple[Picture, Picture]], path: Path) -> None:
    """Ours above, theirs below, one exposure for all."""
    stops = float(np.median([theirs.stops("auto") for _, theirs in pairs]))
    rows = [
        np.concatenate([pair[which].display(exposure=stops) for pair in pairs], axis=1) for which in (0, 1)
    ]
    Image.fromarray(np.concatenate(rows)).save(path, optimize=True)


if __name__ == "__main__":
    main()

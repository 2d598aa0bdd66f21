"""A floor under a model, as in the scenes of the environment-clusters paper."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..camera import Camera
from ..errors import InputError
from ..material import GREY, Material
from .geometry import Scene

SIDE = 193  # vertices along each side: 37,249 in all, the paper's number
LARGEST_SCALE = 1000.0


def with_floor(
    scene: Scene,
    scale: float,
    *,
    albedo: tuple[float, float, float] = GREY,
    material: Material | None = None,
) -> Scene:
    """The scene with a square grid of 193×193 vertices under it, facing up (+Y), after its own vertices.

    Parameters
    ----------
    scene
        The model; only vertices that a triangle uses say how large it is.
    scale
        Side of the square over the largest extent of the model's bounding box; above 0, at most 1000.
    albedo
        Of the floor, linear Rec.709, each in [0, 1].
    material
        Of the floor; diffuse if not given. Its colour is ``albedo``.

    Raises InputError for another scale.
    """
    if isinstance(scale, bool) or not isinstance(scale, int | float | np.number):
        raise InputError("floor", f"scale is {scale!r}, expected a number such as 3")
    if not (math.isfinite(scale) and 0 < scale <= LARGEST_SCALE):
        raise InputError(
            "floor", f"scale is {scale:g}, expected above 0 and at most {LARGEST_SCALE:g}, such as 3"
        )
    used = scene.positions[np.unique(scene.triangles)].astype(np.float64)
    low, high = used.min(axis=0), used.max(axis=0)
    line = np.linspace(-0.5, 0.5, SIDE) * float(scale) * (high - low).max()
    middle = (low + high) / 2
    z, x = np.meshgrid(middle[2] + line, middle[0] + line, indexing="ij")
    grid = np.stack([x, np.full_like(x, low[1]), z], axis=-1).reshape(-1, 3)
    with np.errstate(over="ignore"):
        positions = grid.astype(np.float32)
    if not np.isfinite(positions).all():
        raise InputError(
            "floor", f"scale {scale:g} makes the floor larger than float32 can hold; choose less"
        )
    up = np.tile(np.array([0, 1, 0], np.float32), (len(grid), 1))
    grey = np.tile(np.array(albedo, np.float32), (len(grid), 1))
    cells = _grid_triangles()
    return replace(
        scene,
        cameras=scene.cameras or {"model": Camera.framing(used.astype(np.float32), share=0.7)},
        positions=np.concatenate([scene.positions, positions]),
        normals=np.concatenate([scene.normals, up]),
        triangles=np.concatenate([scene.triangles, cells + np.int32(len(scene.positions))]),
        albedo=np.concatenate([scene.albedo, grey]),
        materials=(*scene.materials, replace(material or Material("floor"), colour=albedo)),
        material_of=np.concatenate([scene.material_of, np.full(len(cells), len(scene.materials), np.int32)]),
        uv=None if scene.uv is None else np.concatenate([scene.uv, np.zeros((len(grid), 2), np.float32)]),
        tint=None if scene.tint is None else np.concatenate([scene.tint, grey]),
    )


def _grid_triangles() -> np.ndarray:
    """Two triangles a cell, counter-clockwise seen from above (rows run along +z, columns along +x)."""
    corner = np.arange(SIDE * SIDE, dtype=np.int32).reshape(SIDE, SIDE)
    here, right, ahead, across = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    two = np.stack([here, ahead, right, right, ahead, across], axis=-1)
    return two.reshape(-1, 3)

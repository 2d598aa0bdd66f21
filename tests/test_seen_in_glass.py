"""Light off a mirror onto what is seen in the mirror, against what the lamp's own picture behind the mirror brings."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.camera import Camera
from prelight.material import Material
from prelight.rays.surfaces import SurfaceScene
from prelight.scene.geometry import Scene
from prelight.scene.stock.parts import rectangle, scene_of
from prelight.transport.basis_images import BasisTracer, ImageSettings
from prelight.transport.near_points_kernels import count_near, fill_near, point_table
from prelight.transport.steered_lamps import SteeredLamp, SteeredPanel, SteeredSpot

ALBEDO = 0.5
AT = np.array([1.1, 1.2, 0.2])
EYE = Camera((1.9, 0.9, 0.0), (0.0, 0.45, 0.0), vertical_fov_deg=30)
SIZE = 24


def _scene() -> Scene:
    """A floor, and a mirror that stands upright on its edge x = 0."""
    x, y, z = np.eye(3)
    matt, mirror = (
        Material("matt", (ALBEDO,) * 3),
        Material("mirror", bsdf={"type": "conductor", "material": "none"}),
    )
    floor = rectangle(-2 * z + 2 * x, -2 * x, 4 * z, cells=(1, 1))
    if floor.normals[0, 1] < 0:
        floor = rectangle(-2 * z, 2 * x, 4 * z, cells=(1, 1))
    upright = rectangle(0.001 * y + 2 * z, 2 * y, -4 * z, cells=(1, 1))
    if upright.normals[0, 0] < 0:
        upright = rectangle(0.001 * y - 2 * z, 2 * y, 4 * z, cells=(1, 1))
    return scene_of("mirrored", [(floor, matt), (upright, mirror)], cameras={"front": EYE})


def _seen_floor() -> np.ndarray:
    """Points (pixels, 3) of the floor that the middles of pixels show in the mirror; nan where they show none."""
    at = np.arange(SIZE) + 0.5 - SIZE / 2
    focal = SIZE / (2 * np.tan(np.radians(EYE.vertical_fov_deg) / 2))
    right, up, back = EYE.axes()
    columns, rows = np.meshgrid(at, at)
    d = columns[..., None] * right - rows[..., None] * up - focal * back
    d = d.reshape(-1, 3)
    eye = np.array(EYE.eye)
    with np.errstate(divide="ignore", invalid="ignore"):
        mirror = eye - d * (eye[0] / d[:, :1])
        turned = d * [-1, 1, 1]
        floor = mirror - turned * (mirror[:, 1:2] / turned[:, 1:2])
    inside = (d[:, 0] < 0) & (mirror[:, 1] > 0.05) & (floor[:, 0] > 0.05) & (floor[:, 0] < 1.8)
    inside &= (np.abs(floor[:, 2]) < 1.5) & (turned[:, 1] < 0)
    return np.where(inside[:, None], floor, np.nan)


def _radiance(points: np.ndarray, lamp: np.ndarray) -> np.ndarray:
    """Of the floor under a small lamp of 1 W/sr."""
    way = lamp - points
    square = (way**2).sum(axis=1)
    return ALBEDO / np.pi * way[:, 1] / square**1.5


def _picture(lamp: SteeredLamp, **how: int) -> np.ndarray:
    """Radiance (pixels,) under the lamp with intensity or radiance 1 all over."""
    scene = _scene()
    settings = ImageSettings(SIZE, SIZE, **{"samples": 64, "particles": 256, "depth": 4, **how})
    tracer = BasisTracer(scene, lamp, EYE, settings=settings, surfaces=SurfaceScene(scene))
    assert not any("onto what is seen" in words for words in tracer.left_out)
    even = np.zeros((1, lamp.functions))
    even[0, 0] = np.sqrt(4 * np.pi) if isinstance(lamp, SteeredSpot) else 1.0
    total = tracer.nothing(poses=1)
    for batch in range(tracer.batches):
        tracer.add_batch(batch, total, weights=even)
    return (tracer.pixels(0, SIZE * SIZE, weights=even).posed + total.posed)[:, 0].mean(axis=1)


@pytest.mark.parametrize("radius", [0.0, 0.02])
def test_what_a_mirror_shows_is_lit_by_the_mirror_too(radius: float) -> None:
    points = _seen_floor()
    seen = np.isfinite(points[:, 0])
    assert seen.sum() > 100
    direct, mirrored = _radiance(points, AT), _radiance(points, AT * [-1, 1, 1])
    ours = _picture(SteeredSpot(tuple(AT.tolist()), 1, radius))
    assert mirrored[seen].mean() > 0.2 * direct[seen].mean()
    share = (ours - direct)[seen].mean() / mirrored[seen].mean()
    assert abs(share - 1) < 0.03, share
    assert np.sqrt(np.mean((ours / (direct + mirrored) - 1)[seen] ** 2)) < 0.08


def test_near_points_are_those_that_are_near(rng: np.random.Generator) -> None:
    points, others = rng.random((400, 3), np.float32), rng.random((300, 3), np.float32) * 1.2 - 0.1
    reach = (0.02 + 0.1 * rng.random(400)).astype(np.float32)
    table, order, width = point_table(points, reach)
    counts = np.zeros(300, np.int64)
    count_near(others, table, width, counts)
    starts = np.concatenate([[0], np.cumsum(counts)])
    found = np.empty(starts[-1], np.int64)
    fill_near(others, table, width, starts, found)
    near = np.linalg.norm(others[:, None] - points[None], axis=2) < reach
    assert near.sum() > 100
    for k in range(300):
        assert sorted(order[found[starts[k] : starts[k + 1]]]) == np.flatnonzero(near[k]).tolist()


def test_the_same_paths_are_the_same_bytes() -> None:
    lamp = SteeredPanel((0.8, 1.2, -0.1), (0.4, 0, 0), (0, 0, 0.4), (0, 0))
    first, second = (_picture(lamp, samples=16, particles=64) for _ in range(2))
    assert np.array_equal(first, second)
    assert np.isfinite(first).all()

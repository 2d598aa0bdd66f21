"""The lamp's own image in a mirror: chains of mirrors alone bring what all paths bring, with less noise."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.camera import Camera
from prelight.material import Material
from prelight.rays.surfaces import SurfaceScene
from prelight.scene.geometry import Scene
from prelight.scene.stock.parts import rectangle, scene_of
from prelight.transport import mirrored_lamp
from prelight.transport.basis_images import BasisTracer, ImageSettings, TracedRows
from prelight.transport.steered_lamps import SteeredSpot

pytest.importorskip("mitsuba")

EYE = Camera((0.0, 1.0, 2.0), (0.0, 1.0, 0.0), vertical_fov_deg=40)
AT, RADIUS, SIZE = (0.3, 1.2, 1.0), 0.05, 16


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A small mirror at z = 0, upright, and nothing else."""
    mirror = Material("mirror", bsdf={"type": "conductor", "material": "none"})
    x, y, _ = np.eye(3)
    corner = np.array([0.0, 0.95, 0.0])
    upright = rectangle(corner, 0.4 * x, 0.4 * y, cells=(1, 1))
    if upright.normals[0, 2] < 0:
        upright = rectangle(corner + 0.4 * x, -0.4 * x, 0.4 * y, cells=(1, 1))
    return scene_of("mirror", [(upright, mirror)], cameras={"front": EYE})


def _traced(scene: Scene, *, samples: int, radius: float = RADIUS, seed: int = 0) -> TracedRows:
    lamp = SteeredSpot(AT, 1, radius)
    settings = ImageSettings(SIZE, SIZE, samples, 0, 4, seed=seed)
    tracer = BasisTracer(scene, lamp, EYE, settings=settings, surfaces=SurfaceScene(scene))
    return tracer.pixels(0, SIZE * SIZE)


def test_its_light_is_that_of_a_lamp_behind_the_mirror(scene):
    """Radiance Y₀ / (π r²) of the first function over the pixels that its disc covers."""
    found = _traced(scene, samples=4096).images[:, 0, 0].reshape(SIZE, SIZE)
    behind = np.array(AT) * [1, 1, -1] - EYE.eye
    focal = SIZE / (2 * np.tan(np.radians(EYE.vertical_fov_deg) / 2))
    across = focal * RADIUS / -behind[2]  # pixels; a ball a little beside the axis: 1/cos³ of its area
    cosine = -behind[2] / np.linalg.norm(behind)
    area = np.pi * across**2 / cosine
    assert found.sum() == pytest.approx(area / (np.pi * RADIUS**2) / np.sqrt(4 * np.pi), rel=0.02)
    row, column = np.unravel_index(found.argmax(), found.shape)
    assert abs(column + 0.5 - (SIZE / 2 + focal * behind[0] / -behind[2])) <= 1
    assert abs(row + 0.5 - (SIZE / 2 - focal * behind[1] / -behind[2])) <= 1


def test_no_light_is_lost_or_counted_twice(scene, monkeypatch):
    many = _traced(scene, samples=4096, seed=1).images.sum(dtype=np.float64)
    monkeypatch.setattr(mirrored_lamp, "_MOST", 1)  # so that paths from the eye find it as everything else
    assert _traced(scene, samples=4096, seed=2).images.sum(dtype=np.float64) == pytest.approx(many, rel=0.01)


def test_it_has_less_noise(scene, monkeypatch):
    few = _traced(scene, samples=64, seed=1)
    monkeypatch.setattr(mirrored_lamp, "_MOST", 1)
    plain = _traced(scene, samples=64, seed=1)
    assert few.variance.sum() < plain.variance.sum() / 4


def test_a_point_has_no_image(scene):
    assert not _traced(scene, samples=16, radius=0.0).images.any()

"""Whether a mesh holds its light, where the answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.scene.subdivision import subdivided
from prelight.transport.bounces import bounced
from prelight.transport.gathering import Gathering
from prelight.transport.mesh_fitness import MeshFitness, measure_fitness

from .rooms import box, rectangle, room, scene_of_rectangles

CELLS = 20


def step(positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Light to the right of a line in the middle of a column of cells."""
    return (positions[:, :1] > 0.5 + 0.5 / CELLS).astype(np.float32)[:, None]


def ramp(positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
    return positions[:, :1, None] + np.float32(0.2)


def floor(cells: int = CELLS) -> Scene:
    return scene_of_rectangles(rectangle((0, 0, 0), (0, 0, 1), (1, 0, 0), cells=cells))


def fitness(scene: Scene, light, **options) -> MeshFitness:
    occluders = Occluders(scene.positions, scene.triangles)
    D = light(scene.positions, scene.normals)
    return measure_fitness(scene, occluders, direct=D, indirect=np.zeros_like(D), direct_at=light, **options)


def test_light_that_is_linear_is_held():
    found = fitness(floor(4), ramp)
    assert found.share == 1
    assert found.deviation.max() < 1e-5
    assert found.judged.all()
    assert found.edge_for(0.99) == np.inf


@pytest.mark.parametrize("most", [50_000, 600])
def test_at_a_sharp_edge_the_cells_it_crosses_do_not_hold_it(most):
    """In them light is interpolated from 0 to 1: within the limit only in its first 5 % and its last 10 %."""
    found = fitness(floor(), step, most=most)
    shares = [found.share] + [fitness(floor(), step, most=most, seed=seed).share for seed in range(1, 12)]
    assert 1 - np.mean(shares) == pytest.approx(0.85 / CELLS, rel=0.08)
    x = floor().positions[:, 0]
    far = (x < 0.5 - 0.1) | (x > 0.6 + 0.1)
    assert found.judged[far].all()
    if most > len(found.triangle):
        assert not found.judged.all()


def test_what_splitting_would_do_is_foretold():
    found = fitness(floor(), step)
    half = float(found.edge.max()) / 2
    finer = subdivided(floor(), half)
    assert found.share_with_edges(half) == pytest.approx(fitness(finer, step).share, abs=0.012)
    wanted = found.share_with_edges(half)
    assert found.edge_for(wanted) == pytest.approx(half, rel=1e-3)


def test_bounced_light_is_held_by_a_fine_room_and_what_is_inside_of_things_does_not_count():
    block = box((1.0, -0.1, 1.5), (3.0, 0.8, 3.5), cells=6)
    scene = room(12, albedo=0.6, more=block)
    occluders = Occluders(scene.positions, scene.triangles)
    gathering = Gathering.trace(scene, occluders, rays=1024)
    lamp = np.float32([2.0, 2.5, 2.5])
    away = lamp - scene.positions
    D = np.maximum((away * scene.normals).sum(axis=1), 0) / (0.5 + (away**2).sum(axis=1)) ** 2
    D = D[:, None, None].astype(np.float32)
    found = measure_fitness(scene, occluders, direct=D, indirect=bounced(gathering, D).indirect)
    assert found.share > 0.95
    covered = 2 * 2  # of the floor; the block's underside and the foot of its sides look out below the room
    total = 2 * (4 * 3 + 4 * 5 + 3 * 5) + 2 * covered + 4 * 2 * 0.9
    assert total - found.area.sum() == pytest.approx(covered, rel=0.15)

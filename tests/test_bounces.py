"""All bounces together: white furnaces, partial sums, and what is said to remain."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from prelight.errors import InputError
from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.transport.bounces import bounced
from prelight.transport.gathering import Gathering

from .rooms import coloured, room
from .test_gathering import lit_from_within, papered_room


def traced(scene: Scene, *, rays: int = 256) -> Gathering:
    return Gathering.trace(scene, Occluders(scene.positions, scene.triangles), rays=rays)


def relative(light: np.ndarray, truth: np.ndarray) -> float:
    """RMS of the worst column."""
    return float(np.sqrt(((light - truth) ** 2).mean(axis=0) / (truth**2).mean(axis=0)).max())


@pytest.mark.parametrize(("albedo", "within"), [(0.2, 0.001), (0.5, 0.001), (0.8, 0.001), (0.95, 0.005)])
def test_white_furnace(albedo, within):
    """A closed room that shines with Le everywhere has radiance Le / (1 − ρ): Le and ρ times what arrives."""
    scene = room(8, albedo=albedo)
    gathering = traced(scene)
    direct = gathering.bounce(np.ones((len(scene.positions), 1, 1), np.float32)) / np.float32(albedo)
    found = bounced(gathering, direct)
    radiance = 1 + albedo * (direct + found.indirect)
    assert np.abs(radiance * (1 - albedo) - 1).max() < within
    assert found.remaining < 1e-3
    assert found.bounces <= 4


def test_each_colour_has_its_own_furnace():
    scene = coloured(room(5), (0.9, 0.5, 0.0))
    direct = np.ones((len(scene.positions), 2, 3), np.float32) * np.float32([[1], [-3]])
    found = bounced(traced(scene, rays=64), direct, tolerance=1e-4)
    expected = np.float32([[1], [-3]]) * np.float32([9.0, 1.0, 0.0])
    assert np.abs(found.indirect / np.float32([[1], [-3]]) - np.abs(expected[0])).max() < 2e-3
    assert (found.indirect[..., 2] == 0).all()


def test_so_many_bounces_and_no_more():
    scene = room(5, albedo=0.7)
    D = np.ones((len(scene.positions), 1, 1), np.float32)
    gathering = traced(scene, rays=64)
    for most in (1, 2, 5):
        found = bounced(gathering, D, most=most)
        assert found.bounces == most
        assert found.indirect == pytest.approx(sum(0.7**k for k in range(1, most + 1)), rel=1e-4)
    assert bounced(gathering, D, most=1000, tolerance=1e-2).bounces == 13  # 0.7¹³ / (1 − 0.7¹³) = 0.98 %


@pytest.mark.parametrize("make", [lambda: room(6, albedo=0.85), lambda: papered_room(_paper())])
def test_solved_is_the_sum_of_very_many(make, rng):
    scene = make()
    gathering = traced(scene, rays=64)
    light = np.repeat(lit_from_within(scene), 3, axis=2) * rng.normal(size=(1, 3, 3)).astype(np.float32)
    light -= np.float32(0.5) * light.mean(axis=0)  # of both signs
    truth = bounced(gathering, light, most=400, tolerance=1e-7)
    for tolerance in (1e-2, 1e-4):
        found = bounced(gathering, light, tolerance=tolerance)
        assert found.remaining <= tolerance
        assert relative(found.indirect, truth.indirect) <= found.remaining + 1e-6
        assert found.bounces < truth.bounces / 3
    added = bounced(gathering, light, tolerance=1e-2, most=400)
    assert relative(added.indirect, truth.indirect) <= added.remaining <= 1e-2


def _paper() -> np.ndarray:
    return np.random.default_rng(3).integers(150, 256, (6, 6, 3), dtype=np.uint8)


def test_light_by_light_is_light_together(rng):
    scene = room(5, albedo=0.6)
    gathering = traced(scene, rays=64)
    light = rng.random((len(scene.positions), 20, 1)).astype(np.float32)
    together = bounced(gathering, light, tolerance=1e-4).indirect
    alone = np.concatenate(
        [bounced(gathering, light[:, k : k + 1], tolerance=1e-4).indirect for k in (0, 13)], axis=1
    )
    assert relative(together[:, [0, 13]], alone) < 2e-4


def test_no_light_stays_none_and_dark_columns_do_not_matter():
    scene = room(4, albedo=0.5)
    gathering = traced(scene, rays=64)
    dark = np.zeros((len(scene.positions), 2, 1), np.float32)
    found = bounced(gathering, dark)
    assert (found.indirect == 0).all()
    assert found.remaining == 0
    dark[:, 1] = 1
    found = bounced(gathering, dark)
    assert (found.indirect[:, 0] == 0).all()
    assert found.indirect[:, 1] == pytest.approx(1.0, rel=2e-3)


def test_black_surfaces_reflect_nothing():
    scene = room(4, albedo=0.0)
    found = bounced(traced(scene, rays=64), np.ones((len(scene.positions), 1, 3), np.float32))
    assert (found.indirect == 0).all()
    assert found.remaining == 0


def test_white_surfaces_that_let_nothing_out_have_no_solution_and_say_so():
    scene = room(3, albedo=1.0)
    found = bounced(traced(scene, rays=16), np.ones((len(scene.positions), 1, 1), np.float32))
    assert np.isfinite(found.indirect).all()
    assert found.remaining > 1
    assert found.bounces <= 66


def test_the_same_bytes_for_one_thread(rng):
    scene = room(6, albedo=0.8)
    gathering = traced(scene, rays=64)
    light = rng.normal(size=(len(scene.positions), 7, 1)).astype(np.float32)
    two = bounced(gathering, light).indirect
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        one = bounced(gathering, light).indirect
    finally:
        numba.set_num_threads(threads)
    assert np.array_equal(one, two)


@pytest.mark.parametrize("wrong", [{"tolerance": 0.0}, {"tolerance": float("nan")}, {"most": 0}])
def test_refusals(wrong):
    gathering = traced(room(2), rays=4)
    with pytest.raises(InputError, match="expected"):
        bounced(gathering, np.ones((gathering.rows, 1, 1), np.float32), **wrong)
    with pytest.raises(InputError, match="expected"):
        bounced(gathering, np.ones((gathering.rows, 1), np.float32))

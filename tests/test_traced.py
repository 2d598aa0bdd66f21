"""Strong lights in the live session: traced by rays, off and on, given back to their clusters by an edit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prelight.baking.environment import bake_environment
from prelight.bases.cube_map import directions
from prelight.camera import Camera
from prelight.checking.against import Comparison
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.material import Material
from prelight.rays.plain import PlainOccluders, PlainVisibility
from prelight.relighting.relighter import Relighter
from prelight.transport.exact import integrate_exactly

from .scenes import ball_on_floor

R = 32
SUN = (2, 9, 21)  # a texel high up on the side


def sunny() -> np.ndarray:
    cube = np.full((6, R, R, 3), 0.05, np.float32)
    cube[SUN] = (900.0, 800.0, 600.0)
    return cube


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    """A bake whose clusters alone are far off."""
    path = tmp_path_factory.mktemp("traced") / "ball.prelight"
    return bake_environment(ball_on_floor(), path, resolution=R, tolerance=0.06, bounces=0)


def truth(bake, cube) -> np.ndarray:
    receivers = bake.receivers
    every = np.arange(len(receivers), dtype=np.int32)
    exact = integrate_exactly(
        receivers.positions, bake.triangles, receivers.normals, receivers=every, cube=cube
    )
    return exact * receivers.albedo


def error(radiance: np.ndarray, true: np.ndarray) -> float:
    return float(np.sqrt(((radiance - true) ** 2).sum() / (true**2).sum()))


def lit(bake, environment, *, trace_strong: bool) -> Relighter:
    light = Relighter(bake, trace_strong=trace_strong)
    light.environment = environment
    return light


def test_a_sun_is_right_with_rays_and_wrong_without(coarse):
    cube = sunny()
    true, environment = truth(coarse, cube), Environment.from_cube(cube)
    clusters = lit(coarse, environment, trace_strong=False)
    traced = lit(coarse, environment, trace_strong=True)
    assert len(clusters.strong_lights) == 0
    assert traced.strong_lights.rectangles.tolist() == [[*SUN, 1, 1]]
    assert error(clusters.radiance, true) > 0.05
    assert error(traced.radiance, true) < 0.002


def test_switching_is_the_same_as_beginning_so(coarse):
    environment = Environment.from_cube(sunny())
    light = lit(coarse, environment, trace_strong=True)
    first = light.radiance
    light.trace_strong = False
    alone = lit(coarse, environment, trace_strong=False).radiance
    assert light.radiance == pytest.approx(alone, rel=1e-6, abs=1e-6)
    light.trace_strong = True
    assert light.radiance == pytest.approx(first, rel=1e-6, abs=1e-7)
    assert light.environment is environment


def test_a_small_disc(coarse):
    """A sun among the discs is traced; a window is not; moved and put out, nothing of it stays."""
    sky = Environment.constant((0.05, 0.05, 0.05))
    sun = Disc((0.5, 0.8, 0.3), 0.5, (3000.0, 2500.0, 2000.0))
    window = Disc((-1.0, 0.4, 0.0), 15.0, (1.0, 1.0, 1.0))
    environment = sky.with_discs([sun, window])
    light = lit(coarse, environment, trace_strong=True)
    assert light.strong_lights.energy.sum(axis=0) == pytest.approx(sun.total, rel=1e-4)
    assert error(light.radiance, truth(coarse, environment.cube(R))) < 0.02
    light.environment = sky.with_discs([window])
    assert len(light.strong_lights) == 0
    fresh = lit(coarse, sky.with_discs([window]), trace_strong=True)
    assert light.radiance == pytest.approx(fresh.radiance, rel=1e-5, abs=1e-7)
    light.environment = environment
    assert light.radiance == pytest.approx(
        lit(coarse, environment, trace_strong=True).radiance, rel=1e-5, abs=1e-7
    )


def test_an_edit_takes_it_back(coarse):
    """Texels painted over a strong light replace it; beside it they do not touch it."""
    light = lit(coarse, Environment.from_cube(sunny()), trace_strong=True)
    light.edit(0, slice(0, 3), slice(0, 3), np.ones(3))
    assert len(light.strong_lights) == 1
    face, row, column = SUN
    light.edit(face, slice(row - 1, row + 1), slice(column, column + 2), np.full(3, 0.05))
    assert len(light.strong_lights) == 0
    cube = sunny()
    cube[SUN] = 0.05
    cube[0, 0:3, 0:3] = 1
    plain = lit(coarse, Environment.from_cube(cube), trace_strong=False)
    assert light.radiance == pytest.approx(plain.radiance, rel=1e-5, abs=1e-6)


def test_off_is_exactly_nothing(coarse):
    light = lit(coarse, Environment.from_cube(sunny()), trace_strong=True)
    light.environment = Environment.constant((0.0, 0.0, 0.0))
    assert not light.radiance.any()


def test_under_a_fixed_eye(tmp_path):
    """What an eye sees of a lacquered ball: the sun's highlight and shadow by the renderer's BSDF."""
    ball = ball_on_floor()
    lacquer = Material("lacquer", roughness=0.4, specular=1.0)
    scene = replace(ball, materials=(lacquer,), cameras={"front": Camera.framing(ball.positions)})
    bake = bake_environment(
        scene, tmp_path / "ball.prelight", resolution=16, tolerance=0.06, camera="front", bounces=0
    )
    cube = np.full((6, 16, 16, 3), 0.05, np.float32)
    cube[2, 5, 10] = (200.0, 180.0, 150.0)
    environment = Environment.from_cube(cube)
    errors = {}
    for traced in (True, False):
        light = lit(bake, environment, trace_strong=traced)
        errors[traced] = Comparison(light, count=0).run(samples=None)["relative_rms"]
    assert errors[False] > 0.05
    assert errors[True] < 0.01


def test_at_pixels_a_texel_throws_a_penumbra_as_wide_as_it_is(coarse):
    environment = Environment.from_cube(sunny())
    suns = lit(coarse, environment, trace_strong=True).fine_suns
    assert suns is not None
    rng = np.random.default_rng(3)
    points = np.zeros((9000, 3), np.float32)
    points[:, [0, 2]] = rng.uniform(-1.4, 1.4, (9000, 2))
    up = np.tile(np.float32([0, 1, 0]), (9000, 1))
    face, row, column = SUN
    u, v = (2 * (k + rng.random(400)) / R - 1 for k in (column, row))
    anywhere = directions(np.full(400, face), u, v).astype(np.float32)
    free = PlainVisibility(
        PlainOccluders(coarse.receivers.positions, coarse.triangles), origins=points, normals=up
    ).trace(anywhere)[0]
    true = np.unpackbits(free, axis=1, count=9000, bitorder="little").mean(axis=0)
    light = suns.lamp_light_at(points, up)[:, 1]
    share = light / light.max()
    half = (true > 0.02) & (true < 0.98)
    assert half.sum() > 60
    assert np.abs(share - true)[half].mean() < 0.06  # one ray alone: 0.25 or so
    np.testing.assert_allclose(share[~half], true[~half], atol=0.07)

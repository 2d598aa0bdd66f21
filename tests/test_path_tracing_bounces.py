"""The reference of bounced light: white furnaces, closed forms, and its own direct part by other means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.transport.exact import integrate_exactly
from prelight.transport.lamps import LuminousTriangles, SphereLamps, lamp_light, triangle_light
from prelight.transport.path_traced_light import LitScene

from .scenes import ball_on_floor, grid, scene_of


def chamber(albedo: float, *, emission: float = 0.0) -> Scene:
    """A closed box seen from within, one colour, all of it shining."""
    sides = []
    for k in range(3):
        p, t = grid(4, size=2.0, height=-1.0)
        sides += [(np.roll(p, k, axis=1), t), (np.roll(-p * (1, 1, -1), k, axis=1).astype(np.float32), t)]
    scene = scene_of(*sides, albedo=albedo)
    inward = np.einsum("ij,ij->i", scene.positions, scene.normals) < 0
    assert inward.all()
    return replace(scene, materials=(Material(colour=(albedo,) * 3, emission=(emission,) * 3),))


@pytest.mark.parametrize("albedo", [0.0, 0.5, 0.8])
def test_a_white_furnace_is_everywhere_alike(albedo: float) -> None:
    scene = chamber(albedo, emission=2.0)
    found = LitScene(scene, emission=True).light(np.int32([0, 5, 21, 40]), samples=256)
    assert found.direct == pytest.approx(2.0, rel=0.1)
    expected = 2.0 / (1 - albedo)
    sigma = np.sqrt(found.total_variance)
    assert (np.abs(found.total - expected) <= 5 * sigma + 1e-4).all()
    assert found.total.mean() == pytest.approx(expected, rel=0.03)


def test_bounces_are_counted() -> None:
    scene = chamber(0.5, emission=1.0)
    lit, rows = LitScene(scene, emission=True), np.int32([5, 21, 40, 60])
    for bounces in (0, 1, 3):
        found = lit.light(rows, bounces=bounces, samples=2048)
        assert found.total.mean() == pytest.approx(2 - 0.5**bounces, rel=0.01)
        assert (found.indirect == 0).all() == (bounces == 0)


def test_direct_light_of_lamps_is_that_of_shadow_rays() -> None:
    scene = ball_on_floor(side=15, rings=8)
    lamps = SphereLamps(
        np.float32([[1, 1.5, 0.5], [-1, 1.2, 0]]), np.float32([0.15, 0]), np.float32([[9, 5, 1], [3, 3, 3]])
    )
    rows = np.arange(0, len(scene.positions), 5, dtype=np.int32)
    found = LitScene(scene, lamps=lamps).light(rows, bounces=0, samples=4096)
    occluders = Occluders(scene.positions, scene.triangles)
    own = lamp_light(occluders, scene.positions[rows], scene.normals[rows], lamps=lamps, rays=1024).sum(
        axis=1
    )
    assert np.abs(own - found.direct).sum() < 0.02 * found.direct.sum()
    assert abs((own - found.direct).sum()) < 0.005 * found.direct.sum()


def test_direct_light_of_a_luminous_mesh_is_that_of_shadow_rays() -> None:
    roof = grid(3, size=0.8, height=1.4)
    scene = scene_of((roof[0], roof[1][:, ::-1]), grid(11, size=3.0))
    materials = (Material(), Material(emission=(3.0, 2.0, 1.0)))
    scene = replace(scene, materials=materials, material_of=np.repeat([1, 0], [8, 200]).astype(np.int32))
    rows = np.arange(9, 9 + 121, 4, dtype=np.int32)
    found = LitScene(scene, emission=True).light(rows, bounces=0, samples=4096)
    occluders = Occluders(scene.positions, scene.triangles)
    lights = LuminousTriangles.of_scene(scene)
    own = triangle_light(occluders, scene.positions[rows], scene.normals[rows], lights=lights)[:, 0]
    np.testing.assert_allclose(own, found.direct, atol=5 * np.sqrt(found.direct_variance).max() + 1e-4)
    assert own.sum() == pytest.approx(found.direct.sum(), rel=3e-3)


def test_a_sky_that_is_below_zero_in_places_is_integrated_with_its_sign() -> None:
    """A basis function of the sky in each channel, beside the sum over all texels."""
    scene = ball_on_floor(side=15, rings=8)
    rng = np.random.default_rng(4)
    sky = rng.normal(size=(6, 4, 4, 3)).astype(np.float32)
    rows = np.arange(0, len(scene.positions), 11, dtype=np.int32)
    found = LitScene(scene, sky=sky).light(rows, samples=2048)
    # Each texel in 8 × 8 parts: as good as its integral.
    fine = sky.repeat(8, axis=1).repeat(8, axis=2)
    own = integrate_exactly(scene.positions, scene.triangles, scene.normals, receivers=rows, cube=fine)
    off = np.abs(own - found.direct) / np.sqrt(found.direct_variance + 1e-8)
    assert off.max() < 6
    assert found.direct.min() < 0 < found.direct.max()
    halves = [LitScene(scene, sky=np.maximum(s * sky, 0)).light(rows, samples=2048) for s in (1, -1)]
    difference = halves[0].total - halves[1].total - found.total
    sigma = np.sqrt(sum(f.total_variance for f in (*halves, found)))
    assert np.abs(difference / sigma).max() < 6


def test_one_bounce_between_two_parallel_squares() -> None:
    """A small patch under a large roof that a sky below lights evenly: E = ρ L F, F the form factor of its corners."""
    roof = grid(2, size=2.0, height=1.0)
    patch = grid(2, size=1e-3, height=0.0)
    scene = scene_of((roof[0], roof[1][:, ::-1]), patch, albedo=0.6)
    scene = replace(scene, materials=(Material(colour=(0.6,) * 3),))
    sky = np.zeros((6, 1, 1, 3), np.float32)
    sky[3] = 1.0  # −Y: the square below, which lights the roof by a known form factor
    found = LitScene(scene, sky=sky).light(np.int32([4]), bounces=1, samples=200_000)
    rng = np.random.default_rng(0)
    xz = rng.uniform(-1, 1, (100_000, 2))
    arriving = 4 * (1 / (1 + (xz**2).sum(axis=1)) ** 2).mean() / np.pi  # of even light on the roof
    share = _cube_face_irradiance()
    assert found.direct[0, 0] == pytest.approx(0.0, abs=1e-6)
    assert found.indirect[0, 0] == pytest.approx(0.6 * share * arriving, rel=0.02)


def _cube_face_irradiance() -> float:
    """E / π of a surface that faces one face of the sky's cube: the form factor of a square of side 2 at 1."""
    q = np.sqrt(2.0)
    return float(4 * 2 / q * np.arctan(1 / q) / (2 * np.pi))


def test_samples_are_repeatable_and_variance_falls() -> None:
    scene = chamber(0.5, emission=1.0)
    lit, rows = LitScene(scene, emission=True), np.int32([5, 21])
    few, again = lit.light(rows, samples=64), lit.light(rows, samples=64)
    np.testing.assert_array_equal(few.total, again.total)
    assert (lit.light(rows, samples=64, seed=1).total != few.total).any()
    many = lit.light(rows, samples=6400)
    assert 0 < many.total_variance.mean() < few.total_variance.mean() / 90  # stratified: faster than 1/n


def test_the_variance_is_that_of_the_mean() -> None:
    """Means of twenty seeds spread as their variances say, for stratified sets as for single samples."""
    scene = ball_on_floor(side=11, rings=6)
    lamps = SphereLamps(np.float32([[1, 1.5, 0.5]]), np.float32([0.2]), np.float32([[9, 9, 9]]))
    lit, rows = LitScene(scene, lamps=lamps), np.arange(0, len(scene.positions), 9, dtype=np.int32)
    for samples in (32, 1024):
        found = [lit.light(rows, samples=samples, seed=seed) for seed in range(20)]
        means = np.stack([f.total for f in found])
        said = np.mean([f.total_variance for f in found], axis=0)
        lit_ones = said > 1e-12
        assert (means.var(axis=0, ddof=1)[lit_ones] / said[lit_ones]).mean() == pytest.approx(1.0, abs=0.25)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match="nothing shines"):
        LitScene(chamber(0.5))
    with pytest.raises(InputError, match="samples"):
        LitScene(chamber(0.5, emission=1.0), emission=True).light(np.int32([0]), samples=1)

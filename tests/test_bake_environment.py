"""The environment bake is true: closed forms, exact integration, and Mitsuba's path tracer."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

import numpy as np
import pytest

from prelight.baking import environment_plan
from prelight.baking.clustering import ClusterTest, cluster_lights
from prelight.baking.environment import bake_environment, bake_planned
from prelight.baking.environment_plan import plan_environment
from prelight.baking.environment_settings import EnvironmentSettings
from prelight.bases.cube_map import texel_directions
from prelight.bases.quadtree import LeafCover
from prelight.checking.statistics import agreement, sidak_z
from prelight.errors import InputError, OutputError
from prelight.lighting.environment import Environment
from prelight.rays.mitsuba import Occluders
from prelight.relighting.relighter import Relighter
from prelight.transport.direct import DiffuseTransfer
from prelight.transport.exact import integrate_exactly
from prelight.transport.path_tracing import path_traced_radiance

from .scenes import ball_on_floor, grid, plane, scene_of


def gentle_sky(resolution: int) -> np.ndarray:
    """A sky with a broad sun: bounded, so that a path tracer's variance is known well."""
    d = texel_directions(np.arange(6 * resolution**2), resolution).astype(np.float64)
    sun = np.exp(30 * (d @ np.array([0.5, 0.7, 0.51]) - 1))
    sky = 1 + 0.8 * d[:, 1:2] + 6 * sun[:, None] + d[:, :1] * np.array([0.2, 0.0, -0.2])
    return sky.reshape(6, resolution, resolution, 3).astype(np.float32)


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ball")
    return bake_environment(
        ball_on_floor(side=33, rings=20), folder / "ball.prelight", resolution=64, bounces=0
    )


def irradiance(bake, cube) -> np.ndarray:
    """Irradiance / π of all receivers under a cube map."""
    light = Relighter(bake)
    light.environment = Environment.from_cube(cube)
    return light.radiance / bake.receivers.albedo


@pytest.mark.parametrize(("resolution", "bound"), [(63, 1e-3), (256, 1e-4)])
def test_an_open_white_plane_under_a_constant_sky_has_its_albedo(tmp_path, resolution, bound):
    bake = bake_environment(plane(albedo=1.0), tmp_path / "plane.prelight", resolution=resolution, bounces=0)
    light = Relighter(bake)
    light.environment = Environment.constant((2.0, 1.0, 0.5))
    np.testing.assert_allclose(light.radiance, np.tile([2.0, 1.0, 0.5], (144, 1)), rtol=bound)


def test_a_disc_light_on_a_tilted_plane(tmp_path):
    """A disc of angular radius r whose centre makes the angle θ with the normal: E/π = L sin²r cos θ."""
    positions, triangles = grid(9)
    tilt = np.radians(25)
    turn = np.array([[np.cos(tilt), -np.sin(tilt), 0], [np.sin(tilt), np.cos(tilt), 0], [0, 0, 1]])
    scene = scene_of(((positions @ turn.T).astype(np.float32), triangles))
    bake = bake_environment(scene, tmp_path / "tilted.prelight", resolution=128, tolerance=0.002, bounces=0)
    d = texel_directions(np.arange(6 * 128**2), 128).reshape(6, 128, 128, 3)
    centre, radius = np.array([0.36, 0.8, 0.48]), np.radians(12)
    cube = np.repeat((d @ centre > np.cos(radius))[..., None], 3, axis=-1).astype(np.float32) * 40
    expected = 40 * np.sin(radius) ** 2 * (scene.normals[0] @ centre)
    np.testing.assert_allclose(irradiance(bake, cube), np.full((81, 3), expected), rtol=0.01)


@pytest.mark.parametrize(("sky", "bound"), [("gentle", 0.003), ("noise", 0.012)])
def test_against_exact_integration(ball, rng, sky, bound):
    """Noise, every texel for itself and a few a hundred times the rest, is the worst a map can be."""
    noise = (rng.random((6, 64, 64, 3)) ** 12 * 100 + 1).astype(np.float32)
    cube = gentle_sky(64) if sky == "gentle" else noise
    receivers = np.arange(0, len(ball.receivers), 5)
    exact = integrate_exactly(
        ball.receivers.positions, ball.triangles, ball.receivers.normals, receivers=receivers, cube=cube
    )
    ours = irradiance(ball, cube)[receivers]
    assert np.sqrt(((ours - exact) ** 2).sum() / (exact**2).sum()) < bound
    assert abs(ours.sum() / exact.sum() - 1) < 0.002


def test_against_the_path_tracer(ball):
    """Exact integration without bias; the bake within what its tolerance explains."""
    cube = gentle_sky(64)
    used = np.flatnonzero(ball.receivers.normals.any(axis=1))
    # Where ball and floor nearly touch, rays begin and end within the offset of each other.
    clear = used[np.linalg.norm(ball.receivers.positions[used] * [1, 0, 1], axis=1) > 0.02][::3]
    geometry = (ball.receivers.positions, ball.triangles, ball.receivers.normals)
    reference, variance = path_traced_radiance(*geometry, receivers=clear, cube=cube, samples=1024)
    exact = integrate_exactly(*geometry, receivers=clear, cube=cube)
    unbiased = agreement(exact, reference, variance)
    assert unbiased.passing_share >= 0.9975
    assert abs(unbiased.pooled_z) < 3.5
    assert unbiased.noise < 0.02
    ours = irradiance(ball, cube)[clear]
    lossy = agreement(ours, reference, variance, tolerance=0.01 * float(reference.max()))
    assert lossy.passing_share >= 0.9975
    # Test of the test: a bias of half a percent, and one light of a hundred forgotten, are seen.
    assert abs(agreement(exact * 1.005, reference, variance).pooled_z) > 3.5
    dropped = cube.copy()
    dropped.reshape(-1, 3)[np.argsort(cube.sum(axis=-1).ravel())[-60:]] = 0
    without = integrate_exactly(*geometry, receivers=clear, cube=dropped)
    assert abs(agreement(without, reference, variance).pooled_z) > 3.5


def test_blocks_lanes_and_memory_do_not_change_a_byte():
    scene = ball_on_floor(side=17, rings=10)
    transfer = DiffuseTransfer(Occluders(scene.positions, scene.triangles), scene.positions, scene.normals)

    def run(block: int, lanes: int, covered: np.ndarray | None = None):
        found = cluster_lights(
            transfer,
            ClusterTest(27, 0.06, 3),
            covered=np.zeros((0, 5), np.int32) if covered is None else covered,
            block=block,
            lanes=lanes,
        )
        groups = [group for group, _ in found]
        return [
            np.concatenate([getattr(g, name) for g in groups])
            for name in ("leaves", "columns", "scale", "rays")
        ]

    reference = run(4096, 1 << 25)
    assert LeafCover(reference[0], 27).is_complete
    for block, lanes in ((1, 1 << 25), (7, 5000)):
        for expected, found in zip(reference, run(block, lanes), strict=True):
            np.testing.assert_array_equal(expected, found)
    for done in (1, 50, len(reference[0]) - 1):
        for expected, found in zip(reference, run(64, 1 << 25, reference[0][:done]), strict=True):
            np.testing.assert_array_equal(expected[done:], found)


def test_every_accepted_cluster_passed_equation_11(rng):
    """Against transfer vectors made one by one in NumPy, for a sample of the leaves and of their parents."""
    scene = ball_on_floor(side=17, rings=10)
    R, tolerance = 32, 0.02
    transfer = DiffuseTransfer(Occluders(scene.positions, scene.triangles), scene.positions, scene.normals)
    groups = [
        group
        for group, _ in cluster_lights(
            transfer,
            ClusterTest(R, tolerance, 3),
            covered=np.zeros((0, 5), np.int32),
            block=64,
            lanes=1 << 20,
        )
    ]  # fmt: skip
    leaves = np.concatenate([g.leaves for g in groups])
    large = leaves[(leaves[:, 3] * leaves[:, 4]) >= 9]
    for face, row, column, height, width in large[rng.choice(len(large), min(40, len(large)), replace=False)]:
        rows = row + np.array([0, np.rint((height - 1) / 2), height - 1], int)
        columns = column + np.array([0, np.rint((width - 1) / 2), width - 1], int)
        texels = ((face * R + rows[:, None]) * R + columns[None]).ravel()
        d = texel_directions(texels, R)
        T = transfer.values(transfer.trace(d, lanes=1 << 20)[0], d)[:, 0]
        assert (np.sqrt(((T - T.mean(axis=0)) ** 2).mean(axis=1)) < tolerance * 1.0001).all()


def test_odd_and_tiny_resolutions(tmp_path):
    for resolution in (1, 2, 5):
        bake = bake_environment(
            plane(), tmp_path / f"{resolution}.prelight", resolution=resolution, bounces=0
        )
        light = Relighter(bake)
        light.environment = Environment.constant((1.0, 1.0, 1.0))
        assert np.isfinite(light.radiance).all()
        assert light.radiance.max() > 0


def test_a_scene_in_the_dark_still_bakes(tmp_path):
    """Inside a closed octahedron no light arrives: there is no tile to store."""
    corners = np.concatenate([np.eye(3), -np.eye(3)]).astype(np.float32)
    inward = np.array(
        [[0, 2, 1], [0, 1, 5], [0, 5, 4], [0, 4, 2], [3, 1, 2], [3, 5, 1], [3, 4, 5], [3, 2, 4]], np.int32
    )
    scene = scene_of((corners, inward))
    assert ((scene.normals * corners).sum(axis=1) < 0).all()
    bake = bake_environment(scene, tmp_path / "dark.prelight", resolution=4, bounces=0)
    light = Relighter(bake)
    light.environment = Environment.constant((1.0, 1.0, 1.0))
    assert not light.radiance.any()


def test_the_plan_is_within_a_third_of_the_bake(tmp_path):
    """Clusters, rays and bytes; seconds belong to the benchmarks."""
    scene, settings = ball_on_floor(side=49, rings=24), EnvironmentSettings(resolution=64, bounces=0)
    plan = plan_environment(scene, settings)
    bake = bake_planned(scene, tmp_path / "ball.prelight", plan=plan)
    layer = bake.layers["environment"]
    assert plan.clusters == pytest.approx(layer.coefficients, rel=0.3)
    assert plan.rays == pytest.approx(layer.rays, rel=0.3)
    assert plan.bytes == pytest.approx(bake.manifest.bytes_of(""), rel=0.3)


def tree_digest(folder: Path) -> str:
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            digest.update(str(path.relative_to(folder)).encode() + path.read_bytes())
    return digest.hexdigest()


def test_the_same_bake_twice_is_the_same_bytes_whatever_the_memory(tmp_path):
    scene = ball_on_floor(side=17, rings=10)
    paths = [tmp_path / name / "a.prelight" for name in ("one", "two")]
    for path, memory in zip(paths, (None, 500_000_000), strict=True):
        path.parent.mkdir()
        bake_environment(scene, path, resolution=16, memory=memory, bounces=0)
    assert tree_digest(paths[0]) == tree_digest(paths[1])


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"resolution": 0}, "resolution"),
        ({"resolution": 4097}, "resolution"),
        ({"resolution": 2.5}, "resolution"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": float("nan")}, "tolerance"),
        ({"epsilon": -1.0}, "epsilon"),
        ({"tolerance": 0.01, "epsilon": 1e-5}, "not both"),
        ({"samples_per_side": 1}, "samples-per-side"),
        ({"memory": 10}, "memory"),
        ({"zones": 0}, "zones"),
        ({"zones": -3}, "zones"),
        ({"zones": 4097}, "zones"),
        ({"zones": 2.0}, "zones"),
        ({"zones": True}, "zones"),
        ({"zones": "many"}, "zones"),
        ({"receivers": "faces"}, "receivers"),
        ({"receivers": "pixels"}, "camera"),
        ({"pixel_samples": 3}, "square"),
        ({"pixel_samples": 81}, "pixel-samples"),
        ({"width": 0}, "width"),
        ({"height": 4096}, "height"),
    ],
)
def test_settings_out_of_range_are_refused(options, name):
    with pytest.raises(InputError, match=name):
        EnvironmentSettings(**options)


def test_sidaks_z():
    assert sidak_z(1, alpha=0.05) == pytest.approx(1.959964, abs=1e-5)
    assert sidak_z(1000) > sidak_z(10) > 2.5


def test_a_disk_that_is_too_small_is_said_before_any_ray(tmp_path, monkeypatch):
    scene = plane()
    plan = plan_environment(scene, EnvironmentSettings(resolution=4, bounces=0))
    full = shutil.disk_usage(tmp_path)._replace(free=plan.bytes // 2)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: full)
    with pytest.raises(OutputError, match="are free"):
        bake_planned(scene, tmp_path / "a.prelight", plan=plan)
    assert not list(tmp_path.iterdir())


def test_more_clusters_than_a_manifest_lists_are_refused(monkeypatch):
    monkeypatch.setattr(environment_plan, "MOST_PARCELS", 0)
    with pytest.raises(InputError, match="clusters"):
        plan_environment(ball_on_floor(side=9, rings=6), EnvironmentSettings(resolution=8, bounces=0))

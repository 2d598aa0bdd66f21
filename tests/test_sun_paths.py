"""Where the sun stands the tree is finer: the band of the sky is the astronomers', and a sun there is nearly exact."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from prelight.baking.environment import bake_environment
from prelight.baking.environment_plan import plan_environment
from prelight.baking.environment_settings import EnvironmentSettings
from prelight.baking.sun_paths import SunPaths
from prelight.bases.cube_map import texel_directions
from prelight.bases.quadtree import Nodes, roots, split
from prelight.camera import Camera
from prelight.errors import InputError
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.material import Material
from prelight.relighting.relighter import Relighter
from prelight.transport.exact import integrate_exactly

from .scenes import ball_on_floor
from .workshop import assert_refusal

R = 32


def sun_at(latitude: float, *, day: float, hour: float) -> np.ndarray:
    """Direction of the sun; ``day`` and ``hour`` angles in degrees from the northern spring and from noon."""
    declination = np.arcsin(np.sin(np.radians(23.44)) * np.sin(np.radians(day)))
    turn, up = np.radians(hour), np.radians(latitude)
    # In the plane of the equator (towards the meridian, east) and along the pole; then as seen from there.
    meridian, east = np.cos(declination) * np.cos(turn), -np.cos(declination) * np.sin(turn)
    south = meridian * np.sin(up) - np.sin(declination) * np.cos(up)
    height = meridian * np.cos(up) + np.sin(declination) * np.sin(up)
    return np.array([east, height, south])


def texel_of(d: np.ndarray, resolution: int) -> Nodes:
    nearest = int((texel_directions(np.arange(6 * resolution**2), resolution) @ d).argmax())
    return np.array(
        [[nearest // resolution**2, nearest // resolution % resolution, nearest % resolution, 1, 1]]
    )


@pytest.mark.parametrize("latitude", [-60.0, 0.0, 48.2, 90.0])
def test_no_hour_of_the_year_is_left_out(latitude, rng):
    """Every node around it, from the texel up to the face; and under the horizon there is no need."""
    paths, everywhere = SunPaths.read(latitude), SunPaths.read("any")
    for day, hour in rng.uniform(0, 360, (30, 2)):
        d = sun_at(latitude, day=day, hour=hour)
        if d[1] <= 0:
            continue
        nodes = roots(64)
        texel = texel_of(d, 64)[0]
        while True:
            _, row, column, height, width = nodes.T
            inside = (nodes[:, 0] == texel[0]) & (row <= texel[1]) & (texel[1] < row + height)
            node = nodes[inside & (column <= texel[2]) & (texel[2] < column + width)]
            assert paths.meet(node, 64)[0]
            assert everywhere.meet(node, 64)[0]
            if node[0, 3] == 1:
                break
            nodes = split(node)[0]


@pytest.mark.parametrize(
    ("latitude", "direction", "is_met"),
    [
        (0.0, (0, 1, 0), True), (0.0, (0, 1, 1), False), (0.0, (1, 0.02, 0), True),  # overhead at the equator
        (45.0, (0, 1, 1), True), (45.0, (0, 1, -1), False), (45.0, (0, 1, 0), False),  # equinox at noon; never north
        (45.0, (0, np.tan(np.radians(68)), 1), True), (45.0, (0, np.tan(np.radians(71)), 1), False),  # midsummer
        (-45.0, (0, 1, -1), True), (-45.0, (0, 1, 1), False),  # in the south it stands in the north
        (90.0, (0, np.tan(np.radians(22)), 1), True), (90.0, (0, np.tan(np.radians(26)), -1), False),
        (45.0, (0, -1, 1), False), ("any", (0, 1, 0), True), ("any", (1, 0.5, -1), True), ("any", (1, -1, 0), False),
    ],
)  # fmt: skip
def test_the_band_is_where_the_sun_stands(latitude, direction, is_met):
    d = np.array(direction) / np.linalg.norm(direction)
    assert SunPaths.read(latitude).meet(texel_of(d, 256), 256)[0] == is_met


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    """A ball on a floor, with the sun's paths and without."""
    folder = tmp_path_factory.mktemp("suns")
    return {
        paths: bake_environment(
            ball_on_floor(), folder / f"{paths}.prelight", resolution=R, bounces=0, sun_paths=paths
        )
        for paths in (None, 45, "any")
    }


@pytest.mark.parametrize("paths", [45, "any"])
def test_a_sun_from_clusters_alone(baked, paths):
    """Under 1 % on average, where it is several without; the rest of the sky costs what it did."""
    suns = [
        sun_at(45, day=day, hour=hour) for day, hour in ((0, 0), (90, 50), (200, -30), (120, -70), (260, 20))
    ]
    errors = {paths: [], None: []}
    for d in suns:
        cube = Environment.dark().with_disc(Disc(tuple(d), 0.27, (1e4, 9e3, 8e3))).cube(R)
        for which, found in errors.items():
            light = Relighter(baked[which], trace_strong=False)
            light.environment = Environment.from_cube(cube)
            receivers = light.bake.receivers
            true = integrate_exactly(
                receivers.positions, light.bake.triangles, receivers.normals,
                receivers=np.arange(len(receivers), dtype=np.int32), cube=cube,
            ) * receivers.albedo  # fmt: skip
            found.append(np.abs(light.radiance - true).sum() / true.sum())
    assert np.mean(errors[paths]) < 0.01
    assert np.mean(errors[None]) > 0.02
    below = [Relighter(baked[which]).clusters() for which in (paths, None)]
    counts = [len(clusters[clusters[:, 0] == 3]) for clusters in below]  # −Y: no sun
    assert counts[0] == counts[1]
    assert baked[paths].layers["environment"].parameters["sun_paths"] == paths


def test_a_sun_on_gloss_without_rays(tmp_path):
    """What it is for: materials whose light only the renderer could trace, relit without it."""
    glossy = Material(colour=(0.5, 0.2, 0.1), roughness=0.5)
    scene = dataclasses.replace(ball_on_floor(side=17, rings=9), materials=(glossy,))
    errors = []
    for paths in (None, 45):
        bake = bake_environment(
            scene, tmp_path / f"{paths}.prelight", resolution=24, bounces=0, sun_paths=paths,
            camera=Camera((0.3, 2.0, 2.5), (0.0, 0.0, 0.0)),
        )  # fmt: skip
        alone, traced = Relighter(bake, trace_strong=False), Relighter(bake)
        found = []
        for day, hour in ((0, 0), (90, 50), (200, -30), (120, -70)):
            sky = Environment.dark().with_disc(Disc(tuple(sun_at(45, day=day, hour=hour)), 0.27, (1e4,) * 3))
            alone.environment = traced.environment = sky
            assert len(traced.strong_lights)
            found.append(np.abs(alone.radiance - traced.radiance).sum() / traced.radiance.sum())
        errors.append(np.mean(found))
    assert errors[1] < 0.01
    assert errors[0] > 0.02


def test_the_plan_knows_what_it_costs():
    scene = ball_on_floor()
    plans = [
        plan_environment(scene, EnvironmentSettings(resolution=R, bounces=0, sun_paths=paths))
        for paths in (None, 45)
    ]
    assert plans[1].clusters > 1.3 * plans[0].clusters
    assert plans[1].summary()["sun_paths"] == 45
    assert "sun_paths" not in plans[0].summary()


@pytest.mark.parametrize("value", ["91", "-90.5", "nan", "noon", "", True, [45]])
def test_other_latitudes_are_refused(value):
    with pytest.raises(InputError, match="expected a latitude from -90 to 90 degrees, or any"):
        EnvironmentSettings(sun_paths=value)


def test_the_command_asks_plans_and_tells(prelight, tmp_path):
    command = ["bake", "environment", "stock:sculpture-small", "--resolution", 4, "--bounces", 0]
    assert_refusal(prelight(*command, "--sun-paths", "noon", "--dry-run"), 2, "latitude")
    plan = json.loads(prelight(*command, "--sun-paths=-33", "--dry-run", "--json").out)
    assert plan["sun_paths"] == -33
    target = tmp_path / "sun.prelight"
    assert prelight(*command, "--sun-paths=-33", "-o", target, "--json").code == 0
    assert "latitude -33°" in prelight("inspect", target).out

"""A glass ball in a cloud of lights: every light of the grid has its caustic, lamps between them a mixture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from prelight.baking.cloud import bake_cloud
from prelight.baking.cloud_caustics import CloudCaustics
from prelight.baking.cloud_plan import plan_cloud
from prelight.baking.cloud_settings import CloudSettings
from prelight.errors import InputError
from prelight.lighting.placed_lights import Lamp
from prelight.material import Material
from prelight.relighting.cloud import CloudRelighter
from prelight.scene.geometry import Scene
from prelight.transport.lamps import SphereLamps
from prelight.transport.photon_mapping import PhotonMap
from prelight.transport.photon_sources import SphereSource
from prelight.transport.photon_tracing import BATCH, CAUSTIC

from .glass import GREEN_GLASS, ball_in_room
from .rooms import SIZE, room

WITH = CloudSettings(
    lights=18, box=((1.2, 1.6, 1.6), (3.0, 2.6, 3.4)), radius=0.05, modes=0, interpolation="kernel", zone=4096,
    clusters=8, coefficients=16, gather_rays=256, photons=1 << 14, w1=1e-6, w2=1e6,
)  # fmt: skip


def crystal_room() -> Scene:
    return ball_in_room(material=GREEN_GLASS, cells=12)


@pytest.fixture(scope="module")
def path(tmp_path_factory) -> Path:
    return bake_cloud(crystal_room(), tmp_path_factory.mktemp("cloud") / "a.prelight", settings=WITH).path


def lamp_at(place: np.ndarray) -> Lamp:
    """Of 1 W/sr, as the grid's lights."""
    x, y, z = place.tolist()
    return Lamp.of_power((x, y, z), (4 * np.pi,) * 3, radius=0.05)


def floor_of(scene: Scene) -> np.ndarray:
    return np.flatnonzero((scene.positions[:, 1] == 0) & (scene.normals[:, 1] > 0.9))


def test_a_lamp_on_a_light_of_the_grid_has_its_own_caustic(path) -> None:
    scene = crystal_room()
    plan, live, floor = plan_cloud(scene, WITH), CloudRelighter(path), floor_of(scene)
    places = plan.grid.positions.astype(np.float64)
    first, last = places[0], places[-1]
    mapped = PhotonMap(
        scene, plan.ground.occluders,
        SphereSource(SphereLamps(np.float32([first]), np.float32([0.05]), np.full((1, 3), 4 * np.pi, np.float32))),
        ways=CAUSTIC,
    )  # fmt: skip
    mapped.more(BATCH)
    C = mapped.light().light[floor, 0]
    live.shine([lamp_at(first)])
    here = live.indirect[floor]
    live.shine([lamp_at(last)])
    there = live.indirect[floor]
    bright = np.argsort(C[:, 1])[-6:]
    assert C[bright, 1].mean() > 2 * np.median(here[:, 1]), "so that it would be missed"
    np.testing.assert_allclose((here - there)[bright, 1].mean(), C[bright, 1].mean(), rtol=0.2)
    assert (here - there)[bright, 0].mean() < 0.4 * C[bright, 1].mean(), "it is green"
    live.shine([lamp_at(place) for place in (first, last)])
    np.testing.assert_allclose(live.indirect[floor], here + there, atol=1e-5 * here.max())
    live.shine([])
    assert not live.irradiance.any()


def test_each_light_of_a_part_has_the_caustic_that_it_has_alone() -> None:
    scene = crystal_room()
    caustics = CloudCaustics(plan_cloud(scene, WITH))
    places = np.array([[1.4, 2.2, 2.0], [2.8, 2.0, 3.2]])
    both = caustics.of(places)
    for k in range(2):
        alone = caustics.of(places[k : k + 1])[:, 0]
        assert both[:, k, 1].sum() == pytest.approx(alone[:, 1].sum(), rel=0.05)
        lit = alone[:, 1] > 0.2 * alone[:, 1].max()
        assert both[lit, k, 1].mean() == pytest.approx(alone[lit, 1].mean(), rel=0.1)


def test_photons_are_traced_only_where_a_material_needs_them() -> None:
    settings = CloudSettings(lights=2, box=((1, 1, 1), tuple(0.7 * s for s in SIZE)), photons=None)
    assert plan_cloud(room(3), settings).photons == 0
    plan = plan_cloud(crystal_room(), settings)
    assert plan.photons == 1 << 16
    assert not plan.notes
    for wrong in (-1, 1 << 40, 2.5):
        with pytest.raises(InputError, match="photons"):
            CloudSettings(photons=wrong)


def test_a_material_that_photons_cannot_carry_is_refused_before_anything_is_paid() -> None:
    scene = crystal_room()
    hair = replace(scene, materials=(Material("fur", bsdf={"type": "hair"}), *scene.materials[1:]))
    settings = CloudSettings(lights=2, box=((1, 1, 1), tuple(0.7 * s for s in SIZE)))
    with pytest.raises(InputError, match="fur: its bsdf hair scatters as fibres do"):
        plan_cloud(hair, settings)

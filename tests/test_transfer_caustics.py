"""A glass ball in a transfer bake: the caustic of a lamp, a beam and a panel, wherever they are moved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from prelight.baking import transfer as baking
from prelight.baking.transfer import bake_transfer, identity
from prelight.baking.transfer_plan import plan_transfer
from prelight.baking.transfer_settings import TransferSettings
from prelight.checking.placed_emitters import emitter_of
from prelight.errors import InputError
from prelight.lighting.distributions import Power
from prelight.lighting.placed_lights import Lamp, PlacedLight, PlacedPanel
from prelight.lighting.spot import Spot
from prelight.rays.mitsuba import Occluders
from prelight.relighting.transfer import TransferRelighter
from prelight.scene.geometry import Scene
from prelight.scene.variant import mitsuba
from prelight.storage.bake import Bake
from prelight.transport.caustic_light import CausticLight
from prelight.transport.path_traced_light import LitScene
from prelight.transport.vantage import vantage_points

from .glass import FLOOR, GREEN_GLASS, ball, floor, joined

CELLS = 110
SETTINGS = TransferSettings(gather_rays=64, entries=64, modes=12)
TOWARD = (-0.25, -1.0, -0.15)
LAMP = Lamp((0.5, 2.0, 0.3), Spot((3.0, 3.0, 2.0), direction=TOWARD), 0.15)
BEAM = Lamp((0.5, 2.0, 0.3), Spot((3.0, 3.0, 2.0), direction=TOWARD, distribution=Power.of_width(40)), 0.15)
PANEL = PlacedPanel((0.5, 1.8, 0.3), (0.3, 0.2), Spot((20.0, 20.0, 20.0), direction=TOWARD))


def scene() -> Scene:
    return joined(
        floor(size=1.6, cells=CELLS), *ball(radius=0.25, centre=(0.0, 0.27, 0.0), rings=40), GREEN_GLASS
    )


@pytest.fixture(scope="module")
def bake(tmp_path_factory) -> Bake:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(baking, "TRIALS", 31)
        return bake_transfer(scene(), tmp_path_factory.mktemp("glass") / "a.prelight", settings=SETTINGS)


@pytest.mark.parametrize("light", [LAMP, BEAM, PANEL], ids=["lamp", "beam", "panel"])
def test_a_caustic_is_the_path_tracers(bake: Bake, light: PlacedLight) -> None:
    """All light, where the caustic brings a tenth of its brightest: within 5 % in the mean.

    Some 3 % are missing: light of the floor that goes through the ball to the floor again.
    """
    live, whole = TransferRelighter(bake), scene()
    live.shine([light])
    sent = live.indirect[:, 1]
    rows = np.flatnonzero(sent > 0.1 * sent.max()).astype(np.int32)
    assert len(rows) > 100
    rows = rows[:: len(rows) // 100]
    assert sent.max() > 2 * live.direct[:, 1].max(), "so that it would be missed"
    origins = vantage_points(whole, Occluders(whole.positions, whole.triangles))
    lit = LitScene(whole, emitters=[emitter_of(mitsuba(), light)])
    seen = lit.light(rows, origins=origins, samples=1 << 13, seed=3).total
    np.testing.assert_allclose(
        np.abs(live.irradiance[rows] - seen).mean(axis=0) / seen.mean(axis=0), 0, atol=0.05
    )
    np.testing.assert_allclose(live.irradiance[rows].mean(axis=0), seen.mean(axis=0), rtol=0.04)


def test_it_follows_the_light_and_depends_on_nothing_else(bake: Bake) -> None:
    live = TransferRelighter(bake, shadow_rays=2)
    live.shine([LAMP])
    dragged = live.indirect
    moved = replace(LAMP, position=(-0.5, 2.0, -0.3))
    live.shine([moved])
    brightest = live.bake.receivers.positions[np.argmax(live.indirect[:, 1])]
    assert brightest[0] > 0.03  # across the ball from the lamp
    live.shadow_rays = 16
    live.shine([LAMP])
    assert not np.array_equal(live.indirect, dragged), "more photons at rest"
    assert np.abs(live.indirect - dragged).mean() < 0.1 * dragged.mean()
    fresh = TransferRelighter(bake)
    fresh.shine([LAMP])
    np.testing.assert_array_equal(live.irradiance, fresh.irradiance)
    live.shine([replace(LAMP, beam=replace(LAMP.beam, intensity=(0.0, 0.0, 0.0)))])
    assert not live.irradiance.any()


def test_light_that_is_linear_over_triangles_is_found_again() -> None:
    """Photons from a far point straight down on a bare floor, each landing where it would: E / π everywhere."""
    from prelight.transport.photon_tracing import Photons

    ground, n = scene(), 1 << 18
    rng = np.random.default_rng(1)
    triangle = rng.integers(0, 2 * CELLS * CELLS, n)  # all of one size
    a, b = np.sort(rng.random((2, n)), axis=0)
    corners = ground.positions[ground.triangles[triangle]].astype(np.float64)
    weights = np.stack([a, b - a, 1 - b], axis=1)
    places = np.einsum("nk,nkc->nc", weights, corners).astype(np.float32)
    power = np.repeat(((places[:, 0] + 1) * 1.6 * 1.6)[:, None], 3, axis=1).astype(np.float32)
    way = np.zeros((n, 3), np.float32)
    landed = Photons(
        places, power, way, way, triangle.astype(np.int32), np.zeros(n, np.int32), np.zeros(n, np.uint8), n
    )
    found = CausticLight(ground, Occluders(ground.positions, ground.triangles)).at_vertices(landed)
    inner = (np.abs(ground.positions[:, [0, 2]]) < 0.7).all(axis=1) & (ground.positions[:, 1] == 0)
    expected = (ground.positions[inner, 0] + 1) / np.pi
    noise = CELLS / np.sqrt(n)
    assert abs(found[inner, 0].mean() / expected.mean() - 1) < 0.01
    assert np.abs(found[inner, 0] - expected).mean() < 2 * noise * expected.mean()


def test_nothing_is_traced_where_no_glass_is_or_none_is_asked_for(bake: Bake, tmp_path: Path) -> None:
    plain, glass = floor(size=1.0, cells=4), scene()
    assert "caustics" not in identity(plan_transfer(plain, SETTINGS))
    assert identity(plan_transfer(glass, SETTINGS))["caustics"] == 1
    without = replace(SETTINGS, caustics=False)
    assert "caustics" not in identity(plan_transfer(glass, without))
    assert bake.layers["transfer"].parameters["caustics"] == 1
    assert plan_transfer(glass, SETTINGS).notes == ()
    assert "green glass" in plan_transfer(glass, without).notes[0]
    hairy = replace(glass, materials=(replace(FLOOR, bsdf={"type": "hair"}), GREEN_GLASS))
    with pytest.raises(InputError, match="hair scatters"):
        plan_transfer(hairy, SETTINGS)

"""Rooms through their portals, against what is known: form factors, a furnace, sums, a path tracer."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from prelight.baking.portals import bake_planned, bake_portals
from prelight.baking.portals_plan import plan_portals
from prelight.baking.portals_room import PortalsRoom
from prelight.baking.portals_settings import PortalsSettings
from prelight.bases.harmonic_cells import spectrum_of
from prelight.errors import InputError, InterruptedBakeError
from prelight.lighting.environment import Environment
from prelight.lighting.glass import Glass
from prelight.lighting.rig import Rig
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.portals import PortalWish
from prelight.transport import portal_light
from prelight.transport.path_traced_light import LitScene, as_diffuse

from .disk import tree
from .portal_rooms import (
    QUICK,
    portals_of,
    skylight_form_factor,
    two_windows,
    under_glass,
    with_glass,
)
from .rooms import rectangle

EVEN = Environment.constant((1.0, 1.0, 1.0))
SKY = Environment.stock("overcast")
SHUT_LEFT, SHUT_RIGHT = (Glass(f"{side} glass", "shut") for side in ("left", "right"))


@pytest.fixture(scope="module")
def windows(tmp_path_factory) -> PortalsRelighter:
    return portals_of(two_windows(), tmp_path_factory.mktemp("windows") / "a.prelight")


def lit(room: PortalsRelighter, environment: Environment, *glass: Glass) -> np.ndarray:
    room.light(Rig(environment, portals=glass))
    return room.irradiance


# ---- closed forms --------------------------------------------------------------------------------


def skylight_error(path: Path, *, rays: int = 4096) -> float:
    """The largest relative error of an even sky through a rectangle above a floor, against its form factor."""
    low, high, height = (-0.5, -0.3), (0.7, 0.9), 1.2
    floor = rectangle((-2, 0, -2), (0, 0, 4), (4, 0, 0), cells=9)
    glass = rectangle((low[0], height, low[1]), (high[0] - low[0], 0, 0), (0, 0, high[1] - low[1]), cells=3)
    room = portals_of(with_glass((floor,), {"glass": [glass]}), path, bounces=0, rays=rays)
    found = lit(room, EVEN)[: len(floor[0]), 0]
    known = skylight_form_factor(floor[0][:, [0, 2]], low, high, height)
    return float(np.abs(found / known - 1).max())


def test_a_floor_under_a_skylight_has_its_form_factor(tmp_path) -> None:
    assert skylight_error(tmp_path / "a.prelight") < 0.004


@pytest.mark.parametrize("fault", ["cosine", "area", "distance"])
def test_seeded_faults_at_the_portal_are_found(tmp_path, monkeypatch, fault) -> None:
    honest = portal_light._Panes.points

    def wrong(self, pane, numbers):
        point, normal, area = honest(self, pane, numbers)
        if fault == "cosine":  # the pane turned by 30°
            normal = type(normal)(0.5, 0.8660254, 0.0) + 0 * normal
        if fault == "area":
            area = area * 1.02
        if fault == "distance":  # points crowded toward a triangle's corner
            numbers = (numbers[0] * numbers[0], *numbers[1:])
            point, normal, area = honest(self, pane, numbers)
        return point, normal, area

    monkeypatch.setattr(portal_light._Panes, "points", wrong)
    assert skylight_error(tmp_path / "a.prelight") > 0.015


def test_a_white_room_in_an_even_sky_is_as_bright_as_the_sky(tmp_path) -> None:
    """The furnace: no light is lost or made, and none counted twice between direct and bounced."""
    room = portals_of(under_glass(albedo=1.0), tmp_path / "a.prelight", gather_rays=1024)
    inside = room.layer.receiver
    irradiance = lit(room, EVEN)
    assert np.abs(irradiance[np.unique(inside)] - 1).mean() < 0.01
    assert np.abs(room.direct[np.unique(inside)]).max() < 1.02


def test_order_0_alone_carries_an_even_sky(tmp_path) -> None:
    scene = two_windows()
    low = lit(portals_of(scene, tmp_path / "0.prelight", order=0), EVEN)
    high = lit(portals_of(scene, tmp_path / "4.prelight", order=4), EVEN)
    assert np.abs(low - high).mean() < 0.005 * high.mean()


def test_what_stands_outside_a_window_shadows_it(tmp_path) -> None:
    """Backward occlusion: half of the sky above a skylight, behind a wall that never ends."""
    floor = rectangle((-2, 0, -2), (0, 0, 4), (4, 0, 0), cells=4)
    glass = rectangle((-1, 1, -1), (2, 0, 0), (0, 0, 2), cells=2)
    # Over the glass, from z = 0 on: from the middle of the floor it hides what is beyond.
    screen = rectangle((-50, 1.05, 0), (100, 0, 0), (0, 0, 50), cells=2)
    whole = portals_of(with_glass((floor,), {"glass": [glass]}), tmp_path / "a.prelight", bounces=0)
    half = portals_of(with_glass((floor, screen), {"glass": [glass]}), tmp_path / "b.prelight", bounces=0)
    middle = len(floor[0]) // 2
    assert floor[0][middle].tolist() == [0, 0, 0]
    ratio = lit(half, EVEN)[middle, 0] / lit(whole, EVEN)[middle, 0]
    assert abs(ratio - 0.5) < 0.01


def test_two_sheets_of_one_window_count_once(tmp_path) -> None:
    one = lit(portals_of(two_windows(), tmp_path / "a.prelight", bounces=0), EVEN)
    scene = two_windows(slab=True)
    two = lit(portals_of(scene, tmp_path / "b.prelight", bounces=0), EVEN)[: len(one)]
    assert abs(two.mean() / one.mean() - 1) < 0.02


# ---- portals add ---------------------------------------------------------------------------------


def test_portals_add(windows) -> None:
    both = lit(windows, SKY)
    left, right = lit(windows, SKY, SHUT_RIGHT), lit(windows, SKY, SHUT_LEFT)
    assert left.max() > 0
    assert right.max() > 0
    assert np.abs(left + right - both).max() < 1e-5 * both.max()


def test_one_portal_alters_its_share_alone(windows) -> None:
    before = lit(windows, SKY)
    share = lit(windows, SKY, SHUT_RIGHT)
    tinted = lit(windows, SKY, Glass("left glass", tint=(0.5, 0.25, 0.0)))
    expected = before + share * (np.float32([0.5, 0.25, 0.0]) - 1)
    assert np.abs(tinted - expected).max() < 1e-5 * before.max()
    assert windows.last.clusters == 0, "a tint reads no row of direct light"


def test_shut_is_exactly_dark(windows) -> None:
    assert (lit(windows, SKY, Glass("*", "shut")) == 0).all()
    assert (lit(windows, SKY, Glass(blind=1.0)) == 0).all()
    assert (lit(windows, Environment.dark()) == 0).all()


def test_a_state_does_not_depend_on_what_came_before(windows) -> None:
    rig = Rig(SKY, portals=(Glass("left glass", "frosted", frost_deg=20.0, blind=0.3),))
    windows.light(rig)
    first = windows.irradiance
    lit(windows, EVEN, Glass("*", "shut"))
    assert windows.light(rig)
    assert (windows.irradiance == first).all()
    assert not windows.light(rig), "nothing changed"


def test_light_is_linear(windows) -> None:
    once = lit(windows, SKY)
    assert np.allclose(lit(windows, SKY.scaled(3.0)), 3 * once, rtol=1e-5, atol=1e-6 * once.max())
    blind = lit(windows, SKY, Glass(blind=0.75))
    assert np.allclose(blind, once / 4, rtol=1e-5, atol=1e-6 * once.max())


def test_shells_of_their_own_are_what_each_window_shows(windows) -> None:
    n = windows.layer.cube
    red, blue = (np.zeros((6, n, n, 3), np.float32) for _ in range(2))
    red[..., 0], blue[..., 2] = 1, 1
    windows.set_shells(np.stack([red, blue]), [Glass()] * 2)
    found = windows.irradiance
    left, right = lit(windows, EVEN, SHUT_RIGHT), lit(windows, EVEN, SHUT_LEFT)
    assert np.allclose(found[:, 0], left[:, 0], atol=1e-6)
    assert np.allclose(found[:, 2], right[:, 2], atol=1e-6)
    assert (found[:, 1] == 0).all()
    with pytest.raises(InputError, match="portals or 1"):
        windows.set_shells(np.ones((3, 6, n, n, 3), np.float32))


def test_cut_portals_bring_what_one_brings(tmp_path) -> None:
    scene = two_windows()
    whole = portals_of(scene, tmp_path / "a.prelight", rays=4096)
    cut = portals_of(scene, tmp_path / "b.prelight", wish=PortalWish(exterior_distance=5.0), rays=4096)
    assert len(cut.layer.names) >= 8
    assert cut.layer.names[0] == "left glass 1"
    assert abs(cut.layer.areas.sum() / whole.layer.areas.sum() - 1) < 1e-5
    a, b = lit(whole, SKY), lit(cut, SKY)
    assert np.abs(a - b).mean() < 0.02 * a.mean()


def test_one_portal_with_its_colours_baked_in(tmp_path) -> None:
    scene = two_windows(tints={"left glass": (0.9, 0.3, 0.1), "right glass": (0.2, 0.4, 0.9)})
    each = portals_of(scene, tmp_path / "a.prelight")
    one = portals_of(scene, tmp_path / "b.prelight", wish=PortalWish(group="one"))
    assert one.layer.names == ("all",)
    assert len(one.layer.portal_of_pane) == 2
    a, b = lit(each, SKY), lit(one, SKY)
    assert np.allclose(each.direct, one.direct, rtol=1e-5, atol=1e-6)
    assert np.abs(a - b).mean() < 0.01 * a.mean()


# ---- the path tracer -----------------------------------------------------------------------------


def test_against_the_path_tracer(tmp_path) -> None:
    """Direct and bounced light apart, at vertices of the floor and the far wall; the path tracer's noise allowed."""
    scene = two_windows(cells=16, albedo=0.6)
    settings = PortalsSettings(rays=4096)
    room = PortalsRoom(scene, settings)
    light = PortalsRelighter(bake_portals(scene, tmp_path / "a.prelight", settings=settings))
    light.light(Rig(SKY))
    chosen = np.arange(0, 17 * 17 * 2, 7, dtype=np.int32)  # floor and ceiling
    truth = LitScene(as_diffuse(room.open), sky=SKY.cube(32)).light(
        chosen, origins=room.origins, samples=1024
    )
    direct = light.direct[chosen]
    bounced = light.irradiance[chosen] - direct
    for found, known, variance in (
        (direct, truth.direct, truth.direct_variance), (bounced, truth.indirect, truth.indirect_variance),
    ):  # fmt: skip
        noise = np.sqrt(variance).mean() / known.mean()
        assert np.abs(found - known).mean() / known.mean() < 0.02 + noise
        assert abs((found - known).mean() / known.mean()) < 0.01 + 3 * noise / math.sqrt(len(chosen))


def test_direct_light_is_the_same_with_bounces_and_without(tmp_path, windows) -> None:
    alone = portals_of(two_windows(), tmp_path / "a.prelight", bounces=0)
    expected = lit(alone, SKY)
    lit(windows, SKY)
    assert (windows.direct == expected).all()
    assert (windows.irradiance > windows.direct - 1e-4).all()


# ---- orders --------------------------------------------------------------------------------------


def test_a_smaller_portal_needs_a_higher_order(tmp_path) -> None:
    """The paper's section 4.2: the energy of each order, Eqs. 4 and 5."""
    held = []
    for k, share in enumerate((1.0, 0.25)):
        floor = rectangle((-2, 0, -2), (0, 0, 4), (4, 0, 0), cells=12)
        lid = rectangle((-2, 1.5, -2), (4, 0, 0), (0, 0, 4), cells=12)
        h = 0.8 * share
        frame = tuple(
            rectangle((x, 1.2, z), (a, 0, 0), (0, 0, b), cells=1)
            for x, z, a, b in (
                (-9, -9, 18, 9 - h),
                (-9, h, 18, 9 - h),
                (-9, -h, 9 - h, 2 * h),
                (h, -h, 9 - h, 2 * h),
            )
        )
        del lid
        glass = rectangle((-h, 1.2, -h), (2 * h, 0, 0), (0, 0, 2 * h), cells=2)
        room = portals_of(
            with_glass((floor, *frame), {"glass": [glass]}), tmp_path / f"{k}.prelight", order=6
        )
        energy = room.layer.energy[0].sum(axis=1)
        assert (energy >= 0).all()
        held.append(np.cumsum(energy) / energy.sum())
    assert held[0][2] > held[1][2] + 0.02


def test_the_order_is_chosen_for_an_accuracy(tmp_path) -> None:
    low = portals_of(two_windows(), tmp_path / "a.prelight", order=8, accuracy=0.6)
    high = portals_of(two_windows(), tmp_path / "b.prelight", order=8, accuracy=0.97)
    assert 2 <= low.layer.order < high.layer.order <= 8
    same = low.layer.energy
    assert np.allclose(high.layer.energy[:, : same.shape[1]], same, rtol=2e-2), (
        "a higher order goes on from a lower"
    )
    # A sky that is nearly even wants less.
    mild = spectrum_of(Environment.stock("overcast").cube(32), 12)
    assert mild[0] > 2 * sum(mild[1:])
    even = portals_of(two_windows(), tmp_path / "c.prelight", order=8, accuracy=0.97, spectrum=mild)
    assert even.layer.order < high.layer.order


def test_many_portals_have_modes_of_their_own(tmp_path) -> None:
    scene = two_windows()
    wish = PortalWish(exterior_distance=5.0)
    mixed = portals_of(scene, tmp_path / "a.prelight", wish=wish)
    whole = portals_of(scene, tmp_path / "b.prelight")
    assert len(mixed.layer.names) * 25 > 192
    a, b = lit(mixed, SKY) - mixed.direct, lit(whole, SKY) - whole.direct
    assert np.abs(a - b).mean() < 0.03 * b.mean()
    assert 124 < mixed.layer.weights.shape[3] <= 512
    left = lit(mixed, SKY, Glass("right glass*", "shut"))
    assert np.abs(left - lit(whole, SKY, Glass("right glass", "shut"))).mean() < 0.03 * left.mean()


def test_very_many_portals_are_bounced_as_mixtures(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("prelight.baking.portals_indirect._MOST_OWN", 8)
    scene, wish = two_windows(), PortalWish(exterior_distance=5.0)
    mixed = portals_of(scene, tmp_path / "a.prelight", wish=wish)
    whole = portals_of(scene, tmp_path / "b.prelight")
    a, b = lit(mixed, SKY) - mixed.direct, lit(whole, SKY) - whole.direct
    assert np.abs(a - b).mean() < 0.03 * b.mean()
    assert mixed.layer.weights.shape[3] <= 124


# ---- the bake ------------------------------------------------------------------------------------


def test_bakes_are_identical_and_resumed_ones_too(tmp_path, monkeypatch) -> None:
    scene, settings = two_windows(), PortalsSettings(**QUICK)
    monkeypatch.setattr("prelight.baking.portals_direct.LANES", 1 << 17)
    bake_portals(scene, tmp_path / "a.prelight", settings=settings)
    calls = 0

    def stop(_: float) -> None:
        nonlocal calls
        calls += 1
        if calls == 3:
            raise KeyboardInterrupt

    plan = plan_portals(scene, settings)
    with pytest.raises(InterruptedBakeError, match="direct light of 3 parts"):
        bake_planned(tmp_path / "b.prelight", plan=plan, report=stop)
    bake_portals(scene, tmp_path / "b.prelight", settings=settings, resume=True)
    assert tree(tmp_path / "a.prelight") == tree(tmp_path / "b.prelight")
    assert not list((tmp_path / "b.prelight").glob("tracing"))


def test_panes_show_what_is_outside(windows) -> None:
    lit(windows, EVEN, Glass("left glass", tint=(1.0, 0.5, 0.0)))
    shine = windows.glossy((2.0, 1.5, 2.0))
    assert shine is not None
    left = windows.layer.glass[windows.layer.glass_portal == 0]
    assert np.allclose(shine[left], (1.0, 0.5, 0.0), atol=1e-5)
    assert (shine[np.setdiff1d(np.arange(windows.vertices), windows.layer.glass)] == 0).all()


def test_glass_of_no_portal_is_refused(windows) -> None:
    with pytest.raises(InputError, match="none of this bake's: left glass, right glass"):
        windows.light(Rig(SKY, portals=(Glass("middle"),)))


def test_the_plan_tells_costs_and_advice() -> None:
    wish = PortalWish(exterior_distance=8.0)
    plan = plan_portals(two_windows(), PortalsSettings(wish, **QUICK))
    told = plan.summary()
    assert told["portals"] == len(told["names"]) > 2
    assert 0 < told["angle_deg"] <= 5.0
    assert json.dumps(told)
    # A of both panes seen straight on, in different walls: π·0.02·4·d² = A.
    assert 1.0 < told["returned_distance"] < 6.0
    assert "as near as" in "\n".join(plan.advice.lines(plan.settings))


def test_where_nothing_bounces_there_is_direct_light_alone(tmp_path) -> None:
    floor = rectangle((-2, 0, -2), (0, 0, 4), (4, 0, 0), cells=4)
    room = portals_of(
        with_glass((floor,), {"glass": [rectangle((-1, 1, -1), (2, 0, 0), (0, 0, 2), cells=1)]}),
        tmp_path / "a.prelight",
    )
    assert np.abs(lit(room, EVEN) - room.direct).max() == 0

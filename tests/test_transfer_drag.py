"""A transfer layer while a light is dragged: less exact, and exact again as soon as the hand rests."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from prelight.baking import transfer as baking
from prelight.baking.transfer import bake_transfer
from prelight.baking.transfer_settings import TransferSettings
from prelight.lighting.environment import Environment
from prelight.lighting.placed_lights import Lamp
from prelight.relighting.first_bounce import FirstBounce
from prelight.relighting.placed_caustics import PlacedCaustics
from prelight.relighting.stand_ins import StandIns
from prelight.relighting.transfer import TransferRelighter

from .glass import GREEN_GLASS, ball, joined
from .test_transfer import LAMP, PANEL, chamber

SKY = Environment.constant((0.5, 0.5, 0.5))


def test_coarse_is_near_and_leaves_nothing_behind(tmp_path, monkeypatch) -> None:
    settings = TransferSettings(gather_rays=256, entries=100, modes=60)
    bake = bake_transfer(chamber(), tmp_path / "room.prelight", settings=settings)
    places = StandIns.of(bake.receivers.positions, bake.receivers.normals, count=len(bake.receivers) // 2)
    assert places is not None
    exact = TransferRelighter(bake)
    exact.shine([LAMP, PANEL], SKY)
    live, asked = TransferRelighter(bake), []
    operator = type(live._indirect.first)
    bounce = operator.bounce

    def noted(self: FirstBounce, light: np.ndarray) -> np.ndarray:
        asked.append(len(self.sums))
        return bounce(self, light)

    monkeypatch.setattr(operator, "bounce", noted)
    far = replace(LAMP, position=(LAMP.position[0] - 0.3, *LAMP.position[1:]))
    aside = replace(PANEL, position=(PANEL.position[0] - 0.3, *PANEL.position[1:]))
    live.shine([far], coarse=places)
    assert len(live.bake.receivers) in asked  # the first is exact
    live.shine([far, aside])
    asked.clear()
    live.shine([LAMP, PANEL], SKY, coarse=places)
    assert asked == [len(places)] * 3
    assert off(live.direct, exact.direct) < 0.05  # its shadows have fewer rays
    assert live.is_coarse
    assert 0 < off(live.indirect, exact.indirect) < 0.15
    assert live.shine([LAMP, PANEL], SKY)
    assert not live.is_coarse
    np.testing.assert_array_equal(live.irradiance, exact.irradiance)
    assert not live.shine([LAMP, PANEL], SKY, coarse=places)  # what is exact stays
    near = replace(LAMP, position=(LAMP.position[0] + 0.02, *LAMP.position[1:]))
    for k in range(20):  # a drag: the exact lamp that it began with gives detail to the end
        way = replace(LAMP, position=(LAMP.position[0] + 0.001 * k, *LAMP.position[1:]))
        live.shine([way, PANEL], SKY, coarse=places)
    live.shine([near], coarse=places)
    exact.shine([near])
    assert off(live.indirect, exact.indirect) < 0.02


def test_a_light_given_up_is_made_by_the_next_call(tmp_path) -> None:
    settings = TransferSettings(gather_rays=64, entries=50, modes=20)
    bake = bake_transfer(chamber(side=5), tmp_path / "room.prelight", settings=settings)
    exact = TransferRelighter(bake)
    exact.shine([LAMP, PANEL], SKY)
    for after in range(8):
        live, calls = TransferRelighter(bake), iter(range(after))
        live.shine([PANEL])

        def check(calls: Iterator[int] = calls) -> None:
            if next(calls, None) is None:
                raise TimeoutError

        with contextlib.suppress(TimeoutError):
            live.shine([LAMP, PANEL], SKY, check=check)
        live.shine([LAMP, PANEL], SKY)
        np.testing.assert_array_equal(live.irradiance, exact.irradiance)


def test_what_was_made_before_an_answer_was_given_up_is_told(tmp_path) -> None:
    """Then gloss is not left as the coarse light had it."""
    settings = TransferSettings(gather_rays=64, entries=50, modes=20)
    bake = bake_transfer(chamber(side=9), tmp_path / "room.prelight", settings=settings)
    places = StandIns.of(bake.receivers.positions, bake.receivers.normals, count=len(bake.receivers) // 2)
    assert places is not None
    told = []
    for after in range(8):
        live, calls = TransferRelighter(bake), iter(range(after))
        live.shine([replace(LAMP, position=(LAMP.position[0] - 0.3, *LAMP.position[1:]))])
        live.shine([LAMP], coarse=places)

        def check(calls: Iterator[int] = calls) -> None:
            if next(calls, None) is None:
                raise TimeoutError

        try:
            live.shine([LAMP], check=check)
        except TimeoutError:
            if not live.is_coarse:
                told.append(live.shine([LAMP], coarse=places))
    assert told
    assert all(told)


def test_a_caustic_does_not_stay_where_the_light_was(tmp_path, monkeypatch) -> None:
    """Under a glass ball: while the lamp is dragged away what bounces is found roughly, and nothing is left there."""
    monkeypatch.setattr(baking, "TRIALS", 7)
    settings = TransferSettings(gather_rays=64, entries=60, modes=20)
    glass = ball(radius=0.4, centre=(-0.5, -0.59, 0.4), rings=16)
    scene = joined(chamber(side=25), *glass, GREEN_GLASS)
    bake = bake_transfer(scene, tmp_path / "glass.prelight", settings=settings)
    places = StandIns.of(bake.receivers.positions, bake.receivers.normals, count=len(bake.receivers) // 6)
    assert places is not None
    above = Lamp((-0.5, 0.6, 0.4), LAMP.beam, 0.05)
    aside = replace(above, position=(0.1, 0.6, 0.4))
    live, exact, caustics = TransferRelighter(bake), TransferRelighter(bake), PlacedCaustics(bake)
    live.shine([above])
    live.shine([aside], coarse=places)
    exact.shine([aside])
    assert live.is_coarse
    was, now = (caustics.of(light, shadow_rays=16)[:, 1] for light in (above, aside))
    rows = (was > 0.1 * was.max()) & (now < 0.02 * now.max())
    assert rows.sum() >= 5
    there = exact.indirect[rows, 1].mean()
    assert was[rows].mean() * LAMP.beam.intensity[1] > 3 * there, "so that it would be seen"
    assert live.indirect[rows, 1].mean() == pytest.approx(there, rel=0.5)
    assert off(live.indirect, exact.indirect) < 0.15


def test_a_lamp_that_is_dragged_within_a_solid_says_so(tmp_path) -> None:
    settings = TransferSettings(gather_rays=64, entries=50, modes=20)
    bake = bake_transfer(chamber(), tmp_path / "room.prelight", settings=settings)
    places = StandIns.of(bake.receivers.positions, bake.receivers.normals, count=len(bake.receivers) // 2)
    assert places is not None
    live = TransferRelighter(bake)
    live.shine([LAMP])
    assert live.notes == []
    live.shine([replace(LAMP, position=(0.3, -0.5, -0.2))], coarse=places)
    assert live.is_coarse
    assert "inside a solid" in live.notes[0]


def off(found: np.ndarray, exact: np.ndarray) -> float:
    return float(np.sqrt(((found - exact) ** 2).mean() / (exact**2).mean()))

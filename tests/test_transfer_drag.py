"""A transfer layer while a light is dragged: less exact, and exact again as soon as the hand rests."""

from __future__ import annotations

import numpy as np

from prelight.baking.transfer import bake_transfer
from prelight.baking.transfer_settings import TransferSettings
from prelight.lighting.environment import Environment
from prelight.relighting.transfer import TransferRelighter

from .test_transfer import LAMP, PANEL, chamber

SKY = Environment.constant((0.5, 0.5, 0.5))


def test_coarse_is_near_and_leaves_nothing_behind(tmp_path, monkeypatch) -> None:
    settings = TransferSettings(gather_rays=256, entries=100, modes=60)
    bake = bake_transfer(chamber(), tmp_path / "room.prelight", settings=settings)
    exact = TransferRelighter(bake)
    exact.shine([LAMP, PANEL], SKY)
    live, asked = TransferRelighter(bake), []
    operator = type(live._indirect.first)
    bounce = operator.bounce
    monkeypatch.setattr(operator, "bounce", lambda self, light: asked.append(1) or bounce(self, light))
    live.coarse = True
    live.shine([LAMP], None)
    assert len(asked) == 1  # of a point, whose direct light is exact
    live.shine([LAMP, PANEL], SKY)
    assert len(asked) == 3
    np.testing.assert_array_equal(live.direct, exact.direct)
    off = np.sqrt(((live.indirect - exact.indirect) ** 2).mean() / (exact.indirect**2).mean())
    assert 0 < off < 0.1
    live.coarse = False
    assert live.shine([LAMP, PANEL], SKY)
    np.testing.assert_array_equal(live.irradiance, exact.irradiance)
    live.coarse = True
    assert not live.shine([LAMP, PANEL], SKY)  # what is exact stays

"""Glass in the middle of a wall: what is before it and what is beyond it are lit as if it were at the outer edge."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.baking.portals_room import PortalsRoom
from prelight.baking.portals_settings import PortalsSettings
from prelight.errors import DamagedBakeError
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.glass import Glass
from prelight.lighting.rig import Rig
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.geometry import Scene

from .portal_rooms import SIZE, portals_of, with_glass
from .rooms import rectangle

SKY = Environment.stock("overcast")
DOWN = np.array((0.3, 0.8, -0.25)) / np.linalg.norm((0.3, 0.8, -0.25))
SUN = Disc(tuple(DOWN.tolist()), 0.25, (4e4, 3e4, 2e4), 0.5)
TINT = (0.5, 0.25, 1.0)


def shaft(height: float) -> Scene:
    """Floor and four walls, open to the sky, and a sheet of glass across them at some height."""
    X, Y, Z = SIZE
    sides = (
        ((0, 0, 0), (0, 0, Z), (X, 0, 0)), ((0, 0, 0), (0, Y, 0), (0, 0, Z)), ((X, 0, 0), (0, 0, Z), (0, Y, 0)),
        ((0, 0, 0), (X, 0, 0), (0, Y, 0)), ((0, 0, Z), (0, Y, 0), (X, 0, 0)),
    )  # fmt: skip
    walls = tuple(rectangle(*side, cells=6) for side in sides)
    return with_glass(walls, {"glass": [rectangle((0, height, 0), (X, 0, 0), (0, 0, Z), cells=2)]})


@pytest.fixture(scope="module")
def shafts(tmp_path_factory) -> tuple[PortalsRelighter, PortalsRelighter]:
    """Glass at the top, and a third of the way down."""
    at = tmp_path_factory.mktemp("shafts")
    top, low = (portals_of(shaft(y), at / f"{y}.prelight", gather_rays=1024) for y in (3.0, 2.0))
    return top, low


def test_who_is_beyond() -> None:
    room = PortalsRoom(shaft(2.0), PortalsSettings())
    height = room.open.positions[:, 1]
    is_wall = np.abs(room.open.normals).sum(axis=1) > 0
    assert (room.beyond[height <= 2.001] == -1).all()
    assert (room.beyond[is_wall & (height > 2.001)] == 0).all()
    assert (PortalsRoom(shaft(3.0), PortalsSettings()).beyond == -1).all()


@pytest.mark.parametrize("light", ["sky", "sun"])
def test_clear_glass_may_be_anywhere_in_its_reveal(shafts, light: str) -> None:
    top, low = shafts
    black = Environment.constant((0.0, 0.0, 0.0))
    rig = Rig(SKY if light == "sky" else black.with_discs((SUN,)))
    for room in shafts:
        room.light(rig)
    walls = np.ones(top.vertices, bool)
    walls[top.layer.glass] = False
    for ours, known in ((low.irradiance, top.irradiance), (low.direct, top.direct)):
        off = np.abs(ours - known)[walls]
        assert off.mean() < 0.02 * known[walls].mean()
        beyond = low.layer.openings.beyond[walls] >= 0
        assert off[beyond].mean() < 0.03 * known[walls][beyond].mean()


def test_what_is_beyond_goes_with_the_glass(shafts) -> None:
    _, low = shafts
    low.light(Rig(SKY.with_discs((SUN,))))
    clear = low.irradiance
    low.light(Rig(SKY.with_discs((SUN,)), portals=(Glass("*", tint=TINT),)))
    assert low.irradiance == pytest.approx(clear * np.array(TINT, np.float32), rel=1e-4, abs=1e-6)
    low.light(Rig(SKY.with_discs((SUN,)), portals=(Glass("*", "shut"),)))
    assert not low.irradiance.any()


def test_panes_that_do_not_exist_are_refused(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(PortalsRoom, "beyond", property(lambda room: np.full(len(room.origins), 9, np.int32)))
    monkeypatch.setattr("prelight.transport.portal_light.PortalRays._over_hemisphere", _nothing)
    with pytest.raises(DamagedBakeError, match="beyond"):
        portals_of(shaft(2.0), tmp_path / "a.prelight", bounces=0, rays=64)


def _nothing(*_: object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return np.zeros(0, np.int64), np.zeros(0, np.int32), np.zeros(0, np.float32)

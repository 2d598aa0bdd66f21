"""Portals that are none, and bakes that have none: refused in one line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from prelight.baking.portals_room import PortalsRoom
from prelight.baking.portals_settings import PortalsSettings
from prelight.errors import InputError
from prelight.lighting.environment import Environment
from prelight.lighting.rig import Rig
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.geometry import Scene
from prelight.scene.portals import PortalWish
from prelight.storage.bake import Bake

from .disk import quick_bake
from .portal_rooms import SIZE, portals_of, two_windows, under_glass, with_glass
from .rooms import rectangle

SKY = Environment.stock("overcast")


def rectangle_alone() -> Scene:
    return with_glass((rectangle((0, 0, 0), (1, 0, 0), (0, 0, 1), cells=1),), {})


@pytest.mark.parametrize(
    ("scene", "wish", "reason"),
    [
        (
            two_windows,
            PortalWish(materials=("nothing",)),
            "no material 'nothing'; it has plaster, left glass",
        ),
        (
            lambda: replace(under_glass(), material_of=np.ones(5 * 72 + 8, np.int32)),
            PortalWish(),
            "nothing but glass",
        ),
        (rectangle_alone, PortalWish(), "no portal found in rectangles: looked for"),
    ],
)
def test_portals_that_are_none_are_refused(tmp_path, scene, wish, reason) -> None:
    with pytest.raises(InputError, match=reason):
        portals_of(scene(), tmp_path / "a.prelight", wish=wish)


def polygon(path: Path, *corners: tuple) -> PortalWish:
    path.write_text("[[portal]]\nname = 'hole'\npolygon = " + str([list(corner) for corner in corners]))
    return PortalWish(file=str(path))


def test_a_portal_in_a_solid_wall_or_outside_is_refused(tmp_path) -> None:
    X, Y, _ = SIZE
    closed = ((1, 1, 1), (2, 1, 1), (2, 2, 1), (1, 2, 1))
    room = two_windows()
    # Its windows are walled up.
    shut = replace(room, materials=(room.materials[0],) * 3, material_of=np.zeros_like(room.material_of))
    with pytest.raises(InputError, match="portal hole: light cannot leave through it"):
        portals_of(shut, tmp_path / "a.prelight", wish=polygon(tmp_path / "a.toml", *closed))
    far = [(x + 5 * X, y + Y, z) for x, y, z in closed]
    with pytest.raises(InputError, match="portal hole: it lies outside"):
        portals_of(shut, tmp_path / "a.prelight", wish=polygon(tmp_path / "b.toml", *far))


def test_a_polygon_is_as_good_as_glass(tmp_path) -> None:
    X, Y, Z = SIZE
    scene = under_glass(albedo=0.5)
    glass = portals_of(scene, tmp_path / "a.prelight")
    open_ = PortalsRoom(scene, PortalsSettings()).open
    wish = polygon(tmp_path / "a.toml", (0, Y, 0), (X, Y, 0), (X, Y, Z), (0, Y, Z))
    given = portals_of(open_, tmp_path / "b.prelight", wish=wish)
    for room in (glass, given):
        room.light(Rig(SKY))
    a, b = glass.irradiance, given.irradiance
    assert np.abs(a - b).mean() < 0.01 * a.mean()


def test_a_bake_without_portals_is_told(tmp_path) -> None:
    with pytest.raises(InputError, match="has no layer of portals"):
        PortalsRelighter(Bake.open(quick_bake(tmp_path / "ball.prelight").path))

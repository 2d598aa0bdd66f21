"""What bounces of a sun that shines on what is outside a window: none of it may leak into rows that do not see it."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.baking.portals_room import PortalsRoom
from prelight.baking.portals_settings import PortalsSettings
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.rig import Rig
from prelight.scene.geometry import Scene
from prelight.transport.bounces import bounced
from prelight.transport.gathering import Gathering

from .portal_rooms import SIZE, portals_of, wall_with_hole, with_glass
from .rooms import rectangle

UP = np.array((0.45, 0.8, 0.1)) / np.linalg.norm((0.45, 0.8, 0.1))
SUN = Disc(tuple(UP.tolist()), 0.25, (4e4, 4e4, 4e4), 0.5)
LOW, HIGH, TOP = (0.40, 0.42), (0.60, 0.58), 2.0  # the hole in the ceiling, and metres of the shaft above it


def below_a_shaft() -> Scene:
    """A room whose only window lies at the bottom of a shaft that the sun shines into, and not through."""
    X, Y, Z = SIZE
    sides = (
        ((0, 0, 0), (0, 0, Z), (X, 0, 0)), ((0, 0, 0), (0, Y, 0), (0, 0, Z)), ((X, 0, 0), (0, 0, Z), (0, Y, 0)),
        ((0, 0, 0), (X, 0, 0), (0, Y, 0)), ((0, 0, Z), (0, Y, 0), (X, 0, 0)),
    )  # fmt: skip
    walls = tuple(rectangle(*side, cells=24) for side in sides)
    walls += wall_with_hole((0, Y, 0), (X, 0, 0), (0, 0, Z), hole=(LOW, HIGH), cells=10)
    (x0, z0), (x1, z1) = ((x * X, z * Z) for x, z in (LOW, HIGH))
    shaft = (
        ((x0, Y, z0), (0, TOP, 0), (0, 0, z1 - z0)), ((x1, Y, z0), (0, 0, z1 - z0), (0, TOP, 0)),
        ((x0, Y, z0), (x1 - x0, 0, 0), (0, TOP, 0)), ((x0, Y, z1), (0, TOP, 0), (x1 - x0, 0, 0)),
    )  # fmt: skip
    walls += tuple(rectangle(*side, cells=16) for side in shaft)
    glass = rectangle((x0, Y, z0), (x1 - x0, 0, 0), (0, 0, z1 - z0), cells=2)
    return with_glass(walls, {"glass": [glass]})


def test_sun_on_a_reveal_does_not_leak(tmp_path) -> None:
    """With entries that are not weighed (``EntryWeights()``) the room is two thirds too bright."""
    scene, settings = below_a_shaft(), {"rays": 256, "gather_rays": 256}
    light = portals_of(scene, tmp_path / "a.prelight", **settings)
    light.light(Rig(Environment.dark().with_discs((SUN,))))
    room = PortalsRoom(scene, PortalsSettings(**settings))
    exact = Gathering.trace(room.bouncing, room.occluders, origins=room.origins, rays=256)
    fallen = light.point_lit.around_vertices[:, None, :1]
    known = bounced(exact, np.ascontiguousarray(fallen)).indirect[:, 0, 0]
    found = (light.irradiance - light.direct)[:, 0]
    indoors = (np.abs(room.open.normals).sum(axis=1) > 0) & (room.open.positions[:, 1] < 0.99 * SIZE[1])
    assert not fallen[indoors].any()
    assert found[indoors].mean() == pytest.approx(known[indoors].mean(), rel=0.03)
    assert np.abs(found - known)[indoors].mean() < 0.04 * known[indoors].mean()

"""The path tracer beside the page: a room's glass and the world outside are there as the relighter has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from prelight.camera import Camera
from prelight.errors import InputError
from prelight.lighting.environment import Environment
from prelight.lighting.glass import Glass
from prelight.lighting.outside import OutsideObject, Path, Placement
from prelight.lighting.rig import Rig
from prelight.relighting.exterior import placed_shape
from prelight.relighting.lit_bake import LitBake
from prelight.storage.bake import Bake
from prelight.studio.environments import Environments

from .portal_rooms import portals_of, two_windows
from .test_studio_views import town

pytest.importorskip("mitsuba", reason="the renderer is not installed")
CORNER = Camera((3.5, 1.5, 4.5), (1.0, 1.0, 1.0), vertical_fov_deg=60.0)
WIDE, HIGH, SAMPLES = 24, 16, 96


@pytest.fixture(scope="module")
def bake(tmp_path_factory) -> Bake:
    path = tmp_path_factory.mktemp("windows") / "room.prelight"
    portals_of(two_windows(), path)
    return Bake.open(path)


def traced(bake: Bake, rig: Rig) -> np.ndarray:
    from prelight.checking.on_screen import ScreenTracer

    *_, (count, picture) = ScreenTracer(bake, rig, CORNER, width=WIDE, height=HIGH).pictures(SAMPLES)
    assert count == SAMPLES
    return picture.astype(np.float64)


def test_glass_and_a_world_light_the_room_as_the_relighter_says(bake, tmp_path) -> None:
    """The median pixel is the same to 6 %; red glass takes blue, a wall before a window takes light."""
    overcast = Rig(Environment.stock("overcast"))
    wall = Environments([str(town(tmp_path))]).worlds.open("town.toml")
    rigs = {
        "built": overcast,
        "red": replace(overcast, portals=(Glass("*", tint=(1.0, 0.2, 0.1)),)),
        "half": replace(
            overcast, portals=(Glass("left glass", kind="shut"), Glass("right glass", blind=0.5))
        ),
        "wall": replace(overcast, outside=wall),  # nine metres away, where the room takes little of its sky
    }
    light, seen = LitBake(bake), {}
    for name, rig in rigs.items():
        seen[name] = traced(bake, rig)
        light.light(rig)
        ours = light.picture(CORNER, width=WIDE, height=HIGH).linear.reshape(-1, 3)
        lit = ours.sum(axis=1) > 1e-4  # shut glass is black
        assert lit.mean() > 0.9
        assert np.median(seen[name][lit].sum(axis=1) / ours[lit].sum(axis=1)) == pytest.approx(1, abs=0.06), (
            name
        )
    total = {name: picture.mean(axis=0) for name, picture in seen.items()}
    assert total["red"][0] == pytest.approx(total["built"][0], rel=0.03)
    assert total["red"][2] < 0.15 * total["built"][2]
    assert total["half"][1] < 0.6 * total["built"][1]
    assert total["wall"][1] < 0.92 * total["built"][1]


def test_frosted_glass_is_refused_in_a_line(bake) -> None:
    with pytest.raises(
        InputError, match=r"frosted glass has no like in the path tracer, and 'left glass' is"
    ):
        traced(bake, Rig(Environment.stock("noon"), portals=(Glass("left*", kind="frosted"),)))


def test_the_world_stands_where_a_room_that_drives_sees_it(tmp_path) -> None:
    """A room at x = 10 that looks along +X has what stands at x = 15 five metres ahead of it."""
    file = tmp_path / "post.obj"
    file.write_text("v 0 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n")
    post = OutsideObject(str(file), Path.resting((15.0, 0.0, 0.0)))
    found = placed_shape(post, 3.0, room=Placement((10.0, 0.0, 0.0), 90.0))
    assert np.abs(np.sort(found.positions, axis=0) - [[0, 0, -5], [0, 0, -5], [1, 1, -5]]).max() < 1e-6

"""What the studio tells a page beside its light: gloss, worlds, steerable pixels, timelines."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from prelight.baking.environment import bake_environment
from prelight.baking.steerable import bake_steerable
from prelight.baking.steerable_settings import BakedLamp, SteerableSettings
from prelight.errors import InputError
from prelight.lighting.disc import Disc
from prelight.lighting.distributions import Power
from prelight.lighting.environment import Environment
from prelight.lighting.rig import Rig
from prelight.lighting.spot import Spot
from prelight.relighting.lit_bake import LitBake
from prelight.relighting.relighter import Relighter
from prelight.relighting.steerable_bake import SteerableBake
from prelight.storage.bake import Bake
from prelight.studio import kept
from prelight.studio.environments import Environments
from prelight.studio.frames import FRAME_ASIDE, FRAME_EXACT, FRAME_SHINE, FRAME_VIEW, FRAME_WORLD
from prelight.studio.history import History
from prelight.studio.lighting import SkyLight, lighting_of
from prelight.studio.protocol import (
    Compare,
    Mark,
    RemoveLook,
    SaveLook,
    SetDisc,
    SetEnvironment,
    SetGlass,
    SetLamp,
    SetTimeline,
    SetWorld,
    ShowLook,
    State,
)
from prelight.studio.protocol_values import LampLight, LookKey, PortalGlass
from prelight.studio.rig_state import changed, initial
from prelight.studio.rig_toml import opened_rig, rig_text
from prelight.studio.timeline_rig import timeline_text
from prelight.studio.whole_light import WholeLight
from prelight.transport.basis_images import ImageSettings
from prelight.transport.steered_lamps import SteeredSpot

from .live_studio import running
from .portal_rooms import portals_of, two_windows
from .steered import LAMP_AT, room
from .studio_bakes import lamps_bake
from .test_gloss_layer import golden_ball
from .test_studio_rgb9e5 import unpacked

EYE = (0.5, 1.5, 2.0)
LAMP = LampLight(
    "l0", "Lamp", "lamp", True, (0.4, 1.5, 0.3), (0.0, 0.0, 0.0), 4000.0, 1.0, (1.0, 0.9, 0.8), 0.05, 40.0, (0.5, 0.5)
)  # fmt: skip


def rig(*changes, start: State | None = None) -> State:
    state = start or initial("stock:noon")
    for change in changes:
        state = changed(state, change, author=1)
    return state


def lit(light, state: State, *, exact: bool = True) -> np.ndarray:
    light.relight(state, exact=exact, check=lambda: None)
    return unpacked(np.frombuffer(light.frame(state), np.uint32, offset=32))


@pytest.fixture(scope="module")
def golden(tmp_path_factory) -> Bake:
    path = tmp_path_factory.mktemp("golden") / "ball.prelight"
    return bake_environment(golden_ball(), path, resolution=32, glossy_order=6, bounces=0)


def test_looks_shine_toward_the_eye_that_asks(golden, tmp_path) -> None:
    """Beside a look's light comes its gloss, also of the light before the last step; another eye gets another."""
    light = lighting_of(golden, Environments())
    with running(golden.path, state_file=tmp_path / "s.json") as studio, studio.page() as page:
        start = page.message("Welcome")["state"]
        page.send(SaveLook("Bright"))
        page.send(SetEnvironment(scale=0.25))
        page.exact(start["sequence"] + 2)
        for look, scale, eye in (("Bright", 1.0, EYE), ("Bright", 1.0, (-2.0, 1.0, 0.0)), (None, 1.0, EYE)):
            page.send(Compare(look, eye))
            page.until(lambda got: getattr(got, "flags", 0) == FRAME_ASIDE | FRAME_VIEW | FRAME_SHINE)
            found = np.frombuffer(page.frames[-1][1], np.float16, offset=32).reshape(-1, 4)
            state = rig(SetEnvironment(scale=scale), start=initial(start["environment"]))
            lit(light, state)
            expected = light.view(state, eye).shine
            assert expected is not None
            assert np.abs(expected).max() > 0.01
            assert np.abs(found - expected).max() <= 2e-3 * np.abs(expected).max()
        page.send(Compare("Bright"))  # without an eye nothing of it comes
        page.until(lambda got: getattr(got, "flags", 0) == FRAME_ASIDE | FRAME_EXACT)
        page.send(Mark(1))
        page.message("Marked")
        assert page.frames[-1][0].flags == FRAME_ASIDE | FRAME_EXACT


def test_a_look_that_is_asked_for_from_elsewhere_meanwhile_is_lit_again(
    golden, tmp_path, monkeypatch
) -> None:
    """The second question comes while the first is being answered."""
    answer, asked, goes_on = SkyLight.view, threading.Event(), threading.Event()

    def waiting(self, state, eye):
        asked.set()
        assert goes_on.wait(20)
        return answer(self, state, eye)

    monkeypatch.setattr(SkyLight, "view", waiting)
    with running(golden.path, state_file=tmp_path / "s.json") as studio, studio.page() as page:
        page.send(SaveLook("One"))
        page.send(Compare("One", EYE))
        assert asked.wait(20)
        page.send(Compare("One", (-2.0, 1.0, 0.0)))
        page.send(Mark(1))
        page.message("Marked")
        goes_on.set()
        shines = []
        while len(shines) < 2:
            page.until(lambda got: getattr(got, "flags", 0) & FRAME_SHINE)
            shines.append(page.frames[-1][1])
        assert shines[0] != shines[1]


def test_gloss_is_the_relighters_whatever_was_lit_before(golden) -> None:
    """A turned and tinted map with its traced sun, and two lights: a broad one, and one that is traced."""
    bake = golden
    broad = Disc.at(-120, 40, radius_deg=10, radiance=(6, 5, 4))
    small = Disc.at(30, 60, radius_deg=0.5, radiance=(900, 800, 700))
    first = SetDisc("a", -120.0, 40.0, 10.0, (6.0, 5.0, 4.0))
    second = SetDisc("b", 30.0, 60.0, 0.5, (900.0, 800.0, 700.0))
    light, other = lighting_of(bake, Environments()), Relighter(bake)
    for turn, tint, some in (
        (40.0, (1.0, 0.6, 0.3), (first, second)),
        (10.0, (1.0, 1.0, 1.0), (first,)),
        (40.0, (0.5, 0.5, 0.5), ()),
    ):
        state = rig(SetEnvironment(rotation_deg=turn, tint=tint), *some)
        lit(light, state)
        seen = light.view(state, EYE)
        discs = [broad, small][: len(some)]
        other.environment = (
            Environment.stock("noon")
            .rotated(turn)
            .tinted(tint)
            .with_discs([*Environment.stock("noon").rotated(turn).tinted(tint).discs, *discs])
        )
        expected = other.glossy(EYE)
        assert seen.world is None
        assert seen.shine is not None
        assert expected is not None
        assert np.abs(expected).max() > 0.01
        # Map and lights are mirrored each by itself, and each is cut off at 0.
        assert np.abs(seen.shine[:, :3] - expected).max() < 0.03 * np.abs(expected).max()


def town(folder: Path) -> Path:
    """A wall that comes nearer to the left window, facing the way it goes."""
    wall = folder / "wall.obj"
    wall.write_text("v -4 -4 0\nv 4 -4 0\nv 4 4 0\nv -4 4 0\nf 1 2 3 4\nf 4 3 2 1\n")
    file = folder / "town.toml"
    file.write_text(
        "[environment]\nmap = 'stock:noon'\n\n[outside]\n[[outside.object]]\nscene = 'wall.obj'\n"
        "position = [-9, 1, 2]\nkeys = [{ at = 4, position = [-1, 1, 2] }]\n"
    )
    return file


def test_an_exact_answer_given_up_does_not_coarsen_the_sky(tmp_path) -> None:
    """Somebody drags a blind again as soon as the exact answer has begun: the map stays the one that was lit by."""
    portals_of(two_windows(), tmp_path / "room.prelight")
    bake, known = Bake.open(tmp_path / "room.prelight"), Environments()
    light, lets_one_by = WholeLight(bake, known), iter([None])
    lit(light, state := rig(SetEnvironment("stock:noon")))
    state = rig(SetGlass(PortalGlass("left glass", "clear", None, 10.0, 0.5)), start=state)

    def check() -> None:
        if next(lets_one_by, "given up"):
            raise TimeoutError

    with pytest.raises(TimeoutError):
        light.relight(state, exact=True, check=check)
    np.testing.assert_array_equal(lit(light, state, exact=False), lit(WholeLight(bake, known), state))


def test_a_world_outside_lights_the_room_and_is_seen_through_its_windows(tmp_path) -> None:
    portals_of(two_windows(), tmp_path / "room.prelight")
    bake, known = Bake.open(tmp_path / "room.prelight"), Environments([str(town(tmp_path))])
    (view,) = known.worlds.views
    assert (view.id, view.title, view.duration) == ("town.toml", "town", 4.0)
    light, other = WholeLight(bake, known), LitBake(bake)
    state = rig(SetEnvironment("stock:noon"))
    open_air = lit(light, state)
    wholes = []
    for seconds in (0.0, 4.0):
        state = rig(SetWorld("town.toml", seconds), start=state)
        found = lit(light, state)
        other.light(
            replace(Rig(Environment.stock("noon")), outside=known.worlds.open("town.toml"), seconds=seconds)
        )
        assert np.abs(found - other.irradiance).max() < 2.0**-8 * open_air.max()
        wholes.append(found.sum())
        world = light.view(state, (2.0, 1.5, 2.5)).world
        assert world is not None
        wholes.append(unpacked(world).reshape(256, 512, 3)[100:156, 100:156].sum())  # to the left
    assert wholes[2] < 0.97 * wholes[0], "a wall at the window takes its light"
    assert wholes[3] != wholes[1]
    text = rig_text(state, known, takes=("environment", "glass"), title="x")
    assert opened_rig(text, initial("stock:noon"), known).world == "town.toml"
    saved = tmp_path / "rig.toml"
    saved.write_text(text)
    assert Rig.open(str(saved)).outside == known.worlds.open("town.toml")
    with pytest.raises(InputError, match="command line"):
        opened_rig(text, initial("stock:noon"), Environments())
    with pytest.raises(InputError, match="expected one of"):
        known.worlds.open("city.toml")


def test_looks_bring_the_world_outside_along(tmp_path) -> None:
    """Of the second that each was kept at, as the eye that asks sees it; one without a world brings none."""
    portals_of(two_windows(), tmp_path / "room.prelight")
    named, eye, worlds = [town(tmp_path)], (2.0, 1.5, 2.5), {}
    kept_at = (("Open", None, 0.0), ("Far", "town.toml", 0.0), ("Near", "town.toml", 4.0))
    with (
        running(tmp_path / "room.prelight", state_file=tmp_path / "s.json", rigs=named) as studio,
        studio.page() as page,
    ):
        start = page.message("Welcome")["state"]["sequence"]
        page.send(SetEnvironment("stock:noon"))
        for look, world, seconds in kept_at:
            page.send(SetWorld(world, seconds))
            page.send(SaveLook(look))
        page.exact(start + 7)
        for look in ("Near", "Far"):
            page.send(Compare(look, eye))
            page.until(lambda got: getattr(got, "flags", 0) & FRAME_ASIDE and got.flags & FRAME_WORLD)
            worlds[look] = page.frames[-1][1][-4 * 512 * 256 :]
        page.send(Compare("Open", eye))
        page.until(lambda got: getattr(got, "flags", 0) == FRAME_ASIDE | FRAME_EXACT)
        page.send(Mark(1))
        page.message("Marked")
        assert not page.frames[-1][0].flags & FRAME_WORLD
    light = WholeLight(Bake.open(tmp_path / "room.prelight"), Environments([str(town(tmp_path))]))
    for look, world, seconds in kept_at[1:]:
        state = rig(SetEnvironment("stock:noon"), SetWorld(world, seconds))
        lit(light, state)
        seen = light.view(state, eye).world
        assert seen is not None
        assert worlds[look] == seen.tobytes()
    assert worlds["Near"] != worlds["Far"]


def test_steerable_pixels_follow_the_vertices_of_a_frame(tmp_path) -> None:
    images = ImageSettings(20, 14, samples=16, particles=8, depth=3)
    settings = SteerableSettings((BakedLamp("key", SteeredSpot(LAMP_AT, 3)),), images=images, keep="all")
    bake = bake_steerable(room(), tmp_path / "room.prelight", settings=settings)
    light = lighting_of(bake, Environments())
    spot = replace(
        LAMP,
        kind="spot",
        layer="key",
        position=LAMP_AT,
        target=(0.1, 0.2, 0.0),
        beam_deg=90.0,
        strength=683.0,
    )
    state = rig(SetLamp(spot))
    found = lit(light, state)
    vertices = len(bake.receivers)
    assert len(found) == light.rows == vertices + 20 * 14
    assert not found[:vertices].any()
    other = SteerableBake(bake)
    other.light([Spot((1.0, 0.9, 0.8), target=(0.1, 0.2, 0.0), distribution=Power.of_width(90), layer="key")])
    expected = np.maximum(other.radiance, 0)
    assert expected.max() > 0.01
    assert np.abs(found[vertices:] - expected).max() < 2.0**-8 * expected.max()
    dark = rig(SetLamp(replace(spot, on=False)))
    assert not lit(light, dark).any()
    text = rig_text(state, Environments(), takes=("steered",), title="x")
    (again,) = opened_rig(text, initial("stock:noon"), Environments()).lamps
    assert (again.layer, again.kind, again.beam_deg, again.target) == ("key", "spot", 90.0, (0.1, 0.2, 0.0))
    with pytest.raises(InputError, match="Lamp"):
        rig(SetLamp(replace(spot, kind="panel", size=(5.0, 5.0), position=(9.0, 0.0, 0.0))))


def two_looks() -> History:
    history = History(rig(SetLamp(LAMP)), (), opened=lambda _text, state: state)
    history.obey(SaveLook("One"), author=1)
    history.obey(SetLamp(replace(LAMP, dim=0.5)), author=1)
    history.obey(SetLamp(replace(LAMP, id="l1", position=(-0.6, 1.2, 0.2), color=(0.5, 0.8, 1.0))), author=1)
    history.obey(SaveLook("Two"), author=1)
    history.obey(SetTimeline((LookKey(1.0, "One"), LookKey(3.0, "Two"))), author=1)
    return history


def test_a_timeline_as_a_rig_is_the_cross_fade(tmp_path, tmp_path_factory) -> None:
    bake, known, history = Bake.open(lamps_bake(tmp_path_factory)), Environments(), two_looks()
    text = timeline_text(history.state, history.looks, known, takes=("environment", "lamps"), title="x")
    file = tmp_path / "line.toml"
    file.write_text(text)
    moving, light = Rig.open(str(file)), LitBake(bake)
    ends = []
    for seconds in (0.0, 1.0, 3.0, 9.0):
        light.light(moving.at(seconds))
        ends.append(light.irradiance)
    assert np.array_equal(ends[0], ends[1])
    assert np.array_equal(ends[2], ends[3])
    other = WholeLight(bake, known)
    for end, name in ((ends[1], "One"), (ends[2], "Two")):
        assert np.abs(lit(other, history.look(name)) - end).max() < 0.01 * end.max()
    light.light(moving.at(1.5))
    assert np.abs(light.irradiance - (0.75 * ends[1] + 0.25 * ends[2])).max() < 0.01 * ends[1].max()
    history.obey(SetEnvironment("stock:sunset"), author=1)
    history.obey(SaveLook("Two"), author=1)
    with pytest.raises(InputError, match="different skies"):
        timeline_text(history.state, history.looks, known, takes=("environment", "lamps"), title="x")


def test_timelines_are_kept_checked_and_lose_forgotten_looks(tmp_path) -> None:
    history = two_looks()
    with pytest.raises(InputError, match="rise"):
        history.obey(SetTimeline((LookKey(1.0, "One"), LookKey(1.0, "Two"))), author=1)
    with pytest.raises(InputError, match="not kept"):
        history.obey(SetTimeline((LookKey(1.0, "Three"),)), author=1)
    kept.save(history.state, tmp_path / "s.json", looks=history.looks)
    state, looks = kept.load(tmp_path / "s.json", initial("stock:noon"))
    assert state.timeline == history.state.timeline
    assert [name for name, _ in looks] == ["One", "Two"]
    assert history.before.timeline == ()
    history.obey(ShowLook("One"), author=1)
    assert len(history.before.lamps) == 2
    history.obey(RemoveLook("Two"), author=1)
    assert history.state.timeline == (LookKey(1.0, "One"),)

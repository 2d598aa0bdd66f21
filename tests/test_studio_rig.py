"""A bake of several layers under one rig: lamps, sun, undo, looks; as a rig file it is the same light."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.lighting.placed_lights import Lamp, PlacedPanel
from prelight.lighting.rig import Rig
from prelight.relighting.lit_bake import LAMPS, SKIES, LitBake
from prelight.storage.bake import Bake
from prelight.studio import history as histories
from prelight.studio import kept, rig_state
from prelight.studio.environments import Environments, daylight_id, daylight_of
from prelight.studio.history import History
from prelight.studio.kinds import takes_of
from prelight.studio.light import Light
from prelight.studio.lighting import lighting_of
from prelight.studio.placed import placed_light
from prelight.studio.protocol import (
    OpenRig,
    Redo,
    RemoveLamp,
    RemoveLook,
    SaveLook,
    SetDisc,
    SetEnvironment,
    SetGlass,
    SetLamp,
    SetSun,
    ShowLook,
    State,
    Undo,
)
from prelight.studio.protocol_values import LampLight, PortalGlass
from prelight.studio.rig_toml import opened_rig, rig_text
from prelight.studio.whole_light import WholeLight

from .live_studio import ball_bake
from .studio_bakes import lamps_bake
from .test_studio_rgb9e5 import unpacked

START = rig_state.initial("stock:noon")
TAKES = ("environment", "lamps", "glass")
BULB = LampLight(
    "a",
    "Bulb",
    "lamp",
    True,
    (0.6, 1.2, 0.3),
    (0.0, 0.0, 0.0),
    3000.0,
    0.75,
    (1.2, 0.95, 0.9),
    0.03,
    40.0,
    (0.5, 0.5),
)
SPOT = replace(
    BULB, id="b", name="Spot", kind="spot", position=(-0.8, 1.5, 0.5), strength=900.0, beam_deg=50.0
)
PANEL = replace(BULB, id="c", name="Panel", kind="panel", position=(0.0, 1.8, 0.0), size=(0.4, 0.3), dim=1.0)


@pytest.fixture(scope="module")
def bake(tmp_path_factory) -> Bake:
    return Bake.open(lamps_bake(tmp_path_factory))


def after(*changes, start: State = START) -> State:
    for change in changes:
        start = rig_state.changed(start, change, author=1)
    return start


def lit(light, state: State, *, exact: bool = True) -> np.ndarray:
    light.relight(state, exact=exact, check=lambda: None)
    return unpacked(np.frombuffer(light.frame(state), np.uint32, offset=32))


# ---- Layers ------------------------------------------------------------------------------------------------------


def test_a_bake_of_one_layer_goes_the_quick_way(bake, tmp_path_factory) -> None:
    alone = Bake.open(ball_bake(tmp_path_factory))
    assert isinstance(lighting_of(alone, Environments()), Light)
    assert takes_of(alone) == ("environment",)
    assert isinstance(lighting_of(bake, Environments()), WholeLight)
    assert takes_of(bake) == ("environment", "lamps")
    assert {"environment", "transfer"} <= {*SKIES, *LAMPS}


def test_layers_add_up_to_what_relight_says(bake, tmp_path) -> None:
    """Sky, a soft light, a lamp, a spot and a panel; the file that is saved gives the same light."""
    state = after(
        SetEnvironment("stock:overcast", 30.0, 0.5, (1.0, 0.9, 0.8)),
        SetDisc("d", -125.0, 35.0, 8.0, (6.0, 5.0, 4.0), 0.5),
        SetLamp(BULB), SetLamp(SPOT), SetLamp(PANEL),
    )  # fmt: skip
    found = lit(WholeLight(bake, Environments()), state)
    (tmp_path / "rig.toml").write_text(rig_text(state, Environments(), takes=TAKES, title="ball"))
    whole = LitBake(bake)
    whole.light(Rig.open(str(tmp_path / "rig.toml")))
    assert np.abs(found - whole.irradiance).max() <= whole.irradiance.max() * 2.0**-8
    alone = lit(WholeLight(bake, Environments()), after(SetEnvironment(scale=0.0), SetLamp(BULB)))
    assert 0 < alone.mean() < found.mean()


def test_a_lamp_is_a_change_of_its_own(bake) -> None:
    light = WholeLight(bake, Environments())
    dark = after(SetEnvironment(scale=0.0))
    one = lit(light, after(SetLamp(BULB), start=dark))
    dimmed = lit(light, after(SetLamp(replace(BULB, dim=0.375)), start=dark), exact=False)
    assert np.abs(dimmed - one / 2).max() <= 2.0**-8 * one.max()
    assert {layer.kind for layer in light.layers} >= {"transfer"}
    assert all(layer.ms >= 0 for layer in light.layers)
    both = lit(light, after(SetLamp(BULB), SetLamp(SPOT), start=dark))
    other = lit(light, after(SetLamp(SPOT), start=dark))
    assert np.abs(both - one - other).max() <= 2.0**-7 * both.max()
    assert not lit(light, after(SetLamp(replace(BULB, on=False)), start=dark)).any()
    assert not lit(light, dark).any()
    bluer = lit(light, after(SetLamp(replace(BULB, color=(0.5, 1.0, 2.5))), start=dark))
    assert bluer[:, 2].sum() > 2 * one[:, 2].sum()


def test_a_dimmer_is_a_factor(bake) -> None:
    light, dark = WholeLight(bake, Environments()), SetEnvironment(scale=0.0)
    full, part = (lit(light, after(dark, SetLamp(replace(BULB, dim=dim)))) for dim in (1.0, 0.25))
    assert np.abs(part - 0.25 * full).max() < 2.0**-7 * full.max()
    assert part.mean() > 0


def test_what_is_seen_depends_on_the_state_alone(bake) -> None:
    state = after(SetEnvironment("stock:overcast"), SetLamp(BULB), SetLamp(SPOT))
    light = WholeLight(bake, Environments())
    first = lit(light, state)
    for x in np.linspace(-1, 1, 5).tolist():
        lit(light, after(SetLamp(replace(BULB, position=(x, 1.0, 0.0))), start=state), exact=False)
    assert (lit(light, state) == first).all()
    assert (lit(WholeLight(bake, Environments()), state) == first).all()


def test_lamps_that_cannot_be_are_refused() -> None:
    with pytest.raises(InputError, match="lamp 'Spot'"):
        after(SetLamp(replace(SPOT, target=SPOT.position)))
    with pytest.raises(InputError, match="not there"):
        after(RemoveLamp("zz"))
    many = after(*(SetLamp(replace(BULB, id=f"l{k}")) for k in range(32)))
    with pytest.raises(InputError, match="at most 32"):
        after(SetLamp(SPOT), start=many)
    assert len(after(SetLamp(replace(BULB, id="l3", dim=0.1)), start=many).lamps) == 32


def test_strength_is_in_real_units() -> None:
    bulb, spot, panel = (placed_light(lamp) for lamp in (BULB, SPOT, PANEL))
    assert isinstance(bulb, Lamp)
    assert isinstance(spot, Lamp)
    assert isinstance(panel, PlacedPanel)
    weights = np.array([0.2126, 0.7152, 0.0722])
    level = float(np.array(BULB.color) @ weights)
    assert 683 * 4 * np.pi * np.array(bulb.colour) @ weights == pytest.approx(0.75 * 3000 * level)
    assert 683 * np.array(spot.colour) @ weights == pytest.approx(0.75 * 900 * level)
    assert 683 * np.pi * 0.12 * np.array(panel.colour) @ weights == pytest.approx(3000 * level)


# ---- Sun ---------------------------------------------------------------------------------------------------------


def test_the_sun_goes_through_the_day(bake) -> None:
    light = WholeLight(bake, Environments())
    sun = START.sun
    noon, evening, night = (after(SetSun(replace(sun, hour=hour))) for hour in (12.0, 19.0, 0.5))
    assert noon.environment == "daylight"
    lit_noon, lit_evening = lit(light, noon), lit(light, evening)
    assert lit_noon.mean() > 3 * lit_evening.mean() > 0
    assert lit_noon[:, 0].sum() / lit_noon[:, 2].sum() < lit_evening[:, 0].sum() / lit_evening[:, 2].sum()
    assert not lit(light, night).any()
    coarse = lit(light, noon, exact=False)
    assert coarse.mean() == pytest.approx(lit_noon.mean(), rel=0.1)


def test_the_hour_is_what_the_clock_says() -> None:
    sun = replace(START.sun, hour=14.51, zone="Europe/Zagreb")
    when = daylight_of(daylight_id(sun)).when
    assert (when.hour, when.minute, when.utcoffset()) == (14, 30, timedelta(hours=2))
    assert daylight_of(daylight_id(replace(sun, hour=23.99999))).when.hour == 23
    for wrong in ("daylight:1,2", "daylight:x,2,2026-01-01,3,2,", "daylight:91,2,2026-01-01,3,2,",
                  "daylight:1,2,2026-13-01,3,2,", "daylight:1,2,2026-01-01,24.1,2,", "daylight:1,2,2026-01-01,nan,2,",
                  "daylight:1,2,2026-01-01,3,2,No/Where", "daylight:" + "1" * 300):  # fmt: skip
        with pytest.raises(InputError):
            daylight_of(wrong)
    with pytest.raises(InputError):
        after(SetSun(replace(sun, date="2026-02-30")))
    with pytest.raises(InputError, match="colour of its hour"):
        after(SetSun(sun), SetEnvironment(tint=(1.0, 0.5, 0.5)))


# ---- Undo and looks ----------------------------------------------------------------------------------------------


@pytest.fixture
def history() -> History:
    return History(START, (), opened=lambda text, state: opened_rig(text, state, Environments()))


def light_of(state: State) -> tuple:
    return tuple(getattr(state, name) for name in rig_state.LIGHT)


def test_everything_is_undone_and_done_again(history) -> None:
    glass = PortalGlass("rose", "frosted", None, 20.0, 0.5)
    changes = [
        SetEnvironment("stock:sunset"), SetEnvironment(rotation_deg=20.0), SetSun(START.sun),
        SetDisc("d", 1.0, 2.0, 3.0, (1.0, 1.0, 1.0)), SetLamp(BULB), SetLamp(replace(BULB, on=False)),
        RemoveLamp("a"), SetGlass(glass), SaveLook("One"), ShowLook("One"), RemoveLook("One"),
        OpenRig('[environment]\nmap = "stock:stage"\n'),
    ]  # fmt: skip
    states = [history.state]
    for change in changes:
        states.append(history.obey(change, author=1))
        assert history.state.undo
    sequences = [state.sequence for state in states]
    assert sequences == sorted(set(sequences))
    for before in reversed(states[:-1]):
        now = history.obey(Undo(), author=2)
        assert light_of(now) == light_of(before)
        assert now.looks == before.looks
        assert now.sequence > sequences[-1]
    with pytest.raises(InputError, match="nothing to undo"):
        history.obey(Undo(), author=2)
    assert history.state.undo is None
    for later in states[1:]:
        assert light_of(history.obey(Redo(), author=2)) == light_of(later)
    assert history.state.redo is None


def test_a_drag_is_one_step_and_pauses_divide(history, monkeypatch) -> None:
    clock = [100.0]
    monkeypatch.setattr(histories.time, "monotonic", lambda: clock[0])
    for k in range(30):
        clock[0] += 0.02
        history.obey(SetEnvironment(rotation_deg=float(k), dragging=k < 29), author=1)
    assert history.obey(Undo(), author=1).rotation_deg == 0
    history.obey(Redo(), author=1)
    for k in range(3):
        clock[0] += 5.0
        history.obey(SetEnvironment(rotation_deg=100.0 + k, dragging=True), author=1)
    assert history.obey(Undo(), author=1).rotation_deg == 101
    history.obey(SetLamp(BULB), author=1)
    assert history.state.redo is None


def test_two_sliders_of_a_lamp_are_two_steps(history, monkeypatch) -> None:
    """However soon one follows the other; a drag that ends where it is adds nothing."""
    monkeypatch.setattr(histories.time, "monotonic", lambda: 100.0)
    history.obey(SetLamp(BULB), author=1)
    dimmed = replace(BULB, dim=0.5)
    for lamp in (BULB, replace(BULB, dim=0.7), dimmed, dimmed):
        history.obey(SetLamp(lamp, dragging=True), author=1)
    for red in (0.9, 0.8):
        history.obey(SetLamp(replace(dimmed, color=(red, 0.5, 0.2)), dragging=True), author=1)
    history.obey(Undo(), author=1)
    assert history.state.lamps == (dimmed,)
    history.obey(Undo(), author=1)
    assert history.state.lamps == (BULB,)
    history.obey(Undo(), author=1)
    assert history.state.lamps == ()


def test_looks_are_kept_in_the_file(history, tmp_path) -> None:
    history.obey(SetLamp(BULB), author=1)
    history.obey(SaveLook("Evening"), author=1)
    history.obey(SetGlass(PortalGlass("rose", "shut", (1.0, 0.5, 0.0), 15.0, 0.0)), author=1)
    history.obey(SetSun(replace(START.sun, hour=8.0, zone="UTC")), author=1)
    kept.save(history.state, tmp_path / "a.json", looks=history.looks)
    state, looks = kept.load(tmp_path / "a.json", START)
    assert light_of(state) == light_of(history.state)
    assert [(name, light_of(look)) for name, look in looks] == [
        (name, light_of(look)) for name, look in history.looks
    ]
    with pytest.raises(InputError, match="known are Evening"):
        history.look("Morning")
    for k in range(31):
        history.obey(SaveLook(f"{k}"), author=1)
    with pytest.raises(InputError, match="at most 32"):
        history.obey(SaveLook("more"), author=1)
    history.obey(SaveLook("Evening"), author=1)


# ---- Rig files ---------------------------------------------------------------------------------------------------


def test_a_rig_goes_out_and_comes_back() -> None:
    known = Environments()
    state = after(
        SetEnvironment("stock:sunset", 200.0, 0.5, (1.0, 0.5, 0.25)), SetDisc("d0", 10.0, -5.0, 3.0, (1.0, 2.0, 3.0)),
        SetLamp(replace(BULB, id="l0", color=(1.0, 1.0, 1.0))), SetLamp(replace(SPOT, id="l1", on=False, dim=1.0)),
        SetGlass(PortalGlass("rose", "frosted", (1.0, 0.5, 0.0), 20.0, 0.5)),
    )  # fmt: skip
    text = rig_text(state, known, takes=TAKES, title="a\nname")
    again = opened_rig(text, START, known)
    assert rig_text(again, known, takes=TAKES, title="a\nname") == text.replace('"d"', '"d0"')
    sun = after(
        SetSun(replace(START.sun, hour=8.25, zone="Europe/Zagreb", turbidity=4.0)),
        SetEnvironment(rotation_deg=30.0),
    )
    back = opened_rig(rig_text(sun, known, takes=TAKES, title="x"), START, known)
    assert (back.sun, back.rotation_deg) == (sun.sun, 30.0)
    with pytest.raises(InputError, match="nothing shines"):
        rig_text(after(SetEnvironment(scale=0.0)), known, takes=TAKES, title="x")


@pytest.mark.parametrize(
    ("text", "said"),
    [("x", "not a TOML"), ("[environment]\nmap = 'gone.hdr'", "gone.hdr"),
     ("[environment]\nmap = 3", "/environment/map"),
     ("[[paint]]\nelevation_range_deg=[0,9]\nradiance=[1,1,1]\n[environment]\nmap='stock:noon'", "paint"),
     ("[[lamp]]\nposition=[0,1,0]\nlumens=5\nies='a.ies'", "ies"), ("[[lamp]]\nposition=[0,1,0]", "/lamp/0"),
     ("[[spot]]\nintensity=[1,1,1]\ndirection=[0,-1,0]", "steerable"),
     ("[sun]\nplace=[1,2]\ntime='2026-01-01T10:00'\nground_albedo=0.5", "ground_albedo"),
     ("[sun]\nplace=[1,2]\ntime='x'", "time"), ("[environment]\nmap='stock:noon'\n[[portal]]\nname='*'", "portal")],
    ids=range(10),
)  # fmt: skip
def test_what_the_page_cannot_show_is_said(text, said) -> None:
    with pytest.raises(InputError) as refused:
        opened_rig(text, START, Environments())
    assert said in str(refused.value)
    assert str(refused.value).isprintable()


# ---- A rig to begin with -----------------------------------------------------------------------------------------


def test_a_new_rig_lights_its_bake(bake, tmp_path, prelight) -> None:
    """As it is, with its lamp switched on, and with every table that is a comment."""
    rig = tmp_path / "new.toml"
    answer = prelight("rig", "new", bake.path, "-o", rig)
    assert answer.code == 0, answer.err
    assert prelight("rig", "new", bake.path, "-o", rig).code == 3
    whole = LitBake(bake)
    means = []
    text = rig.read_text()
    tables = "\n".join(
        line.removeprefix("# ") if line.startswith(("# [[", "# ")) and ("=" in line or "[[" in line) else line
        for line in text.split("# Or the sun")[0].splitlines() + text.split("# A soft")[1].splitlines()[1:]
    )
    for each in (text, text.replace("scale = 0.0 ", "scale = 1.0 "), tables):
        rig.write_text(each)
        whole.light(Rig.open(str(rig)))
        means.append(float(whole.irradiance.mean()))
    assert 0 < means[0] < means[1] < means[2]
    assert prelight("rig", "new", bake.path, "-o", tmp_path / "a.png").code == 2

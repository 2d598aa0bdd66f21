"""Lamps, sun, looks, false colour and rig files on the page: what is touched changes the pixels as light must."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from prelight.images.tonemap import srgb_decode
from prelight.lighting.rig import Rig
from prelight.relighting.lit_bake import LitBake

from .live_studio import running
from .portal_rooms import portals_of, two_windows
from .studio_bakes import lamps_bake
from .studio_browser import HEIGHT, WIDTH, Visit, chromium, visiting
from .test_studio_live import LEFT, RIGHT, changed, link, scene_alone
from .test_studio_views import town

STOPS = -1.0


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def bake(browser, tmp_path_factory) -> Path:
    return lamps_bake(tmp_path_factory)


@pytest.fixture
def visit(browser, bake, tmp_path) -> Iterator[Visit]:
    """Under an overcast sky, shown linearly, at an exposure of its own."""
    with (
        running(bake, state_file=tmp_path / "state.json") as live,
        visiting(browser, link(live), height=540) as there,
    ):
        there.settled()
        changed(there, there.page.get_by_role("radio", name="overcast").click)
        there.page.get_by_role("radio", name="Linear").click()
        there.slide("Picture", "Exposure", STOPS)
        yield there
        assert not there.complaints


def linear(visit: Visit) -> np.ndarray:
    """The scene's light as it is shown, before exposure."""
    visit.page.evaluate("() => document.activeElement?.blur()")  # or letters are typed there
    return srgb_decode(scene_alone(visit).astype(np.uint8)) / 2.0**STOPS


def look(visit: Visit) -> dict:
    return visit.page.evaluate("() => JSON.parse(JSON.stringify(__prelight.look()))")


def test_a_lamp_is_put_up_dimmed_coloured_switched_and_undone(visit):
    page = visit.page
    before = linear(visit)
    changed(visit, page.get_by_role("button", name="Add lamp").click)
    (lamp,) = look(visit)["lamps"]
    lamps = page.get_by_role("region", name="Lamps")
    set_number(visit, "At full lm", lamp["strength"] / 2)  # well inside what is shown
    lit = linear(visit) - before
    assert lit[LEFT].mean() > 0.02
    assert lit.min() > -0.01
    changed(visit, lambda: visit.slide("Lamps", "Dimmer", 50))
    half = linear(visit) - before
    said = lamps.locator("li .said").text_content() or ""
    assert float(said.removesuffix(" lm").replace(",", "")) == pytest.approx(lamp["strength"] / 4, rel=0.05)
    assert half[LEFT].mean() / lit[LEFT].mean() == pytest.approx(0.5, abs=0.03)
    changed(visit, lambda: visit.slide("Lamps", "Warmth", 2500))
    warm = linear(visit) - before
    assert warm[LEFT][..., 0].mean() > 1.2 * half[LEFT][..., 0].mean()
    assert warm[LEFT][..., 2].mean() < 0.6 * half[LEFT][..., 2].mean()
    changed(visit, lamps.get_by_role("switch").click)
    assert np.abs(linear(visit) - before).mean() < 0.002
    assert page.get_by_text("off", exact=True).is_visible()
    undo = page.get_by_role("button", name="Undo")
    changed(visit, undo.click)
    assert np.abs(linear(visit) - before - warm).mean() < 0.002
    for _ in range(4):
        changed(visit, undo.click)
    assert look(visit)["lamps"] == []
    changed(visit, page.get_by_role("button", name="Redo").click)
    assert len(look(visit)["lamps"]) == 1


def set_number(visit: Visit, name: str, value: float) -> None:
    field = visit.page.get_by_role("spinbutton", name=name, exact=True)
    field.fill(str(value))
    changed(visit, lambda: field.press("Enter"))


def where(handle: Any) -> dict[str, float]:
    """The box of a handle, once the page has come to rest: it follows the picture a frame later."""
    known, found = None, handle.bounding_box()
    while found is None or found != known:
        handle.page.wait_for_timeout(200)
        known, found = found, handle.bounding_box()
    return found


def test_a_lamp_is_moved_by_hand_by_keys_and_by_numbers(visit):
    """To the right of the ball: its shadow falls to the left, and the right gets brighter."""
    page = visit.page
    before = linear(visit)
    changed(visit, page.get_by_role("button", name="Add lamp").click)
    for axis, value in zip("xyz", (-1.2, 1.0, 0.6), strict=True):
        set_number(visit, f"Place, m {axis}", value)
    set_number(visit, "At full lm", 8765)
    left = linear(visit) - before
    assert left[LEFT].mean() > 1.3 * left[RIGHT].mean()
    handle = page.get_by_role("button", name="Lamp 1 at")
    box = where(handle)
    updates = visit.metric("updates")
    page.mouse.move(box["x"] + 10, box["y"] + 10)
    over = partial(page.mouse.move, box["x"] + 180, box["y"] + 10, steps=12)
    changed(visit, page.mouse.down, over, page.mouse.up)
    assert visit.metric("updates") > updates + 1
    moved = look(visit)["lamps"][0]["position"]
    assert moved[0] > -0.4
    for _ in range(3):
        changed(visit, lambda: handle.press("Shift+ArrowRight"))
    at = look(visit)["lamps"][0]["position"]
    assert at[0] > moved[0] + 0.1 or at[2] != moved[2]
    changed(visit, lambda: handle.press("PageUp"))
    assert look(visit)["lamps"][0]["position"][1] > at[1]
    set_number(visit, "Place, m x", 1.2)
    right = linear(visit) - before
    assert right[RIGHT].mean() > 1.3 * left[RIGHT].mean()
    assert right[LEFT].mean() < left[LEFT].mean()
    changed(visit, lambda: handle.press("Delete"))
    assert look(visit)["lamps"] == []


def test_a_spot_is_aimed_at_what_is_pointed_at(visit):
    page = visit.page
    before = linear(visit)
    changed(visit, page.get_by_role("button", name="Add spot").click)
    for name, value in (("Place, m y", 2.0), ("Aim, m x", -0.7), ("Aim, m z", 0.4), ("Aim, m y", 0.0)):
        set_number(visit, name, value)
    changed(visit, lambda: visit.slide("Lamps", "Beam", 30))
    left = linear(visit) - before
    assert left[LEFT].mean() > 2 * left[RIGHT].mean()
    aim = where(page.get_by_role("button", name="Aim of Spot 1"))
    page.mouse.move(aim["x"] + 11, aim["y"] + 11)
    stage = page.locator("#stage canvas").bounding_box()
    # Where RIGHT is seen: the picture is as wide as the page, and its middle that of what the panel leaves free.
    over = partial(page.mouse.move, aim["x"] + 60, aim["y"] + 11, steps=4)
    changed(visit, page.mouse.down, over, page.mouse.up)
    target = look(visit)["lamps"][0]["target"]
    assert target[0] > -0.6
    assert abs(target[1]) < 1.1  # on a surface
    assert stage["width"] > 0


def test_the_hour_moves_the_shadow(visit):
    page = visit.page
    changed(visit, page.get_by_role("radio", name="daylight").click)
    visit.slide("Picture", "Exposure", -6)
    changed(visit, lambda: visit.slide("Sky", "Hour", 8))
    morning = scene_alone(visit)
    changed(visit, lambda: visit.slide("Sky", "Hour", 16))
    afternoon = scene_alone(visit)
    assert (
        morning[LEFT].mean() < 0.93 * afternoon[LEFT].mean()
        or morning[RIGHT].mean() > 1.07 * afternoon[RIGHT].mean()
    )
    changed(visit, lambda: visit.slide("Sky", "Hour", 1))
    ground = slice(165, 225), slice(165, 300)
    assert scene_alone(visit)[ground].max() <= 1
    assert page.get_by_role("slider", name="Hour").get_attribute("aria-valuetext") == "01:00"
    assert page.get_by_role("region", name="Sky").get_by_role("slider", name="Warmth").is_hidden()


def test_looks_side_by_side_and_cross_faded(visit):
    page = visit.page
    first = linear(visit)
    page.get_by_role("textbox", name="Name of the look").fill("Grey day")
    changed(visit, page.get_by_role("button", name="Keep").click)
    changed(visit, lambda: visit.slide("Sky", "Strength", -1.5))
    now = linear(visit)
    page.get_by_role("button", name="Compare with Grey day").click()
    page.get_by_role("slider", name="Where the other look begins").wait_for(state="attached")
    visit.until("__prelight.metrics.sides")
    both = linear(visit)
    half = WIDTH // 2
    assert np.abs(both[:, : half - 3] - now[:, : half - 3]).mean() < 0.003
    assert np.abs(both[:, half + 3 :] - first[:, half + 3 :]).mean() < 0.003
    page.get_by_role("radio", name="Cross-fade").click()
    visit.slide("Looks", "Right side", 25)
    assert np.abs(linear(visit) - (0.75 * now + 0.25 * first)).mean() < 0.005
    visit.slide("Looks", "Right side", 50)
    page.get_by_role("radio", name="Side by side").click()
    assert np.abs(linear(visit) - both).mean() < 0.003
    page.get_by_role("button", name="Done").click()
    assert np.abs(linear(visit) - now).mean() < 0.003
    changed(visit, page.get_by_role("button", name="Grey day", exact=True).click)
    assert np.abs(linear(visit) - first).mean() < 0.003
    changed(visit, page.get_by_role("button", name="Forget Grey day").click)
    assert page.get_by_role("button", name="Grey day", exact=True).count() == 0


def test_false_colour_shows_what_a_meter_reads(visit, bake):
    """Illuminance of the floor, by its colour in the legend, is that of the relighter."""
    page = visit.page
    page.get_by_role("radio", name="lux").click()
    visit.slide("Picture", "Red is", 4)
    shown = scene_alone(visit)
    marks = [mark for mark in page.locator("#legend li").all_text_contents() if mark]
    assert (marks[0], marks[-1]) == ("10,000", "10")
    light = LitBake(bake)
    light.light(Rig.open("stock:overcast"))
    irradiance = light.irradiance @ np.array([0.2126, 0.7152, 0.0722])
    floor = np.abs(light.bake.receivers.positions[:, 1]) < 1e-3
    brightest = 683 * np.pi * np.quantile(irradiance[floor], 0.9)
    palette = np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in PALETTE], float)
    at = np.linspace(0, 7, 701)
    ramp = np.stack([np.interp(at, np.arange(8), palette[:, k]) for k in range(3)], axis=1)
    near = np.abs(ramp[None] - shown[slice(165, 225), slice(165, 300)].reshape(-1, 1, 3)).sum(axis=2)
    assert near.min(axis=1).max() < 12  # every colour is one of the legend's
    lux = 10 ** (4 - 3 * (1 - at[near.argmin(axis=1)] / 7))
    assert np.quantile(lux, 0.9) == pytest.approx(brightest, rel=0.15)
    page.get_by_role("radio", name="Picture", exact=True).click()
    assert page.locator("#legend").is_hidden()


PALETTE = ("#15123f", "#2b3c99", "#1f7fb3", "#1fa88f", "#79c142", "#f1d13a", "#f08c2e", "#cf2a33")


def test_a_rig_is_saved_and_opened(visit, bake, tmp_path, prelight):
    """The file that the page gives shows the same picture with ``prelight relight``."""
    page = visit.page
    changed(visit, page.get_by_role("button", name="Add lamp").click)
    set_number(visit, "Place, m x", -0.9)
    set_number(visit, "At full lm", 4321)
    changed(visit, lambda: visit.slide("Sky", "Turn", 40))
    with page.expect_download() as download:
        page.get_by_role("button", name="Save rig").click()
    rig = tmp_path / "rig.toml"
    download.value.save_as(rig)
    answer = prelight(
        "relight", bake, rig, "-o", tmp_path / "a.png", "--size", f"{WIDTH}x{HEIGHT}", "--exposure", str(STOPS),
        "--curve", "linear",
    )  # fmt: skip
    assert answer.code == 0, answer.err
    from PIL import Image

    expected = np.asarray(Image.open(tmp_path / "a.png").convert("RGB"), float)
    difference = np.abs(scene_alone(visit) - expected)
    assert np.quantile(difference, 0.9) <= 1.5
    assert difference.mean() < 1.0
    seen = linear(visit)
    wanted = look(visit)
    changed(
        visit, page.get_by_role("radio", name="noon").click, page.get_by_role("button", name="Remove").click
    )
    changed(visit, lambda: page.get_by_label("Rig file").set_input_files(rig))
    again = look(visit)
    assert (again["environment"], again["rotation_deg"]) == ("stock:overcast", 40)
    assert again["lamps"][0]["position"] == wanted["lamps"][0]["position"]
    assert np.abs(linear(visit) - seen).mean() < 0.003
    bad = tmp_path / "bad.toml"
    bad.write_text("[environment]\nmap = 'gone.hdr'")
    page.get_by_label("Rig file").set_input_files(bad)
    page.get_by_role("alert").get_by_text("gone.hdr").wait_for()
    assert look(visit)["lamps"]


def test_glass_and_a_world_outside(browser, tmp_path):
    """One of two windows shut takes its share, red glass leaves red, frost spreads the sun, a wall takes light."""
    portals_of(two_windows(), tmp_path / "room.prelight")
    with (
        running(tmp_path / "room.prelight", state_file=tmp_path / "s.json", rigs=[town(tmp_path)]) as live,
        visiting(browser, link(live), height=540) as visit,
    ):
        visit.settled()
        page = visit.page
        changed(visit, page.get_by_role("radio", name="overcast").click)
        page.get_by_role("radio", name="Linear").click()
        page.get_by_role("radio", name="Plain").click()
        visit.slide("Picture", "Exposure", STOPS)
        glass = page.get_by_role("region", name="Glass")
        before = linear(visit)
        glass.get_by_role("button", name="left glass").click()
        changed(visit, page.get_by_role("radio", name="Shut").click)
        shut = linear(visit)
        assert shut.mean() < 0.9 * before.mean()
        assert (shut - before).max() < 0.02
        changed(visit, page.get_by_role("button", name="Undo").click)
        assert np.abs(linear(visit) - before).mean() < 0.003
        changed(visit, lambda: page.get_by_label("Tint of the glass").fill("#ff2000"))
        red = linear(visit)
        assert red[..., 2].mean() < 0.9 * before[..., 2].mean()
        assert red[..., 0].mean() > 0.95 * before[..., 0].mean()
        changed(visit, page.get_by_role("button", name="As built").click)
        assert np.abs(linear(visit) - before).mean() < 0.003
        changed(visit, lambda: page.get_by_role("combobox", name="World outside").select_option("town.toml"))
        far = linear(visit)
        changed(visit, lambda: visit.slide("Outside", "Time", 4))
        near = linear(visit)
        surfaces = np.abs(before - shut).sum(axis=2) > 0.02
        assert near[surfaces].mean() < 0.98 * far[surfaces].mean(), "the wall before the left window"
        changed(visit, lambda: page.get_by_role("combobox", name="World outside").select_option(""))
        assert np.abs(linear(visit) - before).mean() < 0.003
        changed(visit, page.get_by_role("radio", name="noon").click)
        for turn in (60, 90):  # the sun comes in at one of the windows
            changed(visit, lambda turn=turn: visit.slide("Sky", "Turn", turn))
        sunny = linear(visit)
        changed(visit, page.get_by_role("radio", name="Frosted").click)
        frosted = linear(visit)
        changed(visit, lambda: visit.slide("Glass", "Frost", 50))
        assert np.abs(frosted - sunny)[surfaces].mean() > 0.002
        assert np.abs(linear(visit) - frosted)[surfaces].mean() > 0.001
        changed(visit, page.get_by_role("radio", name="Clear", exact=True).click)
        assert np.abs(linear(visit) - sunny)[surfaces].mean() < 0.0005
        changed(visit, page.get_by_role("radio", name="overcast").click)
        for name in ("left glass", "right glass"):
            glass.get_by_role("button", name=name).click()
            changed(visit, lambda: visit.slide("Glass", "Blind", 100))
        assert page.evaluate("() => __prelight.look().glass.length") == 2
        assert linear(visit)[surfaces].max() < 0.02
        assert not visit.complaints

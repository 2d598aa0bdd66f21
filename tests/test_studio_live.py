"""The page and the studio together, in a real browser: what is touched there changes the pixels as light must."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import prelight as pl
from prelight.images.tonemap import srgb_decode

from . import disk
from .live_studio import LiveStudio, running
from .scenes import ball_on_floor
from .studio_browser import HEIGHT, WIDTH, Visit, chromium, visiting

LEFT, RIGHT = (  # of the ball, on the floor
    (slice(173, 187), slice(150, 217)),
    (slice(156, 169), slice(274, 303)),
)


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def bake(browser, tmp_path_factory) -> Path:
    """A ball over a floor of 1,600 vertices."""
    path = tmp_path_factory.mktemp("studio") / "ball.prelight"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(disk, "ball_on_floor", lambda **_: ball_on_floor(side=40))
        disk.quick_bake(path, tolerance=0.03)
    return path


@pytest.fixture
def visit(browser, bake, tmp_path) -> Iterator[Visit]:
    with (
        running(bake, state_file=tmp_path / "state.json") as live,
        visiting(browser, link(live), height=540) as there,
    ):
        there.settled()
        yield there
        assert not there.complaints
        assert all(url.startswith(f"http://127.0.0.1:{live.port}/") for url in there.requests)


def link(live: LiveStudio) -> str:
    return live.studio.new_link()


def scene_alone(visit: Visit) -> np.ndarray:
    """The scene without panels, 16:9, once its light and its sky are there."""
    visit.page.set_viewport_size({"width": WIDTH, "height": HEIGHT})
    visit.page.keyboard.press("h")
    visit.until("document.querySelector('canvas').height", lambda height: height == HEIGHT)
    visit.page.wait_for_timeout(100)
    shown = visit.pixels()
    visit.page.keyboard.press("h")
    drawn = visit.metric("drawn")
    visit.page.set_viewport_size({"width": WIDTH, "height": 540})
    visit.until("document.querySelector('canvas').height", lambda height: height == 540)
    visit.until("__prelight.metrics.drawn", lambda count: count > drawn)  # handles are where lamps are drawn
    return shown


def changed(visit: Visit, *touch) -> None:
    """Do something, and wait for the exact light of it."""
    visit.settled()
    before = visit.metric("lastSequence")
    for each in touch:
        each()
    visit.settled(after=before + 1)


def test_turning_the_sky_moves_the_shadow(visit, bake):
    """With the disc, by hand: the shadow goes from the right of the ball to its left, as `relight` draws it."""
    page = visit.page
    visit.slide("Picture", "Exposure", -2)
    changed(visit, page.get_by_role("radio", name="noon").click)
    first = scene_alone(visit)
    box = page.get_by_role("slider", name="Turn of the sky").bounding_box()
    x, y, r = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, 0.3 * box["width"]
    page.mouse.move(x, y - r)
    page.mouse.down()
    updates = visit.metric("updates")
    for angle in np.radians(np.linspace(0, 150, 16)):
        page.mouse.move(x - r * np.sin(angle), y - r * np.cos(angle))
    changed(visit, page.mouse.up)
    assert visit.metric("updates") > updates + 1  # seen while it moved
    turn = page.evaluate("() => __prelight.look().rotation_deg")
    assert turn == pytest.approx(150, abs=2)
    second = scene_alone(visit)
    assert first[RIGHT].mean() < 0.93 * second[RIGHT].mean()
    assert second[LEFT].mean() < 0.93 * first[LEFT].mean()
    light = pl.Relighter(bake)
    for shown, degrees in ((first, 0.0), (second, turn)):
        light.environment = pl.Environment.stock("noon").rotated(degrees)
        expected = light.picture(width=WIDTH, height=HEIGHT).display(exposure=-2.0)
        difference = np.abs(shown - expected.astype(np.float64))
        assert np.quantile(difference, 0.9) <= 1.5  # bytes
        assert difference.mean() < 1.0


def test_scale_and_warmth_change_the_light_by_their_factors(visit):
    page = visit.page
    changed(visit, page.get_by_role("radio", name="overcast").click)
    page.get_by_role("radio", name="Linear").click()
    visit.slide("Picture", "Exposure", -3)
    ground = slice(165, 225), slice(165, 300)
    before = srgb_decode(scene_alone(visit).astype(np.uint8))[ground].mean(axis=(0, 1))
    changed(visit, lambda: visit.slide("Sky", "Strength", 1))
    brighter = srgb_decode(scene_alone(visit).astype(np.uint8))[ground].mean(axis=(0, 1))
    assert brighter / before == pytest.approx(np.full(3, 2.0), rel=0.02)
    changed(visit, lambda: visit.slide("Sky", "Warmth", 12000))
    bluer = srgb_decode(scene_alone(visit).astype(np.uint8))[ground].mean(axis=(0, 1))
    tint = page.evaluate("() => __prelight.look().tint")
    assert tint[2] > 1.3 * tint[0]
    assert bluer / brighter == pytest.approx(np.array(tint), rel=0.02)


def test_a_light_added_throws_a_shadow_of_its_own(visit):
    page = visit.page
    visit.slide("Picture", "Exposure", -2)
    changed(visit, page.get_by_role("radio", name="overcast").click)
    before = scene_alone(visit)
    changed(visit, page.get_by_role("button", name="Add a light").click)
    after = scene_alone(visit)
    gain = after - before
    assert gain[LEFT].mean() > 10  # it stands on the left
    assert gain[RIGHT].mean() < 0.8 * gain[LEFT].mean()
    page.get_by_role("button", name="Remove", exact=True).scroll_into_view_if_needed()
    changed(visit, page.get_by_role("button", name="Remove", exact=True).click)
    assert np.abs(scene_alone(visit) - before).mean() < 0.5


def test_a_second_visitor_and_a_second_start_see_the_same(browser, bake, tmp_path):
    state = tmp_path / "state.json"
    look = "JSON.stringify({...__prelight.look(), undo: null, redo: null})"  # history ends with the studio
    with running(bake, state_file=state) as live, visiting(browser, link(live), height=540) as first:
        first.settled()
        with visiting(browser, link(live), height=540) as second:
            second.settled()
            changed(first, first.page.get_by_role("radio", name="sunset").click)
            changed(
                first, lambda: first.slide("Sky", "Turn", 60), lambda: first.slide("Sky", "Strength", 0.5)
            )
            changed(first, first.page.get_by_role("button", name="Add a light").click)
            second.until(look, lambda seen: seen == first.page.evaluate(f"() => {look}"))
            wanted = second.page.evaluate(f"() => {look}")
            assert json.loads(wanted)["rotation_deg"] == 60
            assert len(json.loads(wanted)["discs"]) == 1
            second.settled(after=first.metric("lastSequence"))
            picture = scene_alone(first)
            assert np.abs(scene_alone(second) - picture).max() <= 1
            assert not second.complaints
        assert not first.complaints
    with running(bake, state_file=state) as live, visiting(browser, link(live), height=540) as again:
        again.settled()
        assert again.page.evaluate(f"() => {look}") == wanted
        assert np.abs(scene_alone(again) - picture).max() <= 1

"""The page and the studio together, in a real browser: what is touched there changes the pixels as light must."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import prelight as pl
from prelight.images.tonemap import srgb_decode

from .studio_browser import HEIGHT, WIDTH, Visit, chromium, visiting

pytest.importorskip("starlette", reason="the studio's server is not installed")
LEFT, RIGHT = (slice(300, 335), slice(100, 240)), (slice(300, 335), slice(350, 490))  # of the plinth, on the ground


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def bake(browser, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("studio") / "sculpture.prelight"
    pl.bake_environment(pl.load_scene("stock:sculpture-small"), path, resolution=24, tolerance=0.03, bounces=0)
    return path


@contextmanager
def running(bake: Path, state: Path) -> Iterator:
    from prelight.storage.bake import Bake
    from prelight.studio.environments import Environments
    from prelight.studio.server import Served, Studio

    studio = Studio(Served(Bake.open(bake), Environments(()), state, lambda _: None), port=0)
    thread = threading.Thread(target=studio.serve, daemon=True)
    thread.start()
    try:
        yield studio
    finally:
        studio.stop()
        thread.join(15)
        assert not thread.is_alive()


@pytest.fixture
def visit(browser, bake, tmp_path) -> Iterator[Visit]:
    with running(bake, tmp_path / "state.json") as studio, visiting(browser, studio.new_link(), height=720) as there:
        there.settled()
        yield there
        assert not there.complaints
        assert all(url.startswith(f"http://127.0.0.1:{studio.port}/") for url in there.requests)


def scene_alone(visit: Visit) -> np.ndarray:
    """The scene without panels, 16:9, once its light and its sky are there."""
    visit.page.set_viewport_size({"width": WIDTH, "height": HEIGHT})
    visit.page.keyboard.press("h")
    before = visit.pixels()
    for _ in range(40):
        visit.page.wait_for_timeout(80)
        after = visit.pixels()
        if after.shape == (HEIGHT, WIDTH, 3) and np.array_equal(before, after):
            break
        before = after
    visit.page.keyboard.press("h")
    visit.page.set_viewport_size({"width": WIDTH, "height": 720})
    return after


def changed(visit: Visit, *touch) -> None:
    """Do something, and wait for the exact light of it."""
    before = visit.metric("lastSequence")
    for each in touch:
        each()
    visit.settled(after=before + 1)
    visit.page.wait_for_timeout(250)  # a drag may have more to come
    visit.settled()


def test_turning_the_sky_moves_the_shadow(visit, bake):
    """With the disc, by hand: the shadow goes from the right of the plinth to its left, as `relight` draws it."""
    page = visit.page
    changed(visit, page.get_by_role("radio", name="noon").click)
    first = scene_alone(visit)
    assert first[RIGHT].mean() < 0.9 * first[LEFT].mean()
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
    assert second[LEFT].mean() < 0.9 * second[RIGHT].mean()
    light = pl.Relighter(bake)
    for shown, degrees in ((first, 0.0), (second, turn)):
        light.environment = pl.Environment.stock("noon").rotated(degrees)
        expected = light.picture("front", width=WIDTH, height=HEIGHT).display(exposure=0.0)
        difference = np.abs(shown - expected.astype(np.float64))
        assert np.quantile(difference, 0.9) <= 1.5  # bytes
        assert difference.mean() < 1.0


def test_scale_and_warmth_change_the_light_by_their_factors(visit):
    page = visit.page
    changed(visit, page.get_by_role("radio", name="overcast").click)
    page.get_by_role("radio", name="Linear").click()
    visit.slide("Picture", "Exposure", -2)
    ground = slice(200, 360), slice(0, WIDTH)
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
    changed(visit, page.get_by_role("radio", name="overcast").click)
    before = scene_alone(visit)
    changed(visit, page.get_by_role("button", name="Add a light").click)
    after = scene_alone(visit)
    gain = after - before
    assert gain[LEFT].mean() > 15  # it stands on the left, in front
    assert gain[RIGHT].mean() < 0.85 * gain[LEFT].mean()
    page.get_by_role("button", name="Remove", exact=True).scroll_into_view_if_needed()
    changed(visit, page.get_by_role("button", name="Remove", exact=True).click)
    assert np.abs(scene_alone(visit) - before).mean() < 0.5


def test_a_second_visitor_and_a_second_start_see_the_same(browser, bake, tmp_path):
    state = tmp_path / "state.json"
    look = "JSON.stringify(__prelight.look())"
    with running(bake, state) as studio, visiting(browser, studio.new_link(), height=720) as first:
        first.settled()
        with visiting(browser, studio.new_link(), height=720) as second:
            second.settled()
            changed(first, first.page.get_by_role("radio", name="sunset").click)
            changed(first, lambda: first.slide("Sky", "Turn", 60), lambda: first.slide("Sky", "Strength", 0.5))
            changed(first, first.page.get_by_role("button", name="Add a light").click)
            wanted = first.page.evaluate(f"() => {look}")
            second.until(look, lambda seen: seen == wanted)
            second.settled(after=first.metric("lastSequence"))
            picture = scene_alone(first)
            assert np.abs(scene_alone(second) - picture).max() <= 1
            assert not second.complaints
        assert not first.complaints
    with running(bake, state) as studio, visiting(browser, studio.new_link(), height=720) as again:
        again.settled()
        assert again.page.evaluate(f"() => {look}") == wanted
        assert np.abs(scene_alone(again) - picture).max() <= 1

"""The rest of the controls, on one page: colours, beam and softness, keys, the strip, luminance, the path tracer."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from prelight.cli.studio import path_tracer
from prelight.images.tonemap import srgb_decode
from prelight.lighting.rig import Rig

from .live_studio import running
from .studio_bakes import lamps_bake
from .studio_browser import Visit, chromium, visiting
from .test_studio_lamps import linear, look, set_number
from .test_studio_live import LEFT, RIGHT, changed, link, scene_alone

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@pytest.fixture(scope="module")
def visit(tmp_path_factory) -> Iterator[Visit]:
    """One page for all of them; each leaves the overcast sky as it was, six stops down."""
    bake, folder = lamps_bake(tmp_path_factory), tmp_path_factory.mktemp("rest")
    with (
        chromium() as browser,
        running(bake, state_file=folder / "state.json", pictures=path_tracer()) as live,
        visiting(browser, link(live), height=540) as there,
    ):
        there.settled()
        changed(there, there.page.get_by_role("radio", name="overcast").click)
        changed(there, lambda: there.slide("Sky", "Strength", -4))
        there.page.get_by_role("radio", name="Linear").click()
        there.slide("Picture", "Exposure", -1)
        yield there
        assert not there.complaints


def undone(visit: Visit) -> None:
    """Take everything back to the dim sky."""
    while visit.page.evaluate("() => __prelight.look().undo") != "strength of the sky":
        changed(visit, visit.page.get_by_role("button", name="Undo").click)


def test_a_lamps_colour_and_a_spots_beam(visit):
    page = visit.page
    before = linear(visit)
    changed(visit, page.get_by_role("button", name="Add spot").click)
    for name, value in (("Place, m y", 2.0), ("Aim, m x", -0.7), ("Aim, m z", 0.4), ("Aim, m y", 0.0)):
        set_number(visit, name, value)
    set_number(visit, "At full cd", 1500)
    white = (linear(visit) - before)[LEFT].mean(axis=(0, 1))
    changed(visit, lambda: page.get_by_label("Colour of the lamp").fill("#c08040"))
    ours = (linear(visit) - before)[LEFT].mean(axis=(0, 1)) / white  # the floor's own colour is gone
    picked = srgb_decode(np.array([0xC0, 0x80, 0x40], np.uint8)).astype(float)
    assert ours == pytest.approx(picked / (picked @ LUMINANCE), rel=0.1)  # as bright as before
    changed(visit, lambda: visit.slide("Lamps", "Warmth", 9000))
    cool = (linear(visit) - before)[LEFT].mean(axis=(0, 1)) / white
    assert cool @ LUMINANCE == pytest.approx(1, rel=0.1)
    assert cool[2] > 1.1 > 0.97 > cool[0]
    assert page.get_by_role("switch", name="Spot 1 is lit").evaluate(
        "e => e.style.getPropertyValue('--light')"
    )
    changed(visit, lambda: visit.slide("Lamps", "Beam", 20))
    narrow = linear(visit) - before
    changed(visit, lambda: visit.slide("Lamps", "Beam", 110))
    wide = linear(visit) - before
    assert wide[RIGHT].mean() > narrow[RIGHT].mean() + 0.01
    page.get_by_label("Name of the lamp").fill("Key light")
    changed(visit, lambda: page.get_by_label("Name of the lamp").press("Enter"))
    assert page.get_by_role("switch", name="Key light is lit").count() == 1
    changed(visit, page.get_by_role("region", name="Lamps").get_by_role("button", name="Remove").click)
    assert np.abs(linear(visit) - before).mean() < 0.003


def test_the_strip_the_softness_and_the_tint(visit):
    """A double click on the left of the strip lights from there; the tint of the sky is that of its light."""
    page = visit.page
    before = linear(visit)
    strip = page.locator(".strip canvas")
    strip.scroll_into_view_if_needed()
    box = strip.bounding_box()
    changed(
        visit, lambda: page.mouse.dblclick(box["x"] + 0.25 * box["width"], box["y"] + 0.4 * box["height"])
    )
    (disc,) = look(visit)["discs"]
    assert disc["azimuth_deg"] == pytest.approx(-90, abs=3)
    lit = linear(visit) - before
    assert lit[LEFT].mean() > 1.2 * lit[RIGHT].mean()  # the ball's shadow falls to the right
    changed(visit, lambda: visit.slide("Lights in the sky", "Radius", 4.9))
    shadows = []
    for softness in (0, 1):
        changed(visit, lambda softness=softness: visit.slide("Lights in the sky", "Softness", softness))
        shadows.append(linear(visit) - before)
    assert np.abs(shadows[1] - shadows[0]).max() > 0.02
    undone(visit)
    changed(visit, lambda: page.get_by_label("Tint of the sky").fill("#ff6040"))
    red = linear(visit)
    assert red[LEFT][..., 0].mean() > 1.2 * before[LEFT][..., 0].mean()
    assert red[LEFT][..., 2].mean() < 0.7 * before[LEFT][..., 2].mean()
    undone(visit)


def test_keys_do_what_the_sheet_says(visit):
    page = visit.page
    page.evaluate("() => document.activeElement?.blur()")
    before = srgb_decode(scene_alone(visit).astype(np.uint8))
    page.keyboard.press("e")
    brighter = srgb_decode(scene_alone(visit).astype(np.uint8))
    assert np.median(brighter[LEFT] / before[LEFT]) == pytest.approx(2**0.5, rel=0.06)
    page.keyboard.press("d")
    assert np.abs(srgb_decode(scene_alone(visit).astype(np.uint8)) - before).max() < 0.01
    changed(visit, lambda: page.keyboard.press("["))
    assert look(visit)["rotation_deg"] == 5
    changed(visit, lambda: page.keyboard.press("]"))
    assert look(visit)["rotation_deg"] == 0
    changed(visit, lambda: page.keyboard.press("l"))
    assert len(look(visit)["discs"]) == 1
    page.evaluate("() => document.activeElement?.blur()")
    changed(visit, lambda: page.keyboard.press("z"))
    assert look(visit)["discs"] == []
    for undo, redo in (("", "Z"), ("z", "y"), ("Control+z", "Control+Shift+Z")):
        if undo:
            changed(visit, lambda undo=undo: page.keyboard.press(undo))
            assert look(visit)["discs"] == []
        changed(visit, lambda redo=redo: page.keyboard.press(redo))
        assert len(look(visit)["discs"]) == 1
    exposure = page.get_by_role("slider", name="Exposure")
    page.get_by_role("button", name="Auto").click()
    visit.until("__prelight.resting()")
    suitable = float(exposure.input_value())
    visit.slide("Picture", "Exposure", suitable + 2)
    page.evaluate("() => document.activeElement.blur()")
    page.keyboard.press("a")
    visit.until(
        "document.querySelector('[aria-label=Exposure]').value",
        lambda stops: abs(float(stops) - suitable) < 0.2,
    )
    visit.slide("Picture", "Exposure", -1)
    page.evaluate("() => document.activeElement.blur()")
    for is_seen in (False, True):
        page.keyboard.press("h")
        assert page.locator("#panel").is_visible() == is_seen
    page.keyboard.press("?")
    assert page.get_by_role("dialog", name="Keys").is_visible()
    page.get_by_role("button", name="Close").click()
    undone(visit)


def test_a_timeline_is_saved_as_a_rig_that_fades(visit, tmp_path):
    """Half way the page shows half of the lamp, and so does the file."""
    page, line = visit.page, visit.page.get_by_role("region", name="Timeline")
    before = linear(visit)
    changed(visit, page.get_by_role("button", name="Add lamp").click)
    changed(visit, page.get_by_role("button", name="Keep", exact=True).click)
    changed(visit, lambda: visit.slide("Lamps", "Dimmer", 0))
    changed(visit, page.get_by_role("button", name="Keep", exact=True).click)
    for _ in range(2):
        changed(visit, line.get_by_role("button", name="Add key").click)
    assert [key["look"] for key in look(visit)["timeline"]] == ["Look 1", "Look 2"]
    shown = []
    for seconds in (0, 1):
        visit.slide("Timeline", "Time", seconds)
        visit.until("__prelight.metrics.sides")
        shown.append((linear(visit) - before)[LEFT].mean())
    assert shown[0] > 0.01
    assert shown[1] == pytest.approx(shown[0] / 2, rel=0.1)
    with page.expect_download() as download:
        line.get_by_role("button", name="Save as rig").click()
    assert download.value.suggested_filename == "timeline.toml"
    download.value.save_as(tmp_path / "timeline.toml")
    rig = Rig.open(str(tmp_path / "timeline.toml"))
    first, half = (rig.at(seconds).lamps[0].lights[0] for seconds in (0.0, 1.0))
    assert np.divide(half.beam.intensity, first.beam.intensity) == pytest.approx(0.5)
    page.evaluate("() => document.activeElement?.blur()")
    page.keyboard.press("t")  # plays to the end, where the lamp is dark
    line.get_by_role("button", name="Play").wait_for()
    assert np.abs(linear(visit) - before)[LEFT].mean() < 0.1 * shown[0]
    line.get_by_role("button", name="Live").click()
    with page.expect_download() as download:
        page.keyboard.press("p")
    assert download.value.suggested_filename.endswith(".png")
    undone(visit)


def test_luminance_in_false_colour_is_683_times_radiance(visit):
    """Red is the top of the legend: where that is what the floor has, it is red; a thousand times more, it is blue."""
    page = visit.page
    changed(visit, lambda: visit.slide("Sky", "Strength", 0))
    floor = np.median(linear(visit)[LEFT] @ LUMINANCE) * 683
    page.get_by_role("radio", name="cd/m²").click()
    exponent = np.floor(np.log10(floor))  # the legend ends at 1, 2 or 5 times a power of ten
    visit.slide("Picture", "Red is", exponent)
    full = scene_alone(visit)[LEFT].reshape(-1, 3).mean(axis=0)
    assert full[0] > 180 > full[2]
    visit.slide("Picture", "Red is", exponent + 3)
    faint = scene_alone(visit)[LEFT].reshape(-1, 3).mean(axis=0)
    assert faint[2] > faint[0]
    page.get_by_role("radio", name="Picture", exact=True).click()
    undone(visit)


def test_the_path_tracer_sees_what_the_page_shows(visit):
    """Mitsuba's own picture of the view, laid over the page's: brighter by what bounces, which this bake leaves out."""
    pytest.importorskip("mitsuba", reason="the renderer is not installed")
    page = visit.page
    changed(visit, lambda: visit.slide("Sky", "Strength", 0))
    ours = linear(visit)
    page.set_viewport_size({"width": 480, "height": 270})
    page.keyboard.press("h")
    page.evaluate("() => document.documentElement.classList.remove('bare')")
    page.get_by_role("button", name="Trace this view").evaluate("button => button.click()")
    visit.until("__prelight.metrics.traced", seconds=60)
    page.locator("p.told", has_text="samples a pixel in").wait_for()
    visit.until(
        "Number(document.querySelector('p[role=status]').textContent.split(' ')[0])",
        lambda n: n >= 24,
        seconds=60,
    )
    page.get_by_role("button", name="Stop", exact=True).evaluate("button => button.click()")
    page.get_by_text("stopped").wait_for(state="attached")
    visit.slide("Looks", "Right side", 100)
    traced = linear(visit)
    for part in (LEFT, RIGHT):
        assert 0.98 < traced[part].mean() / ours[part].mean() < 1.15
    page.get_by_role("button", name="Done").evaluate("button => button.click()")
    assert np.abs(linear(visit) - ours).mean() < 0.003
    undone(visit)

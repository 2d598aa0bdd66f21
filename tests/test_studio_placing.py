"""Light placed by what it does: a click says where the highlight, the shadow or the light itself shall be."""

from __future__ import annotations

import numpy as np
import pytest

from .live_studio import running
from .studio_bakes import lamps_bake
from .studio_browser import chromium, visiting
from .test_studio_lamps import linear, look
from .test_studio_live import LEFT, RIGHT, changed, link


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture
def visit(browser, tmp_path, tmp_path_factory):
    bake = lamps_bake(tmp_path_factory)
    with (
        running(bake, state_file=tmp_path / "state.json") as live,
        visiting(browser, link(live), height=540) as there,
    ):
        there.settled()
        changed(there, there.page.get_by_role("radio", name="overcast").click)
        there.page.get_by_role("radio", name="Linear").click()
        there.slide("Picture", "Exposure", -1)
        yield there
        assert not there.complaints


def found(visit, *, on_ball: bool, left: bool) -> tuple[float, float]:
    """A place of the page where the ball, or the floor to one side of it, is met."""
    width, height = visit.page.evaluate("() => [innerWidth, innerHeight]")
    hits = visit.page.evaluate(
        f"""() => {{
          const hits = [];
          for (let y = 40; y < {height}; y += 6) for (let x = 10; x < {width}; x += 6) {{
            const at = document.elementFromPoint(x, y);
            const p = at?.tagName === "CANVAS" && at.closest("#stage") ? __prelight.pick(x, y) : null;
            if (p) hits.push([x, y, ...p]);
          }}
          return hits;
        }}"""
    )
    hits = np.array(hits)
    high = hits[:, 3] > 0.02
    chosen = hits[high] if on_ball else hits[~high & (np.hypot(hits[:, 2], hits[:, 4]) > 0.8)]
    if not on_ball:
        chosen = chosen[(chosen[:, 2] < 0) == left]
    middle = np.median(chosen[:, :2], axis=0)
    x, y = chosen[np.abs(chosen[:, :2] - middle).sum(axis=1).argmin(), :2]
    return float(x), float(y)


def met(visit, at: tuple[float, float]) -> np.ndarray:
    return np.array(visit.page.evaluate(f"() => __prelight.pick({at[0]}, {at[1]})"))


def test_a_lamp_goes_where_its_light_and_its_shadow_are_clicked(visit):
    page = visit.page
    before = linear(visit)
    changed(visit, page.get_by_role("button", name="Add spot").click)
    lamps = page.get_by_role("region", name="Lamps")
    strength = page.get_by_role("spinbutton", name="At full cd", exact=True)
    strength.fill("6000")
    changed(visit, lambda: strength.press("Enter"))
    place = found(visit, on_ball=False, left=True)
    floor = met(visit, place)
    lamps.get_by_role("button", name="Light", exact=True).click()
    page.get_by_text("Click what the light shall fall on").wait_for()
    changed(visit, lambda: page.mouse.click(*place))
    lamp = look(visit)["lamps"][0]
    assert np.allclose(lamp["target"], floor, atol=1e-3)
    above = np.array(lamp["position"]) - floor
    assert np.abs(above[[0, 2]]).max() < 0.05 * above[1]  # along the normal of the floor
    lit = linear(visit) - before
    assert lit[LEFT].mean() > 3 * lit[RIGHT].mean()
    # Now its shadow falls there: the ball stands between.
    lamps.get_by_role("button", name="Light", exact=True).click()
    lamps.get_by_role("button", name="Shadow").click()
    page.get_by_text("Click where the shadow shall fall").wait_for()
    page.mouse.click(*place)
    page.get_by_text("Now click what shall cast it").wait_for()
    ball = found(visit, on_ball=True, left=True)
    caster = met(visit, ball)
    changed(visit, lambda: page.mouse.click(*ball))
    page.keyboard.press("Escape")
    lamp = look(visit)["lamps"][0]
    way = np.array(lamp["position"]) - floor
    along = (caster - floor) / np.linalg.norm(caster - floor)
    assert np.linalg.norm(np.cross(way, along)) < 1e-3 * np.linalg.norm(way)
    assert way @ along > np.linalg.norm(caster - floor)
    shaded = linear(visit) - before
    assert shaded[LEFT].mean() < 0.25 * lit[LEFT].mean()


def test_a_light_in_the_sky_goes_where_its_highlight_is_clicked(visit):
    """The direction is the eye's ray, reflected at the surface that is clicked."""
    page = visit.page
    lights = page.get_by_role("region", name="Lights in the sky")
    place = found(visit, on_ball=False, left=False)
    floor, eye = met(visit, place), np.array(page.evaluate("() => __prelight.eye()"))
    changed(visit, lights.get_by_role("button", name="Add a light").click)
    lights.get_by_role("button", name="Highlight").click()
    before = linear(visit)
    changed(visit, lambda: page.mouse.click(*place))
    page.keyboard.press("Escape")
    assert np.abs(linear(visit) - before).max() > 0.05  # the ball's shadow is elsewhere
    (disc,) = look(visit)["discs"]
    ray = (floor - eye) / np.linalg.norm(floor - eye)
    mirrored = ray * (1, -1, 1)  # at the floor
    azimuth, elevation = np.radians([disc["azimuth_deg"], disc["elevation_deg"]])
    toward = [np.sin(azimuth) * np.cos(elevation), np.sin(elevation), -np.cos(azimuth) * np.cos(elevation)]
    assert np.degrees(np.arccos(np.clip(np.dot(toward, mirrored), -1, 1))) < 1
    assert page.locator(".hint").is_hidden()

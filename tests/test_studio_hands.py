"""Hands on the studio's page: controls, keys, what goes wrong, and how fast it may go. The studio is the test's own."""

from __future__ import annotations

import time
from contextlib import ExitStack

import numpy as np
import pytest

from .studio_browser import chromium, visiting
from .studio_stand_in import COLUMNS, ROWS, STRAIGHT, StandIn, patches, serving, state

WHITE = np.ones((ROWS * COLUMNS, 3))
MOST_IN_A_SECOND = """() => {
  const at = __prelight.metrics.arrivals;
  return Math.max(...at.map((from) => at.filter((t) => t >= from && t < from + 1000).length));
}"""
COUNT_FRAMES = """() => {
  window.__frames = 0;
  const count = () => { window.__frames++; requestAnimationFrame(count); };
  count();
}"""


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


def test_dragging_the_disc_turns_the_sky_and_sends_once_a_frame(browser):
    studio = patches(WHITE)
    with serving(studio), visiting(browser, studio.url, width=800, height=450) as visit:
        visit.settled()
        page = visit.page
        box = page.get_by_role("slider", name="Turn of the sky").bounding_box()
        x, y, r = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, 0.35 * box["width"]
        page.evaluate(COUNT_FRAMES)
        page.mouse.move(x, y - r)
        page.mouse.down()
        for angle in np.radians(np.linspace(0, 90, 12)):  # counter-clockwise, from the top to the left
            page.mouse.move(x - r * np.sin(angle), y - r * np.cos(angle))
        page.mouse.up()
        visit.until("__prelight.look().rotation_deg", lambda turn: abs(turn - 90) < 1)
        frames = page.evaluate("() => window.__frames")
        wait_for(lambda: turns_sent(studio)[-1]["dragging"] is False)
        sent = turns_sent(studio)
        assert 2 <= len(sent) <= frames + 1
        assert [m["dragging"] for m in sent] == [True] * (len(sent) - 1) + [False]
        turns = [m["rotation_deg"] for m in sent]
        assert turns == sorted(turns)
        assert turns[-1] == pytest.approx(90, abs=1)
        page.evaluate("() => { for (let i = 1; i <= 50; i++) __prelight.change({rotation_deg: i}, true); }")
        wait_for(lambda: studio.state["rotation_deg"] == 50)
        assert len(turns_sent(studio)) == len(sent) + 1
        assert not visit.complaints


def turns_sent(studio: StandIn) -> list[dict]:
    return [message for message in studio.received if message["type"] == "SetEnvironment"]


def test_every_control_sends_what_it_says(browser):
    studio = patches(WHITE)
    with serving(studio), visiting(browser, studio.url, width=800, height=450) as visit:
        visit.settled()
        page = visit.page
        visit.slide("Sky", "Strength", 2)
        wait_for(lambda: studio.state["scale"] == 4.0)
        visit.slide("Sky", "Turn", -45)
        wait_for(lambda: studio.state["rotation_deg"] == -45.0)
        visit.slide("Sky", "Warmth", 12000)
        wait_for(lambda: studio.state["tint"] != [1.0, 1.0, 1.0])
        red, green, blue = studio.state["tint"]
        assert blue > 1.2 * red
        assert 0.2126 * red + 0.7152 * green + 0.0722 * blue == pytest.approx(1.0)
        page.get_by_role("radio", name="sunset").click()
        wait_for(lambda: studio.state["environment"] == "stock:sunset")
        page.get_by_role("radio", name="sunset").press("ArrowLeft")
        wait_for(lambda: studio.state["environment"] == "stock:noon")
        page.get_by_role("button", name="Add a light").click()
        wait_for(lambda: len(studio.state["discs"]) == 1)
        (disc,) = studio.state["discs"]
        power = np.pi * disc["radiance"][1] * 4 * np.sin(np.radians(disc["radius_deg"] / 2)) ** 2
        assert power == pytest.approx(np.pi)  # a white surface that faces it has a radiance of one
        visit.slide("Lights in the sky", "Strength", 1)
        wait_for(lambda: studio.state["discs"][0]["radiance"][1] == pytest.approx(2 * disc["radiance"][1]))
        visit.slide("Lights in the sky", "Softness", 1)
        wait_for(lambda: studio.state["discs"][0]["softness"] == 1.0)
        dot = page.get_by_role("button", name="Light 1")
        dot.press("ArrowRight")
        wait_for(lambda: studio.state["discs"][0]["azimuth_deg"] == pytest.approx(disc["azimuth_deg"] + 2))
        from_box = page.locator(".strip").bounding_box()
        dot.hover()
        page.mouse.down()
        page.mouse.move(
            from_box["x"] + 0.75 * from_box["width"], from_box["y"] + from_box["height"] / 3, steps=5
        )
        page.mouse.up()
        wait_for(lambda: studio.state["discs"][0]["azimuth_deg"] == pytest.approx(90, abs=2))
        assert studio.state["discs"][0]["elevation_deg"] == pytest.approx(45, abs=2)
        dot.press("Delete")
        wait_for(lambda: studio.state["discs"] == [])
        assert not visit.complaints


def test_no_edit_is_lost_where_the_studio_answers_late(browser):
    """Each edit is made of what is seen, which has those on their way; another visitor's do not take them off."""
    studio = patches(WHITE, lag=0.4)
    with serving(studio), visiting(browser, studio.url, width=800, height=450) as visit:
        visit.settled()
        page = visit.page
        page.get_by_role("button", name="Add lamp").click()
        for name, value in (("Dimmer", 50), ("Warmth", 2500), ("Radius", -0.5)):
            visit.slide("Lamps", name, value)
            page.wait_for_timeout(500)  # answers to earlier ones come in between
            studio.state |= {"rotation_deg": studio.state["rotation_deg"] + 7.0, "author": 99}
        seen = page.evaluate("() => __prelight.look().lamps")
        wait_for(lambda: studio.state["lamps"] == seen)
        (lamp,) = studio.state["lamps"]
        assert (lamp["dim"], lamp["radius"]) == (0.5, pytest.approx(10**-0.5, rel=0.01))
        assert lamp["color"][0] > 2 * lamp["color"][2]
        visit.until("__prelight.look().rotation_deg", lambda turn: turn == 21)
        studio.lag, studio.refuses = 0.0, "no more"
        visit.slide("Lamps", "Dimmer", 10)
        page.get_by_role("alert").get_by_text("no more").wait_for()
        visit.until("__prelight.look().lamps[0].dim", lambda dim: dim == 0.5)
        assert not visit.complaints


def test_camera_and_keyboard_move_the_eye(browser, rng):
    studio = patches(rng.uniform(0, 1, (ROWS * COLUMNS, 3)))
    side = {**STRAIGHT, "name": "aside", "eye": (6.0, 1.0, 8.0)}
    studio.cameras = [STRAIGHT, side]
    with serving(studio), visiting(browser, studio.url) as visit:
        visit.settled()
        straight = visit.pixels()
        visit.page.get_by_role("button", name="aside").click()
        assert np.abs(visit.pixels() - straight).mean() > 5
        visit.page.get_by_role("button", name="straight").click()
        assert np.abs(visit.pixels() - straight).mean() < 0.5
        visit.page.get_by_role("application").press("ArrowRight")
        assert np.abs(visit.pixels() - straight).mean() > 1
        assert visit.page.get_by_role("button", name="straight").get_attribute("aria-pressed") == "false"


def wait_for(condition, *, seconds: float = 10.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


# ---- When things go wrong ----------------------------------------------------------------------------------------


def test_a_refusal_is_told_and_taken_back(browser):
    studio = patches(WHITE, refuses="scale 64: the map is too bright for that")
    with serving(studio), visiting(browser, studio.url, width=800, height=450) as visit:
        visit.settled()
        visit.slide("Sky", "Strength", 6)
        visit.page.get_by_text("scale 64: the map is too bright for that").wait_for()
        visit.until("__prelight.look().scale", lambda scale: scale == 1)


def test_another_version_is_said_and_not_tried_again(browser):
    other = patches(WHITE, welcome={"version": 99})
    with serving(other) as studio, visiting(browser, studio.url) as visit:
        visit.page.get_by_text("do not fit together").wait_for()
    closed = patches(WHITE, close_with=(1002, "The studio speaks protocol 2."))
    with serving(closed) as studio, visiting(browser, studio.url) as visit:
        visit.page.get_by_text("The studio speaks protocol 2.").wait_for()
        time.sleep(0.7)
        assert studio.sockets == 1


def test_a_lost_studio_is_waited_for(browser):
    studio = patches(WHITE)
    with ExitStack() as life:
        life.enter_context(serving(studio))
        with visiting(browser, studio.url) as visit:
            visit.settled()
            assert not visit.complaints
            life.close()
            banner = visit.page.get_by_text("The studio does not answer")
            banner.wait_for()
            studio.state = state(sequence=7, rotation_deg=33.0)
            with serving(studio, port=studio.port):
                visit.until("__prelight.look().rotation_deg", lambda turn: turn == 33)
                banner.wait_for(state="hidden")


def test_a_page_that_is_shut_out_says_so(browser):
    studio = patches(WHITE)
    with ExitStack() as life:
        life.enter_context(serving(studio))
        with visiting(browser, studio.url) as visit:
            visit.settled()
            life.close()
            studio.shut = True
            with serving(studio, port=studio.port):
                visit.page.get_by_text("Use the address that prelight studio printed").wait_for()


def test_a_browser_without_webgl_is_told(browser):
    with serving(patches(WHITE)) as studio:
        page = browser.new_page()
        page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null;")
        page.goto(studio.url)
        page.get_by_text("WebGL 2 is missing").wait_for()
        page.close()


PAYLOADS = (
    "<script>window.__hit = 1; alert(1)</script>",
    "<img src=x onerror='window.__hit = 1; alert(1)'>",
    '"><svg onload=alert(1)>',
    "javascript:alert(1)",
    "{{constructor.constructor('alert(1)')()}}",
    "\u202e\u2066<iframe srcdoc='<script>parent.__hit=1</script>'>",
)


def test_names_stay_text(browser):
    """Names of bakes, cameras and maps, reasons and titles are shown letter by letter; nothing of them runs."""
    everything = " ".join(PAYLOADS)
    studio = patches(WHITE, environments=["stock:noon", *PAYLOADS])
    studio.cameras = [STRAIGHT, *({**STRAIGHT, "name": payload} for payload in PAYLOADS)]
    studio.welcome = {"name": everything, "eye": everything}
    studio.materials = [{"name": everything, "texture": None}]
    studio.refuses = everything
    with serving(studio), visiting(browser, studio.url, width=800, height=450) as visit:
        visit.settled()
        page = visit.page
        assert page.locator("h1").text_content() == everything
        assert page.title().startswith("<script>")
        page.get_by_role("button", name="Add a light").click()
        page.get_by_role("alert").get_by_text(PAYLOADS[0]).wait_for()
        for payload in PAYLOADS[:2]:
            page.get_by_role("radio", name=payload).first.click()
        assert page.evaluate("() => window.__hit") is None
        assert page.locator("script").count() == 1
        assert page.locator("img, iframe, svg, object, embed").count() == 0
        assert not visit.complaints


# ---- Pace --------------------------------------------------------------------------------------------------------


def test_100_000_vertices_arrive_without_a_queue(browser):
    """100,000 vertices under a sky that turns: all acknowledged, 30 a second; drawing may be slower."""
    side = 317  # 100,489 vertices
    y, x = (axis.ravel() for axis in np.mgrid[0:side, 0:side])
    positions = np.stack([6.0 * x / side - 3, 3 - 6.0 * y / side, 0.0 * x], axis=1)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()[:, None]
    triangles = np.concatenate([corner + np.array([0, side, 1]), corner + np.array([1, side, side + 1])])
    rows = np.ones((side * side, 3))
    studio = StandIn(positions, triangles, lambda _: rows, [STRAIGHT], streaming=240)
    once = studio.frame()
    studio.frame = lambda: once[:4] + np.uint32(len(studio.received)).tobytes() + once[8:]
    with serving(studio), visiting(browser, studio.url) as visit:
        visit.until("!!window.__prelight && __prelight.metrics.ready")
        began = visit.metric("updates")
        visit.until("__prelight.metrics.updates", lambda count: count > began + 60, seconds=30)
        most = visit.page.evaluate(MOST_IN_A_SECOND)
        assert most >= 30, "updates in the best second; there are others on this machine"
        visit.until("__prelight.metrics.uploads", lambda count: count >= 5, seconds=60)  # drawing may be slow
        script = visit.page.evaluate("() => [...__prelight.metrics.scriptMs]")
        upload = visit.page.evaluate("() => [...__prelight.metrics.uploadMs]")
        assert (
            np.quantile(script, 0.25) + np.quantile(upload, 0.25) < 2.0
        )  # ms; a busy machine has its moments
        seen = [m["frame"] for m in studio.received if m["type"] == "Seen"]
        assert len(seen) >= began + 60
        assert len(seen) == len(set(seen))


def test_no_small_drawing_waits_for_the_scene(browser):
    """The browser lets a page wait for the graphics processor wherever that draws on a canvas of the panel."""
    accelerated = """() => [...document.querySelectorAll("#panel canvas")].filter(
      (canvas) => canvas.getContext("2d").getContextAttributes().willReadFrequently !== true).length"""
    with serving(patches(WHITE)) as studio, visiting(browser, studio.url) as visit:
        visit.settled()
        visit.until("document.querySelectorAll('#panel canvas').length", lambda count: count >= 4)
        visit.page.wait_for_timeout(300)  # the thumbnails
        assert visit.page.evaluate(accelerated) == 0


NAMELESS = """() => {
  const controls = document.querySelectorAll("button, input, select, [role=slider], [role=switch]");
  const name = (one) => one.getAttribute("aria-label") || one.textContent || one.labels?.[0]?.textContent || "";
  const nameless = [...controls].filter((one) => !one.closest("[aria-hidden=true]") && name(one).trim() === "");
  return nameless.map((one) => one.outerHTML.slice(0, 100));
}"""
FOCUSED = """() => {
  const one = document.activeElement;
  return one.getAttribute("aria-label") ?? one.textContent;
}"""


def test_every_control_has_a_name_and_is_reached_by_keys(browser):
    """With a lamp, a light, glass and a world to set; the tab key goes through all of them and to the scene."""
    everything = {
        "takes": ["environment", "lamps", "glass"],
        "portals": [{"name": "left glass", "tint": [1, 1, 1]}],
        "worlds": [{"id": "town.toml", "title": "town", "duration": 3.0}],
    }
    with serving(patches(WHITE, welcome=everything)) as studio, visiting(browser, studio.url) as visit:
        visit.settled()
        page = visit.page
        page.get_by_role("button", name="Add lamp").click()
        page.get_by_role("button", name="Add a light").click()
        visit.until("document.querySelectorAll('.dot').length", bool)
        assert page.evaluate(NAMELESS) == []
        met = set()
        for _ in range(90):
            page.keyboard.press("Tab")
            met.add(page.evaluate(FOCUSED))
        assert {"Turn of the sky", "Blind", "World outside", "Dimmer", "Exposure", "straight", "Keys"} <= met
        assert any((name or "").startswith("The scene.") for name in met)
        assert not visit.complaints


def test_nobody_else_is_asked(browser):
    """It works offline: whatever is touched, all requests go to the studio itself."""
    with serving(patches(WHITE)) as studio, visiting(browser, studio.url) as visit:
        visit.settled()
        visit.page.get_by_role("button", name="Keys").click()
        assert len(visit.requests) > 8
        assert all(url.startswith(studio.url) for url in visit.requests)
        assert not visit.complaints

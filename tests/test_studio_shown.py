"""What the page shows beside the light that is set: gloss, a world outside, looks in time, the path tracer, films."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import numpy as np
import pytest

from prelight.images.tonemap import srgb_decode
from prelight.studio.frames import FRAME_ASIDE, FRAME_TRACED, FRAME_VIEW, FRAME_WORLD

from .studio_browser import HEIGHT, WIDTH, chromium, visiting
from .studio_stand_in import COLUMNS, ROWS, STRAIGHT, StandIn, framed, packed, patches, serving
from .test_studio_hands import wait_for
from .test_studio_page import middles

pytest.importorskip("starlette", reason="the studio's server is not installed")
SQUARES = ROWS * COLUMNS


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


def seen(visit) -> np.ndarray:
    """Linear colours of the squares (SQUARES, 3), without panels."""
    visit.page.keyboard.press("h")
    shown = srgb_decode(middles(visit.pixels()).astype(np.uint8))
    visit.page.keyboard.press("h")
    return shown


def linearly(visit) -> None:
    visit.settled()
    visit.page.get_by_role("radio", name="Linear").click()
    visit.slide("Picture", "Exposure", 0)
    visit.page.evaluate("() => document.activeElement.blur()")


def test_a_world_is_seen_behind_the_scene_and_moves_with_its_time(browser):
    """The map is what the eye sees: red ahead, to the right of the middle; its place tells the second."""
    studio = patches(np.zeros((SQUARES, 3)), sky=np.full((256 * 512, 3), 0.25))
    studio.positions = studio.positions * 1e-3
    studio.welcome["worlds"] = [{"id": "town.toml", "title": "town", "duration": 10.0}]

    def view(_message):
        world = np.full((256, 512, 3), 0.02)
        at = 256 + int(4 * studio.state["seconds"])
        world[118:138, at : at + 12] = (0.9, 0.1, 0.1)
        return [framed(packed(world.reshape(-1, 3)), FRAME_VIEW | FRAME_WORLD)]

    studio.replies["LookFrom"] = view
    with serving(studio), visiting(browser, studio.url, width=800, height=450) as visit:
        linearly(visit)
        page = visit.page
        assert red(visit) == []
        page.get_by_role("combobox", name="World outside").select_option("town.toml")
        wait_for(lambda: studio.state["world"] == "town.toml")
        visit.until("__prelight.metrics.views", lambda count: count >= 1)
        first = red(visit)
        assert first
        views = visit.metric("views")
        visit.slide("Outside", "Time", 5)
        wait_for(lambda: studio.state["seconds"] == 5.0)
        visit.until("__prelight.metrics.views", lambda count: count > views)
        assert np.mean(red(visit)) > np.mean(first) + 20
        outside = page.get_by_role("region", name="Outside")
        outside.get_by_role("button", name="Play").click()
        wait_for(lambda: sum(m["type"] == "SetWorld" and m["dragging"] for m in studio.received) >= 3)
        outside.get_by_role("button", name="Pause").click()
        page.get_by_role("combobox", name="World outside").select_option("")
        wait_for(lambda: studio.state["world"] is None)
        assert not visit.complaints


def red(visit) -> list[int]:
    row = visit.pixels()[visit.page.evaluate("() => document.querySelector('canvas').height") // 2 - 6]
    return np.flatnonzero(row[:, 0] > row[:, 2] + 60).tolist()


def with_looks(studio: StandIn) -> dict[str, np.ndarray]:
    """Two looks, a light for each; and what was before."""
    lights = {"Red": (0.8, 0.1, 0.1), "Blue": (0.1, 0.1, 0.8), "": (0.1, 0.6, 0.1)}
    rows = {name: np.tile(colour, (4 * SQUARES, 1)) for name, colour in lights.items()}
    studio.state |= {"looks": ["Blue", "Red"], "undo": "turn of the sky"}

    def compared(message):
        light = {"type": "State", **studio.state}
        words = packed(rows[message["look"] or ""]).astype("<u4")
        return [{"type": "Compared", "look": message["look"], "light": light}, framed(words, FRAME_ASIDE | 1)]

    studio.replies["Compare"] = compared
    return {name: np.array(colour) for name, colour in lights.items()}


def test_two_looks_beside_each_other_and_before_and_after(browser):
    studio = patches(np.full((SQUARES, 3), 0.4))
    lights = with_looks(studio)
    with serving(studio), visiting(browser, studio.url) as visit:
        linearly(visit)
        page = visit.page
        page.get_by_role("button", name="Compare with Blue").click()
        page.get_by_role("combobox", name="Left side").select_option("look Red")
        visit.until("__prelight.metrics.sides")
        columns = seen(visit).reshape(ROWS, COLUMNS, 3)
        assert np.abs(columns[:, : COLUMNS // 2 - 1] - lights["Red"]).max() < 0.02
        assert np.abs(columns[:, COLUMNS // 2 + 1 :] - lights["Blue"]).max() < 0.02
        assert page.locator(".divider .left").text_content() == "Red"
        page.get_by_role("button", name="Before / after").click()
        page.get_by_role("combobox", name="Left side").select_option("now")
        visit.until("__prelight.metrics.sides")
        columns = seen(visit).reshape(ROWS, COLUMNS, 3)
        assert np.abs(columns[:, 0] - 0.4).max() < 0.02
        assert np.abs(columns[:, -1] - lights[""]).max() < 0.02
        page.evaluate("() => document.activeElement.blur()")
        page.keyboard.press("b")  # no more
        assert np.abs(seen(visit) - 0.4).max() < 0.02
        page.get_by_role("button", name="Red", exact=True).click()
        page.get_by_role("button", name="Forget Red").click()
        page.get_by_role("textbox", name="Name of the look").fill("Third")
        page.get_by_role("button", name="Keep", exact=True).click()
        asked = ("ShowLook", "RemoveLook", "SaveLook")
        wait_for(lambda: sum(message["type"] in asked for message in studio.received) == 3)
        named = [(m["type"], m["name"]) for m in studio.received if m["type"] in asked]
        assert named == [("ShowLook", "Red"), ("RemoveLook", "Red"), ("SaveLook", "Third")]
        assert not visit.complaints


def test_the_timeline_fades_from_look_to_look(browser):
    studio = patches(np.full((SQUARES, 3), 0.4))
    lights = with_looks(studio)
    with serving(studio), visiting(browser, studio.url, width=800, height=450) as visit:
        linearly(visit)
        page = visit.page
        line = page.get_by_role("region", name="Timeline")
        for count in (1, 2):
            line.get_by_role("button", name="Add key").click()
            wait_for(lambda count=count: len(studio.state["timeline"]) == count)
        assert [key["look"] for key in studio.state["timeline"]] == ["Blue", "Red"]
        line.get_by_role("spinbutton", name="Key 2 at").fill("1.2")
        line.get_by_role("spinbutton", name="Key 2 at").press("Enter")
        wait_for(lambda: studio.state["timeline"][1]["at"] == 1.2)
        visit.slide("Timeline", "Time", 0.3)
        visit.until("__prelight.metrics.sides")
        middle = srgb_decode(visit.pixels()[200:240, 200:240].astype(np.uint8)).mean(axis=(0, 1))
        assert np.abs(middle - (0.75 * lights["Blue"] + 0.25 * lights["Red"])).max() < 0.02
        line.get_by_role("combobox", name="Look of key 2").select_option("Blue")
        wait_for(lambda: studio.state["timeline"][1]["look"] == "Blue")
        visit.until("__prelight.look().timeline[1].look === 'Blue' && __prelight.metrics.sides")
        alone = srgb_decode(visit.pixels()[200:240, 200:240].astype(np.uint8)).mean(axis=(0, 1))
        assert np.abs(alone - lights["Blue"]).max() < 0.02
        line.get_by_role("combobox", name="Look of key 2").select_option("Red")
        wait_for(lambda: studio.state["timeline"][1]["look"] == "Red")
        visit.slide("Timeline", "Time", 1.1)
        line.get_by_role("button", name="Play").click()
        line.get_by_role("button", name="Play").wait_for()  # again: it has come to its end
        end = srgb_decode(visit.pixels()[200:240, 200:240].astype(np.uint8)).mean(axis=(0, 1))
        assert np.abs(end - lights["Red"]).max() < 0.02
        with page.expect_download() as film:
            line.get_by_role("button", name="Film").click()
        first, last = filmed(visit, film.value)
        assert np.argmax(first) == 2, "it begins with the blue look"
        assert np.argmax(last) == 0, "and ends with the red one"
        line.get_by_role("button", name="Live").click()
        live = srgb_decode(visit.pixels()[200:240, 200:240].astype(np.uint8)).mean(axis=(0, 1))
        assert np.abs(live - 0.4).max() < 0.02
        line.get_by_role("button", name="Remove key 1").click()
        wait_for(lambda: len(studio.state["timeline"]) == 1)
        assert not visit.complaints


def filmed(visit, download) -> tuple[np.ndarray, np.ndarray]:
    """The colours in the middle of a film's first and last pictures, as a browser plays it."""
    assert download.suggested_filename.startswith("timeline.")
    film = base64.b64encode(Path(download.path()).read_bytes()).decode()
    kind = "mp4" if download.suggested_filename.endswith("mp4") else "webm"
    page = visit.page.context.new_page()  # the studio's own plays nothing
    colours = page.evaluate(
        """async (address) => {
          const video = Object.assign(document.createElement("video"), {src: address, muted: true});
          const canvas = Object.assign(document.createElement("canvas"), {width: 1, height: 1});
          const pen = canvas.getContext("2d");
          const at = (seconds) => new Promise((resolve) => {
            video.onseeked = () => {
              pen.drawImage(video, video.videoWidth / 4, video.videoHeight / 2, 1, 1, 0, 0, 1, 1);
              resolve([...pen.getImageData(0, 0, 1, 1).data.slice(0, 3)]);
            };
            video.currentTime = seconds;
          });
          await new Promise((resolve) => (video.onloadeddata = resolve));
          return [await at(0.01), await at(1e6)];
        }""",
        f"data:video/{kind};base64,{film}",
    )
    page.close()
    return np.array(colours[0]), np.array(colours[1])


def test_the_path_tracers_picture_lies_where_its_camera_saw_it(browser):
    """It is yellow on the left of the view and blue on the right; the page is grey."""
    studio = patches(np.full((SQUARES, 3), 0.4), welcome={"no_tracer": None})

    def trace(message):
        wide, high = message["width"], message["height"]
        picture = np.tile((0.7, 0.7, 0.1), (high, wide, 1))
        picture[:, wide // 2 :] = (0.1, 0.1, 0.7)
        told = {"type": "Traced", "share": 0.5, "samples": 8, "seconds": 1.0, "stopped": None}
        words = packed(picture.reshape(-1, 3)).astype("<u4")
        return [{**told, "share": 0.0, "samples": 0}, framed(words, FRAME_TRACED), told]

    studio.replies["Trace"] = trace
    studio.replies["StopTrace"] = lambda _: [
        {"type": "Traced", "share": 0.5, "samples": 8, "seconds": 1.2, "stopped": "stopped"}
    ]
    with serving(studio), visiting(browser, studio.url) as visit:
        linearly(visit)
        page = visit.page
        page.keyboard.press("h")  # all of the view
        page.evaluate("() => document.documentElement.classList.remove('bare')")
        page.get_by_role("button", name="Trace this view").click()
        visit.until("__prelight.metrics.traced")
        page.get_by_text("8 samples a pixel").wait_for()
        visit.slide("Looks", "Right side", 100)
        columns = seen(visit).reshape(ROWS, COLUMNS, 3)
        assert np.abs(columns[:, 1] - (0.7, 0.7, 0.1)).max() < 0.03
        assert np.abs(columns[:, -2] - (0.1, 0.1, 0.7)).max() < 0.03
        page.get_by_role("button", name="Stop", exact=True).click()
        page.get_by_text("stopped").wait_for()
        assert page.get_by_role("button", name="Trace this view").is_visible()
        assert not visit.complaints


def test_without_the_renderer_the_path_tracer_says_so(browser):
    studio = patches(np.ones((SQUARES, 3)), welcome={"no_tracer": "Mitsuba is not installed"})
    with serving(studio), visiting(browser, studio.url) as visit:
        visit.settled()
        assert visit.page.get_by_role("button", name="Trace this view").is_disabled()
        assert visit.page.get_by_text("Mitsuba is not installed").count() == 1


def test_steerable_lamps_are_seen_from_their_camera_alone(browser):
    """Their pixels are added to the light of the vertices: green on the right half of the picture."""
    wide, high = 20, 12
    studio = patches(np.full((SQUARES, 3), 0.2))
    camera = {**STRAIGHT, "name": "theirs"}
    studio.cameras = [camera, {**STRAIGHT, "name": "near", "eye": (0.0, 0.0, 9.0)}]
    places = [{"layer": "key", "kind": "spot", "origin": [0.0, 1.0, 2.0]}]
    studio.welcome = {
        "takes": ["steered"],
        "steered": {"camera": camera, "width": wide, "height": high, "places": places},
        "receivers": 4 * SQUARES + wide * high,
    }
    pixels = np.zeros((high, wide, 3))
    pixels[:, wide // 2 :, 1] = 0.4
    rows = np.concatenate([np.full((4 * SQUARES, 3), 0.2), pixels.reshape(-1, 3)])
    studio.radiance = lambda _: rows
    with serving(studio), visiting(browser, studio.url) as visit:
        linearly(visit)
        columns = seen(visit).reshape(ROWS, COLUMNS, 3)
        assert np.abs(columns[:, 1] - 0.2).max() < 0.02
        assert np.abs(columns[:, -2] - (0.2, 0.6, 0.2)).max() < 0.02
        visit.page.get_by_role("button", name="near").click()
        visit.until("__prelight.metrics.lamps", lambda are_seen: not are_seen)
        assert np.abs(seen(visit)[12:18, 1] - 0.2).max() < 0.02
        visit.page.get_by_role("button", name="Add to key").click()
        wait_for(lambda: len(studio.state["lamps"]) == 1)
        (lamp,) = studio.state["lamps"]
        assert (lamp["layer"], lamp["kind"], lamp["position"]) == ("key", "spot", [0.0, 1.0, 2.0])
        assert not visit.complaints


def test_walking_goes_where_one_looks(browser, rng):
    studio = patches(rng.uniform(0, 1, (SQUARES, 3)))
    with serving(studio), visiting(browser, studio.url, width=800, height=450) as visit:
        visit.settled()
        page = visit.page
        page.keyboard.press("v")
        page.get_by_text("Walking:").wait_for()
        first = page.evaluate("() => __prelight.eye()")
        before = visit.pixels()
        page.keyboard.down("w")
        visit.until("__prelight.eye()[2]", lambda z: z < first[2] - 1)
        page.keyboard.up("w")
        assert np.abs(visit.pixels() - before).mean() > 3
        there = page.evaluate("() => __prelight.eye()")
        assert np.abs(np.subtract(there, first)[:2]).max() < 1e-3
        for key, back, axis in (("d", "a", 0), ("e", "q", 1)):  # right and up
            page.keyboard.down(key)
            visit.until(f"__prelight.eye()[{axis}]", lambda at, axis=axis: at > there[axis] + 0.3)
            page.keyboard.up(key)
            farthest = page.evaluate("() => __prelight.eye()")[axis]
            page.keyboard.down(back)
            visit.until(f"__prelight.eye()[{axis}]", lambda at, known=farthest: at < known - 0.3)
            page.keyboard.up(back)
        there = page.evaluate("() => __prelight.eye()")
        visit.rested()
        level = page.evaluate("() => __prelight.pick(240, 225)")
        page.mouse.move(200, 200)
        page.mouse.down()
        page.mouse.move(200, 230, steps=3)  # what is seen follows the hand: one looks up
        visit.rested()
        assert page.evaluate("() => __prelight.pick(240, 225)")[1] > level[1] + 0.1
        page.mouse.move(200, 200, steps=3)
        page.mouse.move(360, 200, steps=3)  # half a radian to the left
        page.mouse.up()
        page.keyboard.down("ArrowUp")
        visit.until("__prelight.eye()[0]", lambda x: x < there[0] - 0.3)
        page.keyboard.up("ArrowUp")
        assert visit.metric("updates") >= 1
        page.get_by_role("button", name="Walk").click()
        assert page.get_by_role("button", name="Walk").get_attribute("aria-pressed") == "false"
        page.get_by_role("button", name="straight").click()
        visit.until("__prelight.eye()[2]", lambda z: abs(z - 10) < 1e-6)
        assert not visit.complaints


def test_a_picture_and_a_film_are_what_is_on_the_screen(browser, rng, tmp_path):
    from PIL import Image

    studio = patches(rng.uniform(0, 1, (SQUARES, 3)))
    with serving(studio), visiting(browser, studio.url) as visit:
        linearly(visit)
        with visit.page.expect_download() as download:
            visit.page.get_by_role("button", name="Save picture").click()
        download.value.save_as(tmp_path / "a.png")
        shown = np.asarray(Image.open(io.BytesIO((tmp_path / "a.png").read_bytes())).convert("RGB"), float)
        assert shown.shape == (HEIGHT, WIDTH, 3)
        assert np.abs(shown - visit.pixels()).mean() < 0.5
        visit.page.get_by_role("button", name="Record").click()
        for turn in range(4):
            drawn = visit.metric("drawn")
            visit.page.evaluate(f"() => __prelight.change({{rotation_deg: {turn}}}, false)")
            visit.until("__prelight.metrics.drawn", lambda count, known=drawn: count > known)
        with visit.page.expect_download() as film:
            visit.page.get_by_role("button", name="Stop recording").click()
        film.value.save_as(tmp_path / "film")
        assert (tmp_path / "film").stat().st_size > 500
        assert film.value.suggested_filename.startswith("prelight.")
        assert not visit.complaints

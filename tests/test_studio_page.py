"""The studio's page in a real browser, with a studio that the test holds in its hands."""

from __future__ import annotations

import io
import time
from contextlib import ExitStack

import numpy as np
import pytest

from prelight.camera import Camera
from prelight.images.tonemap import exposure_for, tonemap

from .studio_browser import HEIGHT, WIDTH, chromium, visiting
from .studio_stand_in import BUILT, StandIn, serving, state, unpacked

pytest.importorskip("starlette", reason="the studio's server is not installed")
ROWS, COLUMNS = 6, 10
STRAIGHT = {
    "name": "straight", "eye": (0.0, 0.0, 10.0), "target": (0.0, 0.0, 0.0), "up": (0.0, 1.0, 0.0),
    "vertical_fov_deg": float(np.degrees(2 * np.arctan(0.1 * ROWS / 2))),
}  # fmt: skip


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


def patches(colours: np.ndarray, **more) -> StandIn:
    """A square for each colour (ROWS·COLUMNS, 3), row by row from the top, that fills the picture."""
    j, i = (index.ravel() for index in np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)))
    x, y = j - COLUMNS / 2, ROWS / 2 - i
    corners = np.stack([np.stack([x + a, y - b, 0 * x], axis=1) for b in (0, 1) for a in (0, 1)], axis=1)
    first = 4 * np.arange(len(x))[:, None]
    triangles = np.concatenate([first + (0, 2, 1), first + (1, 2, 3)])
    rows = np.repeat(colours, 4, axis=0)
    return StandIn(corners.reshape(-1, 3), triangles, lambda _: rows, [STRAIGHT], **more)


def middles(picture: np.ndarray) -> np.ndarray:
    """The colours (ROWS·COLUMNS, 3) in the middle of the squares."""
    side = HEIGHT / ROWS
    left = WIDTH / 2 - side * COLUMNS / 2
    y, x = np.meshgrid(side * (np.arange(ROWS) + 0.5), left + side * (np.arange(COLUMNS) + 0.5), indexing="ij")
    return picture[y.astype(int), x.astype(int)].reshape(-1, 3)


def some_colours(rng: np.random.Generator) -> np.ndarray:
    """From deep shadow to a sun, grey and strong colours, black."""
    colours = 2.0 ** rng.uniform(-9, 7, (ROWS * COLUMNS, 1)) * rng.uniform(0, 1, (ROWS * COLUMNS, 3)) ** 2
    colours[:COLUMNS] = np.geomspace(0.004, 32, COLUMNS)[:, None]
    colours[COLUMNS] = 0.0
    return colours


def bare(visit) -> None:
    visit.page.keyboard.press("h")


@pytest.mark.parametrize("curve", ["filmic", "linear"])
def test_shows_what_the_pictures_show(browser, rng, curve):
    """Decoding, exposure, tone curve and sRGB agree with images/tonemap.py to a byte, over 16 stops."""
    colours = some_colours(rng)
    with serving(patches(colours)) as studio, visiting(browser, studio.url) as visit:
        visit.settled()
        known = unpacked(studio_words(studio))
        visit.page.get_by_role("radio", name=curve).click()
        for exposure in (0.0, -3.0):
            visit.slide("Picture", "Exposure", exposure)
            bare(visit)
            shown = middles(visit.pixels())
            bare(visit)
            expected = tonemap(known.reshape(1, -1, 3).astype(np.float32), exposure=exposure, curve=curve)[0]
            assert np.abs(shown - expected).max() <= 1.01
        assert not visit.complaints


def studio_words(studio: StandIn) -> np.ndarray:
    return np.frombuffer(studio.frame()[32:], "<u4")[::4]


def test_auto_exposure_is_that_of_the_pictures(browser, rng):
    colours = 2.0 ** rng.uniform(-7, -3, (ROWS * COLUMNS, 1)) * np.ones(3)
    with serving(patches(colours, state=state(stops=4.0))) as studio, visiting(browser, studio.url) as visit:
        visit.settled()
        bare(visit)
        visit.page.keyboard.press("a")
        shown = middles(visit.pixels())
        stops = exposure_for(unpacked(studio_words(studio)).reshape(1, -1, 3).astype(np.float32))
        bytes_per_stop = 60
        expected = tonemap(colours.reshape(1, -1, 3).astype(np.float32), exposure=stops)[0]
        assert np.abs(shown - expected).max() < 0.15 * bytes_per_stop
        assert np.abs(expected - tonemap(colours.reshape(1, -1, 3).astype(np.float32), exposure=4.0)[0]).max() > 30


def test_textures_lie_as_stored(browser):
    """Row 0 of a texture is v = 0; what is under a texture is tinted, the rest has its albedo."""
    from PIL import Image

    texture = np.zeros((2, 2, 3), np.uint8)
    texture[0, 0], texture[0, 1], texture[1, 0], texture[1, 1] = (200, 0, 0), (0, 200, 0), (0, 0, 200), (90, 90, 90)
    file = io.BytesIO()
    Image.fromarray(texture).save(file, "PNG")
    studio = patches(np.full((ROWS * COLUMNS, 3), 0.5), textures=[file.getvalue()])
    studio.materials = [{"name": "plain", "texture": None}, {"name": "picture", "texture": 0}]
    corner = np.array([(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)], np.float32)
    squares = ROWS * COLUMNS
    uv = np.zeros((squares, 4, 2), np.float32)
    uv[:4] = corner[:, None]  # the first four squares show one texel each
    material_of = np.tile(np.arange(squares) < 4, 2).astype(np.uint32)
    tint = np.full((4 * squares, 3), 0.5, np.float32)
    albedo = np.full((4 * squares, 3), 0.8, np.float32)
    studio.arrays = {"uv": uv.reshape(-1, 2), "material_of": material_of, "tint": tint, "albedo": albedo}
    with serving(studio), visiting(browser, studio.url) as visit:
        visit.settled()
        visit.page.get_by_role("radio", name="Linear").click()
        bare(visit)
        linear = (texture.reshape(4, 3) / 255.0 + 0.055) / 1.055
        linear = np.where(texture.reshape(4, 3) > 0, linear**2.4, 0.0)
        for _ in range(100):  # the texture comes later
            shown = middles(visit.pixels())
            if shown[0, 0] > 2 * shown[0, 1]:
                break
            time.sleep(0.05)
        expected = tonemap((0.25 * linear)[None].astype(np.float32), curve="linear")[0]
        assert np.abs(shown[:4] - expected).max() <= 2
        assert np.abs(shown[4:] - tonemap(np.full((1, 1, 3), 0.4, np.float32), curve="linear")[0, 0]).max() <= 1
        assert not visit.complaints


def test_the_sky_is_where_the_conventions_say(browser):
    """A patch of the map ahead and to the right: there on screen; a turn of +20 degrees moves it to the left."""
    rows, columns = 256, 512
    sky = np.full((rows, columns, 3), 0.02)
    sky[120:136, 256 + 22 : 256 + 35] = (4.0, 0.5, 0.5)  # azimuth 15.5 to 24.6 degrees, on the horizon
    below = Camera((0.0, 0.0, 10.0), (0.0, 0.0, 0.0), vertical_fov_deg=40.0)
    studio = patches(np.zeros((ROWS * COLUMNS, 3)), sky=sky.reshape(-1, 3), environments=["stock:noon"])
    studio.positions = studio.positions * 1e-3
    studio.cameras = [{"name": "wide", **below.to_dict()}]
    with serving(studio), visiting(browser, studio.url) as visit:
        visit.settled()
        bare(visit)
        for turn in (0.0, 20.0, 30.0):
            visit.page.evaluate(f"() => __prelight.change({{rotation_deg: {turn}}}, false)")
            red = red_columns(visit)
            focal = HEIGHT / 2 / np.tan(np.radians(20.0))
            edges = WIDTH / 2 + focal * np.tan(np.radians(np.array([22, 35]) * 360 / columns - turn))
            assert np.abs(np.array([red.min(), red.max()]) - edges).max() < 4, turn
        assert not visit.complaints


def red_columns(visit) -> np.ndarray:
    """Where the middle row is red, once the sky has come."""
    for _ in range(100):
        row = visit.pixels()[HEIGHT // 2 - 6]
        red = np.nonzero(row[:, 0] > row[:, 2] + 60)[0]
        if len(red):
            return red
        time.sleep(0.05)
    raise AssertionError("no red sky")


def test_a_disc_of_the_rig_stands_in_the_sky(browser):
    disc = {
        "id": "a", "azimuth_deg": -10.0, "elevation_deg": 5.0, "radius_deg": 4.0, "radiance": [0.05, 0.05, 3.0],
        "softness": 0.0,
    }  # fmt: skip
    studio = patches(np.zeros((ROWS * COLUMNS, 3)), sky=np.full((256 * 512, 3), 0.02), state=state(discs=[disc]))
    studio.positions = studio.positions * 1e-3
    studio.cameras = [{"name": "wide", **Camera((0.0, 0.0, 10.0), (0.0, 0.0, 0.0), vertical_fov_deg=40.0).to_dict()}]
    with serving(studio), visiting(browser, studio.url) as visit:
        visit.settled()
        bare(visit)
        picture = visit.pixels()
        y, x = np.nonzero(picture[..., 2] > picture[..., 0] + 60)
        focal = HEIGHT / 2 / np.tan(np.radians(20.0))
        d = np.stack([(x + 0.5 - WIDTH / 2) / focal, (HEIGHT / 2 - y - 0.5) / focal, -np.ones(len(x))], axis=1)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        a, e = np.radians(-10.0), np.radians(5.0)
        middle = np.array([np.sin(a) * np.cos(e), np.sin(e), -np.cos(a) * np.cos(e)])
        angles = np.degrees(np.arccos(np.clip(d @ middle, -1, 1)))
        assert angles.max() == pytest.approx(4.0, abs=0.2)
        assert len(x) == pytest.approx(np.pi * (focal * np.tan(np.radians(4.0))) ** 2, rel=0.08)


# ---- Hands on the controls ---------------------------------------------------------------------------------------


def test_dragging_the_disc_turns_the_sky_and_sends_once_a_frame(browser):
    studio = patches(np.ones((ROWS * COLUMNS, 3)))
    with serving(studio), visiting(browser, studio.url, width=1000, height=720) as visit:
        visit.settled()
        page = visit.page
        box = page.get_by_role("slider", name="Turn of the sky").bounding_box()
        x, y, r = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, 0.35 * box["width"]
        page.evaluate("() => { window.__frames = 0; const f = () => { window.__frames++; requestAnimationFrame(f) }; f() }")
        page.mouse.move(x, y - r)
        page.mouse.down()
        for angle in np.radians(np.linspace(0, 90, 20)):  # counter-clockwise, from the top to the left
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
        assert not visit.complaints


def turns_sent(studio: StandIn) -> list[dict]:
    return [message for message in studio.received if message["type"] == "SetEnvironment"]


def test_every_control_sends_what_it_says(browser):
    studio = patches(np.ones((ROWS * COLUMNS, 3)))
    with serving(studio), visiting(browser, studio.url, width=1000, height=720) as visit:
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
        page.get_by_role("button", name="Add a light").click()
        wait_for(lambda: len(studio.state["discs"]) == 1)
        (disc,) = studio.state["discs"]
        power = np.pi * disc["radiance"][1] * 4 * np.sin(np.radians(disc["radius_deg"] / 2)) ** 2
        assert power == pytest.approx(np.pi)  # a white surface that faces it has a radiance of one
        visit.slide("Lights", "Strength", 1)
        wait_for(lambda: studio.state["discs"][0]["radiance"][1] == pytest.approx(2 * disc["radiance"][1]))
        visit.slide("Lights", "Softness", 1)
        wait_for(lambda: studio.state["discs"][0]["softness"] == 1.0)
        dot = page.get_by_role("button", name="Light 1")
        dot.press("ArrowRight")
        wait_for(lambda: studio.state["discs"][0]["azimuth_deg"] == pytest.approx(disc["azimuth_deg"] + 2))
        from_box = page.locator(".strip").bounding_box()
        dot.hover()
        page.mouse.down()
        page.mouse.move(from_box["x"] + 0.75 * from_box["width"], from_box["y"] + from_box["height"] / 3, steps=5)
        page.mouse.up()
        wait_for(lambda: studio.state["discs"][0]["azimuth_deg"] == pytest.approx(90, abs=2))
        assert studio.state["discs"][0]["elevation_deg"] == pytest.approx(45, abs=2)
        dot.press("Delete")
        wait_for(lambda: studio.state["discs"] == [])
        assert not visit.complaints


def test_camera_and_keyboard_move_the_eye(browser, rng):
    studio = patches(some_colours(rng))
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
        assert np.abs(visit.pixels() - straight).mean() > 2
        assert visit.page.get_by_role("button", name="straight").get_attribute("aria-pressed") == "false"


def wait_for(condition, *, seconds: float = 10.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


# ---- When things go wrong ----------------------------------------------------------------------------------------


def test_a_refusal_is_told_and_taken_back(browser):
    studio = patches(np.ones((ROWS * COLUMNS, 3)), refuses="scale 64: the map is too bright for that")
    with serving(studio), visiting(browser, studio.url, width=1000, height=720) as visit:
        visit.settled()
        visit.slide("Sky", "Strength", 6)
        visit.page.get_by_text("scale 64: the map is too bright for that").wait_for()
        visit.until("__prelight.look().scale", lambda scale: scale == 1)


def test_another_version_is_said_and_not_tried_again(browser):
    with serving(patches(np.ones((ROWS * COLUMNS, 3)), welcome={"version": 99})) as studio:
        with visiting(browser, studio.url) as visit:
            visit.page.get_by_text("do not fit together").wait_for()
    closed = patches(np.ones((ROWS * COLUMNS, 3)), close_with=(1002, "The studio speaks protocol 2."))
    with serving(closed) as studio, visiting(browser, studio.url) as visit:
        visit.page.get_by_text("The studio speaks protocol 2.").wait_for()
        time.sleep(0.7)
        assert studio.sockets == 1


def test_a_lost_studio_is_waited_for(browser):
    studio = patches(np.ones((ROWS * COLUMNS, 3)))
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
    studio = patches(np.ones((ROWS * COLUMNS, 3)))
    with ExitStack() as life:
        life.enter_context(serving(studio))
        with visiting(browser, studio.url) as visit:
            visit.settled()
            life.close()
            studio.shut = True
            with serving(studio, port=studio.port):
                visit.page.get_by_text("Use the address that prelight studio printed").wait_for()


PAYLOADS = (
    "<script>window.__hit = 1; alert(1)</script>",
    "<img src=x onerror='window.__hit = 1; alert(1)'>",
    "\"><svg onload=alert(1)>",
    "javascript:alert(1)",
    "{{constructor.constructor('alert(1)')()}}",
    "\u202e\u2066<iframe srcdoc='<script>parent.__hit=1</script>'>",
)


def test_names_stay_text(browser):
    """Names of bakes, cameras and maps, reasons and titles are shown letter by letter; nothing of them runs."""
    everything = " ".join(PAYLOADS)
    studio = patches(np.ones((ROWS * COLUMNS, 3)), environments=["stock:noon", *PAYLOADS])
    studio.cameras = [STRAIGHT, *({**STRAIGHT, "name": payload} for payload in PAYLOADS)]
    studio.welcome = {"name": everything, "eye": everything}
    studio.materials = [{"name": everything, "texture": None}]
    studio.refuses = everything
    with serving(studio), visiting(browser, studio.url, width=1000, height=720) as visit:
        visit.settled()
        page = visit.page
        assert page.locator("h1").text_content() == everything
        assert page.title().startswith("<script>")
        page.get_by_role("button", name="Add a light").click()
        page.get_by_role("alert").get_by_text(PAYLOADS[0]).wait_for()
        for payload in PAYLOADS:
            page.get_by_role("radio", name=payload).first.click()
        assert page.evaluate("() => window.__hit") is None
        assert page.locator("script").count() == 1
        assert page.locator("img, iframe, svg, object, embed").count() == 0
        assert not visit.complaints


# ---- Pace --------------------------------------------------------------------------------------------------------


def test_100_000_vertices_arrive_without_a_queue(browser):
    """Updates at 100,000 vertices: each acknowledged, none copied about; drawing may be slower, sending not."""
    side = 317  # 100,489 vertices
    y, x = (axis.ravel() for axis in np.mgrid[0:side, 0:side])
    positions = np.stack([6.0 * x / side - 3, 3 - 6.0 * y / side, 0.0 * x], axis=1)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()[:, None]
    triangles = np.concatenate([corner + (0, side, 1), corner + (1, side, side + 1)])
    rows = np.ones((side * side, 3))
    studio = StandIn(positions, triangles, lambda _: rows, [STRAIGHT], streaming=True)
    once = studio.frame()
    studio.frame = lambda: once[:4] + np.uint32(len(studio.received)).tobytes() + once[8:]
    with serving(studio), visiting(browser, studio.url) as visit:
        visit.settled()
        began = visit.metric("updates")
        visit.until("__prelight.metrics.updates", lambda count: count > began + 120, seconds=30)
        script = visit.page.evaluate("() => [...__prelight.metrics.scriptMs]")
        upload = visit.page.evaluate("() => [...__prelight.metrics.uploadMs]")
        assert np.quantile(script, 0.25) + np.quantile(upload, 0.25) < 2.0  # ms; a busy machine has its moments
        seen = [m["frame"] for m in studio.received if m["type"] == "Seen"]
        assert len(seen) >= began + 120
        assert len(seen) == len(set(seen))


def test_small_and_at_home(browser):
    """At most 1 MB compressed, all of it from the studio itself, no script or style inside the page."""
    import gzip

    assert sum(len(gzip.compress(path.read_bytes())) for path in BUILT.iterdir()) < 1_000_000
    text = (BUILT / "index.html").read_text()
    assert text.count("<script") == text.count("src=") == 1
    assert "<style" not in text
    assert "style=" not in text
    with serving(patches(np.ones((ROWS * COLUMNS, 3)))) as studio, visiting(browser, studio.url) as visit:
        visit.settled()
        visit.page.get_by_role("button", name="Keys").click()
        assert visit.requests
        assert all(url.startswith(studio.url) for url in visit.requests)
        assert not visit.complaints

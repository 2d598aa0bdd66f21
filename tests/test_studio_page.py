"""The studio's page in a real browser, with a studio that the test holds in its hands."""

from __future__ import annotations

import io
import time

import numpy as np
import pytest

from prelight.camera import Camera
from prelight.images.tonemap import exposure_for, srgb_decode, tonemap

from .studio_browser import HEIGHT, WIDTH, chromium, visiting
from .studio_stand_in import COLUMNS, ROWS, StandIn, patches, serving, state, unpacked

pytest.importorskip("starlette", reason="the studio's server is not installed")


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


def middles(picture: np.ndarray) -> np.ndarray:
    """The colours (ROWS·COLUMNS, 3) in the middle of the squares."""
    side = HEIGHT / ROWS
    left = WIDTH / 2 - side * COLUMNS / 2
    y, x = np.meshgrid(
        side * (np.arange(ROWS) + 0.5), left + side * (np.arange(COLUMNS) + 0.5), indexing="ij"
    )
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
        visit.page.get_by_role("button", name="Auto").click()  # sees what the panel leaves free
        free = visit.page.get_by_role("slider", name="Exposure").input_value()
        bare(visit)
        visit.page.keyboard.press("a")
        assert float(free) == pytest.approx(
            float(visit.page.get_by_role("slider", name="Exposure", include_hidden=True).input_value()),
            abs=0.5,
        )
        shown = middles(visit.pixels())
        stops = exposure_for(unpacked(studio_words(studio)).reshape(1, -1, 3).astype(np.float32))
        bytes_per_stop = 60
        expected = tonemap(colours.reshape(1, -1, 3).astype(np.float32), exposure=stops)[0]
        assert np.abs(shown - expected).max() < 0.15 * bytes_per_stop
        assert (
            np.abs(expected - tonemap(colours.reshape(1, -1, 3).astype(np.float32), exposure=4.0)[0]).max()
            > 30
        )


def test_textures_lie_as_stored(browser):
    """Row 0 of a texture is v = 0; what is under a texture is tinted, the rest has its albedo."""
    from PIL import Image

    texture = np.zeros((2, 2, 3), np.uint8)
    texture[0, 0], texture[0, 1], texture[1, 0], texture[1, 1] = (
        (200, 0, 0),
        (0, 200, 0),
        (0, 0, 200),
        (90, 90, 90),
    )
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
        visit.slide("Picture", "Exposure", 0.0)  # where there may be lamps what is seen is metered
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
        assert (
            np.abs(shown[4:] - tonemap(np.full((1, 1, 3), 0.4, np.float32), curve="linear")[0, 0]).max() <= 1
        )
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
    studio = patches(
        np.zeros((ROWS * COLUMNS, 3)), sky=np.full((256 * 512, 3), 0.02), state=state(discs=[disc])
    )
    studio.positions = studio.positions * 1e-3
    studio.cameras = [
        {"name": "wide", **Camera((0.0, 0.0, 10.0), (0.0, 0.0, 0.0), vertical_fov_deg=40.0).to_dict()}
    ]
    with serving(studio), visiting(browser, studio.url) as visit:
        visit.settled()
        bare(visit)
        picture = visit.pixels()
        y, x = np.nonzero(picture[..., 2] > picture[..., 0] + 60)
        focal = HEIGHT / 2 / np.tan(np.radians(20.0))
        d = np.stack(
            [(x + 0.5 - WIDTH / 2) / focal, (HEIGHT / 2 - y - 0.5) / focal, -np.ones(len(x))], axis=1
        )
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        a, e = np.radians(-10.0), np.radians(5.0)
        middle = np.array([np.sin(a) * np.cos(e), np.sin(e), -np.cos(a) * np.cos(e)])
        angles = np.degrees(np.arccos(np.clip(d @ middle, -1, 1)))
        assert angles.max() == pytest.approx(4.0, abs=0.2)
        assert len(x) == pytest.approx(np.pi * (focal * np.tan(np.radians(4.0))) ** 2, rel=0.08)


def test_pixels_are_shown_as_a_picture_with_the_sky_behind(browser, rng):
    """Row by row from the top, in the panel's free part; pixel = row + (1 − coverage)·sky."""
    wide, high = 16, 9
    rows = rng.uniform(0, 0.7, (wide * high, 3))
    coverage = rng.choice(np.array([0, 128, 255], np.uint8), (high, wide))
    studio = patches(rows[: ROWS * COLUMNS])
    studio.radiance = lambda _: rows
    studio.welcome = {"pixels": [wide, high], "receivers": wide * high}
    studio.arrays = {"coverage": coverage}
    with serving(studio), visiting(browser, studio.url) as visit:
        visit.settled()
        visit.page.get_by_role("radio", name="Linear").click()
        visit.slide("Picture", "Exposure", 0.0)  # where there may be lamps what is seen is metered
        bare(visit)
        visit.page.wait_for_timeout(100)
        side = HEIGHT // high
        shown = visit.pixels()[side // 2 :: side, side // 2 :: side].reshape(-1, 3)
        seen = unpacked(np.frombuffer(studio.frame()[32:], "<u4"))
        linear = seen + (1 - coverage.reshape(-1, 1) / 255) * 0.25
        difference = srgb_decode(shown.astype(np.uint8)) - linear
        assert np.abs(difference).max() < 0.04  # looked at a sixtieth of a pixel beside its middle
        assert np.abs(difference).mean() < 0.008
        assert visit.page.get_by_role("navigation").is_hidden()
        assert not visit.complaints


def test_another_bake_that_came_in_between_is_shown_with_its_own_mesh(browser, rng):
    """What was fetched before the welcome is of a bake of as many vertices, upside down."""
    studio = patches(rng.uniform(0.1, 0.9, (ROWS * COLUMNS, 3)), welcome={"bake": "b"})
    upright, send = studio.positions, studio.bytes
    studio.positions = upright * (-1, -1, 1)

    async def send_and_change(request):
        answer = await send(request)
        if request.path_params["name"] == "positions":
            studio.positions, studio.bake = upright, "b"
        return answer

    studio.bytes = send_and_change
    with serving(studio), visiting(browser, studio.url) as visit:
        visit.settled()
        visit.page.get_by_role("radio", name="Linear").click()
        visit.slide("Picture", "Exposure", 0)
        bare(visit)
        expected = unpacked(studio_words(studio))
        assert np.abs(srgb_decode(middles(visit.pixels()).astype(np.uint8)) - expected).max() < 0.01
        assert not visit.complaints

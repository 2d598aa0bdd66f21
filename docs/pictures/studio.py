"""Make studio*.png: python docs/pictures/studio.py sculpture=A.prelight still-life=B.prelight room=C.prelight …

The bakes: the demo's; `prelight bake environment stock:still-life --glossy-order 8`; `prelight bake transfer
stock:room`; portals: `prelight bake portals stock:portals`; car: `prelight bake portals stock:car` (or small ones).
Pictures of bakes that are not given, and with `only=NAME` all others, are left as they are. Needs playwright and
Chromium.
"""

from __future__ import annotations

import io
import re
import shutil
import sys
import tempfile
import threading
import time
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from prelight.cli.studio import path_tracer
from prelight.storage.bake import Bake
from prelight.studio.environments import Environments
from prelight.studio.server import Served, Studio

FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
SETTLED = """() => {
  const m = window.__prelight?.metrics;
  return m?.ready && m.shownExact && m.sky === __prelight.look().environment && m.updatesPerSecond() === 0;
}"""


def settled(page: Page) -> None:
    while not page.evaluate(SETTLED):
        time.sleep(0.1)


def sculpture(page: Page) -> None:
    """The sun low on the left; a cool soft light against it, in front on the right."""
    page.get_by_role("radio", name="sunset").click()
    page.get_by_role("region", name="Sky").get_by_role("slider", name="Turn", exact=True).fill("14")
    strip = page.locator(".strip canvas").bounding_box() or {}
    page.mouse.dblclick(strip["x"] + 0.86 * strip["width"], strip["y"] + 0.4 * strip["height"])
    settled(page)
    lights = page.get_by_role("region", name="Lights")
    lights.get_by_role("slider", name="Strength", exact=True).fill("-2.5")
    lights.get_by_role("slider", name="Warmth", exact=True).fill("11000")
    lights.get_by_role("slider", name="Radius", exact=True).fill("4.2")


def still_life(page: Page) -> None:
    """A soft light whose highlight is clicked on the vase."""
    page.get_by_role("radio", name="overcast").click()
    page.get_by_role("region", name="Sky").get_by_role("slider", name="Strength", exact=True).fill("-2.6")
    page.get_by_role("button", name="Add a light").click()
    settled(page)
    lights = page.get_by_role("region", name="Lights in the sky")
    lights.get_by_role("slider", name="Radius").fill("3.6")
    lights.get_by_role("slider", name="Warmth").fill("4300")
    lights.get_by_role("button", name="Highlight").click()
    settled(page)
    page.mouse.click(*seen_at(page, 0.175, 0.36))
    fold(page, "Picture")


def lamps(page: Page) -> None:
    """Dusk outside; a warm lamp over the room and a spot on the vase, whose settings are open."""
    page.get_by_role("radio", name="overcast").click()
    page.get_by_role("region", name="Sky").get_by_role("slider", name="Strength", exact=True).fill("-3.2")
    put_up(page, "lamp", {"Place, m": (-1.35, 2.3, -0.2), "At full": 5200}, kelvin=2700)
    put_up(
        page,
        "spot",
        {"Place, m": (0.5, 2.5, -0.6), "Aim, m": (0.35, 1.15, -1.1), "At full": 4200},
        kelvin=4200,
    )
    fold(page, "Sky", "Lights in the sky")
    page.get_by_role("region", name="Picture").get_by_role("slider", name="Exposure").fill("2.2")
    page.evaluate("() => { document.activeElement.blur(); document.getElementById('panel').scrollTop = 0; }")


def seen_at(page: Page, x: float, y: float) -> tuple[float, float]:
    """A place of the stage, in parts of it."""
    box = page.locator("#stage canvas").bounding_box() or {"width": 0, "height": 0}
    return x * box["width"], y * box["height"]


def timeline(page: Page) -> None:
    """From the afternoon to the evening in four seconds, half way."""
    looks(page)
    page.get_by_role("button", name="Done").click()
    fold(page, "Sky", "Lamps")
    line = page.get_by_role("region", name="Timeline")
    for _ in range(2):
        line.get_by_role("button", name="Add key").click()
        settled(page)
    field = line.get_by_role("spinbutton", name="Key 2 at")
    field.fill("4")
    field.press("Enter")
    settled(page)
    line.get_by_role("slider", name="Time").fill("2")
    page.wait_for_function("() => __prelight.metrics.sides")
    line.scroll_into_view_if_needed()


def placing(page: Page) -> None:
    """A spot that is to throw the shadow of the vase on the wall: where it falls has been clicked."""
    lamps(page)
    page.get_by_role("region", name="Lamps").get_by_role("button", name="Shadow").click()
    page.mouse.click(*seen_at(page, 0.47, 0.47))
    page.get_by_text("Now click what shall cast it").wait_for()


def traced(page: Page) -> None:
    """The page beside Mitsuba's path tracer."""
    lamps(page)
    fold(page, "Lamps", "Picture")
    page.get_by_role("button", name="Trace this view").click()
    page.wait_for_function("() => __prelight.metrics.traced", timeout=120_000)
    page.get_by_text(TRACED_ENOUGH).wait_for(timeout=600_000)
    page.get_by_role("button", name="Stop", exact=True).click()
    page.get_by_text("stopped").wait_for(timeout=60_000)
    page.get_by_role("region", name="Path tracer").scroll_into_view_if_needed()


def outside(page: Page) -> None:
    """Through the town, two and a half seconds on."""
    fold(page, "Sky", "Lights in the sky")
    page.get_by_role("combobox", name="World outside").select_option(index=1)
    lit_since(page, 1)
    page.get_by_role("region", name="Outside").get_by_role("slider", name="Time").fill("2.5")
    lit_since(page, 2)
    page.get_by_role("slider", name="Exposure").fill("-0.6")
    known = -1
    while known != (seen := page.evaluate("() => __prelight.metrics.views")):
        known = seen
        time.sleep(3.0)


def lit_since(page: Page, sequence: int) -> None:
    """The light of a change is shown."""
    page.wait_for_function(
        f"() => __prelight.metrics.shownSequence >= {sequence} && __prelight.metrics.shownExact",
        timeout=200_000,
    )


def looks(page: Page) -> None:
    """The same room in the afternoon and by its lamps, side by side."""
    lamps(page)
    page.get_by_role("textbox", name="Name of the look").fill("Evening")
    page.get_by_role("button", name="Keep", exact=True).click()
    fold(page, "Sky")  # open again
    page.get_by_role("radio", name="sunset").click()
    page.get_by_role("region", name="Sky").get_by_role("slider", name="Strength", exact=True).fill("0")
    page.get_by_role("button", name="Spot 1", exact=True).click()  # closes it
    page.get_by_role("region", name="Lamps").get_by_role("switch").nth(0).click()
    page.get_by_role("region", name="Lamps").get_by_role("switch").nth(1).click()
    page.get_by_role("textbox", name="Name of the look").fill("Afternoon")
    page.get_by_role("button", name="Keep", exact=True).click()
    page.get_by_role("button", name="Compare with Evening").click()
    page.get_by_role("region", name="Picture").get_by_role("slider", name="Exposure").fill("1.8")


def glass(page: Page) -> None:
    page.get_by_role("radio", name="noon").click()
    page.get_by_role("region", name="Glass").get_by_role("button", name="clear glass").click()
    page.get_by_role("region", name="Glass").get_by_role("slider", name="Blind").fill("35")
    fold(page, "Lights in the sky")


def lux(page: Page) -> None:
    lamps(page)
    page.get_by_role("radio", name="lux").click()
    page.get_by_role("slider", name="Red is").fill("3.3")
    page.get_by_role("button", name="Spot 1", exact=True).click()


def put_up(page: Page, kind: str, numbers: dict, *, kelvin: float) -> None:
    region = page.get_by_role("region", name="Lamps")
    region.get_by_role("button", name=f"Add {kind}").click()
    for name, value in numbers.items():
        rows = (
            {f"{name} {axis}": v for axis, v in zip("xyz", value, strict=True)}
            if isinstance(value, tuple)
            else {}
        )
        for row, number in (rows or {name: value}).items():
            field = region.get_by_role("spinbutton", name=row)
            field.fill(str(number))
            field.press("Enter")
    region.get_by_role("slider", name="Warmth").fill(str(kelvin))


def fold(page: Page, *sections: str) -> None:
    for name in sections:
        page.get_by_role("region", name=name, exact=True).get_by_role("button", name=name, exact=True).click()


TRACED_ENOUGH = re.compile(r"^(3[2-9]|[4-9][0-9]|[12][0-9][0-9]) samples a pixel")
PICTURES = (
    ("studio", "sculpture", sculpture, {"width": 1280, "height": 720}, "dark"),
    ("studio-still-life", "still-life", still_life, {"width": 1120, "height": 640}, "light"),
    ("studio-lamps", "room", lamps, {"width": 1280, "height": 800}, "dark"),
    ("studio-looks", "room", looks, {"width": 1280, "height": 800}, "light"),
    ("studio-lux", "room", lux, {"width": 1280, "height": 800}, "dark"),
    ("studio-timeline", "room", timeline, {"width": 1280, "height": 800}, "dark"),
    ("studio-placing", "room", placing, {"width": 1280, "height": 800}, "dark"),
    ("studio-traced", "room", traced, {"width": 1280, "height": 800}, "light"),
    ("studio-outside", "car", outside, {"width": 1280, "height": 800}, "dark"),
    ("studio-glass", "portals", glass, {"width": 1280, "height": 800}, "dark"),
)
RIGS = {"car": [str(Path(__file__).with_name("drive.toml"))]}
BAKES = dict(argument.split("=", 1) for argument in sys.argv[1:])
with tempfile.TemporaryDirectory() as folder, sync_playwright() as p:
    browser = p.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
    for name, shown, touch, size, scheme in PICTURES:
        if shown not in BAKES or BAKES.get("only", name) != name:
            continue
        state = Path(folder) / f"{name}.json"
        studio = Studio(
            Served(Bake.open(BAKES[shown]), Environments(RIGS.get(shown, ())), state, print, path_tracer()),
            port=0,
        )
        thread = threading.Thread(target=studio.serve)
        thread.start()
        try:
            page = browser.new_page(
                viewport=size, color_scheme=scheme, reduced_motion="reduce", device_scale_factor=2
            )  # for smooth edges, which the page itself has only with a graphics card
            page.goto(studio.new_link())
            settled(page)
            touch(page)
            time.sleep(1.5)
            settled(page)
            page.evaluate("() => document.activeElement?.blur()")
            page.evaluate(
                "() => document.querySelector('.pace').remove()"
            )  # its times are of this machine and hour
            shot = Image.open(io.BytesIO(page.screenshot()))
            shot = shot.convert("RGB").resize((size["width"], size["height"]), Image.Resampling.BOX)
            shot.save(Path(__file__).with_name(f"{name}.png"), optimize=True)
            page.close()
        finally:
            studio.stop()
            thread.join()
    browser.close()

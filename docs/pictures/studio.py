"""Make studio*.png: python docs/pictures/studio.py sculpture=A.prelight still-life=B.prelight room=C.prelight …

The bakes: the demo's; the one of scenes.py; `prelight bake transfer stock:room`; portals: `prelight bake portals
stock:portals` (or their small ones). Pictures of bakes that are not given are left as they are. Needs playwright and
Chromium.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
import threading
import time
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

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
    lights = page.get_by_role("region", name="Lights")
    lights.get_by_role("slider", name="Strength", exact=True).fill("-2.5")
    lights.get_by_role("slider", name="Warmth", exact=True).fill("11000")
    lights.get_by_role("slider", name="Radius", exact=True).fill("4.2")


def still_life(page: Page) -> None:
    page.get_by_role("radio", name="sunset").click()


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
    page.evaluate("() => document.activeElement.blur()")


def looks(page: Page) -> None:
    """The same room in the afternoon and by its lamps, side by side."""
    lamps(page)
    page.get_by_role("textbox", name="Name of the look").fill("Evening")
    page.get_by_role("button", name="Keep").click()
    fold(page, "Sky")  # open again
    page.get_by_role("radio", name="sunset").click()
    page.get_by_role("region", name="Sky").get_by_role("slider", name="Strength", exact=True).fill("0")
    page.get_by_role("button", name="Spot 1", exact=True).click()  # closes it
    page.get_by_role("region", name="Lamps").get_by_role("switch").nth(0).click()
    page.get_by_role("region", name="Lamps").get_by_role("switch").nth(1).click()
    page.get_by_role("textbox", name="Name of the look").fill("Afternoon")
    page.get_by_role("button", name="Keep").click()
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


PICTURES = (
    ("studio", "sculpture", sculpture, {"width": 1280, "height": 720}, "dark"),
    ("studio-still-life", "still-life", still_life, {"width": 1120, "height": 640}, "light"),
    ("studio-lamps", "room", lamps, {"width": 1280, "height": 800}, "dark"),
    ("studio-looks", "room", looks, {"width": 1280, "height": 800}, "light"),
    ("studio-lux", "room", lux, {"width": 1280, "height": 800}, "dark"),
    ("studio-glass", "portals", glass, {"width": 1280, "height": 800}, "dark"),
)
BAKES = dict(argument.split("=", 1) for argument in sys.argv[1:])
with tempfile.TemporaryDirectory() as folder, sync_playwright() as p:
    browser = p.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
    for name, shown, touch, size, scheme in PICTURES:
        if shown not in BAKES:
            continue
        state = Path(folder) / f"{name}.json"
        studio = Studio(Served(Bake.open(BAKES[shown]), Environments(()), state, print), port=0)
        thread = threading.Thread(target=studio.serve)
        thread.start()
        try:
            page = browser.new_page(viewport=size, color_scheme=scheme, reduced_motion="reduce")
            page.goto(studio.new_link())
            settled(page)
            touch(page)
            time.sleep(1.5)
            settled(page)
            shot = Image.open(io.BytesIO(page.screenshot()))
            shot.convert("RGB").save(Path(__file__).with_name(f"{name}.png"), optimize=True)
            page.close()
        finally:
            studio.stop()
            thread.join()
    browser.close()

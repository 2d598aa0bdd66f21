"""Make studio.png and studio-still-life.png: python docs/pictures/studio.py SCULPTURE.prelight STILL_LIFE.prelight

The bakes: the demo's, and the one of scenes.py. Needs playwright and Chromium.
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


PICTURES = (
    ("studio", sculpture, {"width": 1280, "height": 720}, "dark"),
    ("studio-still-life", still_life, {"width": 1120, "height": 640}, "light"),
)
with tempfile.TemporaryDirectory() as folder, sync_playwright() as p:
    browser = p.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
    for bake, (name, touch, size, scheme) in zip(sys.argv[1:], PICTURES, strict=True):
        state = Path(folder) / f"{name}.json"
        studio = Studio(Served(Bake.open(bake), Environments(()), state, print), port=0)
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

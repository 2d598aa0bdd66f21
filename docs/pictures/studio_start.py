"""Make studio-start.png: python docs/pictures/studio_start.py [SCENE]

A built-in scene on the start page, half baked, in a folder that is removed. Some minutes; needs Chromium, playwright.
"""

from __future__ import annotations

import sys
import tempfile
import threading
import time
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from prelight.cli.studio import workshop
from prelight.studio.environments import Environments
from prelight.studio.server import Served, Studio

SCENE = sys.argv[1] if len(sys.argv) > 1 else "still-life"
SHARE = 0.55  # that is baked in the picture
_PROJECT = "() => window.__prelight_start?.workshop()?.projects[0]"


def until(page: Page, wanted: str) -> None:
    while not page.evaluate(f"() => (p => !!p && {wanted})(({_PROJECT})())"):
        time.sleep(0.05)


with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
    studio = Studio(
        Served(None, Environments(), None, print, None, workshop(Path(folder) / "scenes")), port=0
    )
    thread = threading.Thread(target=studio.serve, daemon=True)
    thread.start()
    browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
    page = browser.new_page(viewport={"width": 1180, "height": 620}, color_scheme="dark")
    page.goto(studio.new_link())
    page.get_by_role("button", name=SCENE, exact=True).click()
    until(page, "p.vertices > 0")
    page.get_by_role("radio", name="Draft").click()
    page.get_by_role("radio", name="Anywhere").click()
    until(page, "p.stage === 'ready' && p.layers.length === 2 && p.layers[1].seconds > 0")
    page.get_by_role("button", name="Bake", exact=True).click()
    until(page, f"p.share > {SHARE} && p.rays_per_second > 0")
    page.screenshot(path=Path(__file__).with_name("studio-start.png"))
    browser.close()
    studio.stop()
    thread.join(30)

"""Debian's Chromium on the studio's page: what every test of it looks at."""

from __future__ import annotations

import base64
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

WIDTH, HEIGHT = 480, 270
_ARGUMENTS = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-dev-shm-usage",
)
_PIXELS = """() => {
  const {width, height, data} = __prelight.pixels();
  let text = "";
  for (let i = 0; i < data.length; i += 32768) text += String.fromCharCode(...data.subarray(i, i + 32768));
  return {width, height, data: btoa(text)};
}"""

_RESTED = """async () => {
  await Promise.allSettled(document.getAnimations().map((one) => one.finished));
  for (let picture = 0; picture < 2; picture++) await new Promise(requestAnimationFrame);
}"""


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser; skips, saying why, where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("Chromium is not installed (apt install chromium)")
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=path, args=list(_ARGUMENTS))
        try:
            yield browser
        finally:
            browser.close()


@dataclass
class Visit:
    """A page that somebody looks at, and all that it complained of or asked for."""

    page: Any
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def until(self, what: str, wanted: Callable[[Any], bool] = bool, *, seconds: float = 20.0) -> Any:
        """The value of an expression of the page, once it is as wanted."""
        end = time.monotonic() + seconds
        while not wanted(value := self.page.evaluate(f"() => {what}")):
            assert time.monotonic() < end, f"{what} is {value} after {seconds} s; {self.complaints}"
            time.sleep(0.03)
        return value

    def metric(self, name: str) -> Any:
        return self.page.evaluate(f"() => __prelight.metrics.{name}")

    def settled(self, *, after: int = 0) -> None:
        """Wait for the exact light of all that was changed here, and of a state no older than this sequence."""
        self.until(f"window.__prelight?.settled() && __prelight.metrics.shownSequence >= {after}")

    def rested(self) -> None:
        """Wait until nothing on the page moves any more: all pictures that are wanted are drawn, and handles follow."""
        self.settled()
        self.until("__prelight.resting()")
        self.page.evaluate(_RESTED)

    def pixels(self) -> np.ndarray:
        """What the canvas shows, (height, width, 3) bytes, the top row first."""
        got = self.page.evaluate(_PIXELS)
        data = np.frombuffer(base64.b64decode(got["data"]), np.uint8)
        return data.reshape(got["height"], got["width"], 4)[::-1, :, :3].astype(np.float64)

    def slide(self, section: str, name: str, value: float) -> None:
        """Set a slider of a section of the panel."""
        self.page.get_by_role("region", name=section).get_by_role("slider", name=name, exact=True).fill(
            str(value)
        )


@contextmanager
def visiting(
    browser: Any,
    url: str,
    *,
    width: int = WIDTH,
    height: int = HEIGHT,
    scheme: str = "dark",
    touch: bool = False,
) -> Iterator[Visit]:
    """Open the page as somebody new. It must not complain, nor ask anybody else for anything."""
    context = browser.new_context(
        viewport={"width": width, "height": height},
        color_scheme=scheme,
        reduced_motion="reduce",
        has_touch=touch,
    )
    page = context.new_page()
    visit = Visit(page)
    page.on("console", lambda message: visit.complaints.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda error: visit.complaints.append(f"error: {error}"))
    page.on("dialog", lambda dialog: (visit.complaints.append(f"dialog: {dialog.message}"), dialog.dismiss()))
    page.on("request", lambda request: visit.requests.append(request.url))
    page.goto(url)
    try:
        yield visit
    finally:
        context.close()

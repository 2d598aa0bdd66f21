"""The same in the page itself, in Debian's Chromium without a graphics card: what arrives, and what it costs there."""

from __future__ import annotations

import shutil
import time
from typing import Any

ARGUMENTS = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-dev-shm-usage",
)
READY = "() => !!window.__prelight && __prelight.metrics.ready && __prelight.metrics.shownExact"
DRAG = """(milliseconds) => new Promise((done) => {
  const {metrics} = __prelight, began = performance.now(), updates = metrics.updates, drawn = metrics.drawn;
  let k = 0;
  metrics.scriptMs.length = metrics.uploadMs.length = 0;
  const timer = setInterval(() => {
    const now = performance.now() - began;
    if (now < milliseconds) return __prelight.change({scale: 0.5 + 0.01 * (k++ % 50)}, true);
    clearInterval(timer);
    done({seconds: now / 1000, changes: k, updates: metrics.updates - updates, drawn: metrics.drawn - drawn,
          script: [...metrics.scriptMs], upload: [...metrics.uploadMs]});
  }, 1000 / 60);
})"""


def in_browser(link: str, seconds: float) -> dict[str, Any]:
    """Drag the scale of the sky 60 times a second; updates that arrived, pictures drawn, script an update."""
    from playwright.sync_api import sync_playwright

    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None:
        return {"skipped": "no Chromium"}
    with sync_playwright() as p:
        browser = p.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        page = browser.new_page(viewport={"width": 960, "height": 540}, reduced_motion="reduce")
        began = time.perf_counter()
        page.goto(link)
        page.wait_for_function(READY, timeout=120_000)
        opened = time.perf_counter() - began
        got = page.evaluate(DRAG, seconds * 1000)
        browser.close()
    script = sorted(got["script"])
    return {
        "opened_s": opened,
        "changes_per_second": got["changes"] / got["seconds"],
        "updates_per_second": got["updates"] / got["seconds"],
        "drawn_per_second": got["drawn"] / got["seconds"],
        "script_ms_median": script[len(script) // 2] if script else None,
        "script_ms_p95": script[int(0.95 * len(script))] if script else None,
        "upload_ms_median": sorted(got["upload"])[len(got["upload"]) // 2] if got["upload"] else None,
    }

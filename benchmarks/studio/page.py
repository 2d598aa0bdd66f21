"""The same in the page itself, in Debian's Chromium without a graphics card: what arrives, and what it costs there."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable
from typing import Any

ARGUMENTS = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-dev-shm-usage",
)
READY = "() => !!window.__prelight && __prelight.metrics.ready && __prelight.metrics.shownExact"
NOTES = """() => {
  const {updates, drawn, scriptMs, uploadMs} = __prelight.metrics;
  return {updates, drawn, at: performance.now() / 1000, script: [...scriptMs], upload: [...uploadMs]};
}"""


def in_browser(cookie: str, origin: str, *, drags: dict[str, Callable[[], object]]) -> dict[str, Any]:
    """A page that looks on while another visitor drags, once for each kind of drag."""
    from playwright.sync_api import sync_playwright

    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None:
        return {"skipped": "no Chromium"}
    name, _, value = cookie.partition("=")
    with sync_playwright() as p:
        browser = p.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        context = browser.new_context(viewport={"width": 480, "height": 270}, reduced_motion="reduce")
        context.add_cookies([{"name": name, "value": value, "url": origin}])
        page = context.new_page()
        began = time.perf_counter()
        page.goto(origin)
        page.wait_for_function(READY, timeout=120_000)
        found: dict[str, Any] = {"opened_s": time.perf_counter() - began}
        for kind, drag in drags.items():
            page.wait_for_function(READY, timeout=120_000)
            found[kind] = _looked_on(page, drag)
        browser.close()
    return found


def _looked_on(page: Any, drag: Callable[[], object]) -> dict[str, float]:
    """Updates that arrived, pictures drawn, and script: of the update itself, and all that ran, for each update."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")

    def notes() -> dict[str, Any]:
        metrics = {m["name"]: m["value"] for m in session.send("Performance.getMetrics")["metrics"]}
        return {**page.evaluate(NOTES), "all": metrics["ScriptDuration"]}

    before = notes()
    dragging = threading.Thread(target=drag)
    dragging.start()
    dragging.join()
    after = notes()
    session.detach()
    updates, seconds = after["updates"] - before["updates"], after["at"] - before["at"]
    script, upload = sorted(after["script"]), sorted(after["upload"])
    return {
        "updates_per_second": updates / seconds,
        "drawn_per_second": (after["drawn"] - before["drawn"]) / seconds,
        "script_ms_median": script[len(script) // 2],
        "script_ms_p95": script[int(0.95 * len(script))],
        "upload_ms_median": upload[len(upload) // 2],
        "all_script_ms_an_update": 1e3 * (after["all"] - before["all"]) / max(updates, 1),
    }

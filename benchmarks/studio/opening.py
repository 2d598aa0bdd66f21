"""Seconds from the command to the first picture on the screen, in Chromium; bake in the page cache, kernels compiled.

python benchmarks/studio/opening.py BAKE [--runs 3] [--output results/opening.json]
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import time
from pathlib import Path

from page import ARGUMENTS
from playwright.sync_api import sync_playwright
from run import studio

import prelight as pl

DRAWN = """() => {
  const m = window.__prelight?.metrics;
  return !!m && m.ready && m.uploads > 0 && m.drawn > 0;
}"""
EXACT = "() => __prelight.metrics.shownExact"


def opened(browser, bake: Path) -> dict[str, float]:
    """One studio and one page; the browser runs already."""
    began = time.perf_counter()
    with studio(bake) as link:
        found = {"link_s": time.perf_counter() - began}
        page = browser.new_page(viewport={"width": 1280, "height": 720}, reduced_motion="reduce")
        page.goto(link)
        page.wait_for_function(DRAWN, timeout=120_000, polling=20)
        found["first_picture_s"] = time.perf_counter() - began
        page.wait_for_function(EXACT, timeout=120_000, polling=20)
        found["exact_picture_s"] = time.perf_counter() - began
        page.close()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bake", type=Path)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--output", type=Path, help="JSON file of the figures")
    given = parser.parse_args()
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    bake = pl.Bake.open(given.bake)
    load = os.getloadavg()[0]
    with sync_playwright() as p:
        browser = p.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        runs = [opened(browser, given.bake) for _ in range(given.runs + 1)][1:]  # the first fills the caches
        browser.close()
    figures = {
        "bake_bytes": bake.manifest.bytes_of(""),
        "vertices": len(bake.receivers),
        "load_before": load,
        **{name: statistics.median(run[name] for run in runs) for name in runs[0]},
    }
    text = json.dumps(figures, indent=2)
    print(text)
    if given.output:
        given.output.write_text(text + "\n")


if __name__ == "__main__":
    main()

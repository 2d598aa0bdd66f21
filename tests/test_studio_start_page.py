"""The start page in a real browser: a scene is dropped, its cost told, baked, stopped, resumed and opened."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

from prelight.storage.bake import Bake
from prelight.studio.recipes import recipes
from prelight.studio.start_protocol import Wish

from .start_page import small_ply, starting
from .studio_browser import Visit, chromium, visiting

LONG = 120.0  # seconds, of a busy machine


@pytest.fixture(scope="module")
def browser():
    with chromium() as running:
        yield running


def _project(visit: Visit, wanted: str):
    """The newest project, once an expression of it, p, is true."""
    shown = "window.__prelight_start?.workshop()?.projects[0]"
    return visit.until(f"(p => p && {wanted} ? p : null)({shown})", seconds=LONG)


def _press(visit: Visit, name: str) -> None:
    visit.page.get_by_role("button", name=name, exact=True).click(timeout=30_000)


def test_a_scene_is_dropped_baked_stopped_resumed_and_opened(browser, tmp_path) -> None:
    pytest.importorskip("mitsuba", reason="the renderer is not installed")
    with (
        starting(tmp_path / "work") as studio,
        visiting(browser, studio.studio.new_link(), width=1100, height=720) as visit,
    ):
        visit.until("!!window.__prelight_start?.workshop()")
        assert visit.page.url.endswith("/start")
        files = [{"name": "Kugel.txt", "mimeType": "text/plain", "buffer": b"hello"}]
        visit.page.set_input_files("input[type=file]", files)
        visit.page.get_by_text("expected a scene").wait_for()
        ball = {"name": "Kugel.ply", "mimeType": "application/octet-stream", "buffer": small_ply(side=25)}
        visit.page.set_input_files("input[type=file]", [ball])
        _project(visit, "p.vertices > 0")
        visit.page.get_by_role("radio", name="Draft").click()
        ready = _project(visit, "p.stage === 'ready' && p.wish.quality === 'draft'")
        (cost,) = ready["layers"]
        (recipe,) = recipes(Wish(quality="draft"))
        dry = subprocess.run(
            [sys.executable, "-c", "from prelight.cli.main import main; main()", "bake", "environment",
             studio.workshop.project(ready["id"]).scene, *recipe.arguments, "-o", str(tmp_path / "x.prelight"),
             "--dry-run", "--json"],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        assert {k: cost[k] for k in ("rays", "bytes")} == {
            k: json.loads(dry.stdout)[k] for k in ("rays", "bytes")
        }
        _press(visit, "Bake")
        _project(visit, "p.stage === 'baking' && (p.share > 0 || p.seconds_left > 0)")
        _press(visit, "Stop")
        stopped = _project(visit, "p.stage === 'stopped' || p.stage === 'baked'")
        if stopped["stage"] == "stopped":  # else it was ready before the hand was there
            _press(visit, "Go on")
        baked = _project(visit, "p.stage === 'baked' && p.passes >= 4")
        assert list(Bake.open(baked["path"]).layers) == ["environment"]
        picture = visit.page.get_by_role("img", name="Kugel under a sky at noon")
        assert picture.evaluate("image => image.complete && image.naturalWidth") == 480
        _press(visit, "Open in the studio")
        visit.page.wait_for_url("**/")
        visit.until("!!window.__prelight && __prelight.metrics.ready", seconds=LONG)
        visit.settled()
        shown = visit.pixels()
        assert np.ptp(shown.mean(axis=2)) > 50  # a lit ball, its shadow, a sky
        visit.page.goto(f"http://{studio.host}/start")
        visit.until("!!window.__prelight_start?.workshop()")
        assert "Kugel" in visit.page.get_by_role("link").inner_text()
        assert not [line for line in visit.complaints if "422" not in line], visit.complaints
        assert all(
            url.startswith((f"http://{studio.host}/", f"ws://{studio.host}/", "blob:"))
            for url in visit.requests
        )


def test_names_of_scenes_stay_text(browser, tmp_path) -> None:
    hostile = "<img src=x onerror=alert(1)>"
    folder = tmp_path / "work" / "x"
    folder.mkdir(parents=True)
    said = {"name": hostile, "source": "stock:sculpture-small", "wish": {}}
    (folder / "project.json").write_text(json.dumps(said))
    with starting(tmp_path / "work") as studio, visiting(browser, studio.studio.new_link()) as visit:
        visit.until("!!window.__prelight_start?.workshop()")
        assert visit.page.get_by_role("heading", name=hostile).inner_text() == hostile
        assert visit.page.evaluate("() => document.querySelectorAll('img[src=x]').length") == 0
        assert not visit.complaints, visit.complaints

"""Fingers on the studio's page: they turn the view, come nearer, drag lamps and sliders, and tap."""

from __future__ import annotations

import numpy as np
import pytest

from .studio_browser import chromium, visiting
from .studio_stand_in import COLUMNS, ROWS, patches, serving
from .test_studio_hands import wait_for

pytest.importorskip("starlette", reason="the studio's server is not installed")


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


def finger(visit, *ways: list[tuple[float, float]]) -> None:
    """Fingers that go down together, along their ways, and up."""
    devtools = visit.page.context.new_cdp_session(visit.page)

    def send(kind: str, places) -> None:
        points = [{"x": x, "y": y, "id": n} for n, (x, y) in enumerate(places)]
        devtools.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    for n, places in enumerate(zip(*ways, strict=True)):
        send("touchStart" if n == 0 else "touchMove", places)
    send("touchEnd", [])
    devtools.detach()


def along(start: tuple[float, float], end: tuple[float, float]) -> list[tuple[float, float]]:
    return [
        (start[0] + t * (end[0] - start[0]), start[1] + t * (end[1] - start[1])) for t in np.linspace(0, 1, 6)
    ]


def test_fingers_do_what_a_mouse_does(browser, rng):
    studio = patches(rng.uniform(0, 1, (ROWS * COLUMNS, 3)))
    with serving(studio), visiting(browser, studio.url, width=800, height=450, touch=True) as visit:
        visit.settled()
        page = visit.page
        straight, eye = visit.pixels(), page.evaluate("() => __prelight.eye()")
        finger(visit, along((240, 220), (330, 220)))
        around = page.evaluate("() => __prelight.eye()")
        assert abs(around[0] - eye[0]) > 1
        assert np.linalg.norm(around) == pytest.approx(np.linalg.norm(eye), rel=0.01)
        assert np.abs(visit.pixels() - straight).mean() > 5
        finger(visit, along((220, 220), (150, 220)), along((260, 220), (330, 220)))  # apart: nearer
        assert np.linalg.norm(page.evaluate("() => __prelight.eye()")) < 0.8 * np.linalg.norm(eye)
        page.get_by_role("button", name="straight").tap()
        visit.until("__prelight.eye()[2]", lambda z: abs(z - 10) < 1e-6)
        assert np.abs(visit.pixels() - straight).mean() < 0.5
        page.get_by_role("button", name="Walk").tap()
        finger(visit, along((220, 220), (150, 220)), along((260, 220), (330, 220)))  # apart: ahead
        visit.until("__prelight.eye()[2]", lambda z: z < 10)
        page.get_by_role("button", name="straight").tap()
        visit.until("__prelight.eye()[2]", lambda z: abs(z - 10) < 1e-6)
        box = page.get_by_role("slider", name="Turn of the sky").bounding_box()
        x, y, r = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, 0.35 * box["width"]
        finger(visit, [(x - r * np.sin(a), y - r * np.cos(a)) for a in np.linspace(0, np.pi / 2, 6)])
        wait_for(lambda: studio.state["rotation_deg"] == pytest.approx(90, abs=2))
        page.get_by_role("button", name="Add lamp").tap()
        wait_for(lambda: len(studio.state["lamps"]) == 1)
        visit.rested()
        before = studio.state["lamps"][0]["position"]
        box = page.get_by_role("button", name="Lamp 1 at").bounding_box()
        at = (box["x"] + 10, box["y"] + 10)
        finger(visit, along(at, (at[0] + 60, at[1])))
        wait_for(lambda: studio.state["lamps"][0]["position"][0] > before[0] + 0.3)
        visit.rested()  # the rows of the lamp that was picked are there
        page.get_by_role("switch", name="Lamp 1 is lit").tap()
        wait_for(lambda: studio.state["lamps"][0]["on"] is False)
        assert not visit.complaints

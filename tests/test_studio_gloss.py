"""Gloss on the page: of what is lit and of looks beside it, as it is seen from where one stands."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.images.tonemap import srgb_decode
from prelight.studio.frames import FRAME_ASIDE, FRAME_SHINE, FRAME_VIEW, FRAME_WORLD

from .studio_browser import HEIGHT, WIDTH, chromium, visiting
from .studio_stand_in import COLUMNS, ROWS, SKY, STRAIGHT, StandIn, framed, packed, patches, serving
from .test_studio_hands import wait_for
from .test_studio_shown import SQUARES, linearly, seen, with_looks

pytest.importorskip("starlette", reason="the studio's server is not installed")


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


def shining(studio: StandIn) -> None:
    """Half of the squares add a red that tells where the eye is; the others take off a quarter of their light."""
    rows = 4 * SQUARES
    half = np.arange(rows) < rows // 2

    def view(message):
        red = 0.1 + 0.2 * (message["eye"][0] > 1)
        halves = np.zeros((rows, 4), "<f2")
        halves[half, 0] = red
        halves[~half, :3] = -0.1
        return [framed(halves, FRAME_VIEW | FRAME_SHINE)]

    studio.replies["LookFrom"] = view
    studio.welcome["glossy"] = True


def test_gloss_is_added_as_it_is_seen_from_where_one_stands(browser):
    studio = patches(np.full((SQUARES, 3), 0.4))
    shining(studio)
    studio.cameras = [STRAIGHT, {**STRAIGHT, "name": "aside", "eye": (4.0, 0.0, 9.0)}]
    with serving(studio), visiting(browser, studio.url) as visit:
        linearly(visit)
        visit.until("__prelight.metrics.views", lambda count: count >= 1)
        shown = seen(visit)
        assert shown[: SQUARES // 2, 0].mean() == pytest.approx(0.5, abs=0.01)
        assert shown[SQUARES // 2 :].mean() == pytest.approx(0.3, abs=0.01)
        known = visit.metric("views")
        visit.page.get_by_role("button", name="aside").click()
        visit.until("__prelight.metrics.views", lambda count: count > known)
        wait_for(lambda: studio.received[-1]["type"] == "LookFrom" and studio.received[-1]["eye"][0] == 4.0)
        picture = srgb_decode(visit.pixels().astype(np.uint8))
        assert picture[..., 0].max() == pytest.approx(0.7, abs=0.02)
        asked = [m for m in studio.received if m["type"] == "LookFrom"]
        visit.page.wait_for_timeout(300)
        assert len([m for m in studio.received if m["type"] == "LookFrom"]) == len(
            asked
        )  # nothing new to ask
        visit.page.get_by_role("radio", name="lux").click()
        assert not visit.complaints


def test_looks_that_are_compared_shine_as_well(browser):
    """Each side its own gloss, as it is seen from where one stands; after a walk it is asked for anew."""
    studio = patches(np.full((SQUARES, 3), 0.4))
    shining(studio)
    with_looks(studio)
    plain = studio.replies["Compare"]

    def compared(message):
        halves = np.zeros((4 * SQUARES, 4), "<f2")
        halves[:, 1] = {"Red": 0.3, "Blue": 0.1}[message["look"]] + 0.2 * (message["eye"][0] > 1)
        return [*plain(message), framed(halves, FRAME_ASIDE | FRAME_VIEW | FRAME_SHINE)]

    studio.replies["Compare"] = compared
    studio.cameras = [STRAIGHT, {**STRAIGHT, "name": "aside", "eye": (4.0, 0.0, 9.0)}]
    with serving(studio), visiting(browser, studio.url) as visit:
        linearly(visit)
        page = visit.page
        visit.until("__prelight.metrics.views", lambda count: count >= 1)
        page.get_by_role("button", name="Compare with Blue").click()
        visit.until("__prelight.metrics.asideViews", lambda count: count >= 1)
        columns = seen(visit).reshape(ROWS, COLUMNS, 3)
        half = columns[:, : COLUMNS // 2 - 1]
        assert half[..., 0].max() == pytest.approx(0.5, abs=0.02)  # of what is set
        assert half[..., 0].min() == pytest.approx(0.3, abs=0.02)
        assert np.abs(columns[:, COLUMNS // 2 + 1 :] - (0.1, 0.2, 0.8)).max() < 0.02
        page.get_by_role("combobox", name="Left side").select_option("look Red")
        visit.until("__prelight.metrics.asideViews", lambda count: count >= 2)
        assert (
            np.abs(seen(visit).reshape(ROWS, COLUMNS, 3)[:, : COLUMNS // 2 - 1] - (0.8, 0.4, 0.1)).max()
            < 0.02
        )
        page.get_by_role("button", name="aside").click()
        wait_for(lambda: [m["eye"][0] for m in studio.received if m["type"] == "Compare"][-2:] == [4.0, 4.0])
        visit.until("__prelight.metrics.asideViews", lambda count: count >= 4)
        shown = srgb_decode(visit.pixels().astype(np.uint8))
        assert shown[..., 1].max() == pytest.approx(0.6, abs=0.02)
        page.get_by_role("button", name="Done").click()
        page.get_by_role("button", name="straight").click()
        visit.until("__prelight.eye()[2]", lambda z: abs(z - 10) < 1e-6)
        visit.until("__prelight.metrics.views", lambda count: count >= 3)
        assert seen(visit)[:, 0].max() == pytest.approx(0.5, abs=0.02)
        assert not visit.complaints


def test_a_look_that_is_asked_for_before_a_walk_shines_as_it_is_seen_after_it(browser):
    """The answer for the first place is on its way while one goes to the second: it is asked for anew all the same."""
    studio = patches(np.full((SQUARES, 3), 0.4))
    shining(studio)
    with_looks(studio)
    plain, late = studio.replies["Compare"], []

    def compared(message):
        halves = np.zeros((4 * SQUARES, 4), "<f2")
        halves[:, 1] = 0.1 + 0.4 * (message["eye"][0] > 1)
        late.extend([*plain(message), framed(halves, FRAME_ASIDE | FRAME_VIEW | FRAME_SHINE)])
        return late if message["eye"][0] > 1 else []

    studio.replies["Compare"] = compared
    studio.cameras = [STRAIGHT, {**STRAIGHT, "name": "aside", "eye": (4.0, 0.0, 9.0)}]
    with serving(studio), visiting(browser, studio.url) as visit:
        linearly(visit)
        visit.until("__prelight.metrics.views", lambda count: count >= 1)
        visit.page.get_by_role("button", name="Compare with Blue").click()
        wait_for(lambda: [m["eye"][0] for m in studio.received if m["type"] == "Compare"] == [0.0])
        visit.page.get_by_role("button", name="aside").click()
        visit.until("__prelight.metrics.asideViews", lambda count: count == 2)
        assert [m["eye"][0] for m in studio.received if m["type"] == "Compare"] == [0.0, 4.0]
        shown = srgb_decode(visit.pixels().astype(np.uint8))
        assert shown[..., 1].max() == pytest.approx(0.6, abs=0.02)
        assert not visit.complaints


def test_a_late_answer_for_a_look_that_is_not_shown_is_not_kept_for_another_eye(browser):
    """It was asked for from aside, and comes when one is back: shown then, the look is asked for anew."""
    studio = patches(np.full((SQUARES, 3), 0.4))
    shining(studio)
    with_looks(studio)
    plain = studio.replies["Compare"]
    asked: list[float] = []

    def answer(eye: float) -> list:
        halves = np.zeros((4 * SQUARES, 4), "<f2")
        halves[:, 1] = 0.1 + 0.4 * (eye > 1)
        return [*plain({"look": "Blue"}), framed(halves, FRAME_ASIDE | FRAME_VIEW | FRAME_SHINE)]

    def compared(message):
        asked.append(message["eye"][0])
        return ([], answer(0.0), answer(0.0))[len(asked) - 1]  # always that of the question before

    studio.replies |= {"Compare": compared, "Undo": lambda _: answer(4.0)}
    studio.cameras = [STRAIGHT, {**STRAIGHT, "name": "aside", "eye": (4.0, 0.0, 9.0)}]
    with serving(studio), visiting(browser, studio.url) as visit:
        linearly(visit)
        page = visit.page
        visit.until("__prelight.metrics.views", lambda count: count >= 1)
        page.get_by_role("button", name="Compare with Blue").click()
        wait_for(lambda: asked == [0.0])
        page.get_by_role("button", name="Done").click()
        page.get_by_role("button", name="aside").click()
        wait_for(lambda: asked == [0.0, 4.0])
        visit.until("__prelight.metrics.asideViews", lambda count: count == 1)
        page.get_by_role("button", name="straight").click()
        page.wait_for_timeout(400)  # the eye rests
        page.get_by_role("button", name="Undo").click()
        visit.until("__prelight.metrics.asideViews", lambda count: count == 2)
        page.get_by_role("button", name="Compare with Blue").click()
        wait_for(lambda: asked == [0.0, 4.0, 0.0])
        visit.until("__prelight.metrics.asideViews", lambda count: count == 3)
        columns = seen(visit).reshape(ROWS, COLUMNS, 3)
        assert np.abs(columns[:, COLUMNS // 2 + 1 :] - (0.1, 0.2, 0.8)).max() < 0.02
        assert not visit.complaints


def test_each_side_has_the_world_outside_of_its_look(browser):
    """Behind the scene: of what is set on the left; of a look on the right, its sky where it has no world."""
    studio = patches(np.zeros((SQUARES, 3)), sky=np.full((SKY[0] * SKY[1], 3), 0.25))
    studio.positions = studio.positions * 1e-3  # next to nothing is in front of it
    with_looks(studio)
    studio.welcome["worlds"] = [{"id": "town.toml", "title": "town", "duration": 10.0}]
    studio.state |= {"world": "town.toml"}
    plain = studio.replies["Compare"]

    def world(colour, flags):
        return framed(packed(np.tile(colour, (SKY[0] * SKY[1], 1))), flags | FRAME_VIEW | FRAME_WORLD)

    def compared(message):
        if message["look"] == "Red":
            return plain(message)
        green = 0.2 + 0.2 * (message["eye"][0] > 1)
        return [*plain(message), world((0.1, green, 0.7), FRAME_ASIDE)]

    studio.replies |= {"Compare": compared, "LookFrom": lambda _: [world((0.4, 0.3, 0.05), 0)]}
    studio.cameras = [STRAIGHT, {**STRAIGHT, "name": "aside", "eye": (4.0, 0.0, 9.0)}]
    with serving(studio), visiting(browser, studio.url) as visit:
        linearly(visit)
        page = visit.page
        visit.until("__prelight.metrics.views", lambda count: count >= 1)
        assert behind(visit) == pytest.approx(np.array([(0.4, 0.3, 0.05)] * 2), abs=0.01)
        page.get_by_role("button", name="Compare with Blue").click()
        visit.until("__prelight.metrics.asideViews", lambda count: count >= 1)
        assert behind(visit) == pytest.approx(np.array([(0.4, 0.3, 0.05), (0.1, 0.2, 0.7)]), abs=0.01)
        page.get_by_role("combobox", name="Left side").select_option("look Red")
        visit.until("__prelight.metrics.sides")
        assert behind(visit) == pytest.approx(np.array([(0.25, 0.25, 0.25), (0.1, 0.2, 0.7)]), abs=0.01)
        page.get_by_role("button", name="aside").click()
        visit.until("__prelight.metrics.asideViews", lambda count: count >= 2)
        assert behind(visit)[1] == pytest.approx(np.array((0.1, 0.4, 0.7)), abs=0.01)
        page.get_by_role("button", name="Done").click()
        assert behind(visit) == pytest.approx(np.array([(0.4, 0.3, 0.05)] * 2), abs=0.01)
        assert not visit.complaints


def behind(visit) -> np.ndarray:
    """Linear colours of what is above the scene on the left and on the right of the middle (2, 3), without panels."""
    visit.page.keyboard.press("h")
    shown = srgb_decode(visit.pixels().astype(np.uint8))[: HEIGHT // 4]
    visit.page.keyboard.press("h")
    halves = shown[:, : WIDTH // 2 - 8], shown[:, WIDTH // 2 + 8 :]
    assert max(np.ptp(half, axis=(0, 1)).max() for half in halves) < 0.02
    return np.array([half.mean(axis=(0, 1)) for half in halves])

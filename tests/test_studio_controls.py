"""The page's other controls: each number and slider changes the pixels as light must, not only what is sent."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from .live_studio import running
from .studio_bakes import lamps_bake
from .studio_browser import Visit, chromium, visiting
from .test_studio_lamps import linear, look, set_number
from .test_studio_live import LEFT, RIGHT, changed, link

GROUND = slice(165, 225), slice(165, 300)


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture
def visit(browser, tmp_path, tmp_path_factory) -> Iterator[Visit]:
    bake = lamps_bake(tmp_path_factory)
    with (
        running(bake, state_file=tmp_path / "state.json") as live,
        visiting(browser, link(live), height=540) as there,
    ):
        there.settled()
        there.page.get_by_role("radio", name="Linear").click()
        there.slide("Picture", "Exposure", -1)
        yield there
        assert not there.complaints


def mean(picture: np.ndarray) -> np.ndarray:
    """The colour of the ground."""
    return picture[GROUND].mean(axis=(0, 1))


def test_a_panel_and_the_radius_of_a_lamp(visit):
    """A panel lights what it faces and nothing behind it; a lamp's shadow gets softer with its radius."""
    page = visit.page
    changed(visit, page.get_by_role("radio", name="overcast").click)
    changed(visit, lambda: visit.slide("Sky", "Strength", -6))
    before = linear(visit)
    changed(visit, page.get_by_role("button", name="Add panel").click)
    for name, value in (("Place, m x", 0.0), ("Place, m y", 1.9), ("Place, m z", 0.0), ("At full lm", 6000)):
        set_number(visit, name, value)
    for axis, value in zip("xyz", (0.01, 0.0, 0.0), strict=True):
        set_number(visit, f"Aim, m {axis}", value)
    down = linear(visit) - before
    assert mean(down).min() > 0.05
    set_number(visit, "Aim, m y", 4.0)  # up: away from everything
    assert np.abs(linear(visit) - before)[GROUND].max() < 0.02
    set_number(visit, "Aim, m y", 0.0)
    set_number(visit, "Size, m w", 0.02)
    set_number(visit, "Size, m h", 0.02)
    small = linear(visit) - before
    assert mean(small)[1] == pytest.approx(mean(down)[1], rel=0.25), "as many lumens"
    changed(visit, page.get_by_role("radio", name="Lamp", exact=True).click)
    assert look(visit)["lamps"][0]["kind"] == "lamp"
    set_number(visit, "Place, m x", -1.2)
    set_number(visit, "At full lm", 9000)
    changed(visit, lambda: visit.slide("Lamps", "Radius", -2.9))
    hard = linear(visit) - before
    changed(visit, lambda: visit.slide("Lamps", "Radius", 0))  # a metre: some of it is seen past the ball
    soft = linear(visit) - before
    assert soft[RIGHT].mean() > hard[RIGHT].mean() + 0.005
    assert mean(soft)[1] < 2 * mean(hard)[1]
    for kind in ("Spot", "Panel"):  # both are aimed away from the ball
        changed(visit, page.get_by_role("radio", name=kind, exact=True).click)
        set_number(visit, "Aim, m x", -4.0 - len(kind))
        assert look(visit)["lamps"][0]["kind"] == kind.lower()
        aimed = linear(visit) - before
        assert aimed[RIGHT].mean() < 0.5 * soft[RIGHT].mean()


def test_the_sun_by_day_haze_place_and_clock(visit):
    page = visit.page
    changed(visit, page.get_by_role("radio", name="daylight").click)
    visit.slide("Picture", "Exposure", -7)
    changed(visit, lambda: visit.slide("Sky", "Hour", 12))
    june = mean(linear(visit))
    changed(visit, lambda: visit.slide("Sky", "Haze", 8))
    hazy = mean(linear(visit))
    assert hazy[2] / hazy[0] < june[2] / june[0], "haze takes blue from the sun and the sky"
    changed(visit, lambda: visit.slide("Sky", "Haze", 2.5))
    changed(visit, lambda: page.get_by_label("Day", exact=True).fill("2026-12-21"))
    december = mean(linear(visit))
    assert december[1] < 0.7 * june[1]
    changed(visit, lambda: page.get_by_label("Day", exact=True).fill("2026-06-21"))
    assert np.abs(mean(linear(visit)) / june - 1).max() < 0.03
    set_number(visit, "Place N °", -60)
    assert mean(linear(visit))[1] < 0.5 * june[1], "winter there"
    set_number(visit, "Place N °", 43.74)
    clock = page.get_by_label("Clock: a zone such as Europe/Zagreb")
    clock.fill("Europe/Zagreb")
    changed(visit, lambda: clock.press("Enter"))
    assert mean(linear(visit))[1] > 0.7 * june[1]
    set_number(visit, "Place E °", -164)
    assert mean(linear(visit)).max() < 0.02, "as far round the world it is night when it is noon in Zagreb"
    set_number(visit, "Place E °", 15.89)
    clock.fill("Pacific/Auckland")
    changed(visit, lambda: clock.press("Enter"))
    assert mean(linear(visit)).max() < 0.02, "noon there is midnight here"


def test_a_soft_light_by_its_size_its_softness_and_its_colour(visit):
    """Its power stays when its size changes; its shadow gets softer; the light of a warm one is warm."""
    page = visit.page
    changed(visit, page.get_by_role("radio", name="overcast").click)
    changed(visit, lambda: visit.slide("Sky", "Strength", -6))
    dark = linear(visit)
    changed(visit, page.get_by_role("button", name="Add a light").click)
    dot = page.get_by_role("button", name="Light 1,")
    changed(visit, lambda: dot.press("ArrowUp"))
    first = linear(visit) - dark
    assert first[LEFT].mean() > 0.05
    changed(visit, lambda: visit.slide("Lights in the sky", "Radius", 0))
    small = linear(visit) - dark
    assert mean(small)[1] == pytest.approx(mean(first)[1], rel=0.1)
    changed(visit, lambda: visit.slide("Lights in the sky", "Radius", 5.4))
    large = linear(visit) - dark
    assert large[GROUND].std() / large[GROUND].mean() < small[GROUND].std() / small[GROUND].mean()
    changed(visit, lambda: visit.slide("Lights in the sky", "Warmth", 2500))
    warm = linear(visit) - dark
    assert warm[GROUND][..., 0].mean() > 1.5 * warm[GROUND][..., 2].mean()
    changed(visit, lambda: page.get_by_label("Colour of the light").fill("#2040ff"))
    blue = linear(visit) - dark
    assert blue[GROUND][..., 2].mean() > 1.5 * blue[GROUND][..., 0].mean()
    changed(visit, lambda: visit.slide("Lights in the sky", "Strength", -6))
    assert (linear(visit) - dark)[GROUND].mean() < 0.05 * blue[GROUND].mean() + 0.005
    changed(visit, lambda: visit.slide("Lights in the sky", "Strength", 0))
    assert (linear(visit) - dark)[GROUND].mean() > 0.5 * blue[GROUND].mean()
    lights = page.get_by_role("region", name="Lights in the sky")
    changed(visit, lights.get_by_role("button", name="Remove", exact=True).click)
    assert np.abs(linear(visit) - dark).mean() < 0.003

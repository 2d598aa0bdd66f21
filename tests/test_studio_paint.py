"""Paint on the strip of the sky: its messages, undo, rig files, every kind of layer, and the page."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.lighting.rig import Rig
from prelight.relighting.lit_bake import LitBake
from prelight.storage.bake import Bake
from prelight.studio import history as histories
from prelight.studio import kept
from prelight.studio.environments import Environments
from prelight.studio.fields import MOST_DABS
from prelight.studio.history import History
from prelight.studio.lighting import lighting_of
from prelight.studio.protocol import (
    ClearPaint,
    Redo,
    RemovePaint,
    SaveLook,
    SetEnvironment,
    SetPaint,
    ShowLook,
    Undo,
)
from prelight.studio.protocol_values import PaintStroke
from prelight.studio.rig_state import changed as step
from prelight.studio.rig_state import initial
from prelight.studio.rig_toml import opened_rig, rig_text
from prelight.studio.wire import decode, encode

from .live_studio import ball_bake, running
from .portal_rooms import portals_of, two_windows
from .studio_bakes import lamps_bake
from .studio_browser import Visit, chromium, visiting
from .test_studio_lamps import linear, look
from .test_studio_live import LEFT, RIGHT, changed, link
from .test_studio_rgb9e5 import unpacked

STROKE = PaintStroke("a", 20.0, (9.0, 6.0, 3.0), 0.5, 0.75, ((-90.0, 30.0), (-70.0, 30.0)))
OTHER = PaintStroke("b", 40.0, (0.0, 0.0, 0.1), 1.0, 1.0, ((60.0, 80.0),))
START = initial("stock:sunset")


def after(*changes, start=START):
    for change in changes:
        start = step(start, change, author=1)
    return start


# ---- Messages and the rig ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "wrong",
    [
        {"radius_deg": 0.0}, {"radius_deg": 91.0}, {"softness": 1.5}, {"opacity": -0.1}, {"radiance": [1, 1, -1]},
        {"radiance": [1e8, 0, 0]}, {"points": []}, {"points": [[0, 91]]}, {"points": [[0, 0, 0]]}, {"id": "a b"},
        {"points": [[0, 0]] * (MOST_DABS + 1)}, {"points": [["NaN", 0]]}, {"more": 1},
    ],
)  # fmt: skip
def test_a_stroke_that_cannot_be_is_refused(wrong) -> None:
    text = encode(SetPaint(STROKE, dragging=True))
    assert decode(text) == SetPaint(STROKE, dragging=True)
    message = json.loads(text)
    message["stroke"] |= wrong
    with pytest.raises(InputError, match=r"SetPaint\.stroke"):
        decode(json.dumps(message))
    with pytest.raises(InputError, match="finite"):
        decode(text.replace("9.0", "NaN"))


def test_strokes_lie_one_over_another_and_are_bounded() -> None:
    """A stroke that grows stays where it lies; one too many is refused, and nothing has changed."""
    state = after(SetPaint(STROKE), SetPaint(OTHER), SetPaint(replace(STROKE, opacity=0.5)))
    assert [stroke.id for stroke in state.paint] == ["a", "b"]
    assert state.paint[0].opacity == 0.5
    long = replace(OTHER, id="c", points=((0.0, 0.0),) * (MOST_DABS - 2))
    with pytest.raises(InputError, match=f"{MOST_DABS + 1} dabs"):
        after(SetPaint(long), start=state)
    with pytest.raises(InputError, match="not painted"):
        after(RemovePaint("c"), start=state)
    assert after(RemovePaint("a"), start=state).paint == (OTHER,)
    assert after(ClearPaint(), start=state).paint == ()


def test_a_stroke_is_one_step_and_looks_and_files_keep_it(tmp_path, monkeypatch) -> None:
    """However long a stroke takes; what is undone can be redone; a restarted studio has it."""
    now = iter(np.arange(0.0, 100.0, 3.0))
    monkeypatch.setattr(histories.time, "monotonic", lambda: next(now))
    history = History(START, (), opened=lambda text, state: state)
    for n in (1, 2):
        history.obey(SetPaint(replace(STROKE, points=STROKE.points[:n]), dragging=True), author=1)
    history.obey(SetPaint(STROKE), author=1)
    history.obey(SetPaint(OTHER, dragging=True), author=1)
    history.obey(SetPaint(OTHER), author=1)
    history.obey(SaveLook("Painted"), author=1)
    history.obey(ClearPaint(), author=1)
    assert history.state.undo == "clearing all paint"
    history.obey(Undo(), author=1)
    assert history.state.paint == (STROKE, OTHER)
    history.obey(Undo(), author=1)
    history.obey(Undo(), author=1)
    assert history.state.paint == (STROKE,)
    history.obey(Undo(), author=1)
    assert (history.state.paint, history.state.undo) == ((), None)
    history.obey(Redo(), author=1)
    assert history.state.paint == (STROKE,)
    looks = (("Painted", after(SetPaint(STROKE), SetPaint(OTHER))),)
    kept.save(history.state, tmp_path / "s.json", looks=looks)
    state, looks = kept.load(tmp_path / "s.json", initial("stock:noon"))
    assert state.paint == (STROKE,)
    again = History(state, looks, opened=lambda text, state: state)
    assert again.obey(ShowLook("Painted"), author=1).paint == (STROKE, OTHER)


def test_every_kind_of_layer_is_lit_as_by_the_rig_file(tmp_path_factory, tmp_path) -> None:
    """An environment, portals, a transfer sky; quick and exact; dimmed paint stays as it is."""
    portals_of(two_windows(), tmp_path / "room.prelight")
    bakes = [
        Bake.open(ball_bake(tmp_path_factory)),
        Bake.open(lamps_bake(tmp_path_factory)),
        Bake.open(tmp_path / "room.prelight"),
    ]
    takes, known = ("environment",), Environments()
    plain = after(SetEnvironment("stock:overcast", 30.0, 0.5, (1.0, 0.9, 0.8)))
    state = after(SetPaint(STROKE), SetPaint(OTHER), start=plain)
    text = rig_text(state, known, takes=takes, title="paint")
    assert [len(stroke.points) for stroke in opened_rig(text, START, known).paint] == [2, 1]
    assert opened_rig(text, START, known).paint[0] == replace(STROKE, id="p0")
    (tmp_path / "rig.toml").write_text(text)
    for bake in bakes:
        light, whole = lighting_of(bake, known), LitBake(bake)
        whole.light(Rig.open(str(tmp_path / "rig.toml")))
        found = []
        for exact, of in ((True, plain), (False, state), (True, state)):
            light.relight(of, exact=exact, check=lambda: None)
            found.append(
                unpacked(np.frombuffer(light.frame(of), np.uint32, offset=32))[: len(bake.receivers)]
            )
        expected = whole.irradiance
        assert np.abs(found[2] - expected).max() <= 0.005 * expected.max()
        assert np.abs(found[1] - expected).mean() <= 0.1 * expected.mean()
        assert np.abs(found[2] - found[0]).mean() > 0.1 * found[0].mean()


# ---- The page ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def visit(tmp_path_factory) -> Iterator[Visit]:
    bake, folder = lamps_bake(tmp_path_factory), tmp_path_factory.mktemp("paint")
    with (
        chromium() as browser,
        running(bake, state_file=folder / "state.json") as live,
        visiting(browser, link(live), height=700) as there,
    ):
        there.settled()
        changed(there, there.page.get_by_role("radio", name="overcast").click)
        there.page.get_by_role("radio", name="Linear").click()
        there.slide("Picture", "Exposure", -2)
        yield there
        assert not there.complaints


def strip(visit: Visit) -> np.ndarray:
    """The pixels of the strip (rows, columns, 3)."""
    script = """() => { const one = document.querySelector(".strip canvas");
      return [...one.getContext("2d").getImageData(0, 0, one.width, one.height).data] }"""
    return np.array(visit.page.evaluate(script)).reshape(201, 536, 4)[..., :3]


def test_a_dab_lights_the_side_that_faces_it(visit) -> None:
    """A stroke on the left of the strip: the ball's left is brighter, and the strip is white there; one undo."""
    page, before, bare = visit.page, linear(visit), strip(visit)
    page.get_by_role("radio", name="Paint", exact=True).click()
    visit.slide("Lights in the sky", "Brush", np.log2(14))
    visit.slide("Lights in the sky", "Level", 5)
    visit.slide("Lights in the sky", "Edge", 0.2)
    visit.slide("Lights in the sky", "Cover", 1)
    canvas = page.locator(".strip canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    x, y = box["x"] + 0.25 * box["width"], box["y"] + 0.4 * box["height"]
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 0.05 * box["width"], y, steps=4)
    changed(visit, page.mouse.up)
    (stroke,) = look(visit)["paint"]
    assert stroke["points"][0][0] == pytest.approx(-90, abs=3)
    assert len(stroke["points"]) == 2
    lit = linear(visit) - before
    assert lit[LEFT].mean() > 1.2 * lit[RIGHT].mean()  # the ball's shadow falls to the right
    assert lit[LEFT].mean() > 0.05
    assert strip(visit)[80, 134].min() > 250 > bare[80, 134].min()
    assert np.abs(strip(visit)[:, 300:] - bare[:, 300:]).max() == 0
    changed(visit, page.get_by_role("button", name="Undo").click)
    assert look(visit)["paint"] == []
    assert np.abs(linear(visit) - before).mean() < 0.003
    assert (strip(visit) == bare).all()


def test_paint_has_a_colour_and_is_taken_away(visit) -> None:
    """By keys: two dabs of blue, one erased, all cleared."""
    page, before = visit.page, linear(visit)
    page.get_by_role("radio", name="Paint", exact=True).click()
    visit.slide("Lights in the sky", "Kelvin", 3000)
    page.get_by_label("Colour of the brush").fill("#2040ff")
    ring = page.get_by_role("button", name="Brush at")
    ring.focus()
    for _ in range(3):
        page.keyboard.press("Shift+ArrowLeft")
    there = ring.get_attribute("aria-label")
    changed(visit, lambda: page.keyboard.press("Enter"))
    for _ in range(8):
        page.keyboard.press("Shift+ArrowRight")
    changed(visit, lambda: page.keyboard.press("Enter"))
    blue = (linear(visit) - before)[LEFT].mean(axis=(0, 1))
    assert blue[2] > 3 * max(blue[0], 0.001)
    assert len(look(visit)["paint"]) == 2
    page.get_by_role("radio", name="Erase").click()
    assert ring.get_attribute("aria-label") != there
    ring.focus()
    changed(visit, lambda: page.keyboard.press("Enter"))
    (left,) = look(visit)["paint"]
    assert left["points"][0][0] < ring_azimuth(ring)
    changed(visit, page.get_by_role("button", name="Clear paint").click)
    assert look(visit)["paint"] == []
    assert np.abs(linear(visit) - before).mean() < 0.003
    page.get_by_role("radio", name="Move", exact=True).click()
    assert ring.count() == 0


def ring_azimuth(ring) -> float:
    words = ring.get_attribute("aria-label").split("azimuth ")[1].split("°")[0]
    return float(words.replace("−", "-"))

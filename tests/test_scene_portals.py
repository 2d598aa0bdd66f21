"""Portals of a scene: found, given, grouped and cut."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.material import Material
from prelight.scene.loading import load_scene
from prelight.scene.portals import PortalWish, areas_of, extent_of, find_portals, is_glass
from prelight.scene.stock.catalogue import stock_scene

from .portal_rooms import two_windows, with_glass
from .rooms import rectangle


@pytest.mark.parametrize(
    ("material", "glass"),
    [
        (Material("x", transmission=0.5), True),
        (Material("x", bsdf={"type": "dielectric"}), True),
        (Material("x", bsdf={"type": "mask", "inner": {"type": "thindielectric"}}), True),
        (Material("Window_Glass.001"), True),
        (Material("staklo_plavo"), True),
        (Material("glas rot"), True),
        (Material("window frame"), False),
        (Material("fibreglass"), False),
        (Material("glasgow stone"), False),
        (Material("plaster"), False),
        (Material("x", bsdf={"type": "twosided", "inner": {"type": "diffuse"}}), False),
    ],
)
def test_what_counts_as_glass(material, glass) -> None:
    assert is_glass(material) == glass


def test_glass_is_grouped_by_material_with_its_colour() -> None:
    scene = two_windows(tints={"left glass": (0.9, 0.3, 0.1)})
    portals = find_portals(scene)
    assert portals.names == ("left glass", "right glass")
    assert portals.tints.tolist() == [pytest.approx([0.9, 0.3, 0.1]), [1, 1, 1]]
    assert portals.areas == pytest.approx([1.5 * 2.0, 1.5 * 1.35], rel=1e-5)
    assert portals.centres[0] == pytest.approx([0, 1.65, 2.0], abs=1e-5)
    assert portals.extents[0] == pytest.approx(
        math.hypot(2.5, 1.2) if False else math.hypot(1.5, 2.0), rel=1e-4
    )
    assert sorted(portals.glass) == list(np.flatnonzero(scene.material_of > 0))


def far_panes(gap: float) -> list[tuple]:
    """Two panes side by side, each a metre, ``gap`` metres apart."""
    return [rectangle((x, 1, 0), (1, 0, 0), (0, 0, 1), cells=2) for x in (0, 1 + gap)]


def test_panes_apart_are_windows_of_their_own() -> None:
    floor = rectangle((-2, 0, -2), (0, 0, 4), (4, 0, 0), cells=2)
    window = PortalWish(group="window")
    near, far = (find_portals(with_glass((floor,), {"glass": far_panes(gap)}), window) for gap in (0.05, 1.0))
    assert near.names == ("glass",)
    assert far.names == ("glass 1", "glass 2")
    assert far.areas == pytest.approx([1, 1])
    stained = with_glass((floor,), {"red glass": far_panes(0.0)[:1], "blue glass": far_panes(0.0)[1:]})
    assert find_portals(stained, window).names == ("red glass", "blue glass")


@pytest.mark.parametrize("distance", [1.0, 3.0, 10.0])
def test_portals_are_cut_until_they_are_small_enough(distance) -> None:
    scene = two_windows()
    wish = PortalWish(exterior_distance=distance)
    portals = find_portals(scene, wish)
    assert (portals.extents < 2 * distance * math.radians(5)).all()
    whole = find_portals(scene)
    assert portals.areas.sum() == pytest.approx(whole.areas.sum(), rel=1e-5)
    assert (np.diff(portals.portal_of) >= 0).all()
    # The cuts lie in the panes, and nothing of them twice: their middles' mean is the pane's.
    left = [name.startswith("left") for name in portals.names]
    mean = np.average(portals.centres[left], axis=0, weights=portals.areas[left])
    assert mean == pytest.approx(whole.centres[0], abs=1e-4)


def test_the_papers_example_of_a_size() -> None:
    """θ_M of 5° and 3 m: about half a metre."""
    assert PortalWish(exterior_distance=3.0).longest == pytest.approx(0.52, abs=0.005)


def test_too_many_pieces_are_refused() -> None:
    with pytest.raises(InputError, match="more than 1,024; a larger --exterior-distance"):
        find_portals(two_windows(), PortalWish(exterior_distance=0.1))


def test_one_portal_has_a_pane_for_each_colour() -> None:
    tints = {"left glass": (0.9, 0.3, 0.1)}
    portals = find_portals(two_windows(tints=tints), PortalWish(group="one"))
    assert len(portals) == 1
    assert portals.portal_of_pane.tolist() == [0, 0]
    assert portals.pane_tints[0] == pytest.approx(tints["left glass"])
    assert portals.tints.tolist() == [[1, 1, 1]]


def test_the_extent_of_many_points_is_that_of_the_farthest(rng) -> None:
    corners = rng.normal(size=(2000, 3, 3))
    corners[0, 0], corners[1, 1] = (9, 9, 9), (-9, -9, -9)
    assert extent_of(corners) == pytest.approx(18 * math.sqrt(3))


def test_portals_of_a_chapel_are_its_colours() -> None:
    portals = find_portals(stock_scene("portals-small"))
    assert "clear glass" in portals.names
    assert len(portals) >= 4
    assert portals.tints.min() < 0.5


def given(path: Path, text: str) -> PortalWish:
    path.write_text(text)
    return PortalWish(file=str(path))


def test_portals_are_given_in_a_file(tmp_path) -> None:
    text = """
        [[portal]]
        name = "door"
        polygon = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 2, 0], [1, 1, 0], [0, 1, 0]]
        tint = [1.0, 0.5, 0.25]

        [[portal]]
        material = "Left Glass"
        tint = [0.1, 0.2, 0.3]
    """
    portals = find_portals(two_windows(), given(tmp_path / "a.toml", text))
    assert portals.names == ("door", "left glass")
    assert portals.areas[0] == pytest.approx(3.0)
    assert portals.tints[1] == pytest.approx([0.1, 0.2, 0.3])
    assert len(portals.glass) == 8


SQUARE = "polygon = [[0,0,0],[1,0,0],[1,1,0],[0,1,0]]"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a = 1", "expected tables [[portal]]"),
        ("[portal]\nname = 'a'", "expected tables [[portal]]"),
        ("[[portal]]\nname = 'a'", "expected either polygon"),
        (f"[[portal]]\nmaterial = 'a'\n{SQUARE}", "expected either polygon"),
        ("[[portal]]\npolygon = [[0,0,0],[1,0,0]]", "expected 3 to 1,024 corners"),
        ("[[portal]]\npolygon = [[0,0,0],[1,0,0],[1,nan,0]]", "/portal/0/polygon/2"),
        ("[[portal]]\npolygon = [[0,0,0],[1,0,0],[2,0,0]]", "no area, so it faces nowhere"),
        ("[[portal]]\npolygon = [[0,0,0],[1,0,0],[1,1,0.5],[0,1,0]]", "is not flat"),
        (f"[[portal]]\n{SQUARE}\ntint = [1, 2, 0]", "/portal/0/tint"),
        (f"[[portal]]\n{SQUARE}\ncolor = 3", "'color' is not known here"),
        ("[[portal]]\nmaterial = 'nothing'", "has no material 'nothing'; it has plaster"),
        (
            f"[[portal]]\nname = 'a'\n{SQUARE}\n[[portal]]\nname = 'a'\ntint = [1, 0, 0]\n{SQUARE}",
            "two tints",
        ),
        ("[[portal]", "not a TOML file of portals"),
    ],
)
def test_wrong_files_are_refused(tmp_path, text, reason) -> None:
    with pytest.raises(InputError) as error:
        find_portals(two_windows(), given(tmp_path / "a.toml", text))
    assert reason in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"group": "colour"}, "expected material, window, one"),
        ({"exterior_distance": 0.0}, "a number above 0"),
        ({"theta_deg": 90.0}, "at most 45"),
        ({"group": "one", "exterior_distance": 3.0}, "far away"),
        ({"materials": ("a",), "file": "b"}, "choose one"),
    ],
)
def test_wrong_wishes_are_refused(values, reason) -> None:
    with pytest.raises(InputError, match=reason):
        PortalWish(**values)


def test_glass_without_area_is_no_portal() -> None:
    scene = two_windows()
    positions = scene.positions.copy()
    glass = np.unique(scene.triangles[scene.material_of > 0])
    positions[glass] = positions[glass[0]]
    with pytest.raises(InputError, match="no portal found"):
        find_portals(replace(scene, positions=positions))


def test_sibenik_has_the_glass_of_the_paper(data) -> None:
    portals = find_portals(load_scene(data / "sibenik" / "sibenik.obj"))
    assert sorted(portals.names) == [
        "staklo",
        "staklo_crveno",
        "staklo_plavo",
        "staklo_zeleno",
        "staklo_zuto",
    ]
    assert areas_of(portals.corners).sum() == pytest.approx(73.55, abs=0.01)

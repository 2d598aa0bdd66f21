"""Lights with a place in the scene, in a rig: keys, units, keyframes, and errors with their place."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.lighting.colour_temperature import of_kelvin
from prelight.lighting.distributions import Power
from prelight.lighting.ies import Photometry
from prelight.lighting.painting import LUMINANCE
from prelight.lighting.panel import Panel
from prelight.lighting.placed_lights import RADIUS, Lamp, PlacedPanel
from prelight.lighting.rig import Rig
from prelight.lighting.rig_placed import LampTable, PlacedPanelTable, PlacedSpotTable
from prelight.lighting.spot import Spot

from .test_ies import LAMBERT

LAMP = "[[lamp]]\nposition = [1, 2, 3]\n"
SPOT = "[[spot]]\nposition = [0, 2, 0]\nintensity = [1, 2, 3]\n"
PANEL = "[[panel]]\nposition = [0, 2, 0]\nsize = [0.5, 2]\ndirection = [0, -1, 0]\n"


@pytest.fixture
def rig(tmp_path: Path):
    (tmp_path / "lamp.ies").write_bytes(LAMBERT)

    def opened(text: str) -> Rig:
        (tmp_path / "rig.toml").write_text(text)
        return Rig.open(str(tmp_path / "rig.toml"))

    return opened


def test_a_lamp_s_power_is_the_integral_of_its_intensity(rig) -> None:
    watts, lumens, plain = rig(
        LAMP + "power_w = 40\nradius = 0.1\ncolor = [1, 0.5, 0.25]\n" + LAMP + "lumens = 683\nscale = 2\n"
        + LAMP + 'intensity = [1, 2, 3]\nname = "for people"\n'
    ).lamps_at(0.0)  # fmt: skip
    assert isinstance(watts, Lamp)
    np.testing.assert_allclose(4 * np.pi * np.array(watts.colour), [40, 20, 10])
    assert (watts.position, watts.radius) == ((1, 2, 3), 0.1)
    np.testing.assert_allclose(4 * np.pi * np.array(lumens.colour), [2, 2, 2])
    assert plain == Lamp((1, 2, 3), Spot((1, 2, 3), direction=(0, -1, 0)), RADIUS, "for people")


def test_a_measured_lamp_gives_what_its_file_says(rig) -> None:
    measured, dimmed = rig(
        LAMP + 'ies = "lamp.ies"\n' + LAMP + 'ies = "lamp.ies"\nlumens = 100\ntarget = [1, 5, 3]\n'
    ).lamps_at(0.0)
    assert isinstance(measured.beam.distribution, Photometry)
    peak, flux = measured.beam.distribution.watts
    np.testing.assert_allclose(measured.colour, [peak] * 3)
    assert measured.beam.direction == (0, -1, 0)
    np.testing.assert_allclose(np.array(dimmed.colour) * flux / peak, [100 / 683] * 3)
    np.testing.assert_allclose(dimmed.axes[:, 2], [0, 1, 0], atol=1e-12)


def test_spots_and_panels_stand_in_the_scene_or_in_a_layer(rig) -> None:
    found = rig(
        SPOT + "target = [0, 0, 0]\nwidth_deg = 40\nradius = 0\n" + PANEL + "radiance = [1, 2, 3]\nscale = 2\n"
        + PANEL + "power_w = 10\nkelvin = 6500\n"
        + "[[spot]]\nintensity = [1, 1, 1]\ndirection = [0, -1, 0]\n"
        + "[[panel]]\nposition = [0.5, 0.5]\nwidth = 0.5\nradiance = [1, 2, 3]\n"
    )  # fmt: skip
    spot, panel, powered = found.lamps_at(0.0)
    assert spot == Lamp((0, 2, 0), Spot((1, 2, 3), target=(0, 0, 0), distribution=Power.of_width(40)), 0.0)
    assert panel == PlacedPanel((0, 2, 0), (0.5, 2), Spot((2, 4, 6), direction=(0, -1, 0)))
    assert float(np.pi * 1.0 * np.array(powered.colour) @ LUMINANCE) == pytest.approx(10)
    assert [type(light) for light in found.lights] == [Spot, Panel]


def test_a_panel_s_corners_turn_counter_clockwise_for_who_is_lit() -> None:
    panel = PlacedPanel((1, 2, 3), (0.5, 2), Spot((1, 1, 1), direction=(0.2, -1, 0.4), roll_deg=20))
    a, b, c, d = panel.corners
    np.testing.assert_allclose(np.cross(b - a, d - a), 1.0 * panel.normal, atol=1e-12)
    np.testing.assert_allclose((a + b + c + d) / 4, (1, 2, 3))
    assert np.linalg.norm(b - a) == pytest.approx(0.5)


def test_they_move_in_time(rig) -> None:
    found = rig(
        LAMP + 'power_w = 4\nease = "linear"\nkeys = [{ at = 2, position = [3, 2, 3], power_w = 8, radius = 0.04 }]\n'
        + PANEL + 'radiance = [1, 1, 1]\nease = "linear"\nkeys = [{ at = 4, size = [1.5, 2], radiance = [3, 1, 1] }]\n'
        + SPOT + "direction = [0, -1, 0]\nwidth_deg = 40\nkeys = [{ at = 1, scale = 0 }]\n"
    )  # fmt: skip
    assert found.duration == 4.0
    lamp, spot, panel = found.at(1.0).lamps_at(0.0)
    assert lamp.position == (2, 2, 3)
    np.testing.assert_allclose([lamp.radius, *(4 * np.pi * np.array(lamp.colour))], [0.03, 6, 6, 6])
    assert panel.size == (0.75, 2)
    assert panel.colour == (1.5, 1, 1)
    assert spot.colour == (0, 0, 0)
    assert found.at(1.0).duration == 0.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (LAMP + "power_w = -1\n", r"-1.*greater than or equal to 0.*/lamp/0/power_w"),
        (LAMP + "power_w = nan\n", r"finite number.*/lamp/0/power_w"),
        (LAMP + "intensity = [1, inf, 1]\n", r"finite number.*/lamp/0/intensity/1"),
        (LAMP, r"no strength: expected intensity .*power_w or lumens.*/lamp/0"),
        (LAMP + "power_w = 1\nlumens = 1\n", "each says how strong"),
        (LAMP + "intensity = [1, 1, 1]\nkelvin = 3000\n", "kelvin belong to power_w"),
        (LAMP + "power_w = 1\nkelvin = 100\n", "/lamp/0/kelvin"),
        (LAMP + "power_w = 1\nwidth_deg = 30\n", r"a beam is a \[\[spot\]\]"),
        (LAMP + "power_w = 1\ndirection = [0, 1, 0]\n", "shines all around"),
        (LAMP + "power_w = 1\nlumen = 1\n", "'lumen' is not known here; known are .*lumens.*/lamp/0/lumen"),
        (LAMP + "power_w = 1\nkeys = [{ at = 1, brightness = 2 }]\n", "'brightness' is not known"),
        (LAMP + "power_w = 1\nradius = -1\n", "/lamp/0/radius"),
        ("[[lamp]]\npower_w = 1\n", "position is missing"),
        ("[[lamp]]\nposition = [1, 2]\npower_w = 1\n", "/lamp/0/position"),
        ("[[lamp]]\nposition = [1e9, 2, 0]\npower_w = 1\n", "at most 1e.06 m"),
        (LAMP + 'ies = "none.ies"\n', "none.ies"),
        (SPOT + "direction = [0, -1, 0]\n", "no shape: expected one of power, width_deg"),
        (SPOT + "width_deg = 30\n", "either direction"),
        (SPOT + 'direction = [0, -1, 0]\nwidth_deg = 30\nlayer = "key"\n', "leave layer out"),
        (SPOT + "target = [0, 2, 0]\nwidth_deg = 30\n", "where the light itself is"),
        (SPOT + "direction = [0, -1, 0]\nwidth_dg = 30\n", "'width_dg' is not known here; known are .*width_deg"),
        (PANEL + "radiance = [1, 1, 1]\nwidth = [1, 1]\n", "'width' is not known here; known are .*size"),
        (PANEL + "radiance = [1, 1, 1]\nwidth_deg = 40\n", "shines evenly"),
        (PANEL, "no strength"),
        (PANEL.replace("[0.5, 2]", "[1, 0]") + "radiance = [1, 1, 1]\n", "/panel/0/size/1"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_told_in_one_line(rig, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as error:
        rig(text)
    assert "\n" not in str(error.value)
    assert "(placed)" not in str(error.value)
    assert "(layered)" not in str(error.value)


def test_a_broken_ies_file_names_its_line(rig, tmp_path: Path) -> None:
    (tmp_path / "lamp.ies").write_bytes(LAMBERT[: len(LAMBERT) // 2])
    with pytest.raises(InputError, match=r"lamp\.ies.*line \d+.*/lamp/0"):
        rig(LAMP + 'ies = "lamp.ies"\n')


def test_white_is_white_and_warm_is_warm() -> None:
    """D65 is at about 6500 K; a candle is red."""
    np.testing.assert_allclose(of_kelvin(6504), [1, 1, 1], atol=0.05)
    for kelvin in (1700, 2222.5, 3999.5, 4000.5, 9000, 25000):
        assert float(np.array(of_kelvin(kelvin)) @ LUMINANCE) == pytest.approx(1)
    red, green, blue = of_kelvin(1900)
    assert red > green > blue
    with pytest.raises(InputError, match="kelvin"):
        of_kelvin(500)


def test_lights_that_cannot_be() -> None:
    aim = Spot((1, 1, 1), direction=(0, 1, 0))
    for make in (
        lambda: Lamp((0, 0, float("nan")), aim),
        lambda: Lamp((0, 0, 0), aim, radius=float("inf")),
        lambda: PlacedPanel((0, 0, 0), (1, -1), aim),
        lambda: PlacedPanel((0, 0, 0), (1, 1), Spot((1, 1, 1), direction=(0, 1, 0), distribution=Power(3))),
        lambda: Lamp((0, 0, 0), Spot((1, 1, 1), direction=(0, 1, 0), layer="key")),
        lambda: Lamp.of_power((0, 0, 0), (1, -1, 1)),
    ):
        with pytest.raises(InputError):
            make()


def test_the_documents_example_is_read_and_names_every_key(rig, tmp_path: Path) -> None:
    text = (Path(__file__).resolve().parents[1] / "docs" / "rig.md").read_text(encoding="utf-8")
    (example,) = (
        block for block in re.findall(r"^```toml\n(.*?)^```$", text, re.M | re.S) if "[[lamp]]" in block
    )
    (tmp_path / "downlight.ies").write_bytes(LAMBERT)
    bulb, downlight, spot, panel = rig(example).lamps_at(0.0)
    assert (bulb.name, bulb.radius, panel.size) == ("bulb", 0.04, (1.2, 0.3))
    assert isinstance(downlight.beam.distribution, Photometry)
    assert spot.beam.target == (0.5, 0.9, -1.0)
    for table in (LampTable, PlacedSpotTable, PlacedPanelTable):
        for key in set(table.model_fields) - table.unused:
            assert re.search(rf"\b{key}\b", text), key

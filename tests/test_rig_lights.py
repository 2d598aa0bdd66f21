"""[[spot]] and [[panel]] in a rig: every key does what it says, comes back as written, and errors have their place."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from prelight.errors import InputError
from prelight.images.formats import write_exr
from prelight.lighting.distributions import Gobo, Polynomial, Power
from prelight.lighting.ies import Photometry
from prelight.lighting.panel import Panel
from prelight.lighting.rig import Rig
from prelight.lighting.rig_lights import PanelTable, SpotTable
from prelight.lighting.rig_text import rig_text
from prelight.lighting.spot import Spot

from .test_ies import LAMBERT

SPOT = "[[spot]]\nintensity = [1, 2, 3]\ndirection = [0, -1, 0]\n"
PANEL = "[[panel]]\nposition = [0.5, 0.5]\nwidth = 0.5\nradiance = [1, 2, 3]\n"


@pytest.fixture
def rig(tmp_path: Path):
    (tmp_path / "lamp.ies").write_bytes(LAMBERT)
    Image.new("RGB", (4, 2), (255, 0, 188)).save(tmp_path / "gobo.png")
    write_exr(tmp_path / "gobo.exr", np.full((2, 4, 3), 7.0, np.float32))

    def opened(text: str) -> tuple:
        (tmp_path / "rig.toml").write_text(text)
        return Rig.open(str(tmp_path / "rig.toml")).lights

    return opened


def test_everything_is_passed_through(rig) -> None:
    spot, other, third = rig(
        """
        [[spot]]
        name = "for people"
        layer = "key"
        intensity = [10, 20, 30]
        scale = 0.5
        target = [0.5, 0, 1]
        roll_deg = 15
        width_deg = 40
        [[spot]]
        intensity = [1, 1, 1]
        azimuth_deg = 90
        elevation_deg = 0
        polynomial = [0, 1, 2]
        [[panel]]
        layer = "window"
        position = [0.25, 0.75]
        width = [0.5, 0.6]
        radiance = [1, 2, 3]
        scale = 2
        shape = "soft"
        direction = [0, 0, -2]
        power = 2.5
        """
    )
    assert spot == Spot(
        (5, 10, 15), target=(0.5, 0, 1), distribution=Power.of_width(40), roll_deg=15, layer="key"
    )
    np.testing.assert_allclose(other.direction, [1, 0, 0], atol=1e-12)
    assert other.distribution == Polynomial((0, 1, 2))
    beam = Spot((1, 1, 1), direction=(0, 0, -1), distribution=Power(2.5), layer="window")
    assert third == Panel((0.25, 0.75), (0.5, 0.6), (2, 4, 6), shape="soft", beam=beam, layer="window")
    (plain,) = rig(PANEL)
    assert plain == Panel((0.5, 0.5), (0.5, 0.5), (1, 2, 3))


def test_files_lie_beside_the_rig(rig) -> None:
    measured, bright, thrown, linear = rig(
        '[[spot]]\ndirection = [0, -1, 0]\nies = "lamp.ies"\nscale = 2\n'
        + SPOT + 'ies = "lamp.ies"\n'
        + SPOT + 'picture = "gobo.png"\nspread_deg = 60\n'
        + SPOT + 'picture = "gobo.exr"\nspread_deg = 60\n'
    )  # fmt: skip
    assert isinstance(measured.distribution, Photometry)
    np.testing.assert_allclose(measured.intensity, [200 / 683] * 3)  # the file's own 100 cd, twice
    assert bright.intensity == (1, 2, 3)
    assert isinstance(thrown.distribution, Gobo)
    np.testing.assert_allclose(thrown.distribution.picture[0, 0], [1.0, 0.0, 0.5029], atol=1e-4)  # sRGB 188
    assert linear.distribution.picture[1, 2, 0] == 7.0


def test_lights_come_back_as_written(rig, tmp_path: Path) -> None:
    lights = rig(
        SPOT + "power = 3.25\nroll_deg = -4\n" + SPOT + 'layer = "a \\"b\\" ü"\n'
        + SPOT + 'ies = "lamp.ies"\n' + SPOT + 'picture = "gobo.png"\nspread_deg = 50\n'
        + SPOT + "polynomial = [1, 0.1]\n" + PANEL + PANEL + "target = [1, 0, 0]\nwidth_deg = 50\n"
    )  # fmt: skip
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    text = rig_text(lights, folder=folder, notes=["found\nby hand"])
    assert text.startswith("# found by hand\n")
    (folder / "again.toml").write_text(text)
    again = Rig.open(str(folder / "again.toml")).lights
    assert len(again) == len(lights)
    for one, other in zip(lights, again, strict=True):
        if isinstance(one, Spot) and isinstance(one.distribution, Photometry | Gobo):
            assert type(other.distribution) is type(one.distribution)
            np.testing.assert_array_equal(
                other.distribution.along(np.eye(3)), one.distribution.along(np.eye(3))
            )
        else:
            assert one == other
    with pytest.raises(InputError, match="Gobo without a file"):
        rig_text(
            [Spot((1, 1, 1), direction=(0, 0, 1), distribution=Gobo(np.ones((1, 1, 3)), 20.0))], folder=folder
        )


BAD = {
    SPOT + "color = [1, 1, 1]": "'color' is not known here.*/spot/0/color",
    "[[spot]]\nintensity = [1, 2, 3]": "expected either direction, or both azimuth_deg and elevation_deg.*/spot/0",
    SPOT + "target = [1, 1, 1]": "either a direction or a target",
    "[[spot]]\ndirection = [0, -1, 0]": "intensity is missing",
    SPOT + "power = 1\nwidth_deg = 40": "one of power and width_deg",
    SPOT + "power = -1": "-1, expected a number greater than or equal to 0",
    SPOT + 'picture = "gobo.png"': "picture and spread_deg belong together",
    SPOT + 'ies = "none.ies"': "none.ies: no such file.*/spot/0",
    SPOT + 'picture = "lamp.ies"\nspread_deg = 40': "lamp.ies: .*/spot/0",
    SPOT + "polynomial = []": "polynomial",
    "[[panel]]\nwidth = 0.5\nradiance = [1, 2, 3]": "position is missing",
    PANEL.replace("[0.5, 0.5]", "[0.5, 3]"): "in parts of the panel",
    PANEL.replace("width = 0.5", "width = [0.5, 0.5, 0.5]"): "width has 3 numbers, position 2",
    PANEL.replace("width = 0.5", "width = 0"): "greater than or equal to 0.01",
    PANEL + 'shape = "square"': "'square', expected 'raised-cosine' or 'soft'.*/panel/0/shape",
    PANEL + "power = 2": "expected either direction",
    "[spot]\nintensity = [1, 2, 3]": "double brackets",
    "spot = 3": "double brackets",
}


@pytest.mark.parametrize("text", BAD)
def test_errors_have_their_place(rig, text: str) -> None:
    with pytest.raises(InputError) as caught:
        rig(text)
    line = str(caught.value)
    assert "\n" not in line
    assert re.search(BAD[text], line), line


def test_the_documents_example_is_read_and_names_every_key(rig) -> None:
    text = (Path(__file__).resolve().parents[1] / "docs" / "rig.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```toml\n(.*?)^```$", text, re.M | re.S)
    (example,) = (block for block in blocks if 'layer = "key"' in block)
    (moving,) = (block for block in blocks if 'ease = "smooth"' in block)
    assert rig(moving)[0].distribution.width_deg == pytest.approx(70)
    assert len(rig(example)) == 2
    for shape in ("power", "polynomial", "ies"):  # each instead of the width
        other = re.sub(r"^width_deg.*\n", "", example, flags=re.M).replace(f"# {shape} =", f"{shape} =")
        assert rig(other)[0].distribution != rig(example)[0].distribution
    thrown = re.sub(r"^width_deg.*\n", "", example, flags=re.M)
    thrown = thrown.replace("# picture =", "picture =").replace("# spread_deg =", "spread_deg =")
    assert isinstance(rig(thrown)[0].distribution, Gobo)
    for table in (SpotTable, PanelTable):
        for key in table.model_fields:
            assert re.search(rf"\b{key}\b", text), key


def test_lights_without_a_place_are_not_ignored(rig, tmp_path: Path) -> None:
    rig(SPOT)
    with pytest.raises(InputError, match="no layer of this bake has a place for them"):
        _ = Rig.open(str(tmp_path / "rig.toml")).surroundings
    assert Rig.open("stock:noon").surroundings.total.max() > 0


def test_a_measured_lamp_says_where_it_is_wrong(rig, tmp_path: Path) -> None:
    (tmp_path / "lamp.ies").write_bytes(LAMBERT.replace(b"1 1 50", b"1 one 50"))
    with pytest.raises(InputError, match=r"lamp.ies: 'one' is no number .*\(line 6, rig.toml /spot/0\)"):
        rig(SPOT + 'ies = "lamp.ies"\n')

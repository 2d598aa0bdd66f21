"""Rig files: every key does what it says, and what is wrong is said in one line with its place."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.images.formats import write_exr, write_hdr
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.regions import Cap, Window
from prelight.lighting.rig import Rig

ROOT = Path(__file__).resolve().parents[1]
MAP = '[environment]\nmap = "stock:noon"\n'
DISC = "[[disc]]\nazimuth_deg = 1\nelevation_deg = 2\nradius_deg = 3\nradiance = [1, 2, 3]\n"
PAINT = "[[paint]]\nradiance = [1, 2, 3]\n"


@pytest.fixture
def rig(tmp_path: Path):
    def opened(text: str, **options: str) -> Environment:
        (tmp_path / "rig.toml").write_text(text)
        return Rig.open(str(tmp_path / "rig.toml"), **options).environment

    return opened


def same(a: Environment, b: Environment) -> None:
    np.testing.assert_array_equal(a.cube(16), b.cube(16))
    assert a.discs == b.discs
    assert a.paints == b.paints


def test_everything_is_passed_through(rig, tmp_path: Path, rng: np.random.Generator) -> None:
    pixels = rng.lognormal(0.0, 1.0, (24, 32, 3)).astype(np.float32)
    write_exr(tmp_path / "map.exr", pixels)
    found = rig(
        """
        [environment]
        map = "map.exr"
        layout = "latlong"
        rotate_deg = 30
        scale = 2
        tint = [1.0, 0.5, 0.25]
        blend = { map = "stock:studio", share = 0.25, rotate_deg = -20.5, scale = 3, tint = [1, 1, 0] }
        [[disc]]
        name = "key"
        direction = [1, 2, 3]
        radius_deg = 2.5
        radiance = [10, 20, 30]
        softness = 0.5
        [[disc]]
        azimuth_deg = 40
        elevation_deg = -10
        radius_deg = 4
        radiance = [1, 1, 1]
        [[paint]]
        direction = [0, 1, 0]
        radius_deg = 20
        softness = 0.1
        radiance = [0, 0, 1]
        opacity = 0.5
        [[paint]]
        name = "ground"
        elevation_range_deg = [-90, 0]
        radiance = [0.1, 0.1, 0.1]
        [[paint]]
        azimuth_range_deg = [10, 50]
        elevation_range_deg = [5, 30]
        radiance = [3, 3, 3]
        """
    )
    own = Environment(pixels, "latlong").rotated(30).scaled(2).tinted((1.0, 0.5, 0.25))
    other = Environment.stock("studio").rotated(-20.5).scaled(3).tinted((1, 1, 0))
    expected = own.blended(other, 0.25).with_discs(
        [
            Disc((1, 2, 3), 2.5, (10, 20, 30), 0.5),
            Disc.at(40, -10, radius_deg=4, radiance=(1, 1, 1)),
        ]
    )
    expected = expected.painted(Cap((0, 1, 0), 20, 0.1), (0, 0, 1), opacity=0.5)
    expected = expected.painted(Window((-180, 180), (-90, 0)), (0.1, 0.1, 0.1))
    expected = expected.painted(Window((10, 50), (5, 30)), (3, 3, 3))
    same(found, expected)


def test_a_rig_of_discs_alone_has_a_dark_sky(rig) -> None:
    found = rig(DISC)
    disc = Disc.at(1, 2, radius_deg=3, radiance=(1, 2, 3))
    same(found, Environment.dark().with_disc(disc))
    np.testing.assert_allclose(found.total, disc.total)


def test_faces_may_be_named_by_a_pattern_or_a_folder(rig, tmp_path: Path) -> None:
    for index, face in enumerate(("px", "nx", "py", "ny", "pz", "nz")):
        write_hdr(tmp_path / f"sky_{face}.hdr", np.full((4, 4, 3), index + 1.0, np.float32))
    expected = Environment.open(tmp_path / "sky_{face}.hdr")
    same(rig('[environment]\nmap = "sky_{face}.hdr"\n'), expected)
    same(rig('[environment]\nmap = "."\n'), expected)
    assert expected.pixels[:, 0, 0, 0].tolist() == [1, 2, 3, 4, 6, 5]


def test_the_layout_asked_for_is_that_of_the_map(rig, tmp_path: Path) -> None:
    write_exr(tmp_path / "map.exr", np.ones((24, 32, 3), np.float32))
    assert rig('[environment]\nmap = "map.exr"\n').layout == "horizontal-cross"
    assert rig('[environment]\nmap = "map.exr"\n', layout="latlong").layout == "latlong"
    with pytest.raises(InputError, match=r"--layout: 'latlong', but the rig rig\.toml has no map"):
        rig(DISC, layout="latlong")


@pytest.mark.parametrize(
    ("text", "message", "pointer"),
    [
        ("", "the file is empty", None),
        ("# nothing", "no light: expected a table", "/"),
        ("a rig", "not a TOML rig", None),
        ("a = " + "[" * 50_000, "not a TOML rig", None),
        (MAP + "scale = 1" + "0" * 5000, "thousands of digits", None),
        ("bulb = 1\n" + MAP, "'bulb' is not known here; known are environment, ", "/bulb"),
        (MAP + "blur = 1", "'blur' is not known here; known are map, layout, rotate_deg", "/environment/blur"),
        (DISC + "watts = 1", "'watts' is not known here; known are direction", "/disc/0/watts"),
        ("[environment]\nscale = 1", "map is missing", "/environment/map"),
        ("[environment]\nmap = 1", "1, expected a text in quotes", "/environment/map"),
        ('[environment]\nmap = "a\\u0000b"', "NUL character", "/environment/map"),
        ("environment = 3", "3, expected a table", "/environment"),
        (MAP + "layout = 'fisheye'", "known are latlong", "/environment/layout"),
        (MAP + "scale = -1", "-1, expected a number greater than or equal to 0", "/environment/scale"),
        (MAP + "scale = true", "True, expected a number", "/environment/scale"),
        (MAP + "scale = '2'", "'2', expected a number", "/environment/scale"),
        (MAP + "scale = 1" + "0" * 400, "expected a number", "/environment/scale"),
        (MAP + "rotate_deg = nan", "nan, expected a finite number", "/environment/rotate_deg"),
        (MAP + "tint = 1", "1, expected numbers in brackets", "/environment/tint"),
        (MAP + "tint = [1, 2]", "too few numbers", "/environment/tint"),
        (MAP + "tint = [1, 2, 3, 4]", "too many", "/environment/tint"),
        (MAP + "tint = [1, inf, 1]", "inf, expected a finite number", "/environment/tint/1"),
        (MAP + "blend = { map = 'stock:noon' }", "share is missing", "/environment/blend/share"),
        (MAP + "blend = { map = 'stock:noon', share = 2 }", "2, expected a number less", "/environment/blend/share"),
        (MAP + "blend = { map = 'stock:noon', share = 0.5, blend = 1 }", "'blend' is not", "/environment/blend/blend"),
        (MAP + "blend = { map = 'none.exr', share = 0.5 }", "no such file", "rig.toml /environment/blend/map"),
        ('[environment]\nmap = "none.exr"', "no such file", "rig.toml /environment/map"),
        ('[environment]\nmap = "rig.toml"', "neither of the two kinds", "rig.toml /environment/map"),
        (DISC.replace("azimuth_deg = 1\n", ""), "either direction, or both azimuth_deg and", "/disc/0"),
        (MAP + DISC + DISC + "direction = [1, 2, 3]", "either direction, or both", "/disc/1"),
        ("[[disc]]\ndirection = [0, 0, 0]\nradius_deg = 1\nradiance = [1, 1, 1]", "points nowhere", "/disc/0"),
        (DISC.replace("= 3\n", "= 0\n"), "0, expected a number greater than or equal to 0.001", "/disc/0/radius_deg"),
        (DISC.replace("= 2\n", "= 91\n"), "91, expected a number less than or equal to 90", "/disc/0/elevation_deg"),
        (DISC + "softness = 1.5", "1.5, expected a number less", "/disc/0/softness"),
        (DISC.replace("[1, 2, 3]", "[1, -2, 3]"), "-2, expected a number greater", "/disc/0/radiance/1"),
        (DISC.replace("[1, 2, 3]", "[1e39, 2, 3]"), "radiance above", None),
        ("[disc]\nradius_deg = 3", "tables in double brackets", "/disc"),
        (DISC * 1001, "too many", "/disc"),
        (PAINT, "either direction, or both", "/paint/0"),
        (PAINT + "direction = [0, 1, 0]", "expected radius_deg, or azimuth_range_deg", "/paint/0"),
        (PAINT + "elevation_range_deg = [10, 0]", "the lower number first", "/paint/0"),
        (PAINT + "elevation_range_deg = [0, 10]\nradius_deg = 3", "not both", "/paint/0"),
        (PAINT + "elevation_range_deg = [0, 10]\nsoftness = 0.5", "softness is of round", "/paint/0"),
        (PAINT + "elevation_range_deg = [0]", "too few numbers", "/paint/0/elevation_range_deg"),
        (PAINT + "opacity = -1", "-1, expected a number greater", "/paint/0/opacity"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(rig, text: str, message: str, pointer: str | None) -> None:
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        rig(text)
    line = str(caught.value)
    assert "\n" not in line
    assert len(line) <= 300
    if pointer is not None:
        assert line.endswith(f"({pointer})")


def test_the_example_of_the_documents_is_a_rig(rig) -> None:
    """Every key of the tables is shown, and what is shown opens."""
    from prelight.lighting import rig_file

    text = (ROOT / "docs" / "rig.md").read_text(encoding="utf-8")
    example, *_ = re.findall(r"^```toml\n(.*?)^```$", text, re.M | re.S)
    light = rig(example)
    assert len(light.discs) >= 2
    assert len(light.paints) >= 2
    assert light.parts
    for table in (rig_file.EnvironmentTable, rig_file.BlendTable, rig_file.DiscTable, rig_file.PaintTable):
        for key in table.model_fields:
            assert re.search(rf"\b{key}\b", text), key

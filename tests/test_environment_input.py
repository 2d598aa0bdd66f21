"""Environments: what is accepted, what is refused and how, and what cannot change."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.images.formats import write_exr, write_hdr
from prelight.lighting.environment import Environment


def grey(height: int, width: int) -> np.ndarray:
    return np.full((height, width, 3), 0.5, np.float32)


# ---- Opening -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("height", "width", "layout"),
    [
        (32, 64, "latlong"),
        (511, 1024, "latlong"),
        (31, 31, "angular"),
        (100, 101, "angular"),
        (40, 30, "cross"),
        (30, 40, "horizontal-cross"),
        (8, 48, "strip"),
        (48, 8, "tall-strip"),
    ],
)
def test_the_layout_is_recognised(tmp_path: Path, height: int, width: int, layout: str) -> None:
    for write, name in ((write_exr, "map.exr"), (write_hdr, "map.hdr")):
        write(tmp_path / name, grey(height, width))
        environment = Environment.open(tmp_path / name)
        assert (environment.layout, environment.name) == (layout, name)
        np.testing.assert_allclose(environment.cube(4), 0.5, rtol=1e-6)


@pytest.mark.parametrize(("height", "width"), [(9, 16), (100, 103), (2, 6), (7, 1)])
def test_other_proportions_are_refused_with_what_to_do(tmp_path: Path, height: int, width: int) -> None:
    write_exr(tmp_path / "map.exr", grey(height, width))
    with pytest.raises(InputError, match=rf"map\.exr: {width}×{height} .*latlong 2:1.*3:4.*--layout"):
        Environment.open(tmp_path / "map.exr")
    assert Environment.open(tmp_path / "map.exr", "latlong").layout == "latlong"


def test_a_layout_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    write_exr(tmp_path / "map.exr", grey(32, 64))
    with pytest.raises(InputError, match="do not make a vertical cross"):
        Environment.open(tmp_path / "map.exr", "cross")
    with pytest.raises(InputError, match="expected a square for an angular map"):
        Environment.open(tmp_path / "map.exr", "angular")
    for layout in ("fisheye", "cube", ""):
        with pytest.raises(InputError, match="known are latlong, angular, cross"):
            Environment.open(tmp_path / "map.exr", layout)


def test_a_cross_off_by_a_pixel_is_refused(tmp_path: Path) -> None:
    write_exr(tmp_path / "map.exr", grey(401, 300))
    with pytest.raises(InputError, match=r"300×401 pixels do not make a vertical cross of 3×4 square faces"):
        Environment.open(tmp_path / "map.exr")


# ---- Six pictures of faces ---------------------------------------------------------------------------------

SETS = ["px nx py ny pz nz", "posx negx posy negy posz negz", "right left top bottom front back"]


def write_faces(
    folder: Path, *, names: str = SETS[0], pattern: str = "{}.hdr", side: int = 4
) -> list[np.ndarray]:
    """Six faces, each with a value of its own and a brighter first row."""
    folder.mkdir(exist_ok=True)
    pictures = []
    for index, name in enumerate(names.split()):
        picture = np.full((side, side, 3), index + 1.0, np.float32)
        picture[0] += 0.5
        write_hdr(folder / pattern.format(name), picture)
        pictures.append(picture)
    return pictures


@pytest.mark.parametrize("names", SETS)
@pytest.mark.parametrize("pattern", ["{}.hdr", "sky_{}.hdr", "Church-of.St-{}.HDR"])
def test_six_pictures_make_an_environment(tmp_path: Path, names: str, pattern: str) -> None:
    """Right +X, left −X, top, bottom, front −Z, back +Z; each upright as seen from the middle."""
    write_faces(tmp_path / "sky", names=names, pattern=pattern)
    (tmp_path / "sky" / "readme.txt").write_text("not a face")
    by_folder = Environment.open(tmp_path / "sky")
    by_name = Environment.open(str(tmp_path / "sky" / pattern.format("{face}")))
    np.testing.assert_array_equal(by_folder.pixels, by_name.pixels)
    assert by_folder.layout == "cube"
    axes = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, -1), (0, 0, 1)], np.float32)
    np.testing.assert_allclose(by_folder.radiance_along(axes)[:, 0], np.arange(6) + 1.0)
    # The first row is the upper edge: up on the sides, behind on the top, in front on the bottom.
    upper = np.array([(0, 1, 0)] * 2 + [(0, 0, 1), (0, 0, -1)] + [(0, 1, 0)] * 2, np.float32)
    np.testing.assert_allclose(by_folder.radiance_along(axes + 0.75 * upper)[:, 0], np.arange(6) + 1.5)


def test_six_faces_that_do_not_belong_together_are_refused(tmp_path: Path) -> None:
    write_faces(tmp_path / "sky")
    for name, picture, message in (
        ("nz.hdr", grey(5, 5), "5×5 pixels, but px.hdr has 4; expected six of one size"),
        ("nz.hdr", grey(4, 5), "5×4 pixels, expected a square picture of one face"),
    ):
        write_hdr(tmp_path / "sky" / name, picture)
        with pytest.raises(InputError, match=message):
            Environment.open(tmp_path / "sky")
    (tmp_path / "sky" / "nz.hdr").unlink()
    with pytest.raises(InputError, match=r"a folder without six pictures .*px nx py ny pz nz, or right left"):
        Environment.open(tmp_path / "sky")
    with pytest.raises(InputError, match=r"six pictures are needed; missing: nz\.hdr"):
        Environment.open(tmp_path / "sky" / "{face}.hdr")
    with pytest.raises(InputError, match=r"no such files; {face} stands for px nx"):
        Environment.open(tmp_path / "{face}.exr")
    with pytest.raises(InputError, match="six pictures are the faces of a cube"):
        Environment.open(tmp_path / "sky", "latlong")
    write_faces(tmp_path / "sky")
    write_faces(tmp_path / "sky", pattern="b_{}.hdr")
    with pytest.raises(InputError, match=r"more than one picture of a face \(b_px.hdr, px.hdr\)"):
        Environment.open(tmp_path / "sky")
    assert Environment.open(tmp_path / "sky" / "b_{face}.hdr").layout == "cube"


def test_missing_files_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        Environment.open(tmp_path / "none.hdr")


# ---- Values ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [np.nan, np.inf, -0.01])
@pytest.mark.parametrize("layout", ["latlong", "cube"])
def test_radiance_that_no_light_has_is_refused(bad: float, layout: str) -> None:
    pixels = np.ones((6, 4, 4, 3) if layout == "cube" else (4, 8, 3), np.float32)
    pixels[2, 3, 1] = bad
    with pytest.raises(InputError, match="finite and not negative"):
        Environment(pixels, layout, name="mine")


def test_numbers_beyond_float32_are_refused() -> None:
    with pytest.raises(InputError, match="finite and not negative"):
        Environment(np.full((2, 4, 3), 1e39), "latlong")
    with pytest.raises(InputError, match="radiance above"):
        Environment(np.full((2, 4, 3), 3e38, np.float32), "latlong")
    with pytest.raises(InputError, match="radiance above"):
        Environment(np.full((2, 4, 3), 1e30, np.float32), "latlong").scaled(1e10)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.0, "bright", None])
def test_bad_scales_and_tints_are_refused(bad: object) -> None:
    light = Environment.constant((1.0, 1.0, 1.0))
    with pytest.raises(InputError, match=r"scale: .*expected a finite number of at least 0"):
        light.scaled(bad)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"tint: .*expected a finite number of at least 0"):
        light.tinted((1.0, bad, 1.0))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="radiance: "):
        Environment.constant((bad, 1.0, 1.0))  # type: ignore[arg-type]


def test_bad_turns_and_triples_are_refused() -> None:
    light = Environment.constant((1.0, 1.0, 1.0))
    for bad in (np.nan, -np.inf, "left"):
        with pytest.raises(InputError, match="rotation: "):
            light.rotated(bad)  # type: ignore[arg-type]
    for triple in ((1.0, 1.0), (1.0,) * 4, 1.0, "red", None):
        with pytest.raises(InputError, match="three numbers"):
            light.tinted(triple)  # type: ignore[arg-type]


@pytest.mark.parametrize("bad", [0, -1, 4097, 2.5, "64", None])
def test_bad_resolutions_are_refused(bad: object) -> None:
    with pytest.raises(InputError, match="expected a whole number from 1 to 4096"):
        Environment.constant((1.0, 1.0, 1.0)).cube(bad)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("shape", "layout"),
    [
        *(((4, 8), "latlong"), ((4, 8, 4), "latlong"), ((0, 8, 3), "latlong"), ((6, 4, 4, 3), "angular")),
        *(((5, 4, 4, 3), "cube"), ((6, 4, 5, 3), "cube"), ((4, 8, 3), "cube")),
    ],
)
def test_shapes_that_do_not_fit_are_refused(shape: tuple[int, ...], layout: str) -> None:
    with pytest.raises(InputError, match="expected \\("):
        Environment(np.ones(shape, np.float32), layout)


def test_what_is_no_array_of_numbers_is_refused() -> None:
    for pixels in ([[1.0]], np.array([["a"]]), None):
        with pytest.raises(InputError, match="expected an array of numbers"):
            Environment(pixels, "latlong")  # type: ignore[arg-type]


# ---- Values that stay --------------------------------------------------------------------------------------


def test_environments_do_not_change() -> None:
    pixels = grey(4, 8)
    light = Environment(pixels, "latlong")
    pixels[:] = 7.0
    assert light.pixels.max() == 0.5
    assert not light.pixels.flags.writeable
    with pytest.raises(dataclasses.FrozenInstanceError):
        light.scale = 2.0  # type: ignore[misc]
    brighter = light.scaled(3.0).rotated(10.0).tinted((1.0, 0.5, 0.0))
    assert (light.scale, light.rotation_deg, light.tint) == (1.0, 0.0, (1.0, 1.0, 1.0))
    assert (brighter.scale, brighter.rotation_deg, brighter.tint) == (3.0, 10.0, (1.0, 0.5, 0.0))
    assert brighter.pixels is light.pixels
    other = dataclasses.replace(light, pixels=grey(4, 4), layout="angular")  # nothing is known of this map
    np.testing.assert_allclose(other.scaled(2.0).cube(4), 1.0, rtol=1e-6)
    brighter.cube(4)[:] = 9.0  # a cube is the caller's own
    np.testing.assert_allclose(light.cube(4), 0.5, rtol=1e-6)


def test_scale_and_tint_multiply() -> None:
    light = (
        Environment.constant((0.5, 1.0, 2.0))
        .scaled(2.0)
        .scaled(3.0)
        .tinted((1.0, 0.5, 0.0))
        .tinted((2.0, 1.0, 9.0))
    )
    np.testing.assert_allclose(light.cube(3), np.broadcast_to([6.0, 3.0, 0.0], (6, 3, 3, 3)), rtol=1e-6)
    np.testing.assert_allclose(
        light.radiance_along(np.array([[0.0, 1.0, 2.0]])), [[6.0, 3.0, 0.0]], rtol=1e-6
    )
    np.testing.assert_allclose(light.total, 4.0 * np.pi * np.array([6.0, 3.0, 0.0]), rtol=1e-6)


def test_a_dark_map_is_dark_everywhere() -> None:
    light = Environment(np.zeros((4, 8, 3), np.float32), "latlong").rotated(20.0)
    assert not light.cube(9).any()
    assert not light.total.any()

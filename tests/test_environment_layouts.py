"""Environments: every layout shows the same world, however it is turned and looked at."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from prelight.bases import cube_map
from prelight.lighting.environment import Environment
from prelight.lighting.layouts import PICTURE_LAYOUTS

from .maps import (
    DIRECTION,
    OTHER_FACES,
    SHAPES,
    SUNS,
    areas,
    cross_direction,
    face_direction,
    texel_directions,
    textured,
    turned,
)

# ---- Turning -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("layout", ["cross", "cube"])
@pytest.mark.parametrize("quarters", [0, 1, 2, 3, -1])
def test_quarter_turns_of_faces_only_move_texels(
    layout: str, quarters: int, rng: np.random.Generator
) -> None:
    environment = Environment(textured(layout, rng), layout)
    d = texel_directions(32).reshape(-1, 3)
    face, u, v = cube_map.face_coordinates(turned(d, -90.0 * quarters))
    row, column = np.floor((v + 1.0) * 16.0).astype(int), np.floor((u + 1.0) * 16.0).astype(int)
    expected = environment.cube(32)[face, row, column].reshape(6, 32, 32, 3)
    np.testing.assert_array_equal(environment.rotated(90.0 * quarters).cube(32), expected)


@pytest.mark.parametrize("layout", SHAPES)
def test_turns_add_up(layout: str, rng: np.random.Generator) -> None:
    environment = Environment(textured(layout, rng), layout)
    there_and_back = environment.rotated(300.0).rotated(75.0).rotated(-15.0)
    assert there_and_back.rotation_deg == 0.0
    np.testing.assert_array_equal(there_and_back.cube(16), environment.cube(16))


def test_any_turn_agrees_with_the_map_seen_from_there(rng: np.random.Generator) -> None:
    """Two ways to the same cube: turn a lat-long by whole columns, or turn the environment."""
    pixels = textured("latlong", rng)
    columns = 11
    by_pixels = Environment(np.roll(pixels, -columns, axis=1), "latlong")  # counter-clockwise: towards −X
    by_turn = Environment(pixels, "latlong").rotated(columns * 360.0 / 128)
    np.testing.assert_allclose(by_turn.cube(20), by_pixels.cube(20), rtol=1e-4)


# ---- Faces, and one place in two layouts -------------------------------------------------------------------


def test_an_unturned_cross_is_given_back(rng: np.random.Generator) -> None:
    pixels = textured("cross", rng)
    cube = Environment(pixels, "cross").cube(32)
    rows, columns = np.nonzero(PICTURE_LAYOUTS["cross"].unfold(np.ones((6, 32, 32, 3), np.float32))[..., 0])
    assert rows.size == 6 * 32 * 32
    for row, column in zip(rows[::7], columns[::7], strict=True):
        face, u, v = cube_map.face_coordinates(cross_direction(row, column)[None])
        at, to = int((v[0] + 1.0) * 16.0), int((u[0] + 1.0) * 16.0)
        np.testing.assert_array_equal(cube[face[0], at, to], pixels[row, column])
    np.testing.assert_array_equal(Environment.from_cube(cube).cube(32), cube)


@pytest.mark.parametrize("layout", OTHER_FACES)
def test_other_pictures_of_faces_lie_as_they_are_seen(layout: str, rng: np.random.Generator) -> None:
    """Every pixel of a face is one texel, where the picture seen from the middle says; and back again."""
    pixels = rng.lognormal(0.0, 1.0, OTHER_FACES[layout]).astype(np.float32)
    kind = PICTURE_LAYOUTS[layout]
    inside = kind.unfold(np.ones((6, 32, 32, 3), np.float32))[..., 0] > 0
    assert inside.sum() == 6 * 32 * 32
    cube = Environment(pixels, layout).cube(32)
    for row, column in zip(*(places[::13] for places in np.nonzero(inside)), strict=True):
        face, u, v = cube_map.face_coordinates(face_direction(layout, row, column)[None])
        at, to = int((v[0] + 1.0) * 16.0), int((u[0] + 1.0) * 16.0)
        np.testing.assert_array_equal(cube[face[0], at, to], pixels[row, column])
    np.testing.assert_array_equal(kind.unfold(cube)[inside], pixels[inside])


def test_the_two_crosses_are_of_one_world(rng: np.random.Generator) -> None:
    cube = rng.lognormal(0.0, 1.0, (6, 16, 16, 3)).astype(np.float32)
    for layout in ("cross", *OTHER_FACES):
        picture = PICTURE_LAYOUTS[layout].unfold(cube)
        np.testing.assert_array_equal(Environment(picture, layout).cube(16), cube)


@pytest.mark.parametrize(("side", "resolution"), [(12, 3), (12, 8), (8, 24), (7, 5), (5, 7), (1, 3), (3, 1)])
def test_faces_overlap_texels_exactly(side: int, resolution: int, rng: np.random.Generator) -> None:
    faces = rng.lognormal(0.0, 1.0, (6, side, side, 3)).astype(np.float32)
    grid = side * resolution  # both resolutions divide it
    weights = areas(grid)
    fine = faces.repeat(resolution, axis=1).repeat(resolution, axis=2) * weights[..., None]
    blocks = (resolution, side, resolution, side)
    expected = (
        fine.reshape(6, *blocks, 3).sum(axis=(2, 4)) / weights.reshape(blocks).sum(axis=(1, 3))[..., None]
    )
    np.testing.assert_allclose(Environment.from_cube(faces).cube(resolution), expected, rtol=1e-6)


def test_probe_and_cross_of_the_beach_agree(data: Path) -> None:
    """Two files of one place, exposed alike: their maps agree once fine detail is averaged out."""
    probe = Environment.open(data / "probes" / "beach_probe.hdr")
    cross = Environment.open(data / "probes" / "beach_cross.hdr")
    assert (probe.layout, cross.layout) == ("angular", "cross")
    # The cross was made from a larger picture; behind the ball (+Z) the probe sees almost nothing.
    a, b = probe.cube(12), cross.cube(12)
    ahead = [0, 1, 2, 3, 5]
    ratio = np.log(a[ahead] / b[ahead])
    assert abs(np.median(ratio)) < 0.01
    assert np.corrcoef(np.log(a[ahead]).ravel(), np.log(b[ahead]).ravel())[0, 1] > 0.998
    np.testing.assert_allclose(probe.total, cross.total, rtol=0.02)


# ---- Looking up --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("layout", ["latlong", "angular", "cross"])
@pytest.mark.parametrize("degrees", [0.0, 77.0])
def test_looking_at_the_middle_of_a_pixel_sees_it(
    layout: str, degrees: float, rng: np.random.Generator
) -> None:
    pixels = textured(layout, rng)
    environment = Environment(pixels, layout).rotated(degrees).tinted((2.0, 1.0, 0.5))
    spots = [(row, column) for name, row, column in SUNS if name == layout]
    d = np.array([turned(DIRECTION[layout](*spot), degrees) for spot in spots])
    expected = np.array([pixels[spot] for spot in spots]) * np.float32([2.0, 1.0, 0.5])
    np.testing.assert_allclose(environment.radiance_along(3.0 * d), expected, rtol=2e-3)


def test_looking_over_the_edges_of_faces_has_no_seam(rng: np.random.Generator) -> None:
    """Along a path across edges radiance changes only as fast as the texels do."""
    smooth = 1.0 + texel_directions(16) @ np.array([0.5, 0.2, -0.4])[:, None] * np.ones(3)
    angle = np.linspace(0.0, 2.0 * np.pi, 4001)
    for tilt in rng.normal(size=(5, 2, 3)):
        p, q = np.linalg.qr(tilt.T)[0].T
        d = np.cos(angle)[:, None] * p + np.sin(angle)[:, None] * q
        seen = Environment.from_cube(smooth).radiance_along(d)[:, 0]
        assert np.abs(seen - (1.0 + d @ np.array([0.5, 0.2, -0.4]))).max() < 0.01


def test_looking_nowhere_is_harmless_and_nan_is_refused() -> None:
    for layout, shape in SHAPES.items():
        seen = Environment(np.ones(shape, np.float32), layout).radiance_along(np.zeros((1, 3)))
        np.testing.assert_allclose(seen, 1.0, rtol=1e-6)
        assert Environment(np.ones(shape, np.float32), layout).radiance_along(np.zeros((0, 3))).shape == (
            0,
            3,
        )
    with pytest.raises(ValueError, match="expected finite numbers"):
        Environment.constant((1, 1, 1)).radiance_along(np.full((2, 3), np.nan))
    with pytest.raises(ValueError, match=r"shape \(3,\)"):
        Environment.constant((1, 1, 1)).radiance_along(np.ones(3))

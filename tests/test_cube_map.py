"""The cube map: where texels look, how large they are."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.bases import cube_map

# Written out from the OpenGL specification, not from the module: the direction before normalisation at (u, v).
OPENGL = {
    "+X": lambda u, v: (1.0, -v, -u),
    "-X": lambda u, v: (-1.0, -v, u),
    "+Y": lambda u, v: (u, 1.0, v),
    "-Y": lambda u, v: (u, -1.0, -v),
    "+Z": lambda u, v: (u, -v, 1.0),
    "-Z": lambda u, v: (-u, -v, -1.0),
}


@pytest.mark.parametrize("face", range(6))
def test_faces_lie_as_in_opengl(face: int) -> None:
    u, v = 0.37, -0.81
    expected = np.array(OPENGL[cube_map.FACES[face]](u, v))
    found = cube_map.directions(face, np.array([u]), np.array([v]))[0]
    np.testing.assert_allclose(found, expected / np.linalg.norm(expected), atol=1e-15)


def test_face_coordinates_undo_directions(rng: np.random.Generator) -> None:
    face = rng.integers(0, 6, 10_000)
    u, v = rng.uniform(-1.0, 1.0, (2, 10_000))
    d = cube_map.directions(face, u, v) * rng.uniform(0.1, 10.0, (10_000, 1))
    again = cube_map.face_coordinates(d)
    np.testing.assert_array_equal(again[0], face)
    np.testing.assert_allclose(again[1:], [u, v], atol=1e-12)


@pytest.mark.parametrize("resolution", [1, 2, 3, 17])
def test_texels_are_numbered_face_row_column(resolution: int) -> None:
    texels = np.arange(6 * resolution**2)
    face, u, v = cube_map.face_coordinates(cube_map.texel_directions(texels, resolution).astype(np.float64))
    row = np.floor((v + 1.0) * 0.5 * resolution).astype(int)
    column = np.floor((u + 1.0) * 0.5 * resolution).astype(int)
    np.testing.assert_array_equal((face * resolution + row) * resolution + column, texels)


@pytest.mark.parametrize("resolution", [1, 2, 3, 17, 256, 1001])
def test_solid_angles_make_a_sphere(resolution: int) -> None:
    table = cube_map.solid_angles(resolution)
    assert table.shape == (resolution, resolution)
    assert not table.flags.writeable
    assert abs(6.0 * table.sum(dtype=np.float64) / (4.0 * np.pi) - 1.0) < 1e-7
    np.testing.assert_allclose(table, table.T, rtol=1e-6)
    np.testing.assert_allclose(table, table[::-1], rtol=1e-6)


def test_solid_angles_in_closed_form() -> None:
    assert cube_map.solid_angles(1)[0, 0] == pytest.approx(4.0 * np.pi / 6.0, rel=1e-7)
    np.testing.assert_allclose(cube_map.solid_angles(2), 4.0 * np.pi / 24.0, rtol=1e-7)  # by symmetry
    resolution = 1024  # so small that the density in the middle times the area will do
    centres = cube_map.texel_centres(resolution)
    density = (1.0 + centres[:, None] ** 2 + centres[None, :] ** 2) ** -1.5
    np.testing.assert_allclose(
        cube_map.solid_angles(resolution), density * (2.0 / resolution) ** 2, rtol=3e-6
    )


def test_solid_angles_add_up() -> None:
    fine, coarse = cube_map.solid_angles(24).astype(np.float64), cube_map.solid_angles(8)
    np.testing.assert_allclose(fine.reshape(8, 3, 8, 3).sum(axis=(1, 3)), coarse, rtol=1e-6)


def test_mean_directions_are_integrals(rng: np.random.Generator) -> None:
    resolution = 16
    start = rng.integers(0, resolution, (40, 2))
    size = 1 + rng.integers(0, 100, (40, 2)) % (resolution - start)
    rectangles = np.column_stack([rng.integers(0, 6, 40), start, size])
    for (face, row, column, height, width), found in zip(
        rectangles, cube_map.mean_directions(rectangles, resolution), strict=True
    ):
        s = (np.arange(200) + 0.5) / 200.0
        u = 2.0 * (column + s * width) / resolution - 1.0
        v = 2.0 * (row + s * height) / resolution - 1.0
        d = cube_map.directions(face, np.tile(u, 200), np.repeat(v, 200))
        weight = np.outer((1.0 + v**2), np.ones(200)) + u[None, :] ** 2
        mean = np.average(d, axis=0, weights=weight.ravel() ** -1.5)
        np.testing.assert_allclose(found, mean, atol=2e-5)

"""Textured pictures against what a texture must look like, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.camera import Camera
from prelight.drawing.surface import Pyramid, Surface
from prelight.drawing.view import View
from prelight.errors import InputError
from prelight.images.tonemap import srgb_decode
from prelight.material import Material

TEXTURED, PLAIN = Material(colour_texture=0), Material()


def wall(width: float, height: float, *, repeat=(1.0, 1.0), shift=(0.0, 0.0)):
    """A rectangle in the xy plane about the origin: positions, triangles, uv."""
    x, y = width / 2, height / 2
    positions = np.array([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uv = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32) * repeat + shift
    return positions, triangles, uv.astype(np.float32)


def facing(height: float) -> Camera:
    """Sees exactly ``height`` of the plane z = 0."""
    return Camera((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), vertical_fov_deg=2 * np.degrees(np.arctan(height / 2)))


def shown(mesh, texture, *, camera, size, tint=(1.0, 1.0, 1.0), light=(1.0, 1.0, 1.0)) -> np.ndarray:
    positions, triangles, uv = mesh
    rows = np.tile(np.float32(tint), (len(positions), 1))
    surface = Surface(np.zeros(len(triangles), int), [TEXTURED], uv=uv, tint=rows, textures=[texture])
    view = View(positions, triangles, camera=camera, width=size[0], height=size[1], surface=surface)
    irradiance = np.tile(np.float32(light), (len(positions), 1))
    return view.draw(np.zeros_like(positions), irradiance=irradiance).linear


def checkerboard(cells: int, texels: int = 1) -> np.ndarray:
    i, j = np.indices((cells * texels, cells * texels)) // texels
    return np.repeat(((i + j) % 2 * 255).astype(np.uint8)[..., None], 3, axis=2)


@pytest.mark.parametrize("size", [(64, 64), (96, 54), (33, 21)])
def test_texel_on_pixel_is_the_texture(size: tuple[int, int], rng: np.random.Generator) -> None:
    width, height = size
    texture = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    picture = shown(wall(width / height * 1.0, 1.0), texture, camera=facing(1.0), size=size)
    inside = (slice(1, -1), slice(1, -1))
    assert np.abs(picture[inside] - srgb_decode(texture)[inside]).max() < 2e-4


def test_irradiance_and_tint_multiply(rng: np.random.Generator) -> None:
    texture = np.full((5, 7, 3), (200, 100, 50), np.uint8)
    picture = shown(
        wall(4, 4), texture, camera=facing(1.0), size=(32, 32), tint=(1, 0.5, 0.25), light=(2, 3, 4)
    )
    expected = srgb_decode(texture[0, 0]) * (1, 0.5, 0.25) * (2, 3, 4)
    assert np.abs(picture / expected - 1).max() < 1e-5


def test_a_tint_that_varies_is_interpolated() -> None:
    positions, triangles, uv = wall(1, 1)
    tint = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], np.float32)
    white = np.full((2, 2, 3), 255, np.uint8)
    surface = Surface([0, 0], [TEXTURED], uv=uv, tint=tint, textures=[white])
    view = View(positions, triangles, camera=facing(1.0), width=40, height=40, surface=surface)
    picture = view.draw(np.zeros((4, 3)), irradiance=np.ones((4, 3))).linear
    centre = (np.arange(40) + 0.5) / 40
    assert np.abs(picture[1:-1, 1:-1, 0] - centre[1:-1]).max() < 1e-3
    assert np.abs(picture[1:-1, 1:-1, 1] - centre[::-1, None][1:-1]).max() < 1e-3


@pytest.mark.parametrize("repeat", [4.3, 7.3, 40.0, 1e5])
def test_a_small_checkerboard_is_even_grey(repeat: float) -> None:
    """Mean of linear light: half, not the half of bytes; and nothing coarse is left of the pattern."""
    mesh = wall(1, 1, repeat=(repeat, repeat))
    picture = shown(mesh, checkerboard(32), camera=facing(1.0), size=(64, 64))[1:-1, 1:-1]
    assert picture.mean() == pytest.approx(0.5, abs=2e-3)
    assert np.abs(picture - 0.5).max() < 0.02


@pytest.mark.parametrize("texels", [12.3, 17.0, 31.0])
def test_moire_is_bounded(texels: float) -> None:
    """Squares of 8 texels, each smaller than a pixel: little is left of a contrast of 0.5, all about the mean."""
    repeat = 64 * texels / 128
    mesh = wall(1, 1, repeat=(repeat, repeat))
    picture = shown(mesh, checkerboard(16, 8), camera=facing(1.0), size=(64, 64))[1:-1, 1:-1]
    assert picture.std() < 0.09
    assert picture.mean() == pytest.approx(0.5, abs=0.01)


def floor(reach: float):
    """A floor of two triangles from under the eye to the distance, two metres for a texture."""
    positions = np.array([(-1, 0, 0), (1, 0, 0), (1, 0, -1), (-1, 0, -1)], np.float32) * reach
    return positions, np.array([[0, 1, 2], [0, 2, 3]], np.int32), positions[:, [0, 2]] / np.float32(2)


def test_a_floor_is_sharp_ahead_and_even_in_the_distance() -> None:
    """Where squares are seen at a slant they keep their edges along the view: more than one lookup a pixel."""
    camera = Camera((0.0, 1.0, 1.0), (0.0, 0.7, 0.0), vertical_fov_deg=50)
    picture = shown(floor(400.0), checkerboard(2, 64), camera=camera, size=(160, 90))[..., 0]
    horizon = int(np.flatnonzero(picture.mean(axis=1) > 0.3)[0])
    assert np.abs(picture[horizon + 1 : horizon + 3] - 0.5).max() < 0.1
    ahead = picture[horizon + 8, 70:90]  # squares of some five pixels' width, less than one high
    assert np.ptp(ahead) > 0.25
    assert np.ptp(picture[-20:]) > 0.95


@pytest.mark.parametrize("shift", [0.0, 0.37, -5.0, 1000.0])
def test_coordinates_wrap(shift: float, rng: np.random.Generator) -> None:
    """A whole turn more changes nothing, and the seam between u = 1 and u = 0 is filtered like any other place."""
    texture = rng.integers(0, 256, (16, 16, 3), dtype=np.uint8)
    picture = shown(wall(1, 1, shift=(shift, shift)), texture, camera=facing(1.0), size=(16, 16))
    rolled = shown(wall(1, 1, shift=(shift + 1, shift - 2)), texture, camera=facing(1.0), size=(16, 16))
    assert np.abs(picture - rolled)[1:-1, 1:-1].max() < 2e-3
    if shift == 0.37:
        linear = srgb_decode(texture)
        u = (np.arange(16) + 0.5) / 16 + shift
        x = u * 16 - 0.5
        k, f = np.floor(x).astype(int), (x % 1)[:, None]
        rows = linear[k % 16] * (1 - f[..., None]) + linear[(k + 1) % 16] * f[..., None]
        expected = rows[:, k % 16] * (1 - f) + rows[:, (k + 1) % 16] * f
        assert np.abs(picture - expected)[1:-1, 1:-1].max() < 2e-3


@pytest.mark.parametrize("size", [(1, 1), (2, 2), (5, 3), (64, 1), (17, 33)])
def test_every_level_keeps_the_mean(size: tuple[int, int], rng: np.random.Generator) -> None:
    texture = rng.integers(0, 256, (*size, 3), dtype=np.uint8)
    pyramid = Pyramid.of(texture)
    mean = srgb_decode(texture).mean(axis=(0, 1))
    assert pyramid.levels[-1, 1:].tolist() == [1, 1]
    for first, h, w in pyramid.levels[1:]:
        level = pyramid.coarser[first : first + h * w] / 65535
        assert np.abs(level.mean(axis=0) - mean).max() < 2e-5


def test_plain_triangles_stay_as_they_are(rng: np.random.Generator) -> None:
    """Bit for bit, with one half textured and without; and all of them without the irradiance."""
    positions, triangles, uv = wall(1, 1)
    positions = np.concatenate([positions, np.add(positions, (1.2, 0, 0))]).astype(np.float32)
    triangles, uv = np.concatenate([triangles, triangles + 4]), np.concatenate([uv, uv])
    texture = rng.integers(0, 256, (8, 8, 3), dtype=np.uint8)
    surface = Surface([0, 0, 1, 1], [PLAIN, TEXTURED], uv=uv, tint=np.ones((8, 3)), textures=[texture])
    size = {"camera": facing(2.5), "width": 60, "height": 40}
    radiance = rng.uniform(0, 3, (8, 3)).astype(np.float32)
    plain = View(positions, triangles, **size)
    with_texture = View(positions, triangles, **size, surface=surface)
    expected = plain.draw(radiance, background=(0.1, 0.2, 0.3)).linear
    found = with_texture.draw(radiance, irradiance=np.ones((8, 3)), background=(0.1, 0.2, 0.3)).linear
    left = slice(0, 37)  # the plain wall's
    assert np.array_equal(found[:, left], expected[:, left])
    assert not np.array_equal(found, expected)
    assert np.array_equal(with_texture.draw(radiance, background=(0.1, 0.2, 0.3)).linear, expected)


def test_several_textures_are_told_apart() -> None:
    positions, triangles, uv = wall(2, 1)
    red, blue = np.zeros((2, 3, 3, 3), np.uint8)
    red[..., 0], blue[..., 2] = 255, 255
    materials = [Material(colour_texture=1), Material(colour_texture=0)]
    surface = Surface([0, 1], materials, uv=uv, tint=np.ones((4, 3)), textures=[red, blue])
    view = View(positions, triangles, camera=facing(1.0), width=64, height=32, surface=surface)
    picture = view.draw(np.zeros((4, 3)), irradiance=np.ones((4, 3))).linear
    assert picture[24, 40].tolist() == [0, 0, 1]  # below the diagonal
    assert picture[8, 24].tolist() == [1, 0, 0]


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"uv": np.zeros((3, 2))}, "tint"),
        ({"uv": np.full((4, 2), np.nan)}, "uv"),
        ({"tint": np.full((4, 3), np.inf)}, "tint"),
        ({"textures": []}, "materials"),
        ({"textures": [np.zeros((0, 4, 3), np.uint8)]}, "textures"),
        ({"textures": [np.zeros((4, 4, 3))]}, "textures"),
        ({"material_of": [0, 1]}, "material_of"),
        ({"material_of": [0.0, 0.0]}, "material_of"),
    ],
)
def test_a_surface_that_does_not_fit_is_refused(change: dict, what: str) -> None:
    given = {"uv": np.zeros((4, 2)), "tint": np.ones((4, 3)), "textures": [checkerboard(2)], **change}
    with pytest.raises(InputError, match=f"^{what}"):
        Surface(given.pop("material_of", [0, 0]), [TEXTURED], **given)


def test_a_surface_of_another_mesh_is_refused() -> None:
    positions, triangles, uv = wall(1, 1)
    surface = Surface([0], [TEXTURED], uv=uv, tint=np.ones((4, 3)), textures=[checkerboard(2)])
    with pytest.raises(InputError, match=r"^surface: is of 4 vertices and 1 triangles, expected 4 and 2"):
        View(positions, triangles, camera=facing(1.0), width=8, height=8, surface=surface)
    good = Surface([0, 0], [TEXTURED], uv=uv, tint=np.ones((4, 3)), textures=[checkerboard(2)])
    view = View(positions, triangles, camera=facing(1.0), width=8, height=8, surface=good)
    with pytest.raises(InputError, match=r"^irradiance: shape \(3, 3\)"):
        view.draw(np.zeros((4, 3)), irradiance=np.zeros((3, 3)))


def test_absurd_coordinates_neither_crash_nor_hang() -> None:
    positions, triangles, _ = wall(1, 1)
    uv = np.array([(-1e9, 1e9), (1e9, 1e9), (1e9, -1e9), (0, 0)], np.float32)
    picture = shown((positions, triangles, uv), checkerboard(4), camera=facing(1.0), size=(16, 16))
    assert np.isfinite(picture).all()
    assert picture[1:-1, 1:-1].mean() == pytest.approx(0.5, abs=0.1)

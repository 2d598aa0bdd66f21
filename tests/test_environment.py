"""Environments: light is neither lost nor moved on its way from a map to a cube map."""

from __future__ import annotations

import os

import numpy as np
import pytest

from prelight.bases import cube_map
from prelight.errors import PrelightError
from prelight.lighting import resampling, scattering
from prelight.lighting.environment import Environment
from prelight.lighting.layouts import PICTURE_LAYOUTS

from .maps import (
    BEYOND,
    DIRECTION,
    RESOLUTIONS,
    SHAPES,
    SUNS,
    areas,
    disc_only,
    energy,
    texel_directions,
    textured,
    turned,
    upright_direction,
)

# ---- Energy ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("layout", SHAPES)
@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_a_constant_map_stays_constant(layout: str, resolution: int) -> None:
    colour = np.array([0.25, 1.0, 3.7], np.float32)
    pixels = np.broadcast_to(colour, SHAPES[layout])
    environment = Environment(disc_only(pixels) if layout == "angular" else pixels, layout)
    for degrees in (0.0, 33.3):
        cube = environment.rotated(degrees).cube(resolution)
        assert cube.dtype == np.float32
        assert cube.shape == (6, resolution, resolution, 3)
        np.testing.assert_allclose(cube, np.broadcast_to(colour, cube.shape), rtol=1e-6)


@pytest.mark.parametrize("layout", SHAPES)
def test_the_total_of_a_constant_map_is_four_pi(layout: str) -> None:
    pixels = np.ones(SHAPES[layout], np.float32)
    environment = Environment(disc_only(pixels) if layout == "angular" else pixels, layout)
    np.testing.assert_allclose(environment.total, 4.0 * np.pi, rtol=1e-6)


@pytest.mark.parametrize("size", [1, 2, 3, 7, 64, 101])
def test_solid_angles_of_pictures_make_a_sphere(size: int) -> None:
    for layout in ("latlong", "angular"):
        table = PICTURE_LAYOUTS[layout].solid_angles(size, size)
        assert table.min() >= 0.0
        assert table.sum() == pytest.approx(4.0 * np.pi, rel=2e-6)


def test_solid_angles_of_an_angular_map_are_those_of_its_rings() -> None:
    size, half = 400, 0.3  # everything within 0.3 π of −Z has 2π (1 − cos 0.3π) steradians
    side = (2.0 * np.arange(size) + 1.0) / size - 1.0
    table = PICTURE_LAYOUTS["angular"].solid_angles(size, size)
    inside = table[np.hypot(side[:, None], side[None, :]) < half].sum()
    assert inside == pytest.approx(2.0 * np.pi * (1.0 - np.cos(half * np.pi)), rel=2e-3)


@pytest.mark.parametrize(("layout", "row", "column"), SUNS)
@pytest.mark.parametrize("degrees", [0.0, 41.7])
def test_a_small_sun_keeps_its_energy_and_direction(
    layout: str, row: int, column: int, degrees: float, rng: np.random.Generator
) -> None:
    """One pixel with 90 % of all energy; its surroundings must not notice."""
    around = 0.5 + textured(layout, rng) / 50.0
    dark, lone = around.copy(), np.zeros_like(around)
    dark[row, column] = 0.5
    lone[row, column] = 1.0
    weight = Environment(lone, layout).total[0]
    sunny = dark.copy()
    sunny[row, column] += 9.0 * 4.0 * np.pi * 0.5 / weight
    expected = 9.0 * 4.0 * np.pi * 0.5
    direction = turned(DIRECTION[layout](row, column), degrees)
    for resolution in (5, 32, 600 if (row, column) in BEYOND else 100):  # 600 is beyond what is scattered to
        with_sun = Environment(sunny, layout).rotated(degrees).cube(resolution)[..., 0]
        without = Environment(dark, layout).rotated(degrees).cube(resolution)[..., 0]
        d = texel_directions(resolution)
        flux = (with_sun.astype(np.float64) - without) * areas(resolution)
        pixel, texel = np.radians(360.0 / 90.0), np.radians(90.0 / resolution)
        near = np.arccos(np.clip(d @ direction, -1.0, 1.0)) < 1.5 * (pixel + texel)
        assert flux[near].sum() == pytest.approx(expected, rel=1e-3)
        assert np.abs(flux[~near]).sum() < 1e-3 * expected
        centroid = (flux[..., None] * d).sum(axis=(0, 1, 2))
        off = np.arccos(centroid @ direction / np.linalg.norm(centroid))
        assert off < 0.25 * pixel + 0.5 * texel


@pytest.mark.parametrize(
    ("layout", "shape", "where", "direction"),
    [
        ("latlong", (2048, 4096, 3), (517, 3001), None),
        ("latlong", (2048, 4096, 3), (0, 5), (0.0, 1.0, 0.0)),
        ("angular", (1000, 1000, 3), (400, 700), None),
        ("cube", (6, 512, 512, 3), (1, 511, 0), None),
        ("horizontal-cross", (768, 1024, 3), (300, 40), None),
    ],
)
@pytest.mark.parametrize("degrees", [0.0, 33.3])
def test_one_hot_pixel_of_a_large_map_is_not_lost(
    layout: str, shape: tuple[int, ...], where: tuple[int, ...], direction: tuple | None, degrees: float
) -> None:
    """A ten-thousandth of a texel, and half of all light: its energy stays, and stays in its place."""
    pixels = np.ones(shape, np.float32)
    if layout == "angular":
        pixels = disc_only(pixels)
    dark = Environment(pixels, layout).total
    pixels[where] = 0.0
    weight = (dark - Environment(pixels, layout).total)[0]
    pixels[where] = 4.0 * np.pi / weight
    if layout == "latlong":
        y, x = ((place + 0.5) / size for place, size in zip(where, shape[:2], strict=True))
        direction = direction or PICTURE_LAYOUTS[layout].directions(np.array(x), np.array(y))
    elif layout == "angular":
        y, x = ((place + 0.5) / size for place, size in zip(where, shape[:2], strict=True))
        direction = PICTURE_LAYOUTS[layout].directions(np.array(x), np.array(y))
    elif layout == "cube":
        direction = np.array([-1.0, -1.0, -1.0]) / np.sqrt(3.0)  # lower left corner of −X
    else:
        direction = upright_direction("left", (40.5 / 128) - 1.0, (2 * 44.5 / 256) - 1.0)
    flux = Environment(pixels, layout).rotated(degrees).cube(16)[..., 0].astype(np.float64) * areas(16)
    assert flux.sum() == pytest.approx(8.0 * np.pi, rel=1e-5)
    flux -= areas(16)
    d, there = texel_directions(16), turned(np.array(direction), degrees)
    near = np.arccos(np.clip(d @ there, -1.0, 1.0)) < np.radians(90.0 / 16 * 1.05)
    assert flux[near].sum() == pytest.approx(4.0 * np.pi, rel=2e-3)
    assert np.count_nonzero(flux > 0.02 * 4.0 * np.pi) <= 4


@pytest.mark.parametrize("side", [1024, 1000])
@pytest.mark.parametrize("layout", ["latlong", "cube"])
def test_merging_pixels_first_changes_little(layout: str, side: int, rng: np.random.Generator) -> None:
    """Light moves by less than an eighth of a texel, and none is lost."""
    slope = np.array([0.5, -0.3, 0.4])
    if layout == "latlong":
        y, x = ((np.arange(n) + 0.5) / n for n in (side // 2, side))
        d = PICTURE_LAYOUTS[layout].directions(x[None, :], y[:, None])
    else:
        d = texel_directions(side // 4)
    for pixels, most in ((1.0 + d @ slope, 0.002), (rng.lognormal(0.0, 1.0, d.shape[:-1]), 0.05)):
        environment = Environment(pixels[..., None] * np.ones(3), layout)
        merged = resampling._merged(environment.pixels, 16, layout=layout)
        assert merged.shape[-2] < environment.pixels.shape[-2]
        np.testing.assert_allclose(Environment(merged, layout).total, environment.total, rtol=1e-6)
        found, direct = (
            resampling._scattered(p, 16, layout=layout, degrees=20.0, total=environment.total)[0]
            for p in (merged, environment.pixels)
        )
        assert np.sqrt(np.mean((found / direct - 1.0) ** 2)) < most
    hot = np.zeros_like(environment.pixels)
    where = tuple(rng.integers(0, hot.shape[:-1]))
    hot[where] = 1.0
    merged = resampling._merged(hot, 16, layout=layout)
    place = np.unravel_index(merged[..., 0].argmax(), merged.shape[:-1])
    if layout == "latlong":
        x, y = (place[1] + 0.5) / merged.shape[1], (place[0] + 0.5) / merged.shape[0]
        there = PICTURE_LAYOUTS[layout].directions(np.array(x), np.array(y))
    else:
        there = texel_directions(merged.shape[1])[place]
    assert np.linalg.norm(there - d[where]) < np.sqrt(2.0) / 8.0 * (2.0 / 16.0)


@pytest.mark.parametrize("layout", ["latlong", "angular", "cube"])
@pytest.mark.parametrize("width", [1, 2, 5, 9])
def test_scattering_loses_nothing_by_itself(layout: str, width: int, rng: np.random.Generator) -> None:
    """Before the last correction; also for suns of several pixels."""
    for degrees, resolution in ((0.0, 3), (11.0, 17), (123.4, 64), (271.8, 200)):
        pixels = textured(layout, rng)
        row = rng.integers(20, 40)
        square = np.s_[row : row + width, 40 : 40 + width]
        where = np.s_[2, 0:width, 8 : 8 + width] if layout == "cube" else square
        pixels[where] = 2e4 / width**2
        environment = Environment(pixels, layout)
        total = environment.total
        _, found = resampling._scattered(
            environment.pixels, resolution, layout=layout, degrees=degrees, total=total
        )
        np.testing.assert_allclose(found, total, rtol=3e-4)


@pytest.mark.parametrize("shape", [(1, 2, 3), (2, 4, 3), (1, 1, 3), (3, 3, 3), (6, 1, 1, 3), (6, 2, 2, 3)])
def test_maps_of_few_pixels_lose_nothing_either(shape: tuple[int, ...], rng: np.random.Generator) -> None:
    layout = "cube" if len(shape) == 4 else "angular" if shape[0] == shape[1] else "latlong"
    environment = Environment(rng.lognormal(0.0, 2.0, shape).astype(np.float32), layout)
    for resolution in (1, 2, 7, 40):
        _, found = resampling._scattered(
            environment.pixels, resolution, layout=layout, degrees=20.0, total=environment.total
        )
        np.testing.assert_allclose(found, environment.total, rtol=1e-3)


@pytest.mark.parametrize("layout", ["latlong", "angular", "cube"])
@pytest.mark.parametrize("resolution", [16, 64])
def test_sub_samples_cover_every_texel_evenly(layout: str, resolution: int) -> None:
    pixels = np.ones(SHAPES[layout], np.float32)
    pixels.setflags(write=False)
    turned_axes, highest = resampling._face_axes(30.0), (1.0, 1.0, 1.0)
    covered = np.zeros((6, resolution, resolution, 7))
    for face, (axes, sums) in enumerate(zip(resampling._face_axes(0.0), covered, strict=True)):
        slab = scattering.Slab(face, 0, resolution, resolution, *axes, sums)
        if layout == "latlong":
            scattering.scatter_latlong(slab, pixels, np.radians(30.0), highest)
        elif layout == "angular":
            scattering.scatter_angular(slab, pixels, np.radians(30.0), highest)
        else:
            for source, frame in zip(pixels, turned_axes, strict=True):
                scattering.scatter_face(slab, source, frame, highest)
    even = covered[..., 6] / areas(resolution) - 1.0
    assert np.sqrt(np.mean(even**2)) < 0.015
    assert np.abs(even).max() < 0.12


@pytest.mark.parametrize("layout", SHAPES)
@pytest.mark.parametrize("degrees", [0.0, 90.0, 12.3])
def test_the_total_is_kept_in_every_channel(layout: str, degrees: float, rng: np.random.Generator) -> None:
    pixels = textured(layout, rng) * np.float32([1.0, 0.1, 30.0])
    environment = Environment(pixels, layout).rotated(degrees).scaled(1.7).tinted((1.0, 0.5, 0.0))
    for resolution in (*RESOLUTIONS[:-1], 301):
        np.testing.assert_allclose(energy(environment.cube(resolution)), environment.total, rtol=1e-6)
    assert environment.total[2] == 0.0


@pytest.mark.parametrize("layout", ["latlong", "angular", "cube"])
def test_a_smooth_map_stays_smooth(layout: str) -> None:
    """L = 1 + a·d averages to 1 + a·(mean direction of the texel), without a pattern."""
    slope = np.array([0.5, -0.3, 0.4])
    if layout == "cube":
        d = texel_directions(128)
    else:
        size = {"latlong": (256, 512), "angular": (400, 400)}[layout]
        y, x = ((np.arange(n) + 0.5) / n for n in size)
        d = PICTURE_LAYOUTS[layout].directions(x[None, :], y[:, None])
    environment = Environment(1.0 + d @ slope[:, None] * np.ones(3), layout).rotated(25.0)
    for resolution in (7, 100, 200):
        rectangles = np.stack(np.meshgrid(*map(np.arange, (6, resolution, resolution)), indexing="ij"), -1)
        rectangles = np.concatenate([rectangles, np.ones_like(rectangles[..., :2])], -1).reshape(-1, 5)
        exact = 1.0 + cube_map.mean_directions(rectangles, resolution) @ turned(slope, 25.0)
        found = environment.cube(resolution)[..., 1].ravel()
        assert np.abs(found - exact).max() < 0.006  # half a pixel of the map is 0.005
        assert np.sqrt(np.mean((found - exact) ** 2)) < 0.0016


def test_a_loss_would_be_noticed(rng: np.random.Generator) -> None:
    pixels = textured("latlong", rng)
    total = 1.003 * Environment(pixels, "latlong").total
    with pytest.raises(PrelightError, match="lost light"):
        resampling.resampled(pixels, 16, layout="latlong", degrees=1.0, total=total)


# ---- Same bits everywhere ----------------------------------------------------------------------------------


@pytest.mark.parametrize("layout", SHAPES)
def test_one_thread_or_two_or_slabs_give_the_same_bits(
    layout: str, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    pixels = textured(layout, rng)

    def anew() -> np.ndarray:
        return Environment(pixels, layout).rotated(31.0).cube(64)  # another map, of which no cube is kept

    cube = anew()
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    np.testing.assert_array_equal(anew(), cube)
    monkeypatch.setattr(resampling, "_SLAB_TEXELS", 900)  # slabs of 14 rows
    np.testing.assert_allclose(anew(), cube, rtol=3e-7)  # the total is summed in another order


def test_the_last_cube_is_kept_and_nobody_can_change_it(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    environment = Environment(textured("latlong", rng), "latlong").rotated(31.0)
    first = environment.cube(16)
    with monkeypatch.context() as patch:
        patch.setattr(resampling, "resampled", None)  # would be called
        np.testing.assert_array_equal(environment.scaled(2.0).cube(16), 2.0 * first)
        environment.cube(16)[:] = 7.0
        np.testing.assert_array_equal(environment.cube(16), first)
    other = Environment(environment.pixels, "latlong").rotated(32.0).cube(16)
    np.testing.assert_array_equal(environment.rotated(1.0).cube(16), other)
    np.testing.assert_array_equal(environment.cube(16), first)

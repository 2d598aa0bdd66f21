"""Strong lights: which they are, where they are, and the shadows they cast by rays."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.bases.cube_map import solid_angles, texel_directions
from prelight.lighting.disc import Disc, add_discs
from prelight.relighting.strong_lights import MOST, strong_discs, strongest, without


def sky(resolution: int, radiance: float = 1.0) -> np.ndarray:
    return np.full((6, resolution, resolution, 3), radiance, np.float32)


def light_of(cube: np.ndarray) -> np.ndarray:
    return (cube * solid_angles(cube.shape[1])[None, :, :, None]).sum(axis=(0, 1, 2), dtype=np.float64)


@pytest.mark.parametrize("resolution", [1, 7, 64, 256, 300])
def test_an_even_sky_has_none(resolution):
    cube = sky(resolution)
    assert len(strongest(cube, total=light_of(cube))) == 0


@pytest.mark.parametrize("resolution", [33, 256])
def test_a_texel(resolution):
    cube = sky(resolution)
    texel = (3, resolution // 3, resolution // 2)
    cube[texel] = 0.5 * 4 * np.pi / solid_angles(resolution)[texel[1:]]
    found = strongest(cube, total=light_of(cube))
    assert found.rectangles.tolist() == [[*texel, 1, 1]]
    number = (texel[0] * resolution + texel[1]) * resolution + texel[2]
    assert found.directions[0] == pytest.approx(texel_directions(np.array([number]), resolution)[0], abs=1e-6)
    assert found.energy[0] == pytest.approx(2 * np.pi, rel=1e-6)
    assert light_of(without(cube, found)) + found.energy.sum(axis=0) == pytest.approx(
        light_of(cube), rel=1e-6
    )
    assert without(cube, found)[texel].tolist() == [0, 0, 0]


@pytest.mark.parametrize(("share", "count"), [(0.0015, 0), (0.0025, 1), (0.1, 1)])
def test_from_a_five_hundredth(share, count):
    cube = sky(256)
    cube[5, 100, 100] = share / (1 - share) * 4 * np.pi / solid_angles(256)[100, 100]
    assert len(strongest(cube, total=light_of(cube))) == count


def test_towards_the_middle_of_its_energy():
    """A block of texels that cannot be cut finer: its direction is where most of its light is."""
    cube = sky(2048, 1e-6)
    cube[4, :1024:16, :8] = 1.0  # 64 cells are full
    cube[4, :1024:16, 0] = 50.0
    found = strongest(cube, total=light_of(cube))
    assert len(found) == MOST
    assert found.rectangles[0, 3:].tolist() == [8, 8]
    first = (4 * 2048 + 0) * 2048 + 0
    bright, middle = (texel_directions(np.array([first + k]), 2048)[0] for k in (0, 4))
    assert np.linalg.norm(found.directions[0] - bright) < 0.4 * np.linalg.norm(middle - bright)


def test_of_one_colour_only():
    """What is strong in blue counts, however dim it is beside all the red."""
    cube = sky(32)
    cube[..., 0] *= 1000
    cube[2, 5, 6, 2] = 500
    assert strongest(cube, total=light_of(cube)).rectangles.tolist() == [[2, 5, 6, 1, 1]]


def test_a_sun_in_a_fine_map():
    """Thirty-two by thirty-two texels astride cells: at most 64 directions, no energy lost, its middle kept."""
    cube = sky(2048, 1e-3)
    cube[4, 1000:1032, 700:732] = 100
    found = strongest(cube, total=light_of(cube))
    assert 16 < len(found) <= MOST
    sun = light_of(cube) - light_of(np.where(cube > 50, 0, cube))
    assert found.energy.sum(axis=0) == pytest.approx(sun, rel=2e-3)
    area = np.zeros((2048, 2048), np.uint8)
    for _, row, column, height, width in found.rectangles:
        area[row : row + height, column : column + width] += 1
    assert area.max() == 1
    assert (area[1000:1032, 700:732] == 1).all()


def test_more_than_there_is_room_for():
    cube = sky(128, 0.0)
    cube[0, ::8, ::8] = np.linspace(1, 2, 256, dtype=np.float32).reshape(16, 16, 1)
    found = strongest(cube, total=light_of(cube), share=0.001)
    assert len(found) == MOST
    left = without(cube, found)
    assert left.max() <= cube[0][tuple(found.rectangles[:, 1:3].T)].min() * 1.6  # solid angles differ


def test_discs():
    """A sun is strong, a window is not, a spark is not; its blocks are its texels."""
    sun = Disc((0.3, 0.8, 0.2), 0.27, (4e4, 4e4, 4e4))
    window = Disc((1.0, 0.2, 0.0), 12.0, (20.0, 20.0, 20.0))
    spark = Disc((0.0, 1.0, 0.0), 0.27, (10.0, 10.0, 10.0))
    total = 4 * np.pi + sun.total + window.total + spark.total
    for resolution in (64, 256, 1024):
        found, others = strong_discs([window, sun, spark], total, resolution)
        assert others == [window, spark]
        assert len(found) <= MOST
        assert found.energy.sum(axis=0) == pytest.approx(sun.total, rel=1e-5)
        centre = (found.directions * found.energy[:, :1]).sum(axis=0)
        assert centre / np.linalg.norm(centre) == pytest.approx(np.array(sun.direction), abs=2e-3)
    cube = np.zeros((6, 256, 256, 3), np.float32)
    add_discs(cube, [sun])
    found, _ = strong_discs([sun], total, 256)
    assert not without(cube, found).any()


def test_no_light_at_all():
    assert len(strongest(sky(16, 0.0), total=np.zeros(3))) == 0
    found, others = strong_discs([Disc((0.0, 1.0, 0.0), 1.0, (0.0, 0.0, 0.0))], np.zeros(3), 16)
    assert (len(found), len(others)) == (0, 1)

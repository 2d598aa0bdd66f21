"""Stock environments: the pieces they are painted from in closed form, and what each must do for a scene."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.lighting import painting, sky
from prelight.lighting.environment import Environment
from prelight.lighting.layouts import LatLong

SIZE = (256, 512)


@pytest.fixture(scope="module")
def d() -> np.ndarray:
    return painting.every_direction(*SIZE)


@pytest.fixture(scope="module")
def weights() -> np.ndarray:
    return LatLong().solid_angles(*SIZE)


def test_the_overcast_sky_gives_seven_ninths_of_pi(d: np.ndarray, weights: np.ndarray) -> None:
    luminance = painting.cie_overcast(d)
    assert luminance[0].max() == pytest.approx(1.0, abs=1e-4)
    assert luminance[SIZE[0] // 2 - 1].min() == pytest.approx(1.0 / 3.0, abs=0.005)
    irradiance = (luminance * weights * np.maximum(d[..., 1], 0.0)).sum()
    assert irradiance == pytest.approx(7.0 * np.pi / 9.0, rel=1e-3)


def test_the_clear_sky_is_one_at_the_zenith_and_bright_around_the_sun(d: np.ndarray) -> None:
    sun = painting.pointing(-60.0, 40.0)
    luminance = painting.cie_clear(d, sun)
    assert luminance[0].mean() == pytest.approx(1.0, rel=0.02)
    upper = luminance[: SIZE[0] // 2]
    brightest = d[np.unravel_index(upper.argmax(), upper.shape)]
    assert brightest @ sun > np.cos(np.radians(25.0))  # drawn a little towards the horizon
    assert luminance.min() > 0.0


@pytest.mark.parametrize(("azimuth", "elevation"), [(-100.0, 45.0), (0.0, 10.0), (175.0, 80.0)])
def test_a_light_gives_the_irradiance_it_was_told(
    d: np.ndarray, weights: np.ndarray, azimuth: float, elevation: float
) -> None:
    direction = painting.pointing(azimuth, elevation)
    for share in (painting.disc(d, direction, 1.5), painting.soft_box(d, direction, 30.0, 20.0)):
        picture = np.zeros((*SIZE, 3), np.float32)
        painting.add_light(picture, share, (3.0, 2.0, 1.0))
        np.testing.assert_allclose(np.einsum("ijk,ij->k", picture, weights), [3.0, 2.0, 1.0], rtol=1e-5)
        centroid = np.einsum("ij,ijk->k", share * weights, d.astype(np.float64))
        assert centroid @ direction / np.linalg.norm(centroid) > np.cos(np.radians(0.7))


def test_azimuths_and_elevations() -> None:
    np.testing.assert_allclose(painting.pointing(0.0, 0.0), (0, 0, -1), atol=1e-15)
    np.testing.assert_allclose(painting.pointing(90.0, 0.0), (1, 0, 0), atol=1e-15)
    np.testing.assert_allclose(painting.pointing(0.0, 90.0), (0, 1, 0), atol=1e-15)


def test_ground_returns_its_albedo_of_the_light_that_falls_on_it() -> None:
    picture = np.ones((*SIZE, 3), np.float32)
    painting.lay_ground(picture, (0.5, 0.2, 0.0), haze=0.0)
    np.testing.assert_allclose(picture[SIZE[0] // 2 :] - np.float32([0.5, 0.2, 0.0]), 0.0, atol=1e-4)
    assert (picture[: SIZE[0] // 2] == 1.0).all()


@pytest.mark.parametrize("name", sky.STOCK_SKIES)
def test_stock_environments_light_a_scene_well(name: str) -> None:
    light = Environment.open(f"stock:{name}")
    assert (light.layout, light.name) == ("latlong", f"stock:{name}")
    assert light.pixels.shape == (512, 1024, 3)
    np.testing.assert_array_equal(light.pixels, Environment.stock(name).pixels)  # the same every time
    assert light.pixels[256:].min() > 0.0  # ground, not a hole

    # Irradiance/π of surfaces facing all ways: the exposure is right as it is, and there is shape in it.
    cube = light.cube(24) @ painting.LUMINANCE
    from prelight.bases import cube_map

    texels = cube_map.texel_directions(np.arange(6 * 24**2), 24)
    power = (cube * cube_map.solid_angles(24)).ravel()
    faced = (np.maximum(texels @ texels.T, 0.0) @ power) / np.pi
    assert 0.3 < faced.max() < 1.5
    assert faced.max() / faced.min() > 4.0
    key = texels[faced.argmax()]
    assert key[1] > 0.0
    if name != "overcast":
        assert key[0] < -0.5  # on the left of a camera that looks along −Z


def test_unknown_stock_environments_are_refused_with_those_there_are() -> None:
    for name in ("midnight", "", "Noon", "../noon"):
        with pytest.raises(InputError, match="overcast, noon, sunset, studio, stage"):
            Environment.open(f"stock:{name}")
    with pytest.raises(InputError, match="stock environments are latlong"):
        Environment.open("stock:noon", "cross")

"""Skies that are turned, and hours that go by, while a hand drags: the same light, sooner."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.bases import cube_map
from prelight.lighting.daylight import Daylight
from prelight.lighting.environment import Environment
from prelight.lighting.moment import Site, moment_of
from prelight.lighting.remembered_places import latlong_places
from prelight.studio.environments import small, turned


@pytest.mark.parametrize(("degrees", "resolution"), [(0.0, 8), (33.3, 20)])
def test_remembered_places_get_the_same_bits(degrees: float, resolution: int) -> None:
    rng = np.random.default_rng(3)
    skies = rng.lognormal(0.0, 2.0, (2, 24, 48, 3)).astype(np.float32)
    known = latlong_places(24, 48, resolution, degrees)
    assert known is not None
    Environment(skies[0], "latlong").rotated(degrees).cube(resolution)
    Environment(skies[0].copy(), "latlong").rotated(degrees).cube(resolution)
    assert known._faces is not None  # the second time they are found
    found = Environment(skies[1], "latlong").rotated(degrees).cube(resolution)
    latlong_places.cache_clear()
    np.testing.assert_array_equal(
        found, Environment(skies[1].copy(), "latlong").rotated(degrees).cube(resolution)
    )


@pytest.mark.parametrize("degrees", [20.0, 65.0, 199.5])
def test_a_sky_turned_in_the_hand_has_its_sun_where_it_is(degrees: float) -> None:
    """Of a map of 48 cells a side, as it was turned before, a fifth of the light lay in another cell."""
    sky = Environment.stock("sunset")
    quick, exact = turned(small(sky), degrees), sky.rotated(degrees)
    weights = cube_map.solid_angles(32)[..., None]
    off = np.abs(quick.cube(32) - exact.cube(32)) * weights
    assert off.sum() < 0.05 * (exact.cube(32) * weights).sum()
    np.testing.assert_allclose(quick.total, exact.total, rtol=1e-5)


def test_the_air_is_as_its_own_integral_says() -> None:
    """Along one line of sight, light scattered once by the air, summed in another way."""
    place = Site(43.74, 15.89)
    day = Daylight(place, moment_of("hour", "2026-06-21T12:00:00", place=place), turbidity=2.0)
    air, sun = day._air, np.radians(40.0)
    elevation, cosine = np.array([0.6]), np.array([[0.3]])
    found = air.seen(elevation, cosine, sun_elevation=float(sun)).air[0, 0]
    ground, top, eye = 6360.0, 6460.0, 6360.002
    up = np.sin(elevation[0])
    length = -eye * up + np.sqrt(top**2 - eye**2 * (1 - up**2))
    t = (np.arange(4000) + 0.5) / 4000 * length
    at = np.sqrt(eye**2 + t**2 + 2 * eye * t * up)
    by_air, _, extinction = air.coefficients(at)
    through = np.exp(-np.cumsum(extinction, axis=0) * (length / 4000))
    lit = air.transmittance(at, (eye * np.sin(sun) + t * cosine[0, 0]) / at)
    assert ground < at.min()
    np.testing.assert_allclose(found, (by_air * through * lit).sum(axis=0) * (length / 4000), rtol=0.01)


def test_maps_of_other_layouts_are_turned_alike() -> None:
    rng = np.random.default_rng(5)
    sky = Environment.from_cube(rng.lognormal(0.0, 1.0, (6, 16, 16, 3)).astype(np.float32)).tinted(
        (1.0, 0.5, 0.2)
    )
    quick, exact = turned(small(sky), 70.0), sky.rotated(70.0)
    weights = cube_map.solid_angles(16)[..., None]
    off = np.abs(quick.cube(16) - exact.cube(16)) * weights
    assert off.sum() < 0.1 * (exact.cube(16) * weights).sum()
    np.testing.assert_allclose(quick.total, exact.total, rtol=1e-5)

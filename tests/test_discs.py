"""Disc lights and painted regions: closed forms, whatever the radius, the place or the resolution."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from prelight.bases import cube_map
from prelight.errors import InputError
from prelight.lighting.disc import Disc, add_discs
from prelight.lighting.environment import Environment
from prelight.lighting.regions import Cap, Paint, Window

from .maps import areas, energy, texel_directions

# A middle of a face, its edge, its corner, poles, next to all of these, and anywhere.
PLACES = [
    (1, 0, 0), (1, 0, 1), (-1, 1, 1), (0, 1, 0), (0, -1, 0), (1, 1e-4, -1 + 1e-4), (1, 0.999, -1.001),
    (1e-3, 1, 2e-3), (0.3, -0.5, 0.7),
]  # fmt: skip
RADII = (0.001, 0.05, 0.27, 2.86, 20.0, 90.0)


def shares(region: Cap | Window, resolution: int) -> np.ndarray:
    out = np.zeros((6, resolution, resolution))
    for face, rows, columns, share in region.cover(resolution):
        assert share.shape == (rows.stop - rows.start, columns.stop - columns.start)
        out[face, rows, columns] += share
    return out


# ---- Energy ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("softness", [0.0, 0.3, 1.0])
def test_the_energy_of_a_disc_is_its_closed_form(place: tuple[float, float, float], softness: float) -> None:
    """Small ones are never lost, and softness changes nothing: 2π·(1 − cos r)·radiance to float32."""
    colour = np.array([1.0, 20.0, 300.0])
    for radius in RADII:
        disc = Disc(place, radius, tuple(colour), softness)
        expected = 4.0 * np.pi * np.sin(np.radians(radius) / 2.0) ** 2 * colour
        np.testing.assert_allclose(disc.total, expected, rtol=1e-12)
        for resolution in (1, 2, 7, 64, 255):
            cube = Environment.dark().with_disc(disc).cube(resolution)
            np.testing.assert_allclose(energy(cube), expected, rtol=2e-7)


@pytest.mark.parametrize("softness", [0.0, 0.4, 1.0])
def test_shares_are_those_of_fine_samples(softness: float, rng: np.random.Generator) -> None:
    """Each texel, not just the sum: against 200×200 samples of the profile in every texel."""
    for radius, resolution, finer in ((4.0, 12, 200), (35.0, 3, 400), (89.0, 1, 600)):
        region = Cap(tuple(rng.normal(size=3)), radius, softness)
        found = shares(region, resolution)
        near = texel_directions(resolution).reshape(-1, 3) @ np.array(region.direction)
        for texel in np.argsort(-near)[: 16 if resolution > 1 else 6]:
            face, row, column = np.unravel_index(texel, found.shape)
            v, u = (
                2.0 * (at + (np.arange(finer) + 0.5) / finer) / resolution - 1.0 for at in (row, column)
            )  # fmt: skip
            u, v = np.meshgrid(u, v)
            weight = (1.0 + u * u + v * v) ** -1.5
            d = cube_map.directions(int(face), u.ravel(), v.ravel())
            expected = (region.along(d).reshape(u.shape) * weight).sum() / weight.sum()
            assert found[face, row, column] == pytest.approx(expected, abs=6e-4)


def test_texels_inside_have_the_radiance_itself_and_texels_outside_none() -> None:
    disc = Disc((0.2, 0.3, -1.0), 30.0, (1.5, 2.5, 3.5), 0.5)
    cube = Environment.dark().with_disc(disc).cube(64)
    inner, outer = np.degrees(np.arccos(1.0 - np.array(disc.region.depths)))
    angle = np.degrees(np.arccos(np.clip(texel_directions(64) @ disc.direction, -1.0, 1.0)))
    texel = 90.0 / 64.0
    assert (cube[angle < inner - texel] == np.float32([1.5, 2.5, 3.5])).all()
    assert not cube[angle > outer + texel].any()
    assert np.count_nonzero(angle < inner - texel) > 300
    half = cube[np.abs(angle - 30.0) < 0.05, 0]
    np.testing.assert_allclose(half, 0.75, atol=0.02)  # one half at the radius


@pytest.mark.parametrize("place", PLACES)
def test_a_disc_stays_where_it_is(place: tuple[float, float, float]) -> None:
    for radius, resolution in ((0.1, 32), (3.0, 32), (25.0, 100)):
        disc = Disc(place, radius, (1.0, 1.0, 1.0), 0.5)
        flux = Environment.dark().with_disc(disc).cube(resolution)[..., 0] * areas(resolution)
        centroid = (flux[..., None] * texel_directions(resolution)).sum(axis=(0, 1, 2))
        centroid /= np.linalg.norm(centroid)
        off = np.degrees(
            np.arctan2(np.linalg.norm(np.cross(centroid, disc.direction)), centroid @ disc.direction)
        )
        assert off < (0.75 * 90.0 / resolution if radius < 1.0 else 0.1 * 90.0 / resolution)


# ---- Rectangles, and the order of sums ---------------------------------------------------------------------


@pytest.mark.parametrize("place", PLACES)
def test_rectangles_are_tight(place: tuple[float, float, float]) -> None:
    for radius in RADII[:-1]:
        rectangles = Disc(place, radius, (1.0, 2.0, 3.0)).texels(128)
        assert len({face for face, *_ in rectangles}) == len(rectangles)
        for _, _, _, radiance in rectangles:
            assert radiance.dtype == np.float32
            for edge in (radiance[0], radiance[-1], radiance[:, 0], radiance[:, -1]):
                assert edge.any()
        texels = sum(radiance[..., 0].size for *_, radiance in rectangles)
        assert (
            texels < 40 + 5.2 * 4.0 * (np.sin(np.radians(radius)) * 64) ** 2 / np.cos(np.radians(radius)) ** 3
        )


def test_a_cube_is_its_base_plus_the_rectangles_one_after_another(rng: np.random.Generator) -> None:
    """Bit for bit, so that an update of discs alone agrees with a cube made anew."""
    pixels = rng.lognormal(0.0, 1.0, (16, 32, 3)).astype(np.float32)
    discs = [Disc(tuple(rng.normal(size=3)), 20.0, (0.3, 0.7, 1.1), 0.6) for _ in range(5)]
    base = Environment(pixels, "latlong").rotated(12.0).scaled(1.3)
    light = base.with_discs(discs)
    assert light.discs == tuple(discs)
    assert light.same_behind_discs(base)
    by_hand = base.cube(48)
    for disc in discs:
        for face, rows, columns, radiance in disc.texels(48):
            by_hand[face, rows, columns] += radiance
    np.testing.assert_array_equal(light.cube(48), by_hand)
    added = light.with_discs([]).cube(48)
    add_discs(added, discs)
    np.testing.assert_array_equal(added, by_hand)
    np.testing.assert_array_equal(light.with_discs([]).cube(48), base.cube(48))
    assert len(base.with_disc(discs[0]).with_disc(discs[1]).discs) == 2


def test_what_lies_behind_discs_is_compared(rng: np.random.Generator) -> None:
    base = Environment(rng.lognormal(0.0, 1.0, (8, 16, 3)).astype(np.float32), "latlong")
    blend = base.blended(Environment.constant((1.0, 1.0, 1.0)), 0.5)
    cap = Cap((0.0, 1.0, 0.0), 10.0)
    disc = Disc((1.0, 0.0, 0.0), 5.0, (1.0, 1.0, 1.0))
    for light in (base, blend, base.painted(cap, (1.0, 0.0, 0.0))):
        assert light.with_disc(disc).same_behind_discs(light)
        others = (
            light.rotated(1.0), light.scaled(2.0), light.tinted((1.0, 0.5, 1.0)),
            light.painted(cap, (0.0, 1.0, 0.0)), light.blended(base, 0.1),
        )  # fmt: skip
        assert not any(light.same_behind_discs(other) for other in others)
    assert not base.same_behind_discs(Environment(base.pixels.copy(), "latlong"))


# ---- Turning, scaling, looking -----------------------------------------------------------------------------


def test_discs_turn_with_the_environment() -> None:
    disc = Disc((0.2, 0.4, -1.0), 12.0, (1.0, 2.0, 3.0), 0.3)
    light = Environment.dark().with_disc(disc)
    from prelight.lighting.layouts import quarter_turned

    for quarters in (1, 2, 3):
        turned = light.rotated(90.0 * quarters).cube(40)
        np.testing.assert_allclose(turned, quarter_turned(light.cube(40), quarters), rtol=1e-5, atol=1e-7)
    assert light.rotated(30.0).rotated(-30.0).discs[0].direction == pytest.approx(disc.direction)
    ahead = Environment.dark().with_disc(Disc((0.0, 0.0, -1.0), 5.0, (1.0, 1.0, 1.0)))
    assert ahead.rotated(90.0).discs[0].direction == (-1.0, 0.0, 0.0)  # as the map: −Z moves towards −X
    assert Disc.at(90.0, 0.0, radius_deg=1.0, radiance=(1, 1, 1)).direction == pytest.approx((1, 0, 0))
    assert Disc.at(0.0, 90.0, radius_deg=1.0, radiance=(1, 1, 1)).direction == pytest.approx((0, 1, 0))


def test_discs_are_scaled_and_tinted_with_the_environment() -> None:
    light = Environment.constant((1.0, 1.0, 1.0)).with_disc(Disc((1.0, 1.0, 1.0), 9.0, (4.0, 4.0, 4.0)))
    other = light.scaled(2.0).tinted((1.0, 0.5, 0.0))
    assert other.discs[0].radiance == (8.0, 4.0, 0.0)
    np.testing.assert_allclose(other.total, light.total * [2.0, 1.0, 0.0], rtol=1e-12)
    np.testing.assert_allclose(other.cube(9), light.cube(9) * np.float32([2.0, 1.0, 0.0]), rtol=1e-6)


def test_discs_and_paint_are_seen_along_directions() -> None:
    disc = Disc((0.0, 0.0, -1.0), 10.0, (2.0, 3.0, 4.0), 0.5)
    light = Environment.constant((1.0, 1.0, 1.0)).with_disc(disc)
    light = light.painted(Window((80.0, 100.0), (-10.0, 10.0)), (9.0, 0.0, 0.0), opacity=0.5)
    edge = np.radians(10.0)
    d = np.array([(0, 0, -2), (np.sin(edge), 0, -np.cos(edge)), (0, 1, 0), (1, 0, 0), (1, 0.5, 0)])
    expected = [(3, 4, 5), (2, 2.5, 3), (1, 1, 1), (5, 0.5, 0.5), (1, 1, 1)]
    np.testing.assert_allclose(light.radiance_along(d), expected, rtol=1e-5)
    assert np.isfinite(light.radiance_along(np.zeros((1, 3)))).all()


def test_paint_turns_with_the_environment() -> None:
    from prelight.lighting.layouts import quarter_turned

    light = Environment.constant((1.0, 1.0, 1.0)).painted(Cap((0.5, 0.7, -0.2), 20.0, 0.5), (3.0, 0.0, 1.0))
    light = light.painted(Window((10.0, 70.0), (-25.0, 30.0)), (0.0, 2.0, 0.0), opacity=0.5)
    assert np.ptp(light.cube(40)) > 2.0
    for quarters in (1, 2, 3):
        turned = light.rotated(90.0 * quarters).cube(40)
        np.testing.assert_allclose(turned, quarter_turned(light.cube(40), quarters), atol=0.02)


# ---- Painted regions ---------------------------------------------------------------------------------------


def test_a_painted_cap_replaces_or_mixes() -> None:
    grey = Environment.constant((1.0, 1.0, 1.0))
    cap = Cap((0.3, 1.0, 0.2), 25.0, 0.2)
    for opacity in (0.0, 0.25, 1.0):
        light = grey.painted(cap, (3.0, 0.0, 1.0), opacity=opacity)
        change = cap.solid_angle * opacity * np.array([2.0, -1.0, 0.0])
        for resolution in (1, 16, 100):
            np.testing.assert_allclose(energy(light.cube(resolution)), 4.0 * np.pi + change, rtol=1e-6)
        np.testing.assert_allclose(light.total, 4.0 * np.pi + change, rtol=1e-6)
    twice = grey.painted(cap, (5.0, 5.0, 5.0)).painted(cap, (1.0, 1.0, 1.0))
    inner = shares(cap, 32) == 1.0
    assert inner.sum() > 20
    np.testing.assert_allclose(twice.cube(32)[inner], 1.0, rtol=1e-6)  # the later paint lies on top


@pytest.mark.parametrize(
    ("azimuth", "elevation"),
    [((-30.0, 40.0), (10.0, 60.0)), ((170.0, 200.0), (-20.0, 90.0)), ((-180.0, 180.0), (-90.0, 0.0)),
     ((-350.0, 5.0), (-5.0, 5.0)), ((20.0, 20.7), (30.0, 30.5))],
)  # fmt: skip
def test_a_window_has_its_solid_angle_and_place(
    azimuth: tuple[float, float], elevation: tuple[float, float]
) -> None:
    window = Window(azimuth, elevation)
    for resolution in (8, 50, 128):
        share = shares(window, resolution)
        coarse = 90.0 / resolution > elevation[1] - elevation[0]
        solid_angle = (share * areas(resolution)).sum()
        assert solid_angle == pytest.approx(window.solid_angle, rel=0.08 if coarse else 0.02)
    mean = np.einsum("fij,ij,fijk->k", share, areas(128), texel_directions(128))
    turned = np.einsum("fij,ij,fijk->k", shares(window.turned(90.0), 128), areas(128), texel_directions(128))
    np.testing.assert_allclose(turned, [mean[2], mean[1], -mean[0]], atol=0.02 * window.solid_angle)
    middle = 0.5 * (azimuth[0] + azimuth[1])
    across = np.array([np.cos(np.radians(middle)), 0.0, np.sin(np.radians(middle))])
    assert abs(mean @ across) < 0.01 * window.solid_angle  # to the right as much as to the left
    d = Disc.at(middle, 0.5 * sum(elevation), radius_deg=1.0, radiance=(1, 1, 1)).direction
    assert window.along(np.array([d, -np.array(d)]))[0] == 1.0


def test_the_ground_can_be_painted_over() -> None:
    light = Environment.stock("noon").painted(Window((-180.0, 180.0), (-90.0, 0.0)), (0.0, 0.0, 0.0))
    cube = light.cube(32)
    assert not cube[3].any()
    assert not cube[[0, 1, 4, 5], 16:].any()
    np.testing.assert_array_equal(cube[2], Environment.stock("noon").cube(32)[2])


# ---- Blends ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_blends_are_linear(share: float, rng: np.random.Generator) -> None:
    """Each with its own turn, scale, tint, paint and discs; cubes, lookups and totals alike."""
    a = Environment(rng.lognormal(0.0, 1.0, (16, 32, 3)).astype(np.float32), "latlong").rotated(20.0)
    a = a.painted(Cap((1.0, 0.2, 0.0), 30.0), (2.0, 2.0, 9.0), opacity=0.5)
    a = a.with_disc(Disc((0.0, 1.0, 0.3), 4.0, (50.0, 40.0, 30.0)))
    b = Environment(rng.lognormal(0.0, 1.0, (20, 20, 3)).astype(np.float32), "angular").scaled(3.0)
    b = b.tinted((1.0, 0.2, 0.0)).with_disc(Disc((0.0, -1.0, 0.3), 8.0, (5.0, 4.0, 3.0)))
    blend = a.blended(b, share)
    d = rng.normal(size=(500, 3)).astype(np.float32)
    for turn in (0.0, 33.0):
        whole, first, second = (e.rotated(turn).scaled(2.0) for e in (blend, a, b))
        expected = (1.0 - share) * first.cube(24) + share * second.cube(24)
        np.testing.assert_allclose(whole.cube(24), expected, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(whole.total, (1.0 - share) * first.total + share * second.total, rtol=1e-6)
        seen = (1.0 - share) * first.radiance_along(d) + share * second.radiance_along(d)
        np.testing.assert_allclose(whole.radiance_along(d), seen, rtol=1e-5, atol=1e-6)


def test_blends_of_blends_do_not_nest() -> None:
    light = Environment.constant((1.0, 1.0, 1.0))
    for _ in range(6):
        light = light.blended(Environment.constant((2.0, 2.0, 2.0)), 0.5)
    assert len(light.parts) == 7
    assert not any(part.parts for part in light.parts)
    np.testing.assert_allclose(light.cube(2), 2.0 - 0.5**6, rtol=1e-6)


# ---- Refusals ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"direction": (0, 0, 0)}, "points nowhere"), ({"direction": (1, 2)}, "three numbers"),
        ({"direction": (np.nan, 0, 1)}, "finite"), ({"direction": "up"}, "three numbers"),
        ({"radius_deg": 0.0}, "from 0.001 to 90"), ({"radius_deg": 91}, "from 0.001 to 90"),
        ({"radius_deg": None}, "radius: None"), ({"softness": 1.1}, "from 0 to 1"),
        ({"softness": -0.1}, "from 0 to 1"), ({"radiance": (1, -1, 1)}, "of at least 0"),
        ({"radiance": (1, np.inf, 1)}, "of at least 0"), ({"radiance": 5}, "three numbers"),
        ({"radiance": (10**400, 1, 1)}, "of at least 0"),
    ],
)  # fmt: skip
def test_bad_discs_are_refused(change: dict, message: str) -> None:
    good = Disc((0, 1, 0), 3, (1, 1, 1))
    with pytest.raises(InputError, match=message):
        dataclasses.replace(good, **change)


def test_other_bad_values_are_refused() -> None:
    light, disc, cap = Environment.dark(), Disc((0, 1, 0), 3, (1, 1, 1)), Cap((0, 1, 0), 3)
    for share in (-0.1, 1.1, np.nan, "half"):
        with pytest.raises(InputError, match=r"share: .*from 0 to 1"):
            light.blended(light, share)
    with pytest.raises(InputError, match="blend: str, expected an Environment"):
        light.blended("stock:noon", 0.5)
    with pytest.raises(InputError, match="discs: str, expected each a Disc"):
        light.with_discs([disc, "sun"])
    with pytest.raises(InputError, match="radiance above"):
        light.with_disc(dataclasses.replace(disc, radiance=(1e38, 0, 0)))
    with pytest.raises(InputError, match="opacity: 2"):
        light.painted(cap, (1, 1, 1), opacity=2)
    with pytest.raises(InputError, match="region: str"):
        Paint("everything", (1, 1, 1))
    for azimuth, elevation in (((3, 2), (0, 1)), ((0, 1), (0, 91)), ((0,), (0, 1)), ((0, np.nan), (0, 1))):
        with pytest.raises(InputError, match=r"expected (the lower|two|a finite)"):
            Window(azimuth, elevation)
    for resolution in (0, 4097, 2.5):
        with pytest.raises(InputError, match="whole number from 1 to 4096"):
            disc.texels(resolution)

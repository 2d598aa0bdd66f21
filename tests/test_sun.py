"""The sun's place against almanacs, hours of the clock, and the light of sun and sky against published tables."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, date, datetime, timedelta, timezone
from itertools import pairwise

import numpy as np
import pytest

from prelight.bases import cube_map
from prelight.errors import InputError
from prelight.lighting.daylight import LUMENS_PER_WATT, SOLAR_ILLUMINANCE, Daylight
from prelight.lighting.moment import Site, date_of, hours_of_day, moment_of
from prelight.lighting.painting import LUMINANCE
from prelight.lighting.sun_position import equatorial, julian_day, refraction_deg, sun_position

SIBENIK = Site(43.7, 15.9)
DAY_SECONDS = 86_400


def at(hour: float, *, day: int = 172, site: Site = SIBENIK, **air: float) -> Daylight:
    """Daylight at an hour of mean solar time of a day of 2026."""
    when = datetime(2026, 1, 1, tzinfo=site.mean_solar_time) + timedelta(days=day - 1, hours=hour)
    return Daylight(site, when, **air)


def crossing(site: Site, day: date, *, rising: bool) -> datetime:
    """When the sun's upper edge meets the horizon, in universal time."""
    midnight = datetime(day.year, day.month, day.day, tzinfo=site.mean_solar_time)
    low, high = (2 * 3600, 12 * 3600) if rising else (12 * 3600, 22 * 3600)
    for _ in range(24):
        middle = (low + high) / 2
        when = midnight + timedelta(seconds=middle)
        sun = sun_position(when, latitude_deg=site.latitude_deg, longitude_deg=site.longitude_deg)
        is_up = sun.elevation_deg + sun.radius_deg > 0
        low, high = (low, middle) if is_up == rising else (middle, high)
    return (midnight + timedelta(seconds=low)).astimezone(UTC)


def test_the_example_of_nrel() -> None:
    """Reda and Andreas 2008, appendix A.5: azimuth 194.34024°, elevation 39.87205° before refraction."""
    when = datetime(2003, 10, 17, 12, 30, 30, tzinfo=timezone(timedelta(hours=-7)))
    sun = sun_position(when, latitude_deg=39.742476, longitude_deg=-105.1786)
    assert sun.azimuth_deg == pytest.approx(194.34024, abs=0.01)
    assert sun.elevation_deg - refraction_deg(39.87205) == pytest.approx(39.87205, abs=0.005)


def test_the_example_of_meeus() -> None:
    """Astronomical Algorithms, example 25.a: 1992 October 13.0."""
    sun = equatorial(2448908.5)
    assert sun.right_ascension_deg == pytest.approx(198.38083, abs=2e-5)
    assert sun.declination_deg == pytest.approx(-7.78507, abs=2e-5)
    assert sun.distance == pytest.approx(0.99766, abs=1e-5)


@pytest.mark.parametrize(
    ("moment", "ascension", "declination"),
    [((2026, 3, 20, 14, 46), 0, 0), ((2026, 6, 21, 8, 25), 90, 23.436),
     ((2026, 9, 23, 0, 5), 180, 0), ((2026, 12, 21, 20, 50), 270, -23.436)],
)  # fmt: skip
def test_equinoxes_and_solstices_of_the_almanac(moment, ascension: float, declination: float) -> None:
    sun = equatorial(julian_day(datetime(*moment, tzinfo=UTC)))
    assert (sun.right_ascension_deg - ascension + 180) % 360 - 180 == pytest.approx(0, abs=0.02)
    assert sun.declination_deg == pytest.approx(declination, abs=0.01)


@pytest.mark.parametrize(
    ("site", "day", "rises", "sets"),
    [(Site(51.5, -0.13), date(2026, 6, 21), (3, 43), (20, 21)),  # London, in universal time
     (Site(40.71, -74.01), date(2026, 12, 21), (12, 17), (21, 32)),  # New York
     (Site(-33.87, 151.21), date(2026, 12, 21), (18, 41), (9, 5))],
)  # fmt: skip
def test_it_rises_and_sets_when_almanacs_say(site: Site, day: date, rises, sets) -> None:
    for rising, (hour, minute) in ((True, rises), (False, sets)):
        found = crossing(site, day, rising=rising)
        minutes = found.hour * 60 + found.minute + found.second / 60
        assert minutes == pytest.approx(hour * 60 + minute, abs=1.6)


@pytest.mark.parametrize(("day", "minutes"), [((2026, 2, 11), -14.2), ((2026, 11, 3), 16.4)])
def test_the_sundial_is_late_and_early(day, minutes: float) -> None:
    """The equation of time: at Greenwich's mean noon the sun is that far from the south."""
    noon = datetime(*day, 12, tzinfo=UTC) - timedelta(minutes=minutes)
    sun = sun_position(noon, latitude_deg=51.48, longitude_deg=0.0)
    assert sun.azimuth_deg == pytest.approx(180, abs=0.06)


def test_it_stands_in_the_north_below_the_equator() -> None:
    noon = datetime(2026, 6, 21, 12, tzinfo=Site(-40.0, 0.0).mean_solar_time)
    assert sun_position(noon, latitude_deg=-40, longitude_deg=0).azimuth_deg % 360 == pytest.approx(0, abs=1)


def test_summer_time_and_offsets() -> None:
    for text, zone, hour in (("2026-06-21T15:00", "Europe/Zagreb", 13), ("2026-01-21T15:00", "Europe/Zagreb", 14),
                             ("2026-06-21T15:00+02:00", None, 13), ("2026-06-21T15:00Z", None, 15)):  # fmt: skip
        assert moment_of("time", text, place=SIBENIK, zone=zone).astimezone(UTC).hour == hour
    mean = moment_of("time", "2026-06-21T12:00", place=Site(0, 15.0)).astimezone(UTC)
    assert (mean.hour, mean.minute) == (11, 0)
    twice = moment_of("time", "2026-10-25T02:30", place=SIBENIK, zone="Europe/Zagreb")
    assert twice.astimezone(UTC).hour == 0  # the first of two


@pytest.mark.parametrize(
    ("text", "zone", "said"),
    [("2026-03-29T02:30", "Europe/Zagreb", r"does not exist in Europe/Zagreb"),
     ("2026-02-30T12:00", None, r"no time: day"), ("tomorrow", None, r"no time"),
     ("2026-06-21T12:00Z", "Europe/Zagreb", r"offset of its own"), ("1066-10-14T09:00", None, r"1901 to 2099"),
     ("2026-06-21T12:00", "Mars/Olympus", r"^zone: 'Mars/Olympus' is not known"),
     ("2026-06-21T12:00", "../etc/passwd", r"^zone: "), ("2026-06-21T12:00", "Europe", r"^zone: ")],
)  # fmt: skip
def test_times_that_are_none_are_refused(text: str, zone: str | None, said: str) -> None:
    with pytest.raises(InputError, match=said):
        moment_of("time", text, place=SIBENIK, zone=zone)


@pytest.mark.parametrize("text", ["91,0", "43.7", "43.7,181", "north,east", "nan,0", "43.7,15.9,3"])
def test_places_not_on_earth_are_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^--place: "):
        Site.read("--place", text)
    with pytest.raises(InputError, match="no date"):
        date_of("--day", "2026-06-31")


def test_a_day_goes_from_twilight_to_twilight() -> None:
    moments = hours_of_day(date(2026, 6, 21), SIBENIK, steps=9)
    heights = [at(0).at(m).position.elevation_deg for m in moments]
    assert heights[0] == pytest.approx(-6, abs=0.4)
    assert heights[-1] == pytest.approx(-6, abs=0.4)
    steps = {(b - a).total_seconds() for a, b in pairwise(moments)}
    assert max(steps) - min(steps) < 1e-3
    polar = hours_of_day(date(2026, 6, 21), Site(75, 0), steps=3)
    assert (polar[-1] - polar[0]).total_seconds() == DAY_SECONDS
    clock = hours_of_day(date(2026, 6, 21), SIBENIK, steps=2, zone="Europe/Zagreb", between=(5, 21))
    assert [(m.hour, m.utcoffset()) for m in clock] == [(5, timedelta(hours=2)), (21, timedelta(hours=2))]
    spring = hours_of_day(date(2026, 3, 29), SIBENIK, steps=2, zone="Europe/Zagreb", between=(0, 24))
    assert (spring[1] - spring[0].astimezone(UTC)).total_seconds() == 23 * 3600  # a day of 23 hours


# ---- Light ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("hour", [6.5, 8.0, 10.0, 12.0])
def test_illuminance_is_that_of_the_tables(hour: float) -> None:
    """IES 1984, clear sky: the sun 127.5 klx·exp(−0.21 m), the sky 0.8 + 15.5·√sin h klx on level ground.

    These are means of what was measured on clear days, with half and double in between.
    """
    day = at(hour)
    sine = np.sin(np.radians(day.position.elevation_deg))
    sun, sky = day.illuminance
    table = SOLAR_ILLUMINANCE * np.exp(-0.21 / sine) * sine, 800 + 15_500 * np.sqrt(sine)
    assert sun == pytest.approx(table[0], rel=0.08)
    assert sky == pytest.approx(table[1], rel=0.19)
    assert sun + sky == pytest.approx(sum(table), rel=0.035)


def test_twilight_fades_to_exact_night() -> None:
    lux = [at(hour).illuminance[1] for hour in (19.6, 20.0, 20.4, 20.8, 21.2)]
    assert all(a > 2 * b for a, b in pairwise(lux))
    civil = at(20.37)
    assert civil.position.elevation_deg == pytest.approx(-6, abs=0.3)
    assert 1 < civil.illuminance[1] < 10  # 3.4 lx in tables
    night = at(0.0, day=355)
    assert night.is_night
    assert not night.sky.any()
    assert night.sun is None
    assert not night.environment().cube(4).any()


@pytest.mark.parametrize("turbidity", [1.0, 2.0, 4.0, 8.0])
def test_no_more_light_arrives_than_the_sun_sends(turbidity: float) -> None:
    day = at(10.0, turbidity=turbidity, ground=(0.0, 0.0, 0.0))
    sent = SOLAR_ILLUMINANCE / day.position.distance**2 * np.sin(np.radians(day.position.elevation_deg))
    sun, sky = day.illuminance
    assert 0.6 * sent < sun + sky < 0.97 * sent
    assert at(10.0, turbidity=turbidity, ground=(0.8, 0.8, 0.8)).illuminance[1] > 1.05 * sky


def test_haze_takes_from_the_sun_and_gives_to_the_sky() -> None:
    suns, skies = zip(*(at(10.0, turbidity=t).illuminance for t in (1.0, 2.0, 4.0)), strict=True)
    assert suns[0] > suns[1] > suns[2]
    assert skies[0] < skies[1] < skies[2]
    low, high = at(19.3).sunlight, at(12.0).sunlight
    assert low[0] / low[2] > 3 * high[0] / high[2]  # red when low
    zenith = at(8.0).sky[0].mean(axis=0)
    assert zenith[2] > 1.5 * zenith[0]  # blue above


def test_sun_sky_and_ground_are_the_environment_s() -> None:
    day = at(9.0, scale=0.25)
    light = day.environment()
    n = 64
    cube = light.with_discs([]).cube(n).reshape(-1, 3).astype(np.float64)
    weights = np.tile(cube_map.solid_angles(n).ravel(), 6)
    up = cube_map.texel_directions(np.arange(6 * n * n, dtype=np.int32), n)[:, 1]
    sky = LUMENS_PER_WATT * ((weights * np.maximum(up, 0)) @ cube @ LUMINANCE)
    sun = light.discs[0]
    assert sky == pytest.approx(day.illuminance[1], rel=0.01)
    assert sun.total == pytest.approx(day.sunlight, rel=1e-6)
    falls = (weights * np.maximum(up, 0)) @ cube + sun.total * sun.direction[1]
    below = cube[up < -0.3]
    assert below == pytest.approx(np.broadcast_to(0.25 * falls / np.pi, below.shape), rel=0.01)
    assert at(9.0).illuminance[0] == pytest.approx(4 * day.illuminance[0])


def test_the_sky_is_the_same_on_both_sides_of_the_sun() -> None:
    day = at(9.0)
    day = replace(day, north_deg=-day.position.azimuth_deg)  # the sun ahead, in the map's middle
    assert day.azimuth_deg == pytest.approx(0, abs=1e-9)
    assert day.sky == pytest.approx(day.sky[:, ::-1], rel=1e-4)
    x, y, z = day.environment().discs[0].direction
    assert abs(x) < 1e-9
    assert z < 0 < y
    brightest = np.unravel_index(day.sky[..., 1].argmax(), day.sky.shape[:2])
    assert abs(90 - 0.5 - brightest[0] - day.position.elevation_deg) < 3
    assert abs(brightest[1] - 179.5) < 3


def test_morning_and_evening_mirror_each_other() -> None:
    """At the solstice the declination stands still: as long before the sun's noon as after it."""
    noon = min((at(12 + m / 600) for m in range(-100, 200)), key=lambda d: abs(d.position.azimuth_deg - 180))
    before, after = (noon.at(noon.when + timedelta(hours=h)) for h in (-4, 4))
    assert before.position.elevation_deg == pytest.approx(after.position.elevation_deg, abs=0.03)
    assert before.position.azimuth_deg - 180 == pytest.approx(180 - after.position.azimuth_deg, abs=0.05)
    assert before.illuminance == pytest.approx(after.illuminance, rel=2e-3)


def test_north_is_where_it_is_said_to_be() -> None:
    day = at(12.0)
    assert day.environment().discs[0].direction[2] > 0.2  # south is +Z: the sun stands behind
    east_is_ahead = replace(day, north_deg=-90.0)
    assert east_is_ahead.environment().discs[0].direction[0] > 0.2  # and now at the right


def test_the_disc_s_light_is_spread_as_the_sun_s() -> None:
    """Limb darkening 1 − 0.6·(1 − cos): mean r² is 0.45 and mean r⁴ 0.281 of the radius."""
    day = at(12.0)
    sun, radius = day.sun, np.radians(day.position.radius_deg)
    r = (np.arange(200_000) + 0.5) / 200_000 * 1.2
    axis = np.array(sun.direction)
    across = np.cross(axis, (0.0, 1.0, 0.3))
    across /= np.linalg.norm(across)
    d = np.cos(r * radius)[:, None] * axis + np.sin(r * radius)[:, None] * across
    light = sun.region.along(d) * r
    assert (light * r**2).sum() / light.sum() == pytest.approx(0.45, rel=1e-3)
    assert (light * r**4).sum() / light.sum() == pytest.approx(0.28095, rel=1e-3)


@pytest.mark.parametrize(
    ("air", "said"),
    [({"turbidity": 0.5}, "turbidity"), ({"turbidity": 11.0}, "turbidity"), ({"scale": -1.0}, "scale"),
     ({"ground": (2.0, 0.0, 0.0)}, "ground_albedo"), ({"north_deg": float("nan")}, "north_deg")],
)  # fmt: skip
def test_air_that_is_none_is_refused(air: dict, said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}: "):
        at(12.0, **air)

"""Where the sun stands: azimuth, elevation and distance for a place on earth and a moment.

Good to 0.01° from 1901 to 2099; what is near the horizon depends on that day's air more than on the formulas.

References
----------
Meeus, Astronomical Algorithms, 2nd ed. 1998, chapters 12, 13, 16, 22, 25 and 40.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import NamedTuple

FIRST_YEAR, LAST_YEAR = 1901, 2099
MEAN_RADIUS_DEG = 0.26656  # of the sun at a distance of one astronomical unit
_DYNAMICAL_SECONDS = 69.0  # ahead of universal time in our years; the sun moves 0.001° in 90 s
_PARALLAX_DEG = 8.794 / 3600.0


class SunPosition(NamedTuple):
    """As it is seen, with refraction; the middle of the disc."""

    azimuth_deg: float  # from north towards east, 0 to 360
    elevation_deg: float  # above the horizon
    distance: float  # astronomical units

    @property
    def radius_deg(self) -> float:
        """Half the disc's width."""
        return MEAN_RADIUS_DEG / self.distance


class Equatorial(NamedTuple):
    """Where the sun is among the stars: apparent, of the equinox of date."""

    right_ascension_deg: float
    declination_deg: float
    distance: float  # astronomical units


def julian_day(when: datetime) -> float:
    """Days since noon of 1 January 4713 BC, universal time; ``when`` knows its zone."""
    since = when.astimezone(UTC) - datetime(2000, 1, 1, 12, tzinfo=UTC)
    return 2451545.0 + since.total_seconds() / 86400.0


def equatorial(day: float) -> Equatorial:
    """Of a Julian day in dynamical time. [Meeus 25, the method of 0.01°]"""
    T = (day - 2451545.0) / 36525.0
    mean_longitude = 280.46646 + T * (36000.76983 + 0.0003032 * T)
    anomaly = 357.52911 + T * (35999.05029 - 0.0001537 * T)
    M = math.radians(anomaly)
    eccentricity = 0.016708634 - T * (0.000042037 + 0.0000001267 * T)
    centre = (1.914602 - T * (0.004817 + 0.000014 * T)) * math.sin(M)
    centre += (0.019993 - 0.000101 * T) * math.sin(2 * M) + 0.000289 * math.sin(3 * M)
    distance = 1.000001018 * (1 - eccentricity**2) / (1 + eccentricity * math.cos(M + math.radians(centre)))
    node = math.radians(125.04 - 1934.136 * T)
    longitude = math.radians(mean_longitude + centre - 0.00569 - 0.00478 * math.sin(node))
    obliquity = math.radians(_mean_obliquity(T) + 0.00256 * math.cos(node))
    ascension = math.atan2(math.cos(obliquity) * math.sin(longitude), math.cos(longitude))
    declination = math.asin(math.sin(obliquity) * math.sin(longitude))
    return Equatorial(math.degrees(ascension) % 360.0, math.degrees(declination), distance)


def sun_position(when: datetime, *, latitude_deg: float, longitude_deg: float) -> SunPosition:
    """Of the sun as seen from sea level; ``when`` knows its zone, longitudes are positive to the east."""
    day = julian_day(when)
    sun = equatorial(day + _DYNAMICAL_SECONDS / 86400.0)
    hour = math.radians(_sidereal_deg(day) + longitude_deg - sun.right_ascension_deg)
    latitude, declination = math.radians(latitude_deg), math.radians(sun.declination_deg)
    north = math.sin(declination) * math.cos(latitude)
    north -= math.cos(declination) * math.sin(latitude) * math.cos(hour)
    east = -math.cos(declination) * math.sin(hour)
    up = math.sin(declination) * math.sin(latitude)
    up += math.cos(declination) * math.cos(latitude) * math.cos(hour)
    elevation = math.degrees(math.atan2(up, math.hypot(north, east)))
    elevation -= _PARALLAX_DEG / sun.distance * math.cos(math.radians(elevation))
    azimuth = math.degrees(math.atan2(east, north)) % 360.0
    return SunPosition(azimuth, elevation + refraction_deg(elevation), sun.distance)


def refraction_deg(elevation_deg: float) -> float:
    """How much higher something appears that stands at this elevation without air; 1010 hPa, 10 °C. [Meeus 16.4]

    Below −1° nothing is seen whose refraction could be told: it falls to zero there at −5°.
    """
    h = max(elevation_deg, -1.0)
    minutes = 1.02 / math.tan(math.radians(h + 10.3 / (h + 5.11))) + 0.0019279
    fading = min(1.0, max(0.0, (elevation_deg + 5.0) / 4.0))
    return max(minutes, 0.0) / 60.0 * fading


def _mean_obliquity(T: float) -> float:
    return 23.0 + (26.0 + (21.448 - T * (46.8150 + T * (0.00059 - 0.001813 * T))) / 60.0) / 60.0


def _sidereal_deg(day: float) -> float:
    """Apparent sidereal time at Greenwich, degrees. [Meeus 12.4, with the nutation's largest term]"""
    T = (day - 2451545.0) / 36525.0
    mean = 280.46061837 + 360.98564736629 * (day - 2451545.0) + T * T * (0.000387933 - T / 38710000.0)
    node = math.radians(125.04 - 1934.136 * T)
    equinoxes = -0.00478 * math.sin(node) * math.cos(math.radians(_mean_obliquity(T)))
    return (mean + equinoxes) % 360.0

"""A place on earth, and moments of a day there: offsets from universal time, zones with their summer time, or the sun's
own mean time."""

from __future__ import annotations

import zoneinfo
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta, timezone, tzinfo

import numpy as np

from ..errors import InputError
from . import quantities
from .sun_position import FIRST_YEAR, LAST_YEAR, sun_position

TWILIGHT_DEG = -6.0  # civil: where a day of pictures begins and ends
_SCAN_MINUTES = 2


@dataclass(frozen=True)
class Site:
    """Degrees: north and east are positive. Raises InputError for what is not on earth."""

    latitude_deg: float
    longitude_deg: float

    def __post_init__(self) -> None:
        for name, value, most in (
            ("latitude", self.latitude_deg, 90.0),
            ("longitude", self.longitude_deg, 180.0),
        ):
            object.__setattr__(self, f"{name}_deg", quantities.amount(name, value, least=-most, most=most))

    @classmethod
    def read(cls, name: str, value: str | Sequence[float]) -> Site:
        """``43.7,15.9`` or two numbers: latitude, longitude. Raises InputError."""
        parts = value.split(",") if isinstance(value, str) else list(value)
        if len(parts) != 2:
            raise InputError(name, f"{value!r}, expected latitude and longitude such as 43.7,15.9")
        try:
            return cls(float(parts[0]), float(parts[1]))
        except ValueError as error:
            reason = f"{error.path} {error.reason}" if isinstance(error, InputError) else "not two numbers"
            which = "latitude first, north positive; longitude east positive"
            raise InputError(name, f"{value!r}: {reason}; {which}") from None

    @property
    def mean_solar_time(self) -> tzinfo:
        """The zone in which the sun is highest at noon, on a yearly mean; to the second."""
        offset = timedelta(seconds=round(240.0 * self.longitude_deg))
        sign, minutes = ("+" if self.longitude_deg >= 0 else "-"), abs(offset) // timedelta(minutes=1)
        return timezone(offset, f"mean solar time, UTC{sign}{minutes // 60:02}:{minutes % 60:02}")


def zone_named(name: str) -> tzinfo:
    """A zone with its summer time, such as Europe/Zagreb; raises InputError."""
    try:
        return zoneinfo.ZoneInfo(name)
    except (LookupError, ValueError, OSError):
        known = "expected a name such as Europe/Zagreb or UTC"
        if not zoneinfo.available_timezones():
            known = "this system has no time zones (its package tzdata); give an offset such as +02:00"
        raise InputError("zone", f"{name[:60]!r} is not known; {known}") from None


def date_of(name: str, text: str) -> date:
    """``2026-06-21``; raises InputError for what no calendar has."""
    try:
        day = date.fromisoformat(text)
    except ValueError as error:
        raise InputError(
            name, f"{text[:40]!r} is no date: {error}; expected one such as 2026-06-21"
        ) from None
    _check_year(name, day.year)
    return day


def moment_of(name: str, text: str, *, place: Site, zone: str | None = None) -> datetime:
    """``2026-06-21T15:00``, with an offset (``+02:00``, ``Z``), of a zone, or in mean solar time if neither is given.

    Raises InputError for what is no time, for two zones at once, and for an hour that summer time leaves out. Of an
    hour that comes twice it is the first.
    """
    try:
        when = datetime.fromisoformat(text)
    except ValueError as error:
        expected = "expected one such as 2026-06-21T15:00 or 2026-06-21T15:00+02:00"
        raise InputError(name, f"{text[:40]!r} is no time: {error}; {expected}") from None
    _check_year(name, when.year)
    if when.tzinfo is not None:
        if zone is not None:
            raise InputError(name, f"{text[:40]!r} has an offset of its own; leave it or the zone out")
        return when
    where = place.mean_solar_time if zone is None else zone_named(zone)
    local = when.replace(tzinfo=where)
    back = local.astimezone(UTC).astimezone(where)
    if back.replace(tzinfo=None, fold=0) != when:
        raise InputError(name, f"{text[:40]} does not exist in {zone}: clocks are put forward then")
    return local


def hours_of_day(
    day: date,
    place: Site,
    *,
    steps: int,
    zone: str | None = None,
    between: tuple[float, float] | None = None,
) -> list[datetime]:
    """``steps`` moments at even distances through a day, the first and last at its ends.

    From the beginning of civil twilight to its end, where the sun rises and sets on that day; else all 24 hours; or
    ``between`` two hours of the clock.
    """
    where = place.mean_solar_time if zone is None else zone_named(zone)
    midnight = datetime(day.year, day.month, day.day, tzinfo=where)
    start = midnight.astimezone(UTC)
    if between is not None:
        first, last = (
            (midnight.replace(tzinfo=None) + timedelta(hours=hour)).replace(tzinfo=where) for hour in between
        )
    else:
        minutes = range(0, 24 * 60 + 1, _SCAN_MINUTES)
        up = [is_day(start + timedelta(minutes=m), place) for m in minutes]
        first, last = start, start + timedelta(days=1)
        if any(up) and not all(up) and not (up[0] and up[-1]):
            first = start + timedelta(minutes=minutes[up.index(True)])
            last = start + timedelta(minutes=minutes[len(up) - 1 - up[::-1].index(True)])
    shares = np.linspace(0.0, 1.0, steps) if steps > 1 else [0.5]
    span = last.astimezone(UTC) - first.astimezone(UTC)
    begin = first.astimezone(UTC)
    return [(begin + float(share) * span).astimezone(where) for share in shares]


def is_day(when: datetime, place: Site) -> bool:
    """Whether the sun is up, or no deeper than civil twilight."""
    sun = sun_position(when, latitude_deg=place.latitude_deg, longitude_deg=place.longitude_deg)
    return sun.elevation_deg > TWILIGHT_DEG


def _check_year(name: str, year: int) -> None:
    if not FIRST_YEAR <= year <= LAST_YEAR:
        raise InputError(
            name, f"the year {year}; where the sun stands is known from {FIRST_YEAR} to {LAST_YEAR}"
        )

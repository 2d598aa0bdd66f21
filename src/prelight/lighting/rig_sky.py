"""The table [sun] of a rig: a place on earth, a moment there, and the air."""

from __future__ import annotations

from datetime import date, datetime, time
from typing import Annotated

from pydantic import Field, field_validator

from ..errors import InputError
from .daylight import HIGHEST_TURBIDITY, LOWEST_TURBIDITY, Daylight
from .moment import Site, moment_of
from .rig_fields import Number, Positive, Share, Table, Text

Latitude = Annotated[Number, Field(ge=-90, le=90)]
Longitude = Annotated[Number, Field(ge=-180, le=180)]
Turbidity = Annotated[Number, Field(ge=LOWEST_TURBIDITY, le=HIGHEST_TURBIDITY)]


class SunTable(Table):
    """The sun and the clear sky of a place and an hour."""

    place: tuple[Latitude, Longitude]
    time: Text
    zone: Text | None = None
    turbidity: Turbidity = 2.0
    ground_albedo: tuple[Share, Share, Share] = (0.25, 0.25, 0.25)
    north_deg: Annotated[Number, Field(ge=-360, le=360)] = 0.0
    scale: Positive = 1.0

    @field_validator("ground_albedo", mode="before")
    @classmethod
    def _one_for_all(cls, value: object) -> object:
        return [value] * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value

    @field_validator("time", mode="before")
    @classmethod
    def _as_written(cls, value: object) -> object:
        """TOML has times of its own: without quotes they come as such."""
        return value.isoformat() if isinstance(value, date | datetime | time) else value


def daylight_of(table: SunTable, path: object) -> Daylight:
    """What a table says; raises InputError, with its JSON pointer."""
    try:
        place = Site(*table.place)
        when = moment_of("time", table.time, place=place, zone=table.zone)
    except InputError as error:
        raise InputError(path, error.reason, f"/sun/{error.path}") from None
    return Daylight(
        place,
        when,
        turbidity=table.turbidity,
        ground=table.ground_albedo,
        north_deg=table.north_deg,
        scale=table.scale,
    )

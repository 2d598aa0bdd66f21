"""What may stand in a rig file: its tables and keys, and one line for whatever is wrong in it."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field, ValidationError, field_validator, model_validator

from ..errors import InputError
from .layouts import PICTURE_LAYOUTS
from .rig_fields import (
    Azimuth,
    Colour,
    Elevation,
    Number,
    PlacedTable,
    Positive,
    Radius,
    Share,
    Table,
    Text,
)
from .rig_lights import PanelKey, PanelTable, SpotKey, SpotTable
from .rig_outside import ObjectTable, OutsideTable, PathKey, PathTable
from .rig_placed import (
    LAYERED,
    PLACED,
    AnyPanel,
    AnySpot,
    LampKey,
    LampTable,
    PlacedPanelKey,
    PlacedPanelTable,
    PlacedSpotKey,
    PlacedSpotTable,
)
from .rig_portals import PortalTable
from .rig_sky import SunTable

_MOST_DISCS, _MOST_PAINTS, _MOST_LIGHTS = 1_000, 100, 1_000


class MapTable(Table):
    """A map of radiance, turned, scaled and tinted."""

    map: Text
    layout: Text | None = None
    rotate_deg: Number = 0.0
    scale: Positive = 1.0
    tint: Colour = (1.0, 1.0, 1.0)

    @field_validator("map")
    @classmethod
    def _can_be_a_name(cls, value: str) -> str:
        if "\x00" in value:
            raise ValueError("the map's name has a NUL character")
        return value

    @field_validator("layout")
    @classmethod
    def _is_known(cls, value: str | None) -> str | None:
        if value is not None and value not in PICTURE_LAYOUTS:
            raise ValueError(f"layout {value!r} is not known; known are {', '.join(PICTURE_LAYOUTS)}")
        return value


class BlendTable(MapTable):
    """Another map, of which there is a share."""

    share: Share


class EnvironmentTable(MapTable):
    """The map around the scene."""

    blend: BlendTable | None = None


class DiscTable(PlacedTable):
    """A disc light; ``name`` is for people."""

    name: Text | None = None
    radius_deg: Radius
    radiance: Colour
    softness: Share = 0.0

    @model_validator(mode="after")
    def _check(self) -> DiscTable:
        self.check_direction()
        return self


class PaintTable(PlacedTable):
    """A round region, or ranges of azimuth and elevation, mixed with a colour."""

    name: Text | None = None
    radius_deg: Radius | None = None
    softness: Share | None = None
    azimuth_range_deg: tuple[Azimuth, Azimuth] | None = None
    elevation_range_deg: tuple[Elevation, Elevation] | None = None
    radiance: Colour
    opacity: Share = 1.0

    @model_validator(mode="after")
    def _check(self) -> PaintTable:
        ranges = (self.azimuth_range_deg, self.elevation_range_deg)
        if ranges == (None, None):
            self.check_direction()
            if self.radius_deg is None:
                raise ValueError("expected radius_deg, or azimuth_range_deg and elevation_range_deg")
            return self
        if any(
            v is not None for v in (self.direction, self.azimuth_deg, self.elevation_deg, self.radius_deg)
        ):
            raise ValueError("expected either a direction and radius_deg, or ranges of angles, not both")
        if self.softness is not None:
            raise ValueError("softness is of round regions; ranges have hard edges")
        if not all(limits is None or limits[0] < limits[1] for limits in ranges):
            raise ValueError("expected ranges as [from, to], the lower number first")
        return self


class RigTables(Table):
    """All of a rig file."""

    environment: EnvironmentTable | None = None
    sun: SunTable | None = None
    outside: OutsideTable | None = None
    disc: list[DiscTable] = Field(default_factory=list, max_length=_MOST_DISCS)
    paint: list[PaintTable] = Field(default_factory=list, max_length=_MOST_PAINTS)
    lamp: list[LampTable] = Field(default_factory=list, max_length=_MOST_LIGHTS)
    spot: list[AnySpot] = Field(default_factory=list, max_length=_MOST_LIGHTS)
    panel: list[AnyPanel] = Field(default_factory=list, max_length=_MOST_LIGHTS)
    portal: list[PortalTable] = Field(default_factory=list, max_length=_MOST_LIGHTS)

    @model_validator(mode="after")
    def _has_light(self) -> RigTables:
        lights = (self.disc, self.paint, self.lamp, self.spot, self.panel)
        if self.environment is not None and self.sun is not None:
            raise ValueError("[sun] has a sky of its own; leave out either it or [environment]")
        if self.environment is None and self.sun is None and not any(lights):
            raise ValueError(
                "no light: expected a table [environment] with map, [sun], [[disc]], [[lamp]], [[spot]] or [[panel]]"
            )
        return self


_KNOWN: dict[tuple[str, ...], type[BaseModel]] = {
    (): RigTables,
    ("environment",): EnvironmentTable,
    ("environment", "blend"): BlendTable,
    ("sun",): SunTable,
    ("outside",): OutsideTable,
    ("outside", "object"): ObjectTable,
    ("outside", "object", "keys"): PathKey,
    ("outside", "room"): PathTable,
    ("outside", "room", "keys"): PathKey,
    ("disc",): DiscTable,
    ("paint",): PaintTable,
    ("lamp",): LampTable,
    ("lamp", "keys"): LampKey,
    ("spot", LAYERED): SpotTable,
    ("spot", LAYERED, "keys"): SpotKey,
    ("spot", PLACED): PlacedSpotTable,
    ("spot", PLACED, "keys"): PlacedSpotKey,
    ("panel", LAYERED): PanelTable,
    ("panel", LAYERED, "keys"): PanelKey,
    ("panel", PLACED): PlacedPanelTable,
    ("panel", PLACED, "keys"): PlacedPanelKey,
    ("portal",): PortalTable,
}


def known_tables() -> tuple[type[BaseModel], ...]:
    """Every kind of table that a rig may have, itself first."""
    return tuple(dict.fromkeys(_KNOWN.values()))


_IN_WORDS = {
    "tuple_type": "expected numbers in brackets such as [1.0, 0.9, 0.8]",
    "too_long": "too many of them",
    "too_short": "too few of them",
    "list_type": "expected tables in double brackets, such as [[disc]]",
    "model_type": "expected a table",
    "float_type": "expected a number",
    "string_type": "expected a text in quotes",
    "finite_number": "expected a finite number",
}


def checked_tables(document: dict[str, Any], path: object) -> RigTables:
    """The tables of a rig; raises InputError for the first thing wrong, with its JSON pointer."""
    try:
        return RigTables.model_validate(document)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
    place = first["loc"]
    if first["type"] == "missing" and isinstance(place[-1], int):  # a number in brackets
        place, reason = (
            place[:-1],
            "too few numbers, expected three for a colour or direction, two for a range or a place",
        )
    else:
        reason = _reason(first, place)
    pointer = "/" + "/".join(str(part) for part in place if part not in (LAYERED, PLACED))
    raise InputError(path, reason, pointer) from None


def _reason(error: Any, place: tuple[int | str, ...]) -> str:
    kind = error["type"]
    if kind == "extra_forbidden":
        known = _KNOWN[tuple(part for part in place[:-1] if isinstance(part, str))]
        names = [name for name in known.model_fields if name not in getattr(known, "unused", ())]
        return f"{str(place[-1])[:60]!r} is not known here; known are {', '.join(names)}"
    if kind == "missing":
        return f"{place[-1]} is missing"
    if kind == "value_error":
        return error["msg"].removeprefix("Value error, ")
    given = f"{error['input']!r}"[:60] if isinstance(error["input"], str | int | float) else ""
    said = "expected" if kind == "literal_error" else "expected a number"
    reason = _IN_WORDS.get(kind) or error["msg"].lower().replace("input should be", said)
    return f"{given}, {reason}" if given else reason

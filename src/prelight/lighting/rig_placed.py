"""The tables [[lamp]], and [[spot]] and [[panel]] with a place in the scene: read, and made into lights.

A [[spot]] with ``position`` and a [[panel]] with ``size`` stand in the scene; without these they belong to a layer that
has a place for them (``rig_lights``).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Discriminator, Field, Tag, model_validator

from ..errors import InputError
from .colour_temperature import COOLEST, HOTTEST, of_kelvin
from .distributions import Distribution
from .ies import LUMENS_PER_WATT, Photometry
from .keyframes import Track
from .placed_lights import LARGEST_RADIUS, LARGEST_SIDE, RADIUS, Lamp, PlacedPanel
from .quantities import Triple
from .rig_fields import Colour, Direction, Number, Positive
from .rig_lights import BeamKey, BeamTable, PanelTable, SpotTable, beam_of, track_of

Radius = Annotated[Number, Field(ge=0, le=LARGEST_RADIUS)]
Side = Annotated[Number, Field(ge=1e-4, le=LARGEST_SIDE)]
Size = Annotated[list[Side], Field(min_length=2, max_length=2)]
Kelvin = Annotated[Number, Field(ge=COOLEST, le=HOTTEST)]
PLACED, LAYERED = "(placed)", "(layered)"  # tags of tables; in no message
_MOST_KEYS = 1_000
_SHAPES = ("power", "width_deg", "polynomial", "ies", "picture")
_DOWN = (0.0, -1.0, 0.0)


class LampKey(BeamKey):
    """A lamp at a time; what is left out stays as before."""

    position: Direction | None = None
    radius: Radius | None = None
    intensity: Colour | None = None
    power_w: Positive | None = None
    lumens: Positive | None = None
    color: Colour | None = None
    kelvin: Kelvin | None = None


class PlacedSpotKey(BeamKey):
    """A spot at a time; what is left out stays as before."""

    position: Direction | None = None
    radius: Radius | None = None
    intensity: Colour | None = None


class PlacedPanelKey(BeamKey):
    """A panel at a time; what is left out stays as before."""

    position: Direction | None = None
    size: Size | None = None
    radiance: Colour | None = None
    power_w: Positive | None = None
    lumens: Positive | None = None
    color: Colour | None = None
    kelvin: Kelvin | None = None


class _PlacedTable(BeamTable):
    """What stands in the scene. ``color`` and ``kelvin`` are of lights whose strength is one number."""

    position: Direction
    power_w: Positive | None = None
    lumens: Positive | None = None
    color: Colour | None = None
    kelvin: Kelvin | None = None
    scale: Positive = 1.0

    def check_place(self, strength: str, others: str = ", power_w or lumens") -> None:
        """Raises ValueError unless there is one strength and no layer; ``strength`` is the key of three numbers."""
        if self.layer is not None:
            raise ValueError("has a position in the scene: leave layer out, it is for baked lamps")
        given = [name for name in (strength, "power_w", "lumens", "ies") if getattr(self, name) is not None]
        if given[1:] and given[1:] != ["ies"]:
            raise ValueError(f"expected one of {' and '.join(given)}: each says how strong it is")
        if not given:
            raise ValueError(f"no strength: expected {strength} (red, green, blue){others}")
        if self.color is not None and self.kelvin is not None:
            raise ValueError("expected color or kelvin, not both")
        if strength in given and (self.color is not None or self.kelvin is not None):
            raise ValueError(f"color and kelvin belong to power_w, lumens or ies; {strength} has a colour")

    @property
    def tint(self) -> Triple:
        """What its colour multiplies."""
        return of_kelvin(self.kelvin) if self.kelvin is not None else self.color or (1.0, 1.0, 1.0)

    def of_power(self, steradians: float) -> Triple | None:
        """Its strength for each colour, if it is said as power; ``steradians``: its power by unit strength."""
        watts = self.power_w
        if self.lumens is not None:
            watts = self.lumens / LUMENS_PER_WATT
        return None if watts is None else _times(self.tint, watts * self.scale / steradians)


class LampTable(_PlacedTable):
    """A lamp that shines all around, or as its IES file says."""

    unused: ClassVar[frozenset[str]] = frozenset({"layer", "spread_deg", *_SHAPES} - {"ies"})
    radius: Radius = RADIUS
    intensity: Colour | None = None
    keys: list[LampKey] = Field(default_factory=list, max_length=_MOST_KEYS)

    @model_validator(mode="after")
    def _check(self) -> LampTable:
        if any(getattr(self, name) is not None for name in (*_SHAPES, "spread_deg") if name != "ies"):
            raise ValueError("a lamp shines all around or has an ies; a beam is a [[spot]] with position")
        if self.ies is None and (self.has_direction or self.target is not None):
            raise ValueError("a lamp without an ies shines all around: leave its direction out")
        if self.has_direction or self.target is not None:
            self.check_beam()
        self.check_place("intensity")
        return self


class PlacedSpotTable(_PlacedTable):
    """A spot with a place in the scene."""

    unused: ClassVar[frozenset[str]] = frozenset({"layer", "power_w", "lumens"})
    radius: Radius = RADIUS
    intensity: Colour | None = None
    keys: list[PlacedSpotKey] = Field(default_factory=list, max_length=_MOST_KEYS)

    @model_validator(mode="after")
    def _check(self) -> PlacedSpotTable:
        self.check_beam()
        self.check_place("intensity", " or ies")
        if self.power_w is not None or self.lumens is not None:
            raise ValueError("power_w and lumens are of lamps and panels; of a spot intensity, or its ies")
        if not any(getattr(self, name) is not None for name in _SHAPES):
            raise ValueError(f"no shape: expected one of {', '.join(_SHAPES)}")
        return self


class PlacedPanelTable(_PlacedTable):
    """A rectangle with a place in the scene."""

    unused: ClassVar[frozenset[str]] = frozenset({"layer", "spread_deg", *_SHAPES})
    size: Size
    radiance: Colour | None = None
    keys: list[PlacedPanelKey] = Field(default_factory=list, max_length=_MOST_KEYS)

    @model_validator(mode="after")
    def _check(self) -> PlacedPanelTable:
        if any(getattr(self, name) is not None for name in (*_SHAPES, "spread_deg")):
            raise ValueError("a panel with size shines evenly: a shape is for spots")
        self.check_beam()
        self.check_place("radiance")
        return self


def _kind(sign: str) -> Any:
    """Which of two kinds a table is, by a key that only the placed ones have."""

    def kind(value: Any) -> str:
        is_table = isinstance(value, dict)
        placed = sign in value if is_table else isinstance(value, _PlacedTable)
        return PLACED if placed else LAYERED

    return Discriminator(kind)


AnySpot = Annotated[
    Annotated[SpotTable, Tag(LAYERED)] | Annotated[PlacedSpotTable, Tag(PLACED)], _kind("position")
]
AnyPanel = Annotated[
    Annotated[PanelTable, Tag(LAYERED)] | Annotated[PlacedPanelTable, Tag(PLACED)], _kind("size")
]
PlacedTable = LampTable | PlacedSpotTable | PlacedPanelTable


def placed_track(table: PlacedTable, folder: Path) -> Track:
    """The light of a table, at 0 as the table has it and then as its keys say. Raises InputError."""
    return track_of(table, folder, made=_made)


def _made(table: PlacedTable, distribution: Distribution | None) -> Lamp | PlacedPanel:
    if isinstance(table, PlacedPanelTable):
        width, height = table.size
        strength = table.of_power(math.pi * width * height)
        if strength is None:
            strength = _times(table.radiance or (1.0, 1.0, 1.0), table.scale)
        return PlacedPanel(table.position, (width, height), beam_of(table, None, strength), table.name)
    steradians = 4.0 * math.pi
    if isinstance(distribution, Photometry):
        peak, flux = distribution.watts
        steradians = flux / max(peak, 1e-300)
    strength = table.of_power(max(steradians, 1e-300))
    if strength is None:
        strength = _times(_intensity(table, distribution), table.scale)
    if table.target is None and not table.has_direction:
        table = table.model_copy(update={"direction": _DOWN})
    return Lamp(table.position, beam_of(table, distribution, strength), table.radius, table.name)


def _intensity(table: LampTable | PlacedSpotTable, distribution: Distribution | None) -> Triple:
    if table.intensity is not None:
        return table.intensity
    if not isinstance(distribution, Photometry):  # the tables see to it
        raise InputError("intensity", "is missing: red, green, blue in W/sr")
    return _times(table.tint, distribution.watts[0])


def _times(colour: Triple, factor: float) -> Triple:
    red, green, blue = colour
    return red * factor, green * factor, blue * factor

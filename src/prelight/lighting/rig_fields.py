"""Kinds of values that stand in a rig file, and what its tables have in common."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import BaseModel, ConfigDict, Field

from .regions import LARGEST_RADIUS_DEG, SMALLEST_RADIUS_DEG

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Text = Annotated[str, Field(strict=True)]
Positive = Annotated[Number, Field(ge=0)]
Share = Annotated[Number, Field(ge=0, le=1)]
Radius = Annotated[Number, Field(ge=SMALLEST_RADIUS_DEG, le=LARGEST_RADIUS_DEG)]
Azimuth = Annotated[Number, Field(ge=-360, le=360)]
Elevation = Annotated[Number, Field(ge=-90, le=90)]
Colour = tuple[Positive, Positive, Positive]
Direction = tuple[Number, Number, Number]


class Table(BaseModel):
    """A table whose keys are all known."""

    model_config = ConfigDict(extra="forbid")
    unused: ClassVar[frozenset[str]] = frozenset()  # keys that it has from its kind and does not take


class PlacedTable(Table):
    """A table with a direction, as three numbers or as two angles."""

    direction: Direction | None = None
    azimuth_deg: Azimuth | None = None
    elevation_deg: Elevation | None = None

    @property
    def has_direction(self) -> bool:
        """Whether anything is said of a direction."""
        return any(v is not None for v in (self.direction, self.azimuth_deg, self.elevation_deg))

    def check_direction(self) -> None:
        """Raises ValueError unless there is one direction, and said in one way."""
        angles = (self.azimuth_deg is not None, self.elevation_deg is not None)
        if any(angles) if self.direction is not None else not all(angles):
            raise ValueError("expected either direction, or both azimuth_deg and elevation_deg")
        if self.direction is not None and not any(self.direction):
            raise ValueError("direction [0, 0, 0] points nowhere; expected x, y, z")

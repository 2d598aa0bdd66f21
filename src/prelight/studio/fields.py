"""Kinds of values that stand in a message, and their limits."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StringConstraints

from ..lighting.placed_lights import FARTHEST, LARGEST_SIDE
from ..lighting.regions import LARGEST_RADIUS_DEG, SMALLEST_RADIUS_DEG

LARGEST_SCALE, LARGEST_TINT, LARGEST_RADIANCE = 1e6, 1e3, 1e7
MOST_DABS = 96  # round regions of paint, of all strokes together; a rig file has at most 100
LONGEST = 3600.0  # seconds, of a timeline and of a world that moves

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Turn = Annotated[Number, Field(ge=-1e6, le=1e6)]
Scale = Annotated[Number, Field(ge=0, le=LARGEST_SCALE)]
Tint = Annotated[Number, Field(ge=0, le=LARGEST_TINT)]
Radiance = Annotated[Number, Field(ge=0, le=LARGEST_RADIANCE)]
Azimuth = Annotated[Number, Field(ge=-360, le=360)]
Elevation = Annotated[Number, Field(ge=-90, le=90)]
Radius = Annotated[Number, Field(ge=SMALLEST_RADIUS_DEG, le=LARGEST_RADIUS_DEG)]
Share = Annotated[Number, Field(ge=0, le=1)]
Whole = Annotated[int, Field(strict=True, ge=0, lt=2**32)]
Flag = Annotated[bool, Field(strict=True)]
DiscId = Annotated[str, StringConstraints(strict=True, pattern=r"^[A-Za-z0-9_-]{1,16}$")]
Name = Annotated[str, StringConstraints(strict=True, min_length=1, max_length=300)]
Title = Annotated[
    str, StringConstraints(strict=True, min_length=1, max_length=60, pattern=r"^[^\x00-\x1f\x7f]+$")
]
Metres = Annotated[Number, Field(ge=-FARTHEST, le=FARTHEST)]
Seconds = Annotated[Number, Field(ge=0, le=LONGEST)]
Side = Annotated[Number, Field(ge=1e-3, le=LARGEST_SIDE)]
Strength = Annotated[Number, Field(ge=0, le=1e9)]

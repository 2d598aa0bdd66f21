"""What the messages between the studio and its page are made of: lights, glass, cameras, keyframes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field, StringConstraints

from ..lighting.daylight import HIGHEST_TURBIDITY, LOWEST_TURBIDITY
from ..lighting.glass import LARGEST_FROST_DEG
from ..lighting.placed_lights import LARGEST_RADIUS
from .fields import (
    MOST_DABS,
    Azimuth,
    DiscId,
    Elevation,
    Flag,
    Metres,
    Name,
    Number,
    Radiance,
    Radius,
    Seconds,
    Share,
    Side,
    Strength,
    Tint,
    Title,
)


@dataclass(frozen=True)
class LampLight:
    """A light with a place in the scene. ``strength``: lumens of a lamp and a panel, candela along the beam of a spot.

    ``dim`` is its share that is lit. A spot's ``beam_deg`` is its half intensity's whole width; a lamp has no target.
    ``layer``: the steerable layer that it belongs to; then a spot's place is the layer's own, and a panel's
    ``position`` and ``size`` are parts of the layer's panel, its ``strength`` cd/m².
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    id: DiscId
    name: Title
    kind: Literal["lamp", "spot", "panel"]
    on: Flag
    position: tuple[Metres, Metres, Metres]
    target: tuple[Metres, Metres, Metres]
    strength: Strength
    dim: Share
    color: tuple[Tint, Tint, Tint]
    radius: Annotated[Number, Field(ge=0, le=LARGEST_RADIUS)]
    beam_deg: Annotated[Number, Field(ge=2, le=160)]
    size: tuple[Side, Side]
    layer: Name | None = None


@dataclass(frozen=True)
class Sun:
    """Where and when it is, for the environment "daylight": hours of the zone's clock, without one mean solar time."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    latitude_deg: Annotated[Number, Field(ge=-90, le=90)]
    longitude_deg: Annotated[Number, Field(ge=-180, le=180)]
    date: Annotated[str, StringConstraints(strict=True, pattern=r"^[0-9]{4}-[0-9]{2}-[0-9]{2}$")]
    hour: Annotated[Number, Field(ge=0, lt=24)]
    zone: Annotated[str, StringConstraints(strict=True, pattern=r"^[A-Za-z0-9_+/-]{1,60}$")] | None
    turbidity: Annotated[Number, Field(ge=LOWEST_TURBIDITY, le=HIGHEST_TURBIDITY)]


@dataclass(frozen=True)
class PortalGlass:
    """The glass of a portal: ``tint`` is what it lets through, null as built; ``blind`` the share that is covered.

    ``frost_deg`` is by how much frosted glass turns light.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    portal: Name
    kind: Literal["clear", "frosted", "shut"]
    tint: tuple[Share, Share, Share] | None
    frost_deg: Annotated[Number, Field(ge=0, le=LARGEST_FROST_DEG)]
    blind: Share


@dataclass(frozen=True)
class CameraView:
    """An eye to look with; the first of a list is the one to begin with."""

    name: str
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    up: tuple[float, float, float]
    vertical_fov_deg: float


@dataclass(frozen=True)
class PortalView:
    """A portal, and what its glass lets through as built."""

    name: str
    tint: tuple[float, float, float]


@dataclass(frozen=True)
class EnvironmentChoice:
    """A map to choose: what a message calls it, and what it is in one line."""

    id: str
    title: str


@dataclass(frozen=True)
class DiscLight:
    """A disc light as it is."""

    id: str
    azimuth_deg: float
    elevation_deg: float
    radius_deg: float
    radiance: tuple[float, float, float]
    softness: float


@dataclass(frozen=True)
class PaintStroke:
    """A stroke of paint on the environment: round regions, one after another, mixed with a colour.

    ``points``: azimuth and elevation of each; all have the same radius, edge, radiance and opacity.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    id: DiscId
    radius_deg: Radius
    radiance: tuple[Radiance, Radiance, Radiance]
    softness: Share
    opacity: Share
    points: Annotated[tuple[tuple[Azimuth, Elevation], ...], Field(min_length=1, max_length=MOST_DABS)]


@dataclass(frozen=True)
class LayerPace:
    """What a layer did for the last frame: how ("full", "local", "gain", …), and how long it took."""

    name: str
    kind: str
    how: str
    ms: float


@dataclass(frozen=True)
class SteeredPlace:
    """A steerable layer: what lights may stand in it, and where it is.

    ``kind``: a spot or a sky takes spots, a panel or a box takes panels; ``origin`` is a spot's place.
    """

    layer: str
    kind: Literal["spot", "sky", "panel", "box"]
    origin: tuple[float, float, float]


@dataclass(frozen=True)
class SteeredView:
    """What steerable layers light: pixels of one camera's picture, whose radiance follows that of the vertices."""

    camera: CameraView
    width: int
    height: int
    places: tuple[SteeredPlace, ...]


@dataclass(frozen=True)
class LookKey:
    """A keyframe of the timeline: a look, and the second at which it is lit; from one to the next it fades."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    at: Seconds
    look: Title


@dataclass(frozen=True)
class WorldView:
    """A moving world that the windows may look out on, and when it comes to rest, seconds."""

    id: str
    title: str
    duration: float

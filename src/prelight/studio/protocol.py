"""Every message between the studio and its page, in one file; ``typescript`` makes the page's half, ``wire`` JSON.

Text frames are JSON objects ``{"type": NAME, …fields}``; binary frames are radiance (``frames``). The page
speaks first (``Hello``), the studio answers with ``Welcome``; those of two versions do not talk (close code 1002).
A message with a redundancy key replaces an unsent one of the same key: what is dragged never makes a queue.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field, StringConstraints

from ..lighting.daylight import HIGHEST_TURBIDITY, LOWEST_TURBIDITY
from ..lighting.glass import LARGEST_FROST_DEG
from ..lighting.placed_lights import LARGEST_RADIUS
from .fields import (
    Azimuth,
    DiscId,
    Elevation,
    Flag,
    Metres,
    Name,
    Number,
    Radiance,
    Radius,
    Scale,
    Share,
    Side,
    Strength,
    Tint,
    Title,
    Turn,
    Whole,
)

PROTOCOL_VERSION = 2
LARGEST_MESSAGE = 65_536  # bytes of text from a page: a whole rig file
MOST_DISCS, MOST_LAMPS, MOST_LOOKS, MOST_PORTALS = 32, 32, 32, 200
FRAMES_IN_FLIGHT = 2  # sent to a page and not yet seen by it


class Message:
    """A message; those of a redundancy key replace each other while they wait."""

    redundancy_key: ClassVar[str | None] = None
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")


# ---- What both speak of ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LampLight:
    """A light with a place in the scene. ``strength``: lumens of a lamp and a panel, candela along the beam of a spot.

    ``dim`` is its share that is lit. A spot's ``beam_deg`` is its half intensity's whole width; a lamp has no target.
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


# ---- The page to the studio ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Hello(Message):
    """The first message: the version of the protocol that the page was made for."""

    version: Whole


@dataclass(frozen=True)
class SetEnvironment(Message):
    """Change what is given of the environment: which map, its turn, scale and tint. ``dragging``: more will come."""

    environment: Name | None = None
    rotation_deg: Turn | None = None
    scale: Scale | None = None
    tint: tuple[Tint, Tint, Tint] | None = None
    dragging: Flag = False


@dataclass(frozen=True)
class SetDisc(Message):
    """Light a disc, or change the one of this id: all of it. Directions are the scene's, as in a rig file."""

    id: DiscId
    azimuth_deg: Azimuth
    elevation_deg: Elevation
    radius_deg: Radius
    radiance: tuple[Radiance, Radiance, Radiance]
    softness: Share = 0.0
    dragging: Flag = False


@dataclass(frozen=True)
class RemoveDisc(Message):
    """Put out a disc."""

    id: DiscId


@dataclass(frozen=True)
class SetSun(Message):
    """Change place, day or hour: all of it. The environment becomes "daylight"."""

    sun: Sun
    dragging: Flag = False


@dataclass(frozen=True)
class SetLamp(Message):
    """Put up a lamp, or change the one of this id: all of it."""

    lamp: LampLight
    dragging: Flag = False


@dataclass(frozen=True)
class RemoveLamp(Message):
    """Take down a lamp."""

    id: DiscId


@dataclass(frozen=True)
class SetGlass(Message):
    """Change the glass of a portal, one of ``Welcome.portals``: all of it."""

    glass: PortalGlass
    dragging: Flag = False


@dataclass(frozen=True)
class Undo(Message):
    """Take back the last change, whoever made it."""


@dataclass(frozen=True)
class Redo(Message):
    """Make the change again that was taken back last."""


@dataclass(frozen=True)
class SaveLook(Message):
    """Keep the light as it is under a name; one that is known is replaced."""

    name: Title


@dataclass(frozen=True)
class ShowLook(Message):
    """Light as it was kept under a name."""

    name: Title


@dataclass(frozen=True)
class RemoveLook(Message):
    """Forget what is kept under a name."""

    name: Title


@dataclass(frozen=True)
class Compare(Message):
    """Send the light of a look to this page, once, beside the one that is lit: ``Compared``, then a frame."""

    look: Title


@dataclass(frozen=True)
class OpenRig(Message):
    """Light as a rig file says (TOML, docs/rig.md), as far as a page can show it."""

    text: Annotated[str, StringConstraints(strict=True, max_length=60_000)]


@dataclass(frozen=True)
class Seen(Message):
    """A radiance frame has arrived, and the next may be sent."""

    frame: Whole


Change = (
    SetEnvironment | SetSun | SetDisc | RemoveDisc | SetLamp | RemoveLamp | SetGlass
    | Undo | Redo | SaveLook | ShowLook | RemoveLook | OpenRig
)  # fmt: skip
ClientMessage = Hello | Change | Compare | Seen


# ---- The studio to the page ------------------------------------------------------------------------------------


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
class State(Message):
    """The rig as all visitors see it, after change number ``sequence``, which visitor ``author`` made.

    ``stops``: the exposure that suits the map by itself; null until it has been opened. ``undo`` and ``redo``: what
    these would do, in words; null: nothing. ``looks``: the names of what is kept.
    """

    redundancy_key: ClassVar[str | None] = "state"
    sequence: int
    author: int | None
    environment: str
    rotation_deg: float
    scale: float
    tint: tuple[float, float, float]
    sun: Sun
    discs: tuple[DiscLight, ...]
    lamps: tuple[LampLight, ...]
    glass: tuple[PortalGlass, ...]
    stops: float | None
    looks: tuple[str, ...] = ()
    undo: str | None = None
    redo: str | None = None


@dataclass(frozen=True)
class Welcome(Message):
    """The answer to ``Hello``: what is shown, what can be chosen, and how the rig stands.

    ``receivers`` are the rows of a radiance frame: the vertices, or where ``pixels`` is (width, height) those of
    the picture that the first camera sees. ``eye``: the camera that highlights are right for, if one is fixed.
    ``takes``: what some layer of the bake can be lit by. ``portals``: those whose glass can be set;
    the array ``pane`` of the geometry has for each vertex of glass its number among them, from 1.
    """

    version: int
    visitor: int
    name: str
    receivers: int
    vertices: int
    triangles: int
    textures: int
    resolution: int
    pixels: tuple[int, int] | None
    eye: str | None
    cameras: tuple[CameraView, ...]
    environments: tuple[EnvironmentChoice, ...]
    takes: tuple[Literal["environment", "lamps", "glass"], ...]
    portals: tuple[PortalView, ...]
    most_discs: int
    most_lamps: int
    state: State


@dataclass(frozen=True)
class Refused(Message):
    """A message of the page that was not obeyed, and why, in one line; nothing has changed."""

    message: str
    reason: str


@dataclass(frozen=True)
class Compared(Message):
    """The light of a look, whose frame (``FRAME_ASIDE``) comes next."""

    redundancy_key: ClassVar[str | None] = "compared"
    look: str
    light: State


@dataclass(frozen=True)
class Waiting(Message):
    """What the studio is busy with before the first picture; null: nothing any more."""

    redundancy_key: ClassVar[str | None] = "waiting"
    reason: str | None


@dataclass(frozen=True)
class LayerPace:
    """What a layer did for the last frame: how ("full", "local", "gain", …), and how long it took."""

    name: str
    kind: str
    how: str
    ms: float


@dataclass(frozen=True)
class Pace(Message):
    """How fast it goes: the last frame's relighting, its bytes, and frames a second sent to this page of late."""

    redundancy_key: ClassVar[str | None] = "pace"
    relight_ms: float
    pack_ms: float
    kind: str
    strong_lights: int
    bytes: int
    updates_per_second: float
    layers: tuple[LayerPace, ...]


ServerMessage = Welcome | State | Refused | Compared | Waiting | Pace

"""Every message between the studio and its page; ``typescript`` makes the page's half, ``wire`` JSON.

Text frames are JSON objects ``{"type": NAME, …fields}``; binary frames are radiance (``frames``). The page
speaks first (``Hello``), the studio answers with ``Welcome``; those of two versions do not talk (close code 1002).
A message with a redundancy key replaces an unsent one of the same key: what is dragged never makes a queue.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field, StringConstraints

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
    Seconds,
    Share,
    Tint,
    Title,
    Turn,
    Whole,
)
from .protocol_values import (
    CameraView,
    DiscLight,
    EnvironmentChoice,
    LampLight,
    LayerPace,
    LookKey,
    PaintStroke,
    PortalGlass,
    PortalView,
    SteeredView,
    Sun,
    WorldView,
)

PROTOCOL_VERSION = 6
LARGEST_MESSAGE = 65_536  # bytes of text from a page: a whole rig file
MOST_DISCS, MOST_LAMPS, MOST_LOOKS, MOST_PORTALS = 32, 32, 32, 200
MOST_KEYS = 64  # of the timeline
MOST_TRACED = 2_000_000  # pixels of a picture by the path tracer
FRAMES_IN_FLIGHT = 2  # sent to a page and not yet seen by it


class Message:
    """A message; those of a redundancy key replace each other while they wait."""

    redundancy_key: ClassVar[str | None] = None
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")


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
class SetPaint(Message):
    """Paint a stroke over what is there, or change the one of this id: all of it. Directions are the scene's."""

    stroke: PaintStroke
    dragging: Flag = False


@dataclass(frozen=True)
class RemovePaint(Message):
    """Take a stroke of paint away."""

    id: DiscId


@dataclass(frozen=True)
class ClearPaint(Message):
    """Take all paint away."""


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
class SetWorld(Message):
    """What is outside the windows: one of ``Welcome.worlds`` as it is at a second of its own time; null: nothing."""

    world: Name | None
    seconds: Seconds = 0.0
    dragging: Flag = False


@dataclass(frozen=True)
class SetTimeline(Message):
    """The keyframes of looks, all of them, at times that rise."""

    keys: Annotated[tuple[LookKey, ...], Field(max_length=MOST_KEYS)]


@dataclass(frozen=True)
class Compare(Message):
    """Send the light of a look to this page, once, beside the one that is lit: ``Compared``, then a frame.

    Null: the light before the last step that can be undone. With an eye, what depends on it follows where there is
    such: one more frame, flagged ``FRAME_ASIDE | FRAME_VIEW``.
    """

    look: Title | None
    eye: tuple[Metres, Metres, Metres] | None = None


@dataclass(frozen=True)
class LookFrom(Message):
    """Send what depends on the eye, once, as it is seen from here: a frame flagged ``FRAME_VIEW``."""

    eye: tuple[Metres, Metres, Metres]


@dataclass(frozen=True)
class Trace(Message):
    """Let the path tracer make the picture of a camera under the light as it is now: ``Traced`` and frames follow."""

    eye: tuple[Metres, Metres, Metres]
    target: tuple[Metres, Metres, Metres]
    up: tuple[Metres, Metres, Metres]
    vertical_fov_deg: Annotated[Number, Field(ge=1, le=170)]
    width: Annotated[Whole, Field(ge=16, le=4096)]
    height: Annotated[Whole, Field(ge=16, le=4096)]


@dataclass(frozen=True)
class StopTrace(Message):
    """No more of it."""


@dataclass(frozen=True)
class OpenRig(Message):
    """Light as a rig file says (TOML, docs/rig.md), as far as a page can show it."""

    text: Annotated[str, StringConstraints(strict=True, max_length=60_000)]


@dataclass(frozen=True)
class Seen(Message):
    """A radiance frame has arrived, and the next may be sent."""

    frame: Whole


@dataclass(frozen=True)
class Mark(Message):
    """Answer ``Marked`` when every change before this has been carried out or refused."""

    number: Whole


Change = (
    SetEnvironment | SetSun | SetDisc | RemoveDisc | SetPaint | RemovePaint | ClearPaint | SetLamp | RemoveLamp
    | SetGlass | SetWorld | SetTimeline | Undo | Redo | SaveLook | ShowLook | RemoveLook | OpenRig
)  # fmt: skip
ClientMessage = Hello | Change | Mark | Compare | LookFrom | Trace | StopTrace | Seen


# ---- The studio to the page ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class State(Message):
    """The rig as all visitors see it, after change number ``sequence``, which visitor ``author`` made.

    ``stops``: the exposure that suits the map by itself; null until it has been opened. ``undo`` and ``redo``: what
    these would do, in words; null: nothing. ``looks``: the names of what is kept; ``timeline``: keyframes of them.
    ``world``: what is outside, as it is at ``seconds``; null: only the sky. ``paint``: strokes, the first one below.
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
    world: str | None = None
    seconds: float = 0.0
    paint: tuple[PaintStroke, ...] = ()
    looks: tuple[str, ...] = ()
    timeline: tuple[LookKey, ...] = ()
    undo: str | None = None
    redo: str | None = None


@dataclass(frozen=True)
class Welcome(Message):
    """The answer to ``Hello``: what is shown, what can be chosen, and how the rig stands.

    ``bake`` tells one bake from another, and is in ``/geometry.json`` too.
    ``receivers`` are the rows of a radiance frame: the vertices, or where ``pixels`` is (width, height) those of
    the picture that the first camera sees. ``eye``: the camera that highlights are right for, if one is fixed.
    ``takes``: what some layer of the bake can be lit by. ``portals``: those whose glass can be set;
    the array ``pane`` of the geometry has for each vertex of glass its number among them, from 1. ``glossy``: whether
    surfaces shine toward the eye (``LookFrom``). ``steered``: what steerable layers light, whose
    pixels follow the vertices in a frame. ``no_tracer``: why no path tracer is there; null: it is.
    """

    version: int
    visitor: int
    name: str
    bake: str
    receivers: int
    vertices: int
    triangles: int
    textures: int
    resolution: int
    pixels: tuple[int, int] | None
    eye: str | None
    cameras: tuple[CameraView, ...]
    environments: tuple[EnvironmentChoice, ...]
    takes: tuple[Literal["environment", "lamps", "glass", "steered"], ...]
    portals: tuple[PortalView, ...]
    steered: SteeredView | None
    worlds: tuple[WorldView, ...]
    glossy: bool
    no_tracer: str | None
    most_discs: int
    most_lamps: int
    state: State


@dataclass(frozen=True)
class Refused(Message):
    """A message of the page that was not obeyed, and why, in one line; nothing has changed."""

    message: str
    reason: str


@dataclass(frozen=True)
class Marked(Message):
    """All that a page asked for before its mark of this number is in the state of this ``sequence``, or was refused."""

    redundancy_key: ClassVar[str | None] = "marked"
    number: int
    sequence: int


@dataclass(frozen=True)
class Compared(Message):
    """The light of a look, whose frame (``FRAME_ASIDE``) comes next."""

    look: str | None
    light: State


@dataclass(frozen=True)
class Traced(Message):
    """How far the path tracer is: ``share`` of its samples, at 1 it is ready; what stopped it, in a line.

    A frame flagged ``FRAME_TRACED`` has the picture, row by row from the top.
    """

    redundancy_key: ClassVar[str | None] = "traced"
    share: float
    samples: int
    seconds: float
    stopped: str | None


@dataclass(frozen=True)
class Waiting(Message):
    """What the studio is busy with before the first picture; null: nothing any more."""

    redundancy_key: ClassVar[str | None] = "waiting"
    reason: str | None


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


ServerMessage = Welcome | State | Refused | Marked | Compared | Traced | Waiting | Pace

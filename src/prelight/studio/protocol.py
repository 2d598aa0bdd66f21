"""Every message between the studio and its page, in one file; ``typescript`` makes the page's half from it.

Text frames are JSON objects ``{"type": NAME, …fields}``; binary frames are radiance (``FrameHeader``). The page
speaks first (``Hello``), the studio answers with ``Welcome``; those of two versions do not talk (close code 1002).
A message with a redundancy key replaces an unsent one of the same key: what is dragged never makes a queue.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, ClassVar, NamedTuple, get_args

from pydantic import ConfigDict, Field, StringConstraints, TypeAdapter, ValidationError

from ..errors import InputError
from ..lighting.regions import LARGEST_RADIUS_DEG, SMALLEST_RADIUS_DEG

PROTOCOL_VERSION = 1
LARGEST_MESSAGE = 16_384  # bytes of text from a page
MOST_DISCS = 32
FRAMES_IN_FLIGHT = 2  # sent to a page and not yet seen by it

LARGEST_SCALE, LARGEST_TINT, LARGEST_RADIANCE = 1e6, 1e3, 1e7

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


class _Message:
    """A message; those of a redundancy key replace each other while they wait."""

    redundancy_key: ClassVar[str | None] = None
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")


# ---- The page to the studio ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Hello(_Message):
    """The first message: the version of the protocol that the page was made for."""

    version: Whole


@dataclass(frozen=True)
class SetEnvironment(_Message):
    """Change what is given of the environment: which map, its turn, scale and tint. ``dragging``: more will come."""

    environment: Name | None = None
    rotation_deg: Turn | None = None
    scale: Scale | None = None
    tint: tuple[Tint, Tint, Tint] | None = None
    dragging: Flag = False


@dataclass(frozen=True)
class SetDisc(_Message):
    """Light a disc, or change the one of this id: all of it. Directions are the scene's, as in a rig file."""

    id: DiscId
    azimuth_deg: Azimuth
    elevation_deg: Elevation
    radius_deg: Radius
    radiance: tuple[Radiance, Radiance, Radiance]
    softness: Share = 0.0
    dragging: Flag = False


@dataclass(frozen=True)
class RemoveDisc(_Message):
    """Put out a disc."""

    id: DiscId


@dataclass(frozen=True)
class Seen(_Message):
    """A radiance frame has arrived, and the next may be sent."""

    frame: Whole


ClientMessage = Hello | SetEnvironment | SetDisc | RemoveDisc | Seen


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
class State(_Message):
    """The rig as all visitors see it, after change number ``sequence``, which visitor ``author`` made.

    ``stops``: the exposure that suits the map by itself; null until it has been opened.
    """

    redundancy_key: ClassVar[str | None] = "state"
    sequence: int
    author: int | None
    environment: str
    rotation_deg: float
    scale: float
    tint: tuple[float, float, float]
    discs: tuple[DiscLight, ...]
    stops: float | None


@dataclass(frozen=True)
class Welcome(_Message):
    """The answer to ``Hello``: what is shown, what can be chosen, and how the rig stands.

    ``receivers`` are the rows of a radiance frame: the vertices, or where ``pixels`` is (width, height) those of
    the picture that the first camera sees. ``eye``: the camera that highlights are right for, if one is fixed.
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
    most_discs: int
    state: State


@dataclass(frozen=True)
class Refused(_Message):
    """A message of the page that was not obeyed, and why, in one line; nothing has changed."""

    message: str
    reason: str


@dataclass(frozen=True)
class Waiting(_Message):
    """What the studio is busy with before the first picture; null: nothing any more."""

    redundancy_key: ClassVar[str | None] = "waiting"
    reason: str | None


@dataclass(frozen=True)
class Pace(_Message):
    """How fast it goes: the last frame's relighting, its bytes, and frames a second sent to this page of late."""

    redundancy_key: ClassVar[str | None] = "pace"
    relight_ms: float
    pack_ms: float
    kind: str
    strong_lights: int
    bytes: int
    updates_per_second: float


ServerMessage = Welcome | State | Refused | Waiting | Pace


# ---- Radiance frames -------------------------------------------------------------------------------------------

FRAME_MAGIC = 0x31524C50  # "PLR1"
FRAME_EXACT = 1  # flag: the exact light, until something changes; otherwise a first answer
HEADER_BYTES = 32
_HEADER = struct.Struct("<IIIIfI8x")


class FrameHeader(NamedTuple):
    """The first 32 bytes of a binary frame, little-endian; then ``count`` uint32 rgb9e5, one for each row.

    uint32 magic, frame, sequence (of the state), count; float32 milliseconds; uint32 flags; 8 bytes of zeros.
    """

    frame: int
    sequence: int
    count: int
    milliseconds: float
    flags: int

    def write(self, into: bytearray | memoryview) -> None:
        """Fill the first 32 bytes."""
        _HEADER.pack_into(into, 0, FRAME_MAGIC, *self)

    @classmethod
    def read(cls, data: bytes | memoryview) -> FrameHeader:
        """Raises InputError unless ``data`` is a whole frame."""
        if len(data) >= HEADER_BYTES:
            magic, *fields = _HEADER.unpack_from(data)
            header = cls(*fields)
            if magic == FRAME_MAGIC and len(data) == HEADER_BYTES + 4 * header.count:
                return header
        raise InputError("frame", f"{len(data)} bytes that are no whole radiance frame")


# ---- To text and back ------------------------------------------------------------------------------------------


def encode(message: ServerMessage | ClientMessage) -> str:
    """The JSON text of a message."""
    return json.dumps(_plain(message), allow_nan=False)


def _plain(value: Any) -> Any:
    """Messages, also those inside others, as objects with a type."""
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    if not is_dataclass(value):
        return value
    named = {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    return {"type": type(value).__name__, **named} if isinstance(value, _Message) else named


def decode(text: str) -> ClientMessage:
    """A message of a page. Raises InputError, naming the message and the field, for whatever it is not."""
    if len(text) > LARGEST_MESSAGE:
        raise InputError("message", f"{len(text):,} characters, at most {LARGEST_MESSAGE:,} are read")
    try:
        given = json.loads(text, parse_constant=_no_constant)
    except (ValueError, RecursionError):
        raise InputError("message", "not JSON (numbers are finite)") from None
    if not isinstance(given, dict):
        raise InputError("message", f"a {type(given).__name__}, expected an object with a type")
    name = given.pop("type", None)
    readers = _readers()
    if not isinstance(name, str) or name not in readers:
        raise InputError("message", f"type {str(name)[:40]!r}, expected one of {', '.join(readers)}")
    try:
        return readers[name].validate_python(given)
    except ValidationError as error:
        raise _refusal(name, error) from None


def _no_constant(name: str) -> None:
    raise ValueError(name)


@cache
def _readers() -> dict[str, TypeAdapter[Any]]:
    return {kind.__name__: TypeAdapter(kind) for kind in get_args(ClientMessage)}


def _refusal(name: str, error: ValidationError) -> InputError:
    """The first thing that is wrong, in one line."""
    first = error.errors(include_url=False, include_context=False)[0]
    field = ".".join(str(part) for part in first["loc"]) or "message"
    try:
        given = repr(first["input"])[:60]
    except ValueError:  # a whole number of thousands of digits
        given = "a number too large"
    return InputError(f"{name}.{field[:60]}", f"{given}: {first['msg'][:120]}")

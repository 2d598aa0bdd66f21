"""Every message between the studio and its start page, where scenes are dropped and baked; ``typescript`` makes the
page's half. As in ``protocol``: the page says ``Hello`` with its version first, and what is no message is refused.

The studio's answer to everything is ``Workshop``, all of what is there, to every visitor; the newest replaces the
unsent. A bake belongs to the studio, not to the page: whoever comes later sees the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field, StringConstraints

from .fields import Name, Number
from .protocol import Hello, Message, Refused

START_VERSION = 1
LARGEST_UPLOAD = 500_000_000  # bytes of a scene with all its files
MOST_FILES = 64  # of a scene
MOST_PROJECTS = 60
MOST_PASSES = 32  # paths a pixel of the picture that sharpens

ProjectId = Annotated[str, StringConstraints(strict=True, pattern=r"^[a-z0-9][a-z0-9-]{0,50}$")]
UploadId = Annotated[str, StringConstraints(strict=True, pattern=r"^[0-9a-f]{16}$")]
Length = Annotated[Number, Field(ge=1e-4, le=1e4)]


@dataclass(frozen=True)
class Wish:
    """What to bake. ``sky``: from all around, or through the windows' glass; ``lamps``: live, or in a cloud.

    ``floor``: how many times as wide as the scene; ``subdivide``: the longest edge, metres.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    sky: Literal["none", "open", "windows"] = "open"
    lamps: Literal["none", "transfer", "cloud"] = "none"
    quality: Literal["draft", "good", "best"] = "good"
    device: Literal["auto", "cpu"] = "auto"
    floor: Annotated[Number, Field(gt=0, le=1000)] | None = None
    subdivide: Length | None = None


# ---- The page to the studio ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ChooseStock(Message):
    """Begin with a built-in scene."""

    scene: Name


@dataclass(frozen=True)
class TakeUpload(Message):
    """Begin with files that were sent: ``main`` is the one to read, which names the others."""

    upload: UploadId
    main: Name


@dataclass(frozen=True)
class SetWish(Message):
    """Choose what to bake of a scene; its cost is estimated."""

    project: ProjectId
    wish: Wish


@dataclass(frozen=True)
class Bake(Message):
    """Begin, or go on where it was stopped."""

    project: ProjectId


@dataclass(frozen=True)
class Stop(Message):
    """Stop; what is done is kept."""

    project: ProjectId


@dataclass(frozen=True)
class OpenBake(Message):
    """Show a finished bake in the studio, to everybody."""

    project: ProjectId


StartMessage = Hello | ChooseStock | TakeUpload | SetWish | Bake | Stop | OpenBake


# ---- The studio to the page ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class StockView:
    """A built-in scene, and what it is."""

    scene: str
    title: str


@dataclass(frozen=True)
class LayerView:
    """A layer that is wanted, what it costs as ``--dry-run --json`` says it, and how much of it is done.

    ``command``: what does the same in a terminal.
    """

    kind: str
    title: str
    command: str
    rays: int
    seconds: float
    bytes: int
    memory: int
    share: float


@dataclass(frozen=True)
class ProjectView:
    """A scene on its way. ``reason``: why it was refused or has stopped. ``passes``: of its picture, 0 without one."""

    id: str
    name: str
    source: str
    stage: Literal["looking", "planning", "ready", "baking", "stopped", "baked", "refused"]
    reason: str | None
    wish: Wish
    vertices: int
    triangles: int
    windows: int
    devices: tuple[str, ...]
    notes: tuple[str, ...]
    layers: tuple[LayerView, ...]
    share: float
    seconds_left: float | None
    rays_per_second: float | None
    passes: int
    path: str | None


@dataclass(frozen=True)
class Workshop(Message):
    """All there is: scenes to choose, those on their way (the newest first), and what the studio shows."""

    redundancy_key: ClassVar[str | None] = "workshop"
    version: int
    folder: str
    stock: tuple[StockView, ...]
    projects: tuple[ProjectView, ...]
    shown: str | None


@dataclass(frozen=True)
class Taken(Message):
    """The scene that this page has begun with."""

    project: str


@dataclass(frozen=True)
class Opened(Message):
    """The studio shows another bake now: at its page."""

    redundancy_key: ClassVar[str | None] = "opened"
    project: str


StartAnswer = Workshop | Taken | Opened | Refused

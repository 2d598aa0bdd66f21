"""The table [outside] of a rig: the world that is seen from the windows, and how it moves."""

from __future__ import annotations

from pathlib import Path as File
from typing import Annotated

from pydantic import Field, field_validator, model_validator

from ..errors import InputError
from .outside import Outside, OutsideObject, Path
from .quantities import Triple
from .rig_fields import Number, Table, Text
from .rig_lights import Time

STOCK_PREFIX = "stock:"
_MOST_OBJECTS, _MOST_KEYS = 100, 1_000
Metres = Annotated[Number, Field(ge=-1e5, le=1e5)]
Place = tuple[Metres, Metres, Metres]
Heading = Annotated[Number, Field(ge=-3600, le=3600)]
Scale = Annotated[Number, Field(ge=1e-4, le=1e4)]


class PathKey(Table):
    """Where something is at a time; what is left out stays as before."""

    at: Time
    position: Place | None = None
    heading_deg: Heading | None = None


class PathTable(Table):
    """Where something stands, and how it moves."""

    position: Place = (0.0, 0.0, 0.0)
    heading_deg: Heading | None = None
    along: str = "curve"
    keys: list[PathKey] = Field(default_factory=list, max_length=_MOST_KEYS)

    @field_validator("along")
    @classmethod
    def _is_known(cls, value: str) -> str:
        if value not in ("curve", "line"):
            raise ValueError(f"along {value[:40]!r}, expected curve or line")
        return value

    @property
    def path(self) -> Path:
        """Raises InputError for times that do not rise."""
        times, positions, headings = [0.0], [self.position], [self.heading_deg]
        for key in self.keys:
            times.append(key.at)
            positions.append(positions[-1] if key.position is None else key.position)
            headings.append(headings[-1] if key.heading_deg is None else key.heading_deg)
        given = [0.0 if heading is None else heading for heading in headings]
        looks = tuple(given) if any(heading is not None for heading in headings) or not self.keys else None
        return Path(tuple(times), tuple(positions), looks, curved=self.along == "curve")


class ObjectTable(PathTable):
    """A mesh outside; ``name`` is for people."""

    scene: Text
    name: Text = "object"
    scale: Scale = 1.0
    turn_deg: Heading = 0.0

    @field_validator("scene")
    @classmethod
    def _can_be_a_name(cls, value: str) -> str:
        if "\x00" in value or not value:
            raise ValueError("expected the name of a mesh file, or stock:NAME")
        return value


class OutsideTable(Table):
    """Everything outside."""

    scene: Text | None = None
    position: Place = (0.0, 0.0, 0.0)
    scale: Scale = 1.0
    turn_deg: Heading = 0.0
    samples: Annotated[int, Field(strict=True, ge=1, le=8)] = 2
    bounce: Annotated[bool, Field(strict=True)] = True
    object: list[ObjectTable] = Field(default_factory=list, max_length=_MOST_OBJECTS)
    room: PathTable | None = None

    @field_validator("scene")
    @classmethod
    def _can_be_a_name(cls, value: str | None) -> str | None:
        if value is not None and "\x00" in value:
            raise ValueError("the scene's name has a NUL character")
        return value

    @model_validator(mode="after")
    def _has_something(self) -> OutsideTable:
        if self.scene is None and not self.object:
            raise ValueError("nothing outside: expected scene, or [[outside.object]] with one")
        return self


def outside_of(table: OutsideTable, path: File) -> Outside:
    """What a table says; files are looked for beside the rig ``path``. Raises InputError, with its JSON pointer."""
    objects = []
    if table.scene is not None:
        still = Path.resting(_triple(table.position))
        objects.append(
            OutsideObject(_beside(table.scene, path), still, table.scale, table.turn_deg, name="scene")
        )
    for n, one in enumerate(table.object):
        moving = _path(one, path, f"/outside/object/{n}/keys")
        objects.append(
            OutsideObject(_beside(one.scene, path), moving, one.scale, one.turn_deg, name=one.name)
        )
    room = Path.resting() if table.room is None else _path(table.room, path, "/outside/room/keys")
    return Outside(tuple(objects), room, samples=table.samples, bounce=table.bounce)


def _path(table: PathTable, path: File, pointer: str) -> Path:
    try:
        return table.path
    except InputError as error:
        raise InputError(path, error.reason, pointer) from None


def _beside(scene: str, path: File) -> str:
    return scene if scene.startswith(STOCK_PREFIX) else str(path.parent / scene)


def _triple(values: Place) -> Triple:
    x, y, z = values
    return x, y, z

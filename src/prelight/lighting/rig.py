"""A rig: everything a designer sets. Today its environment; a TOML file or an environment map."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..errors import InputError
from ..files import read_regular
from .environment import STOCK_PREFIX, Environment
from .sky import STOCK_SKIES

_LARGEST_FILE = 1_000_000
_IN_WORDS = {
    "extra_forbidden": "not known; a rig has a table [environment] of map, layout, rotate_deg, scale and tint",
    "missing": "missing; a rig has a table [environment] with at least map",
    "tuple_type": "expected three numbers such as [1.0, 0.9, 0.8]",
}


class _EnvironmentTable(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    map: str
    layout: str | None = None
    rotate_deg: float = 0.0
    scale: float = Field(default=1.0, ge=0)
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)


class _RigFile(BaseModel):
    model_config = ConfigDict(extra="forbid")
    environment: _EnvironmentTable


@dataclass(frozen=True)
class Rig:
    """What lights a bake."""

    environment: Environment

    @classmethod
    def open(cls, source: str, *, layout: str | None = None) -> Rig:
        """A rig file (.toml), an environment map, or ``stock:NAME``; ``layout`` is the map's, if not recognised.

        A map named in a rig file is looked for beside it. Raises InputError.
        """
        if source in STOCK_SKIES and not Path(source).exists():
            raise InputError(source, f"no such file; did you mean {STOCK_PREFIX}{source}?")
        if source.startswith(STOCK_PREFIX) or not source.lower().endswith(".toml"):
            return cls(Environment.open(source, layout))
        path = Path(source)
        try:
            document = tomllib.loads(read_regular(path, limit=_LARGEST_FILE).decode())
            table = _RigFile.model_validate(document).environment
        except ValidationError as error:
            first = error.errors()[0]
            where = "/" + "/".join(str(part) for part in first["loc"])
            raise InputError(path, _IN_WORDS.get(first["type"], first["msg"].lower()), where) from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
            raise InputError(path, f"not a TOML rig: {error}") from None
        if "\x00" in table.map:
            raise InputError(path, "the map's name has a NUL character", "/environment/map")
        source = table.map if table.map.startswith(STOCK_PREFIX) else str(path.parent / table.map)
        environment = Environment.open(source, layout or table.layout)
        return cls(environment.rotated(table.rotate_deg).scaled(table.scale).tinted(table.tint))

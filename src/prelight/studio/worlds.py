"""The worlds that the windows of a room may look out on: the [outside] of rig files named when the studio was started.

A visitor names them by an id of this list, never by a path.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..files import read_regular
from ..lighting.outside import Outside
from ..lighting.rig import Rig
from ..lighting.rig_outside import STOCK_PREFIX
from .protocol_values import WorldView

_LARGEST_FILE = 1_000_000


class Worlds:
    """Worlds by their id: the names of rig files. Files without [outside] are none. Raises InputError as ``Rig.open``.

    Safe to use from several threads.
    """

    def __init__(self, rigs: Sequence[str] = ()) -> None:
        self._worlds: dict[str, tuple[Outside, dict[str, Any]]] = {}
        for source in rigs:
            path = Path(source)
            said = _said(path)
            if said is None:
                continue
            outside = Rig.open(source).outside
            key = path.name if path.name not in self._worlds else str(path)
            if outside is not None:
                self._worlds[key] = outside, _from_root(said, path)

    @property
    def views(self) -> tuple[WorldView, ...]:
        """All of them, in the order of their files."""
        return tuple(
            WorldView(key, Path(key).stem.replace("_", " "), outside.duration)
            for key, (outside, _) in self._worlds.items()
        )

    def __contains__(self, key: object) -> bool:
        return key in self._worlds

    def open(self, key: str) -> Outside:
        """What is outside. Raises InputError if there is none of that id."""
        return self._known(key)[0]

    def table(self, key: str) -> dict[str, Any]:
        """Its table of a rig file, with files named from the root. Raises InputError if there is none of that id."""
        return self._known(key)[1]

    def key_of(self, said: Mapping[str, Any]) -> str:
        """The id of a rig's table: files are known by their names. Raises InputError if it is none of these."""
        for key, (_, known) in self._worlds.items():
            if _by_names(known) == _by_names(said):
                return key
        reason = (
            "is none of the worlds of this studio; name its rig file on the command line when you start it"
        )
        raise InputError("rig", f"its [outside] {reason}")

    def _known(self, key: str) -> tuple[Outside, dict[str, Any]]:
        if key not in self._worlds:
            known = ", ".join(self._worlds) or "none"
            raise InputError("world", f"{key[:80]!r}, expected one of the worlds of this studio: {known}")
        return self._worlds[key]


def _said(path: Path) -> dict[str, Any] | None:
    """The table as the file has it; what is wrong with the file is said when it is opened as a rig."""
    try:
        document = tomllib.loads(read_regular(path, limit=_LARGEST_FILE).decode())
    except (ValueError, RecursionError):
        return None
    said = document.get("outside")
    return said if isinstance(said, dict) else None


def _with_scenes(said: Mapping[str, Any], rename: Any) -> dict[str, Any]:
    new = {key: rename(value) if key == "scene" else value for key, value in said.items()}
    if "object" in said:
        new["object"] = [_with_scenes(one, rename) for one in said["object"]]
    return new


def _from_root(said: Mapping[str, Any], path: Path) -> dict[str, Any]:
    return _with_scenes(
        said, lambda scene: scene if scene.startswith(STOCK_PREFIX) else str((path.parent / scene).resolve())
    )


def _by_names(said: Mapping[str, Any]) -> dict[str, Any]:
    return _with_scenes(said, lambda scene: Path(str(scene)).name)

"""The small file that keeps a rig and its looks beside the bake: the messages that lead there, checked as a page's."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..files import publish, read_regular
from .environments import DAYLIGHT
from .history import Looks
from .protocol import MOST_LOOKS, SaveLook, SetDisc, SetEnvironment, SetGlass, SetLamp, SetSun, State
from .rig_state import Step, changed
from .wire import decode, encode

_FORMAT, _VERSION = "prelight-studio", 1
_LARGEST_FILE = 2_000_000


def state_file(bake: Path) -> Path:
    """Where the studio keeps the rig of a bake: NAME.studio.json beside NAME.prelight."""
    whole = bake.resolve()
    return whole.with_name(whole.name.removesuffix(".prelight") + ".studio.json")


def save(state: State, path: Path, *, looks: Looks = ()) -> None:
    """Write a state and its looks, whole or not at all; raises OutputError."""
    document: dict[str, Any] = {"format": _FORMAT, "version": _VERSION, "messages": _messages(state)}
    if looks:
        document["looks"] = [{"name": name, "messages": _messages(light)} for name, light in looks]
    publish(path, (json.dumps(document, indent=1) + "\n").encode())


def _messages(state: State) -> list[Any]:
    steps: list[Step] = [
        SetSun(state.sun),
        SetEnvironment(state.environment, state.rotation_deg, state.scale, state.tint),
        *(
            SetDisc(d.id, d.azimuth_deg, d.elevation_deg, d.radius_deg, d.radiance, d.softness)
            for d in state.discs
        ),
        *(SetLamp(lamp) for lamp in state.lamps),
        *(SetGlass(glass) for glass in state.glass),
    ]
    return [json.loads(encode(step)) for step in steps]


def load(path: Path, start: State) -> tuple[State, Looks]:
    """What is kept in a file, beginning from ``start``. Raises InputError for anything else."""
    data = read_regular(path, limit=_LARGEST_FILE)
    try:
        document = json.loads(data)
        known = document["format"] == _FORMAT and document["version"] == _VERSION
        messages = [json.dumps(message) for message in document["messages"]]
        looks = [
            (look["name"], [json.dumps(message) for message in look["messages"]])
            for look in document.get("looks", ())
        ]
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        known, messages, looks = False, [], []
    if not known or len(looks) > MOST_LOOKS:
        raise InputError(path, f"not a rig kept by the studio (format {_FORMAT}, version {_VERSION})")
    try:
        kept = {_checked(name): _replayed(steps, start) for name, steps in looks}
        return _replayed(messages, start), tuple(sorted(kept.items(), key=lambda item: item[0]))
    except InputError as error:
        raise InputError(path, f"{error.path}: {error.reason}") from None


def _checked(name: object) -> str:
    message = decode(json.dumps({"type": "SaveLook", "name": name}))
    assert isinstance(message, SaveLook)  # by its type
    return message.name


def _replayed(messages: Sequence[str], start: State) -> State:
    state = start
    for text in messages:
        message = decode(text)
        if not isinstance(message, Step):
            raise InputError("message", f"a {type(message).__name__}, expected one that changes the light")
        state = changed(state, message, author=None)
    return replace(state, sequence=0, author=None)


def without_map(state: State, known: Sequence[str], *, first: str) -> State:
    """The state with a map that is there, and whether it needed another one."""
    is_there = state.environment in known or state.environment == DAYLIGHT
    return state if is_there else replace(state, environment=first, stops=None)

"""The small file that keeps a rig and its looks beside the bake: the messages that lead there, checked as a page's."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..files import publish, read_regular
from .environments import DAYLIGHT
from .history import Looks
from .protocol import (
    MOST_LOOKS,
    SaveLook,
    SetDisc,
    SetEnvironment,
    SetGlass,
    SetLamp,
    SetPaint,
    SetSun,
    SetTimeline,
    SetWorld,
    State,
)
from .protocol_values import LookKey
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
    if state.timeline:
        document["timeline"] = json.loads(encode(SetTimeline(state.timeline)))
    publish(path, (json.dumps(document, indent=1) + "\n").encode())


def _messages(state: State) -> list[Any]:
    steps: list[Step] = [
        SetSun(state.sun),
        SetEnvironment(state.environment, state.rotation_deg, state.scale, state.tint),
        *(
            SetDisc(d.id, d.azimuth_deg, d.elevation_deg, d.radius_deg, d.radiance, d.softness)
            for d in state.discs
        ),
        *(SetPaint(stroke) for stroke in state.paint),
        *(SetLamp(lamp) for lamp in state.lamps),
        *(SetGlass(glass) for glass in state.glass),
        *([] if state.world is None else [SetWorld(state.world, state.seconds)]),
    ]
    return [json.loads(encode(step)) for step in steps]


def load(path: Path, start: State) -> tuple[State, Looks]:
    """What is kept in a file, beginning from ``start``. Raises InputError for anything else."""
    data = read_regular(path, limit=_LARGEST_FILE)
    try:
        document = json.loads(data)
        known = document["format"] == _FORMAT and document["version"] == _VERSION
        messages = [json.dumps(message) for message in document["messages"]]
        timeline = json.dumps(document.get("timeline", {"type": "SetTimeline", "keys": []}))
        looks = [
            (look["name"], [json.dumps(message) for message in look["messages"]])
            for look in document.get("looks", ())
        ]
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        known, messages, looks, timeline = False, [], [], ""
    if not known or len(looks) > MOST_LOOKS:
        raise InputError(path, f"not a rig kept by the studio (format {_FORMAT}, version {_VERSION})")
    try:
        kept = {_checked(name): _replayed(steps, start) for name, steps in looks}
        state = replace(_replayed(messages, start), timeline=_keys(timeline, kept))
        return state, tuple(sorted(kept.items(), key=lambda item: item[0]))
    except InputError as error:
        raise InputError(path, f"{error.path}: {error.reason}") from None


def _keys(text: str, kept: dict[str, State]) -> tuple[LookKey, ...]:
    """The timeline, without keys of looks that are not there."""
    message = decode(text)
    if not isinstance(message, SetTimeline) or any(b.at <= a.at for a, b in pairwise(message.keys)):
        raise InputError("timeline", "expected keyframes at times that rise")
    return tuple(key for key in message.keys if key.look in kept)


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


def without_map(state: State, known: Sequence[str], *, first: str, worlds: Sequence[str] = ()) -> State:
    """The state with a map, and a world outside, that are there."""
    is_there = state.environment in known or state.environment == DAYLIGHT
    state = state if state.world in worlds else replace(state, world=None, seconds=0.0)
    return state if is_there else replace(state, environment=first, stops=None)

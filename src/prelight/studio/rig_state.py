"""The rig that all visitors share: how messages change it, and the small file that keeps it.

A state never changes; a message makes a new one or is refused. The file is the list of messages that lead to the
state, so what is read from it is checked exactly as what a page sends.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from ..errors import InputError
from ..files import publish, read_regular
from ..lighting.disc import Disc
from .protocol import (
    MOST_DISCS,
    DiscLight,
    RemoveDisc,
    SetDisc,
    SetEnvironment,
    State,
    decode,
    encode,
)

_FORMAT, _VERSION = "prelight-studio", 1
_LARGEST_FILE = 100_000

Change = SetEnvironment | SetDisc | RemoveDisc


def initial(environment: str) -> State:
    """A map as it is, and no discs."""
    return State(0, None, environment, 0.0, 1.0, (1.0, 1.0, 1.0), (), None)


def changed(state: State, change: Change, *, author: int | None) -> State:
    """The state after a message. Raises InputError for a disc that is not there, or one too many."""
    new = replace(state, sequence=(state.sequence + 1) % 2**32, author=author)
    if isinstance(change, SetEnvironment):
        given = {
            name: getattr(change, name)
            for name in ("environment", "rotation_deg", "scale", "tint")
            if getattr(change, name) is not None
        }
        if "rotation_deg" in given:
            given["rotation_deg"] %= 360.0
        if given.get("environment", state.environment) != state.environment:
            given["stops"] = None
        return replace(new, **given)
    others = tuple(disc for disc in state.discs if disc.id != change.id)
    if isinstance(change, RemoveDisc):
        if len(others) == len(state.discs):
            raise InputError("RemoveDisc.id", f"{change.id!r} is not alight")
        return replace(new, discs=others)
    if len(others) >= MOST_DISCS:
        raise InputError(
            "SetDisc.id", f"{change.id!r} would be disc {MOST_DISCS + 1}, at most {MOST_DISCS} shine"
        )
    disc = DiscLight(
        change.id,
        change.azimuth_deg,
        change.elevation_deg,
        change.radius_deg,
        change.radiance,
        change.softness,
    )
    # By name: what is seen must not depend on the order in which they were lit.
    return replace(new, discs=tuple(sorted((*others, disc), key=lambda d: d.id)))


def lit_discs(state: State) -> tuple[Disc, ...]:
    """The discs of a state as light; those without radiance are left out."""
    return tuple(
        Disc.at(
            d.azimuth_deg, d.elevation_deg, radius_deg=d.radius_deg, radiance=d.radiance, softness=d.softness
        )
        for d in state.discs
        if any(d.radiance)
    )


def state_file(bake: Path) -> Path:
    """Where the studio keeps the rig of a bake: NAME.studio.json beside NAME.prelight."""
    whole = bake.resolve()
    return whole.with_name(whole.name.removesuffix(".prelight") + ".studio.json")


def save(state: State, path: Path) -> None:
    """Write a state, whole or not at all; raises OutputError."""
    messages: list[Change] = [
        SetEnvironment(state.environment, state.rotation_deg, state.scale, state.tint),
        *(
            SetDisc(d.id, d.azimuth_deg, d.elevation_deg, d.radius_deg, d.radiance, d.softness)
            for d in state.discs
        ),
    ]
    document = {
        "format": _FORMAT,
        "version": _VERSION,
        "messages": [json.loads(encode(message)) for message in messages],
    }
    publish(path, (json.dumps(document, indent=1) + "\n").encode())


def load(path: Path, start: State) -> State:
    """The state that is kept in a file, beginning from ``start``. Raises InputError for anything else."""
    data = read_regular(path, limit=_LARGEST_FILE)
    try:
        document = json.loads(data)
        known = document["format"] == _FORMAT and document["version"] == _VERSION
        messages = [json.dumps(message) for message in document["messages"]]
    except (ValueError, TypeError, KeyError, RecursionError):
        known, messages = False, []
    if not known:
        raise InputError(path, f"not a rig kept by the studio (format {_FORMAT}, version {_VERSION})")
    state = start
    for text in messages:
        try:
            message = decode(text)
            if not isinstance(message, Change):
                raise InputError("message", f"a {type(message).__name__}, expected one that changes the rig")
            state = changed(state, message, author=None)
        except InputError as error:
            raise InputError(path, f"{error.path}: {error.reason}") from None
    return replace(state, sequence=0)

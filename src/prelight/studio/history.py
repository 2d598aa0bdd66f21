"""What visitors did to the rig, step by step: undo, redo, and the looks that were kept."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from itertools import pairwise

from ..errors import InputError
from .protocol import (
    MOST_LOOKS,
    Change,
    ClearPaint,
    OpenRig,
    Redo,
    RemoveDisc,
    RemoveLamp,
    RemoveLook,
    RemovePaint,
    SaveLook,
    SetDisc,
    SetEnvironment,
    SetGlass,
    SetLamp,
    SetPaint,
    SetSun,
    SetTimeline,
    SetWorld,
    ShowLook,
    State,
    Undo,
)
from .rig_state import changed, lit_as

MOST_STEPS = 200
_ONE_STEP = 1.0  # seconds; changes of one thing that follow each other sooner, dragged, are one step

Looks = tuple[tuple[str, State], ...]  # names and lights, by name


@dataclass(frozen=True)
class _Desk:
    """All that undo goes back to."""

    state: State
    looks: Looks


@dataclass(frozen=True)
class _Step:
    words: str
    before: _Desk


class History:
    """A state and its looks, and how they came to be. Not safe to use from several threads.

    Parameters
    ----------
    state, looks
        To begin with.
    opened
        Makes the state of a rig file's text, beginning from a state.
    """

    def __init__(self, state: State, looks: Looks, *, opened: Callable[[str, State], State]) -> None:
        self._desk, self._opened = _Desk(state, ()), opened
        self._desk = _Desk(state, tuple(sorted(looks)))
        self._undo: list[_Step] = []
        self._redo: list[_Step] = []
        self._last: tuple[str, str, float] | None = None  # what was dragged last, and when
        self._tell()

    @property
    def state(self) -> State:
        return self._desk.state

    @property
    def looks(self) -> Looks:
        return self._desk.looks

    def look(self, name: str) -> State:
        """The light kept under a name. Raises InputError if there is none."""
        for known, state in self._desk.looks:
            if known == name:
                return state
        raise InputError(
            "look", f"{name!r} is not kept; known are {', '.join(n for n, _ in self.looks) or 'none'}"
        )

    @property
    def before(self) -> State:
        """The light before the last step that can be undone; that which is, where there is none."""
        return self._undo[-1].before.state if self._undo else self.state

    def note(self, state: State) -> None:
        """The same light, of which more is known now."""
        self._desk = replace(self._desk, state=state)

    def obey(self, change: Change, *, author: int | None) -> State:
        """The state after a message. Raises InputError, and nothing has changed, for what cannot be."""
        if isinstance(change, Undo):
            self._go(self._undo, self._redo, author, "there is nothing to undo")
        elif isinstance(change, Redo):
            self._go(self._redo, self._undo, author, "there is nothing to redo")
        else:
            before, after = self._desk, self._after(change, author)
            words, dragged = words_of(change, before.state), getattr(change, "dragging", False)
            now = time.monotonic()
            touched = _touched(change, before.state)
            known = self._goes_on(words, touched, now)
            if not known:
                self._undo = [*self._undo[1 - MOST_STEPS :], _Step(words, before)]
            self._redo = []
            if known and self._last is not None:
                touched = touched or self._last[1]
            self._last = (words, touched, now) if dragged else None
            self._desk = after
        self._tell()
        return self._desk.state

    def _goes_on(self, words: str, touched: str, now: float) -> bool:
        """Whether a message belongs to the drag before it; the last one of a drag often changes nothing more."""
        if self._last is None or not self._undo:
            return False
        known, what, when = self._last
        return (
            known == words
            and (touched in ("", what) or not what)
            and (known == "paint" or now - when < _ONE_STEP)
        )

    def _after(self, change: Change, author: int | None) -> _Desk:
        state, looks = self._desk.state, dict(self._desk.looks)
        next_state = replace(state, sequence=(state.sequence + 1) % 2**32, author=author)
        match change:
            case SaveLook(name):
                if name not in looks and len(looks) >= MOST_LOOKS:
                    raise InputError("look", f"{name!r} would be one too many, at most {MOST_LOOKS} are kept")
                return _Desk(next_state, tuple(sorted((looks | {name: state}).items(), key=_name)))
            case RemoveLook(name):
                self.look(name)
                keys = tuple(key for key in state.timeline if key.look != name)
                left = tuple(item for item in looks.items() if item[0] != name)
                return _Desk(replace(next_state, timeline=keys), left)
            case SetTimeline(keys):
                for key in keys:
                    self.look(key.look)
                if any(later.at <= key.at for key, later in pairwise(keys)):
                    raise InputError("SetTimeline.keys", "expected times that rise")
                return _Desk(replace(next_state, timeline=keys), self._desk.looks)
            case ShowLook(name):
                return _Desk(lit_as(next_state, self.look(name)), self._desk.looks)
            case OpenRig(text):
                return _Desk(lit_as(next_state, self._opened(text, state)), self._desk.looks)
        return _Desk(changed(state, change, author=author), self._desk.looks)  # ty: ignore[invalid-argument-type]

    def _go(self, these: list[_Step], others: list[_Step], author: int | None, nothing: str) -> None:
        if not these:
            raise InputError("history", nothing)
        step = these.pop()
        others.append(_Step(step.words, self._desk))
        state = replace(step.before.state, sequence=(self.state.sequence + 1) % 2**32, author=author)
        self._desk, self._last = _Desk(state, step.before.looks), None

    def _tell(self) -> None:
        undo, redo = (steps[-1].words if steps else None for steps in (self._undo, self._redo))
        state = replace(
            self._desk.state, looks=tuple(name for name, _ in self._desk.looks), undo=undo, redo=redo
        )
        self._desk = replace(self._desk, state=state)


def _name(item: tuple[str, State]) -> str:
    return item[0]


def words_of(change: Change, state: State) -> str:
    """What a message does, in a few words; the same for every step of a drag."""
    match change:
        case SetEnvironment():
            names = {"environment": "sky", "rotation_deg": "turn of the sky", "scale": "strength of the sky"}
            given = [words for name, words in names.items() if getattr(change, name) is not None]
            return given[0] if given else "colour of the sky"
        case SetSun():
            return "sun"
        case SetDisc() | RemoveDisc():
            known = any(disc.id == change.id for disc in state.discs)
            return f"{_verb(known, removed=isinstance(change, RemoveDisc))}soft light"
        case SetPaint():
            return "paint"
        case RemovePaint() | ClearPaint():
            return "erasing paint" if isinstance(change, RemovePaint) else "clearing all paint"
        case SetLamp() | RemoveLamp():
            identity = change.lamp.id if isinstance(change, SetLamp) else change.id
            old = [lamp.name for lamp in state.lamps if lamp.id == identity]
            name = change.lamp.name if isinstance(change, SetLamp) else (old or [identity])[0]
            return f"{_verb(bool(old), removed=isinstance(change, RemoveLamp))}{name}"
        case SetGlass():
            return f"glass {change.glass.portal}"
        case SetWorld():
            return "world outside"
        case SetTimeline():
            return "timeline"
        case SaveLook(name):
            return f"keeping {name}"
        case ShowLook(name):
            return f"showing {name}"
        case RemoveLook(name):
            return f"forgetting {name}"
        case OpenRig():
            return "opening a rig"
    return ""


def _touched(change: Change, state: State) -> str:
    """Which numbers of a lamp, or stroke of paint, a message changes: two sliders one after the other are two steps."""
    if isinstance(change, SetPaint):
        return change.stroke.id  # each stroke is a step
    if not isinstance(change, SetLamp):
        return ""
    old = next((lamp for lamp in state.lamps if lamp.id == change.lamp.id), None)
    if old is None:
        return ""
    return ", ".join(f.name for f in fields(old) if getattr(old, f.name) != getattr(change.lamp, f.name))


def _verb(known: bool, *, removed: bool) -> str:
    return "removing " if removed else "" if known else "adding "

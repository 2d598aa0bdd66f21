"""The live session: the rig that all see, and the one thread that makes light of it.

Messages change the state at once and wait in no queue: the thread takes the newest state whenever it is free and
somebody has room for a frame, so whatever came in between was never computed. It answers coarsely first; when
the hand rests, exactly.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..errors import InputError
from ..storage.bake import Bake
from .environments import Environments
from .frames import FRAME_ASIDE, FRAME_EXACT, FrameHeader
from .history import History, Looks
from .protocol import Change, LayerPace, State
from .rig_state import sky_id
from .rig_toml import opened_rig

if TYPE_CHECKING:
    from .whole_light import Lighting

_REST = 0.15  # seconds without a change after which a hand that drags is at rest
_STOP_PATIENCE = 3.0  # seconds


@dataclass(frozen=True)
class Frame:
    """A radiance frame, ready to be sent, and what it took."""

    number: int
    data: bytes
    exact: bool
    sequence: int
    kind: str
    relight_ms: float
    pack_ms: float
    strong_lights: int
    layers: tuple[LayerPace, ...] = ()


@dataclass(frozen=True)
class Listener:
    """Whom the session tells, from its thread."""

    frame: Callable[[Frame], None]
    aside: Callable[["Aside"], None]  # the light of a look that was asked for
    waiting: Callable[
        [str | None], None
    ]  # what it is busy with before the first frame; None: nothing any more
    stops: Callable[[State], None]  # the exposure of the map has become known
    refused: Callable[[InputError], None]  # a state that was accepted cannot be lit
    failed: Callable[[BaseException], None]  # it cannot go on


@dataclass(frozen=True)
class Aside:
    """The light of a look, for the visitor who asked for it; ``data`` is a whole frame."""

    visitor: int
    look: str
    light: State
    data: bytes


class Superseded(Exception):
    """There is a newer state: what was being computed is not wanted any more."""


class Session:
    """The rig of a bake and its radiance.

    Parameters
    ----------
    bake, environments
        What is lit, and the maps that can light it.
    state, looks
        To begin with.
    listener
        Its functions are called from the session's thread.
    """

    def __init__(
        self,
        bake: Bake,
        environments: Environments,
        *,
        state: State,
        listener: Listener,
        looks: Looks = (),
    ) -> None:
        self._bake, self._environments, self._tell = bake, environments, listener
        self._history = History(state, looks, opened=lambda text, now: opened_rig(text, now, environments))
        self._changed_at, self._dragging = time.monotonic(), False
        self._asides: dict[int, str] = {}  # looks that visitors asked for
        self._has_room, self._stopping = True, False
        self._shown: tuple[State, bool] | None = None  # and whether exactly
        self._number = 0
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="relighting", daemon=True)

    @property
    def state(self) -> State:
        """As it is now."""
        return self._history.state

    @property
    def looks(self) -> Looks:
        """What is kept."""
        return self._history.looks

    def start(self) -> None:
        """Open the bake and begin."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread, and wait for it; what it computes is given up."""
        with self._news:
            self._stopping = True
            self._news.notify_all()
        if self._thread.is_alive():
            self._thread.join(_STOP_PATIENCE)

    def change(self, change: Change, *, author: int | None) -> State:
        """Change the state. Raises InputError, and nothing has changed, for what is not possible.

        A map must be among the environments, and is not opened here.
        """
        with self._news:
            if (name := getattr(change, "environment", None)) is not None and name not in self._environments:
                known = ", ".join(choice.id for choice in self._environments.choices)
                raise InputError("SetEnvironment.environment", f"{name[:60]!r}, expected one of {known}")
            state = self._history.obey(change, author=author)
            self._dragging = getattr(change, "dragging", False)
            self._changed_at = time.monotonic()
            self._news.notify_all()
            return state

    def compare(self, look: str, *, visitor: int) -> None:
        """Light a look for one visitor when nothing else is to do. Raises InputError if none has that name."""
        with self._news:
            self._history.look(look)
            self._asides[visitor] = look
            self._news.notify_all()

    def set_room(self, *, has_room: bool) -> None:
        """Whether anybody can take a frame now."""
        with self._news:
            self._has_room = has_room
            self._news.notify_all()

    # ---- The thread --------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._tell.waiting("opening the bake (the first time, compiling for this machine too: a minute)")
            from .whole_light import lighting_of  # brings the compiler along: the page need not wait for it

            light = lighting_of(self._bake, self._environments)
            self._show_or_refuse(light, *self._next())
            self._tell.waiting(None)
            is_warm = False
            while not self._stopping:
                state, exact = self._next()
                if exact and self._shown == (state, True):
                    self._show_aside(light)
                    continue
                self._show_or_refuse(light, state, exact)
                if exact and not is_warm:
                    light.warm(state)
                    is_warm = True
        except Superseded:
            pass  # by the end of the session
        except BaseException as error:
            self._tell.failed(error)

    def _next(self) -> tuple[State, bool]:
        """Wait for something to do: a state, and whether to light it exactly. Raises Superseded at the end."""
        with self._news:
            while not self._stopping:
                shown, exactly = self._shown or (None, False)
                if shown is not self.state:
                    if self._has_room:
                        return self.state, False
                    self._news.wait()
                elif exactly and self._asides:
                    return self.state, True
                elif exactly:
                    self._news.wait()
                else:
                    left = self._changed_at + _REST - time.monotonic() if self._dragging else 0.0
                    if left <= 0:
                        return self.state, True
                    self._news.wait(left)
        raise Superseded

    def _show_or_refuse(self, light: Lighting, state: State, exact: bool) -> None:
        try:
            self._show(light, state, exact)
        except InputError as error:
            self._shown = state, True
            self._tell.refused(error)

    def _show_aside(self, light: Lighting) -> None:
        """Light the looks that were asked for, until there is a newer state."""
        here = self.state

        def check() -> None:
            if self._stopping or self.state is not here:
                raise Superseded

        while self._asides:
            visitor, name = next(iter(self._asides.items()))
            try:
                look = self._history.look(name)
                light.relight(look, exact=True, check=check)
                data = light.frame(look)
                FrameHeader(0, look.sequence, light.rows, 0.0, FRAME_EXACT | FRAME_ASIDE).write(data)
                self._tell.aside(Aside(visitor, name, look, bytes(data)))
            except InputError as error:
                self._tell.refused(error)
            except Superseded:
                if self._stopping:
                    raise
                return  # again when that one is shown
            with self._news:
                if self._asides.get(visitor) == name:
                    del self._asides[visitor]

    def _show(self, light: Lighting, state: State, exact: bool) -> None:
        """Light a state and tell; nothing, if there is a newer one before an exact answer is found."""

        def check() -> None:
            if self._stopping or (exact and self.state is not state):
                raise Superseded

        began = time.perf_counter()
        try:
            is_exact, kind, strong = light.relight(state, exact=exact, check=check)
        except Superseded:
            if self._stopping:
                raise
            return
        if state.stops is None:
            state = self._with_stops(state)
        packing = time.perf_counter()
        data = light.frame(state)
        ended = time.perf_counter()
        self._number = (self._number + 1) % 2**32
        relight_ms, pack_ms = (packing - began) * 1e3, (ended - packing) * 1e3
        flags = FRAME_EXACT if is_exact else 0
        FrameHeader(self._number, state.sequence, light.rows, relight_ms + pack_ms, flags).write(data)
        self._shown, self._has_room = (state, is_exact), False  # until the hub says so again
        self._tell.frame(
            Frame(
                self._number, bytes(data), is_exact, state.sequence, kind, relight_ms, pack_ms, strong,
                light.layers,
            )
        )  # fmt: skip

    def _with_stops(self, state: State) -> State:
        """The same with the exposure of its map, which is open by now; the session's too, if it is still this one."""
        known = replace(state, stops=self._environments.stops(sky_id(state)))
        with self._news:
            if self.state is state:
                self._history.note(known)
                self._tell.stops(known)
        return known

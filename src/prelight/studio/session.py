"""The live session: the rig that all see, and the one thread that makes light of it.

Messages change the state at once and wait in no queue: the thread takes the newest state whenever it is free and
somebody has room for a frame, so whatever came in between was never computed. It answers coarsely first; when
the hand rests, exactly.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..errors import InputError
from ..lighting.quantities import Triple
from ..storage.bake import Bake
from .environments import Environments
from .frames import FRAME_ASIDE, FRAME_EXACT, FRAME_SHINE, FRAME_VIEW, FRAME_WORLD, HEADER_BYTES, FrameHeader
from .history import History, Looks
from .protocol import MOST_LOOKS, Change, State
from .protocol_values import LayerPace
from .rig_state import sky_id
from .rig_toml import opened_rig

if TYPE_CHECKING:
    from .lit_rows import Lighting, View

_REST = 0.15  # seconds without a change after which a hand that drags is at rest
_STOP_PATIENCE = 3.0  # seconds
_LIGHT_FIRST = 2.0  # times what was spent on views is left to light before the next


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
    view: Callable[["Viewed"], None]  # what depends on the eye, for somebody who asked
    waiting: Callable[
        [str | None], None
    ]  # what it is busy with before the first frame; None: nothing any more
    stops: Callable[[State], None]  # the exposure of the map has become known
    refused: Callable[[InputError], None]  # a state that was accepted cannot be lit
    failed: Callable[[BaseException], None]  # it cannot go on


@dataclass(frozen=True)
class Aside:
    """The light of a look, for the visitor who asked for it; ``data`` is a whole frame, and so is ``view``.

    ``view``: what depends on the visitor's eye; None where it was not asked for, or there is no such thing.
    """

    visitor: int
    look: str | None
    light: State
    data: bytes
    view: bytes | None = None


@dataclass(frozen=True)
class Viewed:
    """What depends on the eye of a visitor; ``data`` is a whole frame."""

    visitor: int
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
        self._asides: dict[
            tuple[int, str | None], Triple | None
        ] = {}  # looks that visitors asked for, and their eyes
        self._eyes: dict[int, Triple] = {}  # from where visitors want to see
        self._eyes_after = 0.0  # when the next of them may be answered: light goes first
        self._worlds: set[str] = set()  # that have been read
        self._lit: State | None = None  # what the light that is there is of
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

    def compare(self, look: str | None, *, visitor: int, eye: Triple | None = None) -> None:
        """Light a look for one visitor when nothing else is to do; None: as it was before the last step.

        ``eye``: from where it is seen; a newer one replaces one that still waits.

        Raises InputError if none has that name, or a visitor asks for more than there can be.
        """
        with self._news:
            if look is not None:
                self._history.look(look)
            if sum(who == visitor for who, _ in self._asides) > MOST_LOOKS:
                raise InputError("Compare", f"more than {MOST_LOOKS} looks are asked for already")
            self._asides[visitor, look] = eye
            self._news.notify_all()

    def look_from(self, eye: Triple, *, visitor: int) -> None:
        """Tell a visitor what depends on the eye, once; a newer eye replaces one that still waits."""
        with self._news:
            self._eyes[visitor] = eye
            self._news.notify_all()

    def forget(self, visitor: int) -> None:
        """A visitor has gone: nothing is made for him any more."""
        with self._news:
            self._eyes.pop(visitor, None)
            for key in [key for key in self._asides if key[0] == visitor]:
                del self._asides[key]

    def set_room(self, *, has_room: bool) -> None:
        """Whether anybody can take a frame now."""
        with self._news:
            self._has_room = has_room
            self._news.notify_all()

    # ---- The thread --------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._tell.waiting("opening the bake (the first time, compiling for this machine too: a minute)")
            from .lighting import lighting_of  # brings the compiler along: the page need not wait for it

            light = lighting_of(self._bake, self._environments)
            is_warm, is_first = False, True
            while not self._stopping:
                wanted = self._next()
                if wanted is None:
                    self._answer_eyes(light)
                    self._show_asides(light)
                    continue
                self._show_or_refuse(light, *wanted)
                if is_first:
                    self._tell.waiting(None)
                self._answer_eyes(light)
                if not is_warm and self._shown is not None and self._shown[1]:
                    with suppress(InputError):  # of a map that has gone: the next state tells
                        light.warm(wanted[0])
                    is_warm = True
                is_first = False
        except Superseded:
            pass  # by the end of the session
        except BaseException as error:
            self._tell.failed(error)

    def _next(self) -> tuple[State, bool] | None:
        """Wait for something to do: a state, and whether to light it exactly; None: what else was asked for.

        Raises Superseded at the end.
        """
        with self._news:
            while not self._stopping:
                shown, exactly = self._shown or (None, False)
                is_old, now = shown is not self.state, time.monotonic()
                if is_old and self._has_room:
                    return self.state, False
                if self._eyes and shown is not None and now >= self._eyes_after:
                    return None
                if exactly and self._asides and not is_old:
                    return None
                waits = [self._eyes_after - now] if self._eyes and shown is not None else []
                if not is_old and not exactly:
                    left = self._changed_at + _REST - now if self._dragging else 0.0
                    if left <= 0:
                        return self.state, True
                    waits.append(left)
                self._news.wait(min(waits, default=None))
        raise Superseded

    def _show_or_refuse(self, light: Lighting, state: State, exact: bool) -> None:
        try:
            self._show(light, state, exact)
        except InputError as error:
            self._shown = state, True
            self._tell.refused(error)

    def _answer_eyes(self, light: Lighting) -> None:
        """What depends on the eye, of the light that is there; light itself goes first, and gets more of the time."""
        began = time.monotonic()
        if self._shown is None or began < self._eyes_after:
            return
        state, exact = self._shown
        with self._news:
            eyes, self._eyes = self._eyes, {}
        for visitor, eye in eyes.items():
            try:
                if self._lit is not state:  # a look was lit in between
                    light.relight(state, exact=exact, check=lambda: None)
                    self._lit = state
                seen = light.view(state, eye)
            except InputError as error:
                self._tell.refused(error)
                seen = None  # an answer all the same: the page waits for one
            self._tell.view(Viewed(visitor, _view_frame(state, seen)))
        if eyes:
            ended = time.monotonic()
            self._eyes_after = ended + _LIGHT_FIRST * (ended - began)

    def _show_asides(self, light: Lighting) -> None:
        """Light the looks that were asked for, until there is a newer state."""
        here = self.state
        if self._shown is None or self._shown[0] is not here or not self._shown[1]:
            return

        def check() -> None:
            if self._stopping or self.state is not here:
                raise Superseded

        while self._asides:
            with self._news:
                (visitor, name), eye = next(iter(self._asides.items()), ((0, None), None))
            try:
                look = self._history.before if name is None else self._history.look(name)
                self._lit = None
                light.relight(look, exact=True, check=check)
                data = light.frame(look)
                FrameHeader(0, look.sequence, light.rows, 0.0, FRAME_EXACT | FRAME_ASIDE).write(data)
                seen = None if eye is None else light.view(look, eye)
                view = _view_frame(look, seen, FRAME_ASIDE) if seen is not None and seen.is_any else None
                self._tell.aside(Aside(visitor, name, look, bytes(data), view))
            except InputError as error:
                self._tell.refused(error)
            except Superseded:
                if self._stopping:
                    raise
                return  # again when that one is shown
            with self._news:
                if self._asides.get((visitor, name)) == eye:  # or it is asked for from elsewhere by now
                    self._asides.pop((visitor, name), None)

    def _show(self, light: Lighting, state: State, exact: bool) -> None:
        """Light a state and tell; nothing, if there is a newer one before an exact answer is found."""

        def check() -> None:
            if self._stopping or (exact and self.state is not state):
                raise Superseded

        began = time.perf_counter()
        try:
            self._lit = None
            with self._patience(state):
                is_exact, kind, strong = light.relight(state, exact=exact, check=check)
            self._lit = state
        except Superseded:
            if self._stopping:
                raise
            return
        if state.stops is None:
            state = self._lit = self._with_stops(state)
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

    @contextmanager
    def _patience(self, state: State) -> Generator[None]:
        """Tell what takes long: a world that is read for the first time."""
        is_new = state.world is not None and state.world not in self._worlds
        if is_new:
            self._tell.waiting("reading the world outside")
        try:
            yield
            if state.world is not None:
                self._worlds.add(state.world)
        finally:
            if is_new:
                self._tell.waiting(None)

    def _with_stops(self, state: State) -> State:
        """The same with the exposure of its map, which is open by now; the session's too, if it is still this one."""
        known = replace(state, stops=self._environments.stops(sky_id(state)))
        with self._news:
            now = self.state
            if now is state:
                self._history.note(known)
                self._tell.stops(known)
            elif now.stops is None and now.environment == state.environment:
                # Otherwise each step of a drag would ask again.
                self._history.note(replace(now, stops=known.stops))
                self._tell.stops(self.state)
        return known


def _view_frame(state: State, view: View | None, flags: int = 0) -> bytes:
    shine = b"" if view is None or view.shine is None else view.shine.tobytes()
    world = b"" if view is None or view.world is None else view.world.tobytes()
    flags |= FRAME_VIEW | (FRAME_SHINE if shine else 0) | (FRAME_WORLD if world else 0)
    head = bytearray(HEADER_BYTES)
    FrameHeader(0, state.sequence, (len(shine) + len(world)) // 4, 0.0, flags).write(head)
    return bytes(head) + shine + world

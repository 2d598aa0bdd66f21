"""Where visitors meet: messages of all go to one session, its frames and states to all."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from starlette.websockets import WebSocket, WebSocketDisconnect

from ..errors import InputError, PrelightError
from .environments import Environments
from .greeting import greeting
from .history import Looks
from .kept import load, save, without_map
from .protocol import (
    PROTOCOL_VERSION,
    ClientMessage,
    Compare,
    Hello,
    LookFrom,
    Mark,
    Marked,
    Refused,
    Seen,
    ServerMessage,
    SetEnvironment,
    SetGlass,
    SetWorld,
    State,
    StopTrace,
    Trace,
    Traced,
    Waiting,
    Welcome,
)
from .rig_state import initial, sky_id
from .rig_toml import rig_text
from .session import Aside, Frame, Listener, Session, Viewed
from .shown import Shown
from .timeline_rig import timeline_text
from .tracing import Pictures, Tracing
from .visitor import Visitor
from .wire import decode, encode

MOST_VISITORS = 30
_HELLO_WITHIN = 5.0  # seconds
_AT_ONCE = 8  # messages of a page that are taken before others have their turn
_STATES_EVERY = 8e-3  # seconds: what all are told after each change of a flood was most of the loop's work
_SAVE_AFTER = 0.3  # seconds from a change, whatever comes after it


class Hub:
    """The visitors of a studio, and the session that they share. Lives on the event loop.

    Parameters
    ----------
    state_file
        Where the rig is kept; read when the hub is made. One that is damaged, or not the studio's, is left as it is
        and the rig is not kept.
    note
        Is told, in a line, what the person at the terminal should know.
    failed
        Is called when the session cannot go on.
    pictures
        The path tracer, where there is one.
    """

    def __init__(
        self,
        shown: Shown,
        environments: Environments,
        *,
        state_file: Path,
        note: Callable[[str], None],
        failed: Callable[[BaseException], None],
        pictures: Pictures | None = None,
    ) -> None:
        self._shown, self._environments, self._note, self._failed = shown, environments, note, failed
        self._file: Path | None = state_file
        self._visitors: set[Visitor] = set()
        self._sockets: set[WebSocket] = set()
        self._numbers = 0
        self._frame: Frame | None = None
        self._greeting: Welcome | None = None  # without a number
        self._waiting: str | None = None
        self._saving: asyncio.Task[None] | None = None
        self._telling: asyncio.TimerHandle | None = None  # of a state that has not been told yet
        self._told_at = 0.0
        self._told: tuple[State, str] | None = None  # the newest, and its JSON
        self._saved, looks = self._first_state()
        self._tracing = Tracing(shown.bake, environments, pictures=pictures, tell=self._traced)
        self._session = Session(
            shown.bake, environments, state=self._saved, looks=looks, listener=self._listener()
        )

    def _first_state(self) -> tuple[State, Looks]:
        """What is kept of the last visit, or the first map as it is."""
        start = initial(self._environments.first)
        if self._file is None or not self._file.exists():
            return start, ()
        try:
            kept, looks = load(self._file, start)
        except InputError as error:
            self._note(f"{error}; it is left as it is, and the rig is not kept this time")
            self._file = None
            return start, ()
        known = [choice.id for choice in self._environments.choices]
        if kept.environment not in known:
            self._note(
                f"the environment {kept.environment!r} of the last visit is not there; name its map again"
            )
        first = start.environment
        worlds = [world.id for world in self._environments.worlds.views]
        kept_looks = tuple(
            (name, without_map(look, known, first=first, worlds=worlds)) for name, look in looks
        )
        return without_map(kept, known, first=first, worlds=worlds), kept_looks

    def rig(self) -> str:
        """The light as a rig file. Raises InputError for what no file can say. Safe from any thread."""
        name = self._shown.bake.manifest.scene.name
        return rig_text(self._session.state, self._environments, takes=self._shown.takes, title=name)

    def timeline(self) -> str:
        """The timeline as a rig file whose lamps fade. Raises InputError for what no file can say."""
        session, name = self._session, self._shown.bake.manifest.scene.name
        takes = self._shown.takes
        return timeline_text(session.state, session.looks, self._environments, takes=takes, title=name)

    def start(self) -> None:
        """Begin, on the running event loop."""
        self._loop = asyncio.get_running_loop()
        self._session.start()

    async def dismiss(self, code: int, reason: str) -> None:
        """Close the sockets of all pages."""
        for socket in list(self._sockets):
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                await socket.close(code, reason)

    async def stop(self) -> None:
        """End the session and keep its rig."""
        await asyncio.to_thread(self._tracing.close)
        await asyncio.to_thread(self._session.stop)
        for waits in (self._saving, self._telling):
            if waits is not None:
                waits.cancel()
        self._save(self._session.state)

    # ---- From the session's thread ----------------------------------------------------------------------

    def _listener(self) -> Listener:
        def on_loop(function: Callable) -> Callable:
            def call(value: object) -> None:
                with contextlib.suppress(RuntimeError):  # the loop has ended
                    self._loop.call_soon_threadsafe(function, value)

            return call

        return Listener(
            frame=on_loop(self._show),
            aside=on_loop(self._show_aside),
            view=on_loop(self._show_view),
            waiting=on_loop(self._wait),
            stops=on_loop(lambda _: self._tell_state()),  # the newest: it may be another by now
            refused=on_loop(lambda error: self._tell_all(Refused("State", str(error)))),
            failed=on_loop(self._failed),
        )

    def _traced(self, visitor: int, said: Traced, data: bytes | None) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._show_traced, visitor, said, data)

    def _show(self, frame: Frame) -> None:
        self._frame = frame
        for visitor in self._visitors:
            visitor.show(frame)
        self._look_for_room()

    def _show_aside(self, aside: Aside) -> None:
        for visitor in self._visitors:
            if visitor.number == aside.visitor:
                visitor.show_aside(aside)

    def _show_view(self, seen: Viewed) -> None:
        for visitor in self._visitors:
            if visitor.number == seen.visitor:
                visitor.show_view(seen.data)

    def _wait(self, reason: str | None) -> None:
        self._waiting = reason
        self._tell_all(Waiting(reason))

    def _tell_all(self, message: ServerMessage) -> None:
        text = encode(message)
        for visitor in self._visitors:
            visitor.tell(message, text=text)

    def _tell_state(self) -> None:
        """Tell all the newest state: at once, or soon where they have just been told one."""
        if self._telling is None:
            wait = self._told_at + _STATES_EVERY - self._loop.time()
            if wait <= 0:
                self._tell_state_now()
            else:
                self._telling = self._loop.call_later(wait, self._tell_state_now)

    def _tell_state_now(self) -> None:
        self._telling, self._told_at = None, self._loop.time()
        state = self._session.state
        for visitor in self._visitors:
            visitor.tell(state, text=self._text_of(state))

    def _text_of(self, state: State) -> str:
        """A state's JSON, made once: a page may ask for it with each mark."""
        if self._told is None or self._told[0] is not state:
            self._told = state, encode(state)
        return self._told[1]

    def _look_for_room(self) -> None:
        self._session.set_room(has_room=not self._visitors or any(v.has_room for v in self._visitors))

    # ---- A visit -----------------------------------------------------------------------------------------

    async def visit(self, socket: WebSocket) -> None:
        """Serve a page until it goes."""
        await socket.accept()
        if len(self._sockets) >= MOST_VISITORS:
            await socket.close(1013, f"{MOST_VISITORS} pages are open already")
            return
        self._sockets.add(socket)
        try:
            if await self._greeted(socket):
                await self._serve(socket)
        except (WebSocketDisconnect, RuntimeError):
            pass  # it went away while something was sent
        finally:
            self._sockets.discard(socket)

    async def _greeted(self, socket: WebSocket) -> bool:
        """Whether the first message is a ``Hello`` of our version; otherwise the socket is closed with a sentence."""
        try:
            async with asyncio.timeout(_HELLO_WITHIN):
                hello = await _received(socket)
        except (TimeoutError, InputError):
            hello = None
        if not isinstance(hello, Hello):
            await socket.close(1002, "expected Hello with the version of the page")
            return False
        if hello.version != PROTOCOL_VERSION:
            said = (
                f"the page speaks version {hello.version}, the studio {PROTOCOL_VERSION}; load the page anew"
            )
            await socket.close(1002, said)
            return False
        return True

    async def _serve(self, socket: WebSocket) -> None:
        self._numbers += 1
        visitor = Visitor(self._numbers)
        visitor.tell(await self._welcome(visitor))
        if self._waiting is not None:
            visitor.tell(Waiting(self._waiting))
        self._visitors.add(visitor)
        if self._frame is not None:
            visitor.show(self._frame)
        sender = asyncio.create_task(
            visitor.send_all(socket.send_text, socket.send_bytes, has_room=self._look_for_room)
        )
        try:
            await self._listen(socket, visitor)
        finally:
            self._visitors.discard(visitor)
            self._session.forget(visitor.number)
            self._tracing.stop(visitor.number)
            sender.cancel()
            self._look_for_room()

    async def _welcome(self, visitor: Visitor) -> Welcome:
        if self._greeting is None:
            begin, missing = self._session.state, self._tracing.missing
            self._greeting = await asyncio.to_thread(
                greeting, self._shown, self._environments, state=begin, no_tracer=missing
            )
        return replace(self._greeting, visitor=visitor.number, state=self._session.state)

    async def _listen(self, socket: WebSocket, visitor: Visitor) -> None:
        for taken in itertools.count(1):
            if taken % _AT_ONCE == 0:
                await asyncio.sleep(0)  # what has come already is received without a pause: others wait
            try:
                message = await _received(socket)
                is_seen = isinstance(message, Seen | Mark)
            except InputError as error:
                visitor.tell(Refused("message", str(error)))
                is_seen, message = False, None
            if not visitor.may_send(is_seen=is_seen):
                await socket.close(1008, "too many messages")
                return
            if isinstance(message, Seen):
                visitor.seen(message)
                self._look_for_room()
            elif isinstance(message, Mark):
                if self._telling is not None:  # from a mark on its page shows what it has been told
                    state = self._session.state
                    visitor.tell(state, text=self._text_of(state))
                visitor.tell(Marked(message.number, self._session.state.sequence))
            elif message is not None:
                await self._obey(message, visitor)

    async def _obey(self, message: ClientMessage, visitor: Visitor) -> None:
        try:
            if isinstance(message, Hello | Seen | Mark):
                raise InputError("Hello", "said already; expected once, as the first message")
            if isinstance(message, SetGlass) and message.glass.portal not in [
                portal.name for portal in self._shown.portals
            ]:
                raise InputError("SetGlass.portal", f"{message.glass.portal[:60]!r} is none of this bake's")
            if isinstance(message, Compare):
                self._session.compare(message.look, visitor=visitor.number, eye=message.eye)
                return
            if isinstance(message, LookFrom):
                self._session.look_from(message.eye, visitor=visitor.number)
                return
            if isinstance(message, Trace | StopTrace):
                self._trace(message, visitor)
                return
            if isinstance(message, SetWorld) and message.world is not None:
                self._environments.worlds.open(message.world)  # or it is not accepted
            if isinstance(message, SetEnvironment) and message.environment is not None:
                await asyncio.to_thread(self._open_map, message.environment)  # or it is not accepted
            self._session.change(message, author=visitor.number)
        except InputError as error:
            visitor.tell(Refused(type(message).__name__, str(error)))
            return
        self._tell_state()
        self._save_soon()

    def _trace(self, message: Trace | StopTrace, visitor: Visitor) -> None:
        """Begin a picture by the path tracer, in place of any other, or end it. Raises InputError."""
        if isinstance(message, StopTrace):
            self._tracing.stop(visitor.number)
            return
        state = self._session.state
        self._tracing.start(message, state, takes=self._shown.takes, visitor=visitor.number)

    def _show_traced(self, visitor_number: int, said: Traced, data: bytes | None) -> None:
        for visitor in self._visitors:
            if visitor.number == visitor_number:
                if data is not None:
                    visitor.show_view(data)
                visitor.tell(said)

    def _open_map(self, key: str) -> None:
        self._environments.open(sky_id(replace(self._session.state, environment=key)))

    # ---- Keeping the rig ---------------------------------------------------------------------------------

    def _save_soon(self) -> None:
        if self._saving is None or self._saving.done():
            self._saving = asyncio.create_task(self._save_later())

    async def _save_later(self) -> None:
        while self._session.state.sequence != self._saved.sequence and self._file is not None:
            await asyncio.sleep(_SAVE_AFTER)
            await asyncio.to_thread(self._save, self._session.state)

    def _save(self, state: State) -> None:
        if self._file is None or state.sequence == self._saved.sequence:
            return
        try:
            save(state, self._file, looks=self._session.looks)
            self._saved = state
        except PrelightError as error:
            self._file = None
            self._note(f"{error}; the rig is not kept")


async def _received(socket: WebSocket) -> ClientMessage:
    """The next message. Raises InputError for one that is none, WebSocketDisconnect at the end."""
    event = await socket.receive()
    if event["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(event.get("code") or 1005)
    text = event.get("text")
    if text is None:
        raise InputError("message", "binary, expected text")
    return decode(text)

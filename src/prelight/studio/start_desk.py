"""The start page's side of the studio: its visitors, who all see the same workshop, and its routes."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from ..errors import InputError, PrelightError
from .projects import Project
from .protocol import Hello, Message, Refused
from .start_protocol import (
    START_VERSION,
    Bake,
    ChooseStock,
    OpenBake,
    Opened,
    SetWish,
    StartMessage,
    Stop,
    Taken,
    TakeUpload,
)
from .start_protocol import (
    Workshop as WorkshopMessage,
)
from .visitor import Visitor
from .wire import decode
from .workshop import Workshop

MOST_VISITORS = 30
_HELLO_WITHIN = 5.0  # seconds
_TELL_EVERY = 0.15  # seconds, while a bake tells how far it is


class StartDesk:
    """Whoever looks at the start page. Lives on the event loop.

    Parameters
    ----------
    workshop
        What they see.
    show
        Has the studio show the bake of a project; raises PrelightError where it cannot.
    shown
        Which project the studio shows.
    """

    def __init__(
        self,
        workshop: Workshop,
        *,
        show: Callable[[Project], Awaitable[None]],
        shown: Callable[[], str | None],
    ) -> None:
        self._workshop, self._show, self._shown = workshop, show, shown
        self._visitors: set[Visitor] = set()
        self._sockets: set[WebSocket] = set()
        self._numbers = 0
        self._telling: asyncio.TimerHandle | None = None
        workshop.changed = self.tell_soon

    def routes(self) -> list[BaseRoute]:
        """For the studio's application; the page itself is a file of it."""
        return [
            Route("/start/file/{upload}", self._workshop.uploads.receive, methods=["POST"]),
            Route("/start/picture/{project}", self._picture),
            WebSocketRoute("/start/socket", self._visit),
        ]

    async def stop(self) -> None:
        """End what runs; bakes stay resumable."""
        if self._telling is not None:
            self._telling.cancel()
        self._workshop.changed = lambda: None
        await self._workshop.close()

    def tell_soon(self) -> None:
        """Tell all how it is, in a moment: much may change at once."""
        if self._telling is None:
            self._telling = asyncio.get_running_loop().call_later(_TELL_EVERY, self._tell_all)

    def _tell_all(self) -> None:
        self._telling = None
        message = self._message()
        for visitor in self._visitors:
            visitor.tell(message)

    def _message(self) -> WorkshopMessage:
        shop = self._workshop
        return WorkshopMessage(START_VERSION, str(shop.work), shop.stock, shop.views(), self._shown())

    def _picture(self, request: Request) -> Response:
        path = self._workshop.picture(request.path_params["project"])
        if path is None:
            return JSONResponse({"reason": "there is no such picture"}, 404)
        return FileResponse(path, media_type="image/png")

    # ---- A visit -----------------------------------------------------------------------------------------

    async def _visit(self, socket: WebSocket) -> None:
        await socket.accept()
        if len(self._sockets) >= MOST_VISITORS:
            await socket.close(1013, f"{MOST_VISITORS} pages are open already")
            return
        self._sockets.add(socket)
        try:
            if await _greeted(socket):
                await self._serve(socket)
        except (WebSocketDisconnect, RuntimeError):
            pass  # it went away while something was sent
        finally:
            self._sockets.discard(socket)

    async def _serve(self, socket: WebSocket) -> None:
        self._numbers += 1
        visitor = Visitor(self._numbers)
        visitor.tell(self._message())
        self._visitors.add(visitor)
        sender = asyncio.create_task(
            visitor.send_all(socket.send_text, socket.send_bytes, has_room=lambda: None)
        )
        try:
            while True:
                try:
                    message = await _received(socket)
                except InputError as error:
                    visitor.tell(Refused("message", str(error)))
                    message = None
                if not visitor.may_send(is_seen=False):
                    await socket.close(1008, "too many messages")
                    return
                if message is not None:
                    await self._obey(message, visitor)
        finally:
            self._visitors.discard(visitor)
            sender.cancel()

    async def _obey(self, message: Message, visitor: Visitor) -> None:
        try:
            if (told := await self._done(message)) is not None:
                visitor.tell(told)
        except PrelightError as error:
            visitor.tell(Refused(type(message).__name__, str(error)))
        self.tell_soon()

    async def _done(self, message: Message) -> Message | None:
        """Do what a message asks, and what its page alone is told. Raises PrelightError."""
        shop = self._workshop
        match message:
            case ChooseStock(scene):
                return Taken(shop.choose(scene))
            case TakeUpload(upload, main):
                return Taken(shop.take(upload, main))
            case SetWish(project, wish):
                shop.wish(project, wish)
            case Bake(project):
                shop.bake(project)
            case Stop(project):
                shop.stop(project)
            case OpenBake(name):
                project = shop.project(name)
                if not project.is_baked:
                    raise InputError("open", f"{project.name} is not baked yet")
                await self._show(project)
                return Opened(name)
            case _:
                raise InputError("Hello", "said already; expected once, as the first message")
        return None


async def _greeted(socket: WebSocket) -> bool:
    """Whether the first message is a ``Hello`` of our version; otherwise the socket is closed with a sentence."""
    try:
        async with asyncio.timeout(_HELLO_WITHIN):
            hello = await _received(socket)
    except (TimeoutError, InputError):
        hello = None
    if isinstance(hello, Hello) and hello.version == START_VERSION:
        return True
    said = "expected Hello with the version of the page"
    if isinstance(hello, Hello):
        said = f"the page speaks version {hello.version}, the studio {START_VERSION}; load the page anew"
    await socket.close(1002, said)
    return False


async def _received(socket: WebSocket) -> Message:
    """The next message. Raises InputError for one that is none, WebSocketDisconnect at the end."""
    event = await socket.receive()
    if event["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(event.get("code") or 1005)
    text = event.get("text")
    if text is None:
        raise InputError("message", "binary, expected text")
    return decode(text, StartMessage)

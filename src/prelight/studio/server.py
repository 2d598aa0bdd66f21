"""The server: the page's files, the scene, and a socket for each visitor. Serves until it is told to end.

It shows one bake at a time; the start page (``start_desk``) may have it show another, or the first.
"""

from __future__ import annotations

import asyncio
import re
import socket
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from ..errors import InputError, OutputError, PrelightError
from ..storage.bake import Bake
from .door import HOST, Door
from .environments import DAYLIGHT, Environments, daylight_id, sky_words
from .hub import Hub
from .kept import state_file
from .projects import Project
from .protocol import LARGEST_MESSAGE
from .rig_state import FIRST_SUN
from .shown import Shown
from .start_desk import StartDesk
from .tracing import Pictures
from .workshop import Workshop

USUAL_PORT = 8737
PAGE = Path(__file__).parent / "web" / "built"
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".png": "image/png",
    ".json": "application/json",
    ".woff2": "font/woff2",
    ".ico": "image/x-icon",
}
_NO_PAGE = b"<!doctype html><title>Prelight</title><p>This installation has no studio page (web/built is missing).</p>"
_PATIENCE = 2  # seconds that connections get to end
_AT_ONCE = 1 << 16  # bytes that are read of a connection before others have their turn: some hundred messages
_ANOTHER = 4001  # the close code of a socket whose bake is no longer shown: its page loads anew


@dataclass(frozen=True)
class Served:
    """What a studio shows and where; without a bake the start page, where one is made."""

    bake: Bake | None
    environments: Environments
    state_file: Path | None
    note: Callable[[str], None]  # a line for the person at the terminal
    pictures: Pictures | None = None  # the path tracer, where there is one
    workshop: Workshop | None = None


def page_files(folder: Path = PAGE) -> dict[str, tuple[bytes, str]]:
    """The page: content and type of each file by its path on the server. No other file is ever opened for it."""
    files = {
        f"/{path.name}": (path.read_bytes(), _TYPES[path.suffix])
        for path in sorted(folder.glob("*"))
        if path.is_file() and path.suffix in _TYPES
    }
    files["/"] = files.pop("/index.html", (_NO_PAGE, _TYPES[".html"]))
    return files


def bound_socket(port: int | None) -> socket.socket:
    """A listening socket on 127.0.0.1; ``None``: the usual port, or where that is taken any free one.

    Raises OutputError if the port cannot be had.
    """
    for number in (USUAL_PORT, 0) if port is None else (port,):
        # By its protocol asyncio knows that small messages are not to wait for others (TCP_NODELAY).
        listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        try:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _AT_ONCE)
            listening.bind((HOST, number))
            listening.listen(64)
            return listening
        except OSError as error:
            listening.close()
            said = (error.strerror or str(error)).lower()
            reason = f"port {number} of {HOST}: {said}; choose another or leave it out"
    raise OutputError("--port", reason)


class Showing:
    """A bake shown, or the start page, as an application (ASGI): whoever serves it sees to who may come in.

    Parameters
    ----------
    failed
        Is called with what makes it end.
    """

    def __init__(self, served: Served, *, page: Path = PAGE, failed: Callable[[BaseException], None]) -> None:
        self._served, self._failed = served, failed
        self._page = page_files(page)
        self._hub: Hub | None = None
        self._shown: Shown | None = None
        self._desk: StartDesk | None = None
        if served.workshop is not None:
            self._desk = StartDesk(served.workshop, show=self._show, shown=self._title)
            content, kind = self._page["/"]
            self._page["/"] = content.replace(b"<html ", b'<html data-start="/start" ', 1), kind
        if served.bake is not None:
            self._open(served.bake, served.state_file or state_file(served.bake.path))

    def start(self) -> None:
        """Begin, on the running event loop."""
        if self._hub is not None:
            self._hub.start()

    async def finish(self) -> None:
        """End, and keep the light; bakes that run stay resumable."""
        if self._desk is not None:
            await self._desk.stop()
        if self._hub is not None:
            await self._hub.stop()

    def _open(self, bake: Bake, kept: Path) -> Hub:
        """Have a bake shown; its hub is not started yet."""
        served = self._served
        self._shown = Shown(bake)
        self._hub = Hub(
            self._shown,
            served.environments,
            state_file=kept,
            note=served.note,
            failed=self._failed,
            pictures=served.pictures,
        )
        return self._hub

    def _title(self) -> str | None:
        """The name of what is shown, if anything is."""
        return None if self._shown is None else self._shown.bake.manifest.scene.name

    async def _show(self, project: Project) -> None:
        """Show the bake of a project in place of what is shown. Raises PrelightError, and nothing has changed."""
        bake = await asyncio.to_thread(Bake.open, project.bake)
        if self._hub is not None:
            await self._hub.dismiss(_ANOTHER, "another bake is shown")
            await self._hub.stop()
        self._open(bake, state_file(bake.path)).start()

    # ---- Routes ------------------------------------------------------------------------------------------

    def application(self) -> Starlette:
        """What answers requests and sockets."""
        return Starlette(
            routes=[
                Route("/geometry.json", self._index),
                Route("/geometry/{name}", self._array),
                Route("/texture/{index}", self._texture),
                Route("/preview/{name:path}", self._preview),
                Route("/sky/{name:path}", self._sky),
                Route("/rig.toml", self._rig),
                Route("/timeline.toml", self._timeline),
                *(self._desk.routes() if self._desk is not None else ()),
                Route("/{path:path}", self._file),
                WebSocketRoute("/socket", self._visit),
            ],
            exception_handlers={PrelightError: _said},
        )

    async def _visit(self, socket: WebSocket) -> None:
        if self._hub is None:
            await socket.accept()
            await socket.close(_ANOTHER, "no bake is shown")
            return
        await self._hub.visit(socket)

    async def _file(self, request: Request) -> Response:
        path = request.scope["path"]
        if path == "/" and self._hub is None:
            return RedirectResponse("/start", 303)
        if path == "/start" and self._desk is not None:
            path = "/"  # one page: it looks where it is
        content, kind = self._page.get(path, (None, ""))
        return _missing() if content is None else Response(content, media_type=kind)

    def _index(self, _request: Request) -> Response:
        return _missing() if self._shown is None else JSONResponse(self._shown.index())

    def _array(self, request: Request) -> Response:
        return _missing() if self._shown is None else _bytes(self._shown.array(request.path_params["name"]))

    def _texture(self, request: Request) -> Response:
        index: str = request.path_params["index"]
        if (
            self._shown is None
            or not re.fullmatch(r"[0-9]{1,6}", index, re.ASCII)
            or int(index) >= self._shown.textures
        ):
            return _missing()
        return _bytes(self._shown.texture_png(int(index)), "image/png")

    def _preview(self, request: Request) -> Response:
        known, name = self._served.environments, request.path_params["name"]
        return _bytes(known.preview(_daily(name)), "image/png") if name in known else _missing()

    def _sky(self, request: Request) -> Response:
        known, name = self._served.environments, request.path_params["name"]
        return _bytes(sky_words(known.open(_daily(name))).tobytes()) if name in known else _missing()

    def _rig(self, _request: Request) -> Response:
        if self._hub is None:
            return _missing()
        return _toml(self._hub.rig)

    def _timeline(self, _request: Request) -> Response:
        return _missing() if self._hub is None else _toml(self._hub.timeline)


def _toml(text: Callable[[], str]) -> Response:
    try:
        return Response(text(), media_type="application/toml")
    except InputError as error:
        return PlainTextResponse(f"{error.reason}\n", 409)


class Studio:
    """A studio on a port, from ``serve`` to ``stop``.

    Raises
    ------
    OutputError
        The port cannot be had.
    """

    def __init__(self, served: Served, *, port: int | None = None, page: Path = PAGE) -> None:
        self._socket = bound_socket(port)
        self._error: BaseException | None = None
        self._showing = Showing(served, page=page, failed=self._fail)
        self._door = Door(self._showing.application(), port=self.port)
        config = uvicorn.Config(
            self._door, loop="asyncio", http="h11", ws="websockets-sansio", lifespan="off",
            ws_max_size=LARGEST_MESSAGE, ws_per_message_deflate=False, ws_ping_interval=20, ws_ping_timeout=20,
            log_config=None, log_level="error", access_log=False, proxy_headers=False, server_header=False,
            timeout_graceful_shutdown=_PATIENCE,
        )  # fmt: skip
        self._server = uvicorn.Server(config)

    @property
    def port(self) -> int:
        return self._socket.getsockname()[1]

    def new_link(self) -> str:
        """A URL that opens the studio once."""
        return self._door.new_link()

    def serve(self) -> None:
        """Serve until ``stop``, or Ctrl-C, which is raised when everything has ended and the rig is kept.

        Raises what made the studio end: DamagedBakeError, InputError, …
        """
        asyncio.run(self._serve())

    def stop(self) -> None:
        """End soon; may be called from any thread."""
        self._server.should_exit = True

    async def _serve(self) -> None:
        self._showing.start()
        try:
            await self._server.serve(sockets=[self._socket])
        finally:
            await self._showing.finish()
        if self._error is not None:
            raise self._error

    def _fail(self, error: BaseException) -> None:
        self._error = error
        self.stop()


def _bytes(content: bytes | None, kind: str = "application/octet-stream") -> Response:
    return _missing() if content is None else Response(content, media_type=kind)


def _daily(name: str) -> str:
    """Of daylight as a choice, the first hour."""
    return daylight_id(FIRST_SUN) if name == DAYLIGHT else name


def _missing() -> Response:
    return PlainTextResponse("there is no such thing here\n", 404)


def _said(_request: Request, error: Exception) -> Response:
    return PlainTextResponse(f"{error}\n", 500)

"""The server: the page's files, the scene, and a socket for each visitor. Serves until it is told to end."""

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
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute

from ..errors import InputError, OutputError, PrelightError
from ..storage.bake import Bake
from .door import HOST, Door
from .environments import DAYLIGHT, Environments, daylight_id, sky_words
from .hub import Hub
from .protocol import LARGEST_MESSAGE
from .rig_state import FIRST_SUN
from .shown import Shown

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


@dataclass(frozen=True)
class Served:
    """What a studio shows and where."""

    bake: Bake
    environments: Environments
    state_file: Path
    note: Callable[[str], None]  # a line for the person at the terminal


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
        listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind((HOST, number))
            listening.listen(64)
            return listening
        except OSError as error:
            listening.close()
            said = (error.strerror or str(error)).lower()
            reason = f"port {number} of {HOST}: {said}; choose another or leave it out"
    raise OutputError("--port", reason)


class Studio:
    """A studio on a port, from ``serve`` to ``stop``.

    Raises
    ------
    OutputError
        The port cannot be had.
    """

    def __init__(self, served: Served, *, port: int | None = None, page: Path = PAGE) -> None:
        self._served = served
        self._shown = Shown(served.bake)
        self._page = page_files(page)
        self._socket = bound_socket(port)
        self._error: BaseException | None = None
        self._hub = Hub(
            self._shown,
            served.environments,
            state_file=served.state_file,
            note=served.note,
            failed=self._fail,
        )
        self._door = Door(self._application(), port=self.port)
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
        self._hub.start()
        try:
            await self._server.serve(sockets=[self._socket])
        finally:
            await self._hub.stop()
        if self._error is not None:
            raise self._error

    def _fail(self, error: BaseException) -> None:
        self._error = error
        self.stop()

    # ---- Routes ------------------------------------------------------------------------------------------

    def _application(self) -> Starlette:
        return Starlette(
            routes=[
                Route("/geometry.json", self._index),
                Route("/geometry/{name}", self._array),
                Route("/texture/{index}", self._texture),
                Route("/preview/{name}", self._preview),
                Route("/sky/{name}", self._sky),
                Route("/rig.toml", self._rig),
                Route("/{path:path}", self._file),
                WebSocketRoute("/socket", self._hub.visit),
            ],
            exception_handlers={PrelightError: _said},
        )

    async def _file(self, request: Request) -> Response:
        content, kind = self._page.get(request.scope["path"], (None, ""))
        return _missing() if content is None else Response(content, media_type=kind)

    def _index(self, _request: Request) -> Response:
        return JSONResponse(self._shown.index())

    def _array(self, request: Request) -> Response:
        return _bytes(self._shown.array(request.path_params["name"]))

    def _texture(self, request: Request) -> Response:
        index: str = request.path_params["index"]
        if not re.fullmatch(r"[0-9]{1,6}", index, re.ASCII) or int(index) >= self._shown.textures:
            return _missing()
        return _bytes(self._shown.texture_png(int(index)), "image/png")

    def _preview(self, request: Request) -> Response:
        known, name = self._served.environments, request.path_params["name"]
        return _bytes(known.preview(_daily(name)), "image/png") if name in known else _missing()

    def _sky(self, request: Request) -> Response:
        known, name = self._served.environments, request.path_params["name"]
        return _bytes(sky_words(known.open(_daily(name))).tobytes()) if name in known else _missing()

    def _rig(self, _request: Request) -> Response:
        try:
            return Response(self._hub.rig(), media_type="application/toml")
        except InputError as error:
            return PlainTextResponse(f"{error.reason}\n", 409)


def _bytes(content: bytes | None, kind: str = "application/octet-stream") -> Response:
    return _missing() if content is None else Response(content, media_type=kind)


def _daily(name: str) -> str:
    """Of daylight as a choice, the first hour."""
    return daylight_id(FIRST_SUN) if name == DAYLIGHT else name


def _missing() -> Response:
    return PlainTextResponse("there is no such thing here\n", 404)


def _said(_request: Request, error: Exception) -> Response:
    return PlainTextResponse(f"{error}\n", 500)

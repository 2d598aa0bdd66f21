"""A studio without a port: its requests and sockets are given by function calls, as a notebook's messages are."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable, Coroutine
from concurrent.futures import Future
from typing import Any

from .server import Served, Showing

Say = Callable[[str | bytes | None], None]  # what a socket says; None: it is closed
_PATIENCE = 10.0  # seconds
_LARGEST_PATH = 300


class Embedded:
    """A studio on a thread of its own; its functions may be called from any thread.

    Nothing of it listens: only who holds it can ask it.
    """

    def __init__(self, served: Served) -> None:
        self.error: BaseException | None = None
        self._showing = Showing(served, failed=self._fail)
        self._application = self._showing.application()
        self._sockets: dict[int, asyncio.Queue[str | None]] = {}
        self._visits: set[asyncio.Task[None]] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="studio", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.call_soon(self._showing.start)
        self._loop.run_forever()

    def _fail(self, error: BaseException) -> None:
        self.error = error

    def _soon(self, work: Coroutine[Any, Any, Any]) -> Future[Any]:
        return asyncio.run_coroutine_threadsafe(work, self._loop)

    def get(self, path: str, then: Callable[[int, bytes], None]) -> None:
        """Ask for a path; ``then`` is called with the status and the content, from the studio's thread."""
        self._soon(self._get(path, then))

    async def _get(self, path: str, then: Callable[[int, bytes], None]) -> None:
        parts: list[bytes] = []
        status = 404

        async def receive() -> dict[str, Any]:
            return {"type": "http.request", "body": b"", "more_body": False}

        async def send(message: Any) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            parts.append(message.get("body", b""))

        if path.startswith("/") and len(path) <= _LARGEST_PATH:
            with contextlib.suppress(Exception):  # its handler has told what is wrong
                await self._application(_scope("http", path), receive, send)
        then(status, b"".join(parts))

    def open(self, number: int, say: Say) -> None:
        """Open a socket under a number; ``say`` is called from the studio's thread."""
        self._loop.call_soon_threadsafe(self._open, number, say)

    def _open(self, number: int, say: Say) -> None:
        self._sockets[number] = asyncio.Queue()
        visit = self._loop.create_task(self._visited(number, say))
        self._visits.add(visit)
        visit.add_done_callback(self._visits.discard)

    async def _visited(self, number: int, say: Say) -> None:
        queue, begun = self._sockets[number], False

        async def receive() -> dict[str, Any]:
            nonlocal begun
            if not begun:
                begun = True
                return {"type": "websocket.connect"}
            text = await queue.get()
            if text is None:
                return {"type": "websocket.disconnect", "code": 1000}
            return {"type": "websocket.receive", "text": text}

        async def send(message: Any) -> None:
            if message["type"] == "websocket.send":
                say(message.get("text") or message.get("bytes") or "")
            elif message["type"] == "websocket.close":
                say(None)

        try:
            await self._application(_scope("websocket", "/socket"), receive, send)
        finally:
            self._sockets.pop(number, None)

    def tell(self, number: int, text: str | None) -> None:
        """Send a message through a socket; None closes it."""

        def put() -> None:
            if number in self._sockets:
                self._sockets[number].put_nowait(text)

        self._loop.call_soon_threadsafe(put)

    async def _finish(self) -> None:
        for queue in self._sockets.values():
            queue.put_nowait(None)
        await asyncio.gather(*self._visits, return_exceptions=True)
        await self._showing.finish()

    def close(self) -> None:
        """End; the light is kept."""
        if not self._thread.is_alive():
            return
        with contextlib.suppress(Exception):
            self._soon(self._finish()).result(_PATIENCE)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_PATIENCE)
        self._loop.close()


def _scope(kind: str, path: str) -> dict[str, Any]:
    scope: dict[str, Any] = {
        "type": kind, "asgi": {"version": "3.0"}, "path": path, "raw_path": path.encode(), "query_string": b"",
        "headers": [], "root_path": "", "scheme": "http" if kind == "http" else "ws", "subprotocols": [],
        "server": ("notebook", 0), "client": ("notebook", 0), "http_version": "1.1",
    }  # fmt: skip
    return scope | ({"method": "GET"} if kind == "http" else {})

"""A studio that runs in a thread of the test, and pages that are no browsers."""

from __future__ import annotations

import contextlib
import http.client
import json
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
import websockets.sync.client

from prelight.baking.environment import bake_environment
from prelight.storage.bake import Bake
from prelight.studio.environments import Environments
from prelight.studio.frames import FrameHeader
from prelight.studio.protocol import PROTOCOL_VERSION, ClientMessage, Hello, Seen
from prelight.studio.server import PAGE, Served, Studio
from prelight.studio.tracing import Pictures
from prelight.studio.wire import encode

from .scenes import ball_on_floor

PATIENCE = 20.0  # seconds until a test gives up


def ball_bake(folders: pytest.TempPathFactory) -> Path:
    """A ball on a floor, baked once for all tests of a process: copy it where it is to be changed."""
    path = folders.getbasetemp() / "studio" / "ball.prelight"
    if not path.exists():
        path.parent.mkdir()
        bake_environment(ball_on_floor(side=13, rings=8), path, resolution=80, tolerance=0.04, bounces=0)
    return path


class Page:
    """What a browser's page does: says Hello, acknowledges frames, keeps the newest."""

    def __init__(
        self, studio: LiveStudio, *, acknowledges: bool = True, version: int = PROTOCOL_VERSION
    ) -> None:
        self.acknowledges = acknowledges
        self.messages: list[dict[str, Any]] = []
        self.frames: list[tuple[FrameHeader, bytes]] = []
        self._open = contextlib.ExitStack()
        self.socket = self._open.enter_context(studio.connect())
        self.send(Hello(version))

    def send(self, message: ClientMessage | str) -> None:
        self.socket.send(message if isinstance(message, str) else encode(message))

    def take(self, timeout: float = PATIENCE) -> dict[str, Any] | FrameHeader:
        """The next message or frame. Raises TimeoutError."""
        got = self.socket.recv(timeout)
        if isinstance(got, str):
            self.messages.append(json.loads(got))
            return self.messages[-1]
        header = FrameHeader.read(got)
        self.frames.append((header, got))
        if self.acknowledges:
            self.send(Seen(header.frame))
        return header

    def until(self, wanted: Callable[[Any], bool]) -> Any:
        """The first message or frame that is wanted."""
        ends = time.monotonic() + PATIENCE
        while time.monotonic() < ends:
            if wanted(got := self.take()):
                return got
        raise TimeoutError

    def message(self, kind: str) -> dict[str, Any]:
        """The next message of a type."""
        return self.until(lambda got: isinstance(got, dict) and got["type"] == kind)

    def exact(self, sequence: int) -> bytes:
        """The exact radiance of a state, packed."""

        def is_it(got: Any) -> bool:
            return isinstance(got, FrameHeader) and (got.sequence, got.flags) == (sequence, 1)

        if not (self.frames and is_it(self.frames[-1][0])):
            self.until(is_it)
        return self.frames[-1][1][32:]

    def quiet(self, seconds: float = 0.4) -> None:
        """Take everything until nothing comes for a while."""
        with contextlib.suppress(TimeoutError):
            while True:
                self.take(seconds)

    def close(self) -> None:
        self._open.close()

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class LiveStudio:
    """A studio of a bake on any free port."""

    def __init__(
        self,
        bake: Path,
        *,
        state_file: Path,
        maps: Path | None = None,
        rigs: Sequence[Path] = (),
        page: Path = PAGE,
        pictures: Pictures | None = None,
    ) -> None:
        self.notes: list[str] = []
        known = Environments([str(rig) for rig in rigs], folder=maps)
        served = Served(Bake.open(bake), known, state_file, self.notes.append, pictures)
        self.studio = Studio(served, port=0, page=page)
        self.port = self.studio.port
        self.host = f"127.0.0.1:{self.port}"
        self.error: BaseException | None = None
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        answer = self.request("GET", self.link_path(), cookie=None)
        assert answer.status == 303, answer.status
        self.cookie = answer.getheader("set-cookie", "").split(";")[0]

    def _serve(self) -> None:
        try:
            self.studio.serve()
        except BaseException as error:
            self.error = error

    def link_path(self) -> str:
        return self.studio.new_link().removeprefix(f"http://{self.host}")

    def request(
        self, method: str, path: str, *, cookie: str | None = "", headers: dict[str, str | None] | None = None
    ) -> http.client.HTTPResponse:
        """One request, whose answer is read; cookie: "" ours, None none. A header of None is left out."""
        all_headers: dict[str, str | None] = {"Host": self.host}
        if cookie is not None:
            all_headers["Cookie"] = cookie or self.cookie
        all_headers |= headers or {}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for name, value in all_headers.items():
            if value is not None:
                connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        answer.content = answer.read()  # type: ignore[attr-defined]
        connection.close()
        return answer

    def get(self, path: str) -> bytes:
        answer = self.request("GET", path)
        assert answer.status == 200, (path, answer.status)
        return answer.content  # type: ignore[attr-defined]

    def connect(self, **options: Any) -> contextlib.AbstractContextManager[Any]:
        given = {"origin": f"http://{self.host}", "additional_headers": {"Cookie": self.cookie}} | options
        return websockets.sync.client.connect(
            f"ws://{self.host}/socket", compression=None, max_size=None, close_timeout=2, **given
        )

    def page(self, **options: Any) -> Page:
        return Page(self, **options)

    def stop(self) -> None:
        self.studio.stop()
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive()


@contextlib.contextmanager
def running(bake: Path, **options: Any) -> Iterator[LiveStudio]:
    """A studio for a while."""
    studio = LiveStudio(bake, **options)
    try:
        yield studio
    finally:
        studio.stop()

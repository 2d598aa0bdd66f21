"""A studio at its start page that runs in a thread of the test, and scenes to drop on it."""

from __future__ import annotations

import contextlib
import http.client
import json
import secrets
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import websockets.sync.client

from prelight.studio.environments import Environments
from prelight.studio.protocol import Hello
from prelight.studio.server import Served, Studio
from prelight.studio.start_protocol import START_VERSION, StockView
from prelight.studio.wire import encode
from prelight.studio.workshop import Workshop

from .scenes import ball_on_floor

PATIENCE = 60.0  # seconds
COMMAND = (sys.executable, "-P", "-m", "prelight.cli.child")


def small_ply(*, side: int = 9) -> bytes:
    """A ball on a floor as an ASCII PLY."""
    scene = ball_on_floor(side=side, rings=6)
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(scene.positions)}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(scene.triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    corners = ["{:g} {:g} {:g}".format(*p) for p in scene.positions]
    faces = ["3 {} {} {}".format(*t) for t in scene.triangles]
    return (head + "\n".join(corners + faces) + "\n").encode()


class StartStudio:
    """A studio without a bake; a second one on the same work folder is the first, restarted."""

    def __init__(self, work: Path, *, command: tuple[str, ...] = COMMAND) -> None:
        stock = (StockView("stock:sculpture-small", "a small one"),)
        self.workshop = Workshop(work, command=command, stock=stock)
        self.notes: list[str] = []
        self._visitors: list[StartVisitor] = []
        self.studio = Studio(
            Served(None, Environments(), None, self.notes.append, None, self.workshop), port=0
        )
        self.port = self.studio.port
        self.host = f"127.0.0.1:{self.port}"
        self._thread = threading.Thread(target=self.studio.serve, daemon=True)
        self._thread.start()
        status, headers, _ = self.request("GET", self.studio.new_link().removeprefix(f"http://{self.host}"))
        assert status == 303, status
        self.cookie = headers["set-cookie"].split(";")[0]

    def request(
        self, method: str, path: str, body: bytes | None = None, **headers: str
    ) -> tuple[int, dict[str, str], bytes]:
        """One request of our own page."""
        given = {"Host": self.host, "Origin": f"http://{self.host}", **headers}
        given |= {"Cookie": self.cookie} if hasattr(self, "cookie") else {}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        try:
            connection.request(
                method, path, body, {name.replace("_", "-"): value for name, value in given.items()}
            )
            answer = connection.getresponse()
            return answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read()
        finally:
            connection.close()

    def upload(self, name: str, data: bytes, upload: str | None = None) -> tuple[str, int, dict[str, Any]]:
        """Send a file; the upload, the status and what was said."""
        upload = upload or secrets.token_hex(8)
        status, _, text = self.request("POST", f"/start/file/{upload}", data, X_Name=quote(name))
        return upload, status, json.loads(text)

    def visitor(self) -> StartVisitor:
        self._visitors.append(StartVisitor(self))
        return self._visitors[-1]

    def stop(self) -> None:
        for visitor in self._visitors:
            visitor.close()
        self.studio.stop()
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive()


class StartVisitor:
    """What the start page does, without a browser."""

    def __init__(self, studio: StartStudio) -> None:
        self._open = contextlib.ExitStack()
        connection = websockets.sync.client.connect(
            f"ws://{studio.host}/start/socket", origin=f"http://{studio.host}", compression=None,
            additional_headers={"Cookie": studio.cookie}, close_timeout=2,
        )  # fmt: skip
        self.socket = self._open.enter_context(connection)
        self.send(Hello(START_VERSION))
        self.newest: dict[str, Any] = {}

    def send(self, message: Any) -> None:
        self.socket.send(message if isinstance(message, str) else encode(message))

    def message(self, kind: str, *, seconds: float = PATIENCE) -> dict[str, Any]:
        """The next message of a type."""
        ends = time.monotonic() + seconds
        while True:
            got = json.loads(self.socket.recv(max(0.01, ends - time.monotonic())))
            if got["type"] == "Workshop":
                self.newest = got
            if got["type"] == kind:
                return got

    def project(self, wanted: Callable[[dict[str, Any]], bool], name: str | None = None) -> dict[str, Any]:
        """A project, the newest if not named, once it is as wanted."""
        while True:
            for project in self.message("Workshop")["projects"]:
                if name in (None, project["id"]) and wanted(project):
                    return project

    def close(self) -> None:
        self._open.close()


@contextlib.contextmanager
def starting(work: Path, **options: Any) -> Iterator[StartStudio]:
    """A start page for a while."""
    studio = StartStudio(work, **options)
    try:
        yield studio
    finally:
        studio.stop()

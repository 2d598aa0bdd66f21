"""Everybody a studio could do without, at once: ``python -m tests.hostile_company ORIGIN COOKIE SECONDS``.

Says a line when all have arrived, and at the end, as JSON, how often whom the studio sent away with which code.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import time
from collections import Counter
from typing import Any

import websockets

from prelight.studio.protocol import LARGEST_MESSAGE, PROTOCOL_VERSION, Hello, SetEnvironment
from prelight.studio.wire import encode

IDLE, BARE, SESSIONS, AT_ONCE = 12, 88, 1000, 24  # with a seat or the wish for one; that only connect
LARGE = b"x" * (64 << 20)
AGAIN, LATER = 0.02, 0.5  # seconds until one that was sent away is back: a flood, and others


class Company:
    """Those who come, until it is time to go."""

    def __init__(self, origin: str, cookie: str, seconds: float) -> None:
        self._origin, self._cookie = origin, cookie
        self._ends = time.monotonic() + seconds
        self.closed: Counter[str] = Counter()
        self.said: Counter[str] = Counter()

    @property
    def goes_on(self) -> bool:
        return time.monotonic() < self._ends

    def _connect(self) -> Any:
        return websockets.connect(
            self._origin.replace("http", "ws") + "/socket",
            additional_headers={"Cookie": self._cookie},
            origin=self._origin,
            compression=None,
            max_size=None,
            max_queue=None,  # or one that does not read would not notice that it is sent away
            ping_interval=None,
            close_timeout=0.2,
        )

    async def _again_and_again(self, who: str, does: Any) -> None:
        while self.goes_on:
            try:
                async with self._connect() as socket:
                    await does(socket)
            except websockets.ConnectionClosed as closed:
                self.closed[f"{who} {closed.rcvd.code if closed.rcvd else 'cut'}"] += 1
            except OSError:
                self.closed[f"{who} cut"] += 1
            await asyncio.sleep(AGAIN if who == "flood" else LATER)

    async def floods(self, socket: Any) -> None:
        """Changes for everybody, ten thousand a second."""
        await socket.send(encode(Hello(PROTOCOL_VERSION)))
        while self.goes_on:
            for _ in range(10):
                self.said["messages"] += 1
                turn = float(self.said["messages"] % 360)
                await socket.send(encode(SetEnvironment(rotation_deg=turn, dragging=True)))
            await asyncio.sleep(1e-3)

    async def shouts(self, socket: Any) -> None:
        """One message of 64 MB."""
        await socket.send(encode(Hello(PROTOCOL_VERSION)))
        await socket.send(LARGE, text=True)
        await self.says_nothing(socket)

    async def never_reads(self, socket: Any) -> None:
        await socket.send(encode(Hello(PROTOCOL_VERSION)))
        socket.transport.pause_reading()
        while self.goes_on:
            await asyncio.sleep(AGAIN)
        socket.transport.abort()

    async def says_nothing(self, socket: Any) -> None:
        async for _ in socket:
            pass
        raise websockets.ConnectionClosedOK(socket.protocol.close_rcvd, None)

    async def only_connects(self) -> None:
        host, port = self._origin.removeprefix("http://").split(":")
        _, writer = await asyncio.open_connection(host, int(port))
        while self.goes_on:
            await asyncio.sleep(0.1)
        writer.close()

    async def visits(self) -> None:
        """Many pages, one after the other, which look at what is there and go."""
        while self.goes_on and self.said["sessions"] < SESSIONS:
            self.said["sessions"] += 1
            try:
                async with self._connect() as socket:
                    await socket.send(encode(Hello(PROTOCOL_VERSION)))
                    await socket.recv()
            except websockets.ConnectionClosed as closed:
                self.closed[f"session {closed.rcvd.code if closed.rcvd else 'cut'}"] += 1

    async def all_of_them(self) -> None:
        """Those with seats first."""
        assert len(LARGE) > LARGEST_MESSAGE
        async with asyncio.TaskGroup() as group:
            for who, does in (("slow", self.never_reads), ("flood", self.floods), ("large", self.shouts)):
                group.create_task(self._again_and_again(who, does))
            await asyncio.sleep(0.1)
            for _ in range(IDLE):
                group.create_task(self._again_and_again("idle", self.says_nothing))
            for _ in range(BARE):
                group.create_task(self.only_connects())
            for _ in range(AT_ONCE):
                group.create_task(self.visits())
            print("here", flush=True)


if __name__ == "__main__":
    company = Company(sys.argv[1], sys.argv[2], float(sys.argv[3]))
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(company.all_of_them())
    print(json.dumps({**company.closed, **company.said}))

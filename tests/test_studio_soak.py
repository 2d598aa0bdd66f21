"""Sixteen pages come and go for a while: nothing breaks, grows or slows down.

``PRELIGHT_SOAK_SECONDS=60 pytest -s tests/test_studio_soak.py`` is the long one, and says its figures.
"""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from prelight.studio.frames import FrameHeader
from prelight.studio.protocol import PROTOCOL_VERSION, Hello, Mark, Seen, SetDisc, SetEnvironment
from prelight.studio.wire import encode

from .live_studio import ball_bake

websockets = pytest.importorskip("websockets")
SECONDS = float(os.environ.get("PRELIGHT_SOAK_SECONDS", "6"))
PAGES, MESSAGES = 16, 50  # at once; of a visit
SLOW, ABRUPT = 5, 10  # every so many pages reads slowly; every so many visits end without a goodbye
EVERY = 0.05  # seconds between a page's messages
LONG = 30.0  # seconds from which growth can be told from warming up


@dataclass
class Company:
    """What the pages noted."""

    cookie: str
    origin: str
    ends: float
    visits: int = 0
    frames: int = 0
    wrong: list[str] = field(default_factory=list)
    late: list[tuple[float, float]] = field(
        default_factory=list
    )  # when a change was shown, and how long it took
    grown: list[tuple[float, float]] = field(default_factory=list)  # when, and megabytes of the studio

    @property
    def goes_on(self) -> bool:
        return time.monotonic() < self.ends

    def connect(self) -> Any:
        address = self.origin.replace("http", "ws") + "/socket"
        return websockets.connect(
            address,
            additional_headers={"Cookie": self.cookie},
            origin=self.origin,
            compression=None,
            max_size=None,
        )


@contextlib.contextmanager
def studio(bake: Path) -> Iterator[tuple[subprocess.Popen, str, str]]:
    """A studio in a process of its own, its cookie and its origin."""
    command = [sys.executable, "-c", "from prelight.cli.main import main; main()", "studio", str(bake)]
    run = subprocess.Popen([*command, "--json", "--port", "0"], stdout=subprocess.PIPE, text=True)
    assert run.stdout is not None
    try:
        said = ""
        while not said.endswith("}\n"):
            said += run.stdout.readline()
        host, path = json.loads(said)["url"].removeprefix("http://").split("/", 1)
        connection = http.client.HTTPConnection(host)
        connection.request("GET", f"/{path}")
        cookie = connection.getresponse().getheader("set-cookie", "").split(";")[0]
        connection.close()
        yield run, cookie, f"http://{host}"
    finally:
        run.send_signal(signal.SIGINT)
        assert run.wait(20) == 0
        run.stdout.close()


def change(page: int, k: int) -> str:
    """Every page drags a light of its own; each fourth message turns the sky, for all."""
    if k % 4 == 3:
        return encode(SetEnvironment(rotation_deg=float(k * 7 % 360), dragging=True))
    return encode(SetDisc(f"d{page}", float(k * 3 % 360 - 180), 40.0, 8.0, (3.0, 2.0, 1.0), dragging=True))


async def visited(company: Company, page: int) -> None:
    """A page that comes, drags, and goes, again and again."""
    turn = 0
    while company.goes_on:
        turn += 1
        async with company.connect() as socket:
            await socket.send(encode(Hello(PROTOCOL_VERSION)))
            reads = asyncio.create_task(_read(company, socket, slowly=page % SLOW == 0))
            for k in range(MESSAGES):
                await socket.send(change(page, k))
                await asyncio.sleep(EVERY)
                if not company.goes_on:
                    break
            company.visits += 1
            if (page + turn) % ABRUPT == 0:
                socket.transport.abort()
            reads.cancel()
            with contextlib.suppress(asyncio.CancelledError, websockets.ConnectionClosed):
                await reads


async def _read(company: Company, socket: Any, *, slowly: bool) -> None:
    async for got in socket:
        if isinstance(got, bytes):
            company.frames += 1
            if slowly:
                await asyncio.sleep(0.4)
            await socket.send(encode(Seen(FrameHeader.read(got).frame)))
        elif '"type": "Refused"' in got[:60]:
            company.wrong.append(got)


async def probed(company: Company) -> None:
    """One more page, which waits for each of its changes to be shown."""
    async with company.connect() as socket:
        await socket.send(encode(Hello(PROTOCOL_VERSION)))
        k = 0
        while company.goes_on:
            began, wanted, shown, k = time.monotonic(), None, -1, k + 1
            await socket.send(encode(SetDisc("probe", float(k % 360 - 180), 20.0, 5.0, (1.0, 1.0, 1.0))))
            await socket.send(encode(Mark(k)))
            while wanted is None or shown < wanted:
                got = await asyncio.wait_for(socket.recv(), 10)
                if isinstance(got, str):
                    said = json.loads(got)
                    if said["type"] == "Marked":
                        wanted = said["sequence"]
                    continue
                header = FrameHeader.read(got)
                await socket.send(encode(Seen(header.frame)))
                shown = header.sequence
            company.late.append((time.monotonic(), time.monotonic() - began))
            await asyncio.sleep(EVERY)


async def weighed(company: Company, process: int) -> None:
    while company.goes_on:
        company.grown.append((time.monotonic(), resident(process)))
        await asyncio.sleep(0.25)


def resident(process: int) -> float:
    """Megabytes."""
    said = Path(f"/proc/{process}/status").read_text()
    return int(said.split("VmRSS:")[1].split()[0]) / 1024


def handles(process: int) -> int:
    return len(list(Path(f"/proc/{process}/fd").iterdir()))


async def soaked(company: Company, process: int) -> None:
    async with asyncio.TaskGroup() as group:
        for page in range(PAGES):
            group.create_task(visited(company, page))
        group.create_task(probed(company))
        group.create_task(weighed(company, process))


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="looks into /proc")
def test_pages_come_and_go_and_leave_nothing(tmp_path_factory) -> None:
    with studio(ball_bake(tmp_path_factory)) as (run, cookie, origin):
        warm = Company(cookie, origin, time.monotonic() + 1.5)
        asyncio.run(soaked(warm, run.pid))
        time.sleep(1.0)
        before = handles(run.pid)
        company = Company(cookie, origin, time.monotonic() + SECONDS)
        began = time.monotonic()
        asyncio.run(soaked(company, run.pid))
        for _ in range(40):
            if handles(run.pid) <= before + 2:
                break
            time.sleep(0.1)
        assert company.wrong == []
        assert company.visits >= PAGES
        assert company.frames > 100
        assert abs(handles(run.pid) - before) <= 2
        third = (company.ends - began) / 3
        first = np.array([took for at, took in company.late if at < began + third])
        last = np.array([took for at, took in company.late if at > company.ends - third])
        late = [float(np.quantile(part, 0.99)) for part in (first, last)]
        settled = np.array([one for one in company.grown if one[0] > began + SECONDS / 3])
        slope = float(np.polyfit(settled[:, 0], settled[:, 1], 1)[0]) * 60  # MB a minute
        figures = {"visits": company.visits, "frames": company.frames, "p99_s": late, "mb_a_minute": slope}
        print(json.dumps(figures))
        if SECONDS >= LONG:
            assert late[1] <= 1.5 * late[0]
            assert slope <= 1.0
        else:  # too short to tell a slope from warming up
            assert settled[-1, 1] - settled[0, 1] <= 16
            assert late[1] < 5.0

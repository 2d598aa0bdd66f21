"""How many updates a second reach the page at 100,000 vertices, and how late each is: over loopback, all real."""

from __future__ import annotations

import argparse
import asyncio
import http.cookiejar
import json
import os
import statistics
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import websockets

import prelight as pl
from prelight.scene.normals import vertex_normals
from prelight.studio.frames import FRAME_EXACT, HEADER_BYTES, FrameHeader
from prelight.studio.protocol import (
    PROTOCOL_VERSION,
    ClientMessage,
    Hello,
    RemoveDisc,
    Seen,
    SetDisc,
    SetEnvironment,
)
from prelight.studio.wire import encode

SIDE = 317  # 100,489 vertices
RATE = 100  # changes a second: a quick pointer's

EDITS: dict[str, Callable[[int], ClientMessage]] = {
    "a disc is dragged": lambda k: SetDisc("a", 0.5 * k % 360 - 180, 35.0, 6.0, (6.0, 5.0, 4.0), 0.5, dragging=True),
    "a disc is dimmed": lambda k: SetDisc("a", -125.0, 35.0, 6.0, (k % 50, 5.0, 4.0), 0.5, dragging=True),
    "the sky is dimmed": lambda k: SetEnvironment(scale=0.5 + 0.01 * (k % 50), dragging=True),
    "the sky is tinted": lambda k: SetEnvironment(tint=(1.0, 0.5 + 0.01 * (k % 50), 1.0), dragging=True),
    "the sky is turned": lambda k: SetEnvironment(rotation_deg=0.5 * k % 360, dragging=True),
}  # fmt: skip


def hills() -> pl.Scene:
    """100,489 vertices: hills that shadow each other."""
    line = np.linspace(-5, 5, SIDE)
    x, z = np.meshgrid(line, line)
    y = 0.5 * np.sin(2.1 * x) * np.cos(1.7 * z) + 0.25 * np.sin(4.3 * x + 1.0) * np.sin(3.9 * z)
    positions = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float32)
    corner = np.arange(SIDE * (SIDE - 1)).reshape(SIDE - 1, SIDE)[:, :-1].ravel()
    first = np.stack([corner, corner + SIDE, corner + 1], axis=-1)
    second = np.stack([corner + 1, corner + SIDE, corner + SIDE + 1], axis=-1)
    triangles = np.concatenate([first, second]).astype(np.int32)
    normals = vertex_normals(positions, triangles).astype(np.float32)
    return pl.Scene("hills", positions, normals, triangles, np.full(positions.shape, 0.6, np.float32))


@contextmanager
def studio(bake: Path, *skies: str) -> Iterator[str]:
    """The link of a studio in a process of its own; maps or rigs to choose from."""
    command = [
        sys.executable,
        "-c",
        "from prelight.cli.main import main; main()",
        "studio",
        str(bake),
        *skies,
    ]
    run = subprocess.Popen(
        [*command, "--json", "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert run.stdout is not None
    try:
        yield json.loads("".join(run.stdout.readline() for _ in range(3)))["url"]
    finally:
        run.terminate()
        run.wait(20)


def entered(link: str) -> tuple[str, str]:
    """Cookie and origin after opening a link."""
    jar = http.cookiejar.CookieJar()
    urllib.request.build_opener(urllib.request.HTTPCookieProcessor(jar)).open(link).read()
    return "; ".join(f"{c.name}={c.value}" for c in jar), link.split("/?", maxsplit=1)[0]


@dataclass
class Visit:
    """What a page of ours notes while it drags."""

    sequence: int = 0  # of the newest state we made
    sent: dict[int, float] = field(default_factory=dict)  # when, by sequence
    latencies: list[float] = field(default_factory=list)  # from a change to the radiance that shows it
    updates: list[float] = field(default_factory=list)
    relight: list[float] = field(default_factory=list)
    size: int = 0
    coarse: bytes = b""  # the last frame that was not exact
    coarse_error: float = 0.0  # RMS of what the exact one of the same state showed
    exact: asyncio.Event = field(default_factory=asyncio.Event)

    def saw(self, frame: bytes) -> int:
        now, header = time.perf_counter(), FrameHeader.read(frame)
        self.updates.append(now)
        self.relight.append(header.milliseconds)
        self.size = len(frame)
        for sequence in [s for s in self.sent if s <= header.sequence]:
            self.latencies.append(now - self.sent.pop(sequence))
        if not header.flags & FRAME_EXACT:
            self.coarse = frame
        elif header.sequence == self.sequence:
            if self.coarse and FrameHeader.read(self.coarse).sequence == self.sequence:
                self.coarse_error = difference(self.coarse, frame)
            self.exact.set()
        return header.frame


def difference(coarse: bytes, exact: bytes) -> float:
    """RMS of two frames' difference over the RMS of the second."""
    a, b = radiance_of(coarse), radiance_of(exact)
    return float(np.sqrt(((a - b) ** 2).mean() / max((b**2).mean(), 1e-30)))


def radiance_of(frame: bytes) -> np.ndarray:
    """(rows, 3) of a radiance frame, as a page reads it."""
    words = np.frombuffer(frame, np.uint32, offset=HEADER_BYTES)
    step = np.exp2((words >> 27).astype(np.float64) - 24)
    return np.stack([(words >> 9 * c & 511) * step for c in range(3)], axis=1)


async def dragged(
    cookie: str, origin: str, *, edit: Callable[[int], ClientMessage], seconds: float
) -> dict[str, float]:
    """One kind of edit, sent at a steady rate; only what arrived while it was sent counts."""
    address = origin.replace("http", "ws") + "/socket"
    headers = {"Cookie": cookie}
    async with websockets.connect(
        address, additional_headers=headers, origin=origin, compression=None, max_size=None
    ) as socket:
        visit = Visit()
        await socket.send(encode(Hello(PROTOCOL_VERSION)))

        async def read() -> None:
            async for got in socket:
                if isinstance(got, str):
                    message = json.loads(got)
                    if message["type"] == "Welcome":
                        visit.sequence = message["state"]["sequence"]
                else:
                    await socket.send(encode(Seen(visit.saw(got))))

        reader = asyncio.create_task(read())
        await visit.exact.wait()
        for warm in range(10):  # threads of the kernels find their pace
            await change(socket, visit, edit(warm))
            await asyncio.sleep(0.05)
        while visit.sent:  # a world is read, a tree of boxes built: once, and not while a hand drags
            await asyncio.sleep(0.01)
        for notes in (visit.latencies, visit.updates, visit.relight):
            notes.clear()
        visit.exact.clear()
        visit.coarse_error = 0.0
        began = time.perf_counter()
        for k in range(int(seconds * RATE)):
            await asyncio.sleep(max(0.0, began + k / RATE - time.perf_counter()))
            await change(socket, visit, edit(10 + k))
        took = time.perf_counter() - began
        last = time.perf_counter()
        await asyncio.sleep(0.1)
        for _ in range(100):  # ten seconds, where one update takes longer than the whole drag
            if visit.latencies:
                break
            await asyncio.sleep(0.1)
        latencies, relight = np.array(visit.latencies) * 1e3, list(visit.relight)
        delivered = sum(at <= began + took for at in visit.updates)
        await visit.exact.wait()
        rested, error = time.perf_counter() - last, visit.coarse_error
        visit.exact.clear()
        await change(socket, visit, SetEnvironment("stock:sunset", 0.0, 1.0, (1.0, 1.0, 1.0)))
        if isinstance(edit(0), SetDisc):
            await change(socket, visit, RemoveDisc("a"))
        await visit.exact.wait()
        reader.cancel()
    return {
        "updates_per_second": delivered / took,
        "latency_ms_median": float(np.median(latencies)),
        "latency_ms_p95": float(np.quantile(latencies, 0.95)),
        "relight_ms_median": statistics.median(relight),
        "coarse_error": error,
        "exact_after_ms": rested * 1e3,
        "frame_bytes": visit.size,
    }


async def steered(cookie: str, origin: str, *, edit: Callable[[int], ClientMessage], seconds: float) -> None:
    """The same changes by somebody who takes no radiance, so that all that is made is another page's."""
    async with websockets.connect(
        origin.replace("http", "ws") + "/socket", additional_headers={"Cookie": cookie}, origin=origin,
        compression=None, max_size=None,
    ) as socket:  # fmt: skip

        async def read() -> None:
            async for _ in socket:  # unread, they would stand in the way of closing
                pass

        await socket.send(encode(Hello(PROTOCOL_VERSION)))
        reader = asyncio.create_task(read())
        began = time.perf_counter()
        for k in range(int(seconds * RATE)):
            await asyncio.sleep(max(0.0, began + k / RATE - time.perf_counter()))
            await socket.send(encode(edit(k)))
        reader.cancel()


async def change(socket, visit: Visit, message: ClientMessage) -> None:
    visit.sequence += 1
    visit.sent[visit.sequence] = time.perf_counter()
    await socket.send(encode(message))


def first_picture(bake: Path) -> dict[str, float]:
    """Seconds from the command to the first and the exact radiance, with everything in the page cache."""

    async def wait(began: float) -> dict[str, float]:
        with studio(bake) as link:
            listening = time.perf_counter() - began
            cookie, origin = entered(link)
            address = origin.replace("http", "ws") + "/socket"
            async with websockets.connect(
                address, additional_headers={"Cookie": cookie}, origin=origin, max_size=None, compression=None
            ) as socket:
                await socket.send(encode(Hello(PROTOCOL_VERSION)))
                first = 0.0
                async for got in socket:
                    if isinstance(got, bytes):
                        header = FrameHeader.read(got)
                        await socket.send(encode(Seen(header.frame)))
                        first = first or time.perf_counter() - began
                        if header.flags:
                            break
            return {"listening_s": listening, "first_s": first, "exact_s": time.perf_counter() - began}

    runs = [asyncio.run(wait(time.perf_counter())) for _ in range(3)]
    return {name: statistics.median(run[name] for run in runs) for name in runs[0]}


def drags(door: tuple[str, str], seconds: float) -> dict[str, Callable[[], object]]:
    """What somebody else does while a browser looks on."""

    def run(way: Callable, name: str) -> Callable[[], object]:
        return lambda: asyncio.run(way(*door, edit=EDITS[name], seconds=seconds))

    alone = {name: run(steered, name) for name in EDITS}
    return {**alone, "a disc is dragged, and another page looks on": run(dragged, "a disc is dragged")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--work", type=Path, default=Path("studio-benchmark"), help="folder for the bake")
    parser.add_argument("--bake", type=Path, help="measure this bake instead")
    parser.add_argument("--seconds", type=float, default=5.0, help="of each kind of edit")
    parser.add_argument("--output", type=Path, help="JSON file of the figures")
    parser.add_argument("--browser", action="store_true", help="in Chromium too")
    given = parser.parse_args()
    path = given.bake
    if path is None:
        given.work.mkdir(parents=True, exist_ok=True)
        path = given.work / "hills.prelight"
        if not path.exists():
            pl.bake_environment(hills(), path, resolution=128, tolerance=0.04, bounces=0, resume=True)
    bake = pl.Bake.open(path)
    figures = {
        "machine": {"processors": os.cpu_count(), "load_before": os.getloadavg()[0]},
        "vertices": len(bake.receivers),
        "bake_bytes": bake.manifest.bytes_of(""),
        "changes_per_second": RATE,
        "first_picture": first_picture(path),
        "edits": {},
    }
    for name, edit in EDITS.items():
        with studio(path) as link:
            figures["edits"][name] = asyncio.run(dragged(*entered(link), edit=edit, seconds=given.seconds))
        print(name, json.dumps(figures["edits"][name]))
    if given.browser:
        from page import in_browser

        with studio(path) as link:
            figures["browser"] = in_browser(*(door := entered(link)), drags=drags(door, given.seconds))
    figures["machine"]["load_after"] = os.getloadavg()[0]
    text = json.dumps(figures, indent=2)
    print(text)
    if given.output:
        given.output.write_text(text + "\n")


if __name__ == "__main__":
    main()

"""A studio that tests hold in their hands: it serves the built page and any radiance, and keeps what it is sent."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from prelight.studio.frames import FRAME_EXACT, FrameHeader
from prelight.studio.protocol import PROTOCOL_VERSION

BUILT = Path(__file__).resolve().parents[1] / "src/prelight/studio/web/built"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
KINDS = {".js": "text/javascript", ".css": "text/css", ".html": "text/html", ".svg": "image/svg+xml"}
SKY = (256, 512)  # rows and columns of a sky that the page is given
State = dict[str, Any]
SUN = {
    "latitude_deg": 43.7, "longitude_deg": 15.9, "date": "2026-06-21", "hour": 15.0, "zone": None, "turbidity": 2.5,
}  # fmt: skip
ROWS, COLUMNS = 6, 10
STRAIGHT = {
    "name": "straight", "eye": (0.0, 0.0, 10.0), "target": (0.0, 0.0, 0.0), "up": (0.0, 1.0, 0.0),
    "vertical_fov_deg": float(np.degrees(2 * np.arctan(0.1 * ROWS / 2))),
}  # fmt: skip


def packed(colours: np.ndarray) -> np.ndarray:
    """Colours (n, 3) as rgb9e5, slowly and plainly."""
    largest = np.maximum(colours.max(axis=1).astype(np.float64), 2.0**-24)
    exponent = np.clip(np.floor(np.log2(largest)) + 16, 0, 31)
    over = np.rint(largest * 2.0 ** (24 - exponent)) == 512
    exponent += over
    parts = np.rint(colours * 2.0 ** (24 - exponent)[:, None]).astype(np.uint32)
    return parts[:, 0] | parts[:, 1] << 9 | parts[:, 2] << 18 | exponent.astype(np.uint32) << 27


def unpacked(words: np.ndarray) -> np.ndarray:
    """The colours (n, 3) in rgb9e5."""
    parts = np.stack([words & 511, words >> 9 & 511, words >> 18 & 511], axis=1)
    return parts * 2.0 ** ((words >> 27).astype(np.float64) - 24)[:, None]


def state(**changed: Any) -> State:
    """A rig as the page is told of it."""
    return {
        "sequence": 0, "author": None, "environment": "stock:noon", "rotation_deg": 0.0, "scale": 1.0,
        "tint": [1.0, 1.0, 1.0], "sun": SUN, "discs": [], "lamps": [], "glass": [], "stops": 0.0, "looks": [],
        "timeline": [], "paint": [], "world": None, "seconds": 0.0,
        "undo": None, "redo": None, **changed,
    }  # fmt: skip


def framed(words: np.ndarray, flags: int, *, sequence: int = 0, number: int = 0) -> bytes:
    """A binary frame of words of four bytes."""
    data = np.ascontiguousarray(words).tobytes()
    header = bytearray(32)
    FrameHeader(number, sequence, len(data) // 4, 0.0, flags).write(header)
    return bytes(header) + data


def png(colour: tuple[int, int, int] = (120, 150, 200)) -> bytes:
    import io

    from PIL import Image

    file = io.BytesIO()
    Image.new("RGB", (256, 128), colour).save(file, "PNG")
    return file.getvalue()


@dataclass
class StandIn:
    """What the page is told; ``radiance`` makes the rows (receivers, 3) of a state."""

    positions: np.ndarray
    triangles: np.ndarray
    radiance: Callable[[State], np.ndarray]
    cameras: list[dict[str, Any]]
    welcome: dict[str, Any] = field(default_factory=dict)
    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    materials: list[dict[str, Any]] = field(default_factory=lambda: [{"name": "white", "texture": None}])
    textures: list[bytes] = field(default_factory=list)
    environments: list[str] = field(default_factory=lambda: ["stock:noon", "stock:sunset"])
    sky: np.ndarray = field(default_factory=lambda: np.full((SKY[0] * SKY[1], 3), 0.25))
    replies: dict[str, Callable[[dict[str, Any]], list[Any]]] = field(
        default_factory=dict
    )  # messages, frames
    preview: Callable[[str], bytes] = lambda name: png()
    state: State = field(default_factory=state)
    refuses: str | None = None
    streaming: int = 0  # frames that are still sent unasked: the browser's driver keeps each of them
    lag: float = 0.0  # seconds before each message of a page is looked at
    shut: bool = False
    close_with: tuple[int, str] | None = None
    received: list[dict[str, Any]] = field(default_factory=list)
    sockets: int = 0
    port: int = 0
    bake: str = "a"
    _frame: int = 0

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    def greeting(self) -> dict[str, Any]:
        vertices = len(self.positions)
        return {
            "type": "Welcome", "version": PROTOCOL_VERSION, "visitor": self.sockets, "name": "patches",
            "bake": self.bake,
            "receivers": vertices, "vertices": vertices, "triangles": len(self.triangles),
            "textures": len(self.textures), "resolution": 64, "pixels": None, "eye": None,
            "cameras": self.cameras,
            "environments": [{"id": name, "title": f"the sky of {name}"} for name in self.environments],
            "takes": ["environment", "lamps"], "portals": [], "steered": None, "worlds": [], "glossy": False,
            "no_tracer": "there is none", "most_discs": 32, "most_lamps": 32,
            "state": {"type": "State", **self.state}, **self.welcome,
        }  # fmt: skip

    def geometry(self) -> dict[str, np.ndarray]:
        vertices = len(self.positions)
        white = np.ones((vertices, 3), np.float32)
        return {
            "positions": self.positions.astype(np.float32), "triangles": self.triangles.astype(np.uint32),
            "material_of": np.zeros(len(self.triangles), np.uint32), "albedo": white, "tint": white,
            **self.arrays,
        }  # fmt: skip

    def frame(self) -> bytes:
        """A frame of the state as it is."""
        self._frame += 1
        words = packed(self.radiance(self.state)).astype("<u4").tobytes()
        header = bytearray(32)
        FrameHeader(self._frame, self.state["sequence"], len(words) // 4, 1.5, FRAME_EXACT).write(header)
        return bytes(header) + words

    # ---- Routes ----------------------------------------------------------------------------------------------

    async def file(self, request):
        from starlette.responses import Response

        if self.shut:
            return Response(status_code=401)
        path = BUILT / (request.path_params.get("name") or "index.html")
        body = path.read_bytes() if path.is_file() else b""
        headers = {"Content-Security-Policy": POLICY}
        kind = KINDS.get(path.suffix, "application/octet-stream")
        return Response(body, 200 if body else 404, headers=headers, media_type=kind)

    async def index(self, request):
        from starlette.responses import JSONResponse

        kinds = {"float32": "f4", "uint32": "u4", "uint8": "u1"}
        arrays = {
            name: {"url": f"/geometry/{name}", "type": kinds[str(a.dtype)], "shape": list(a.shape)}
            for name, a in self.geometry().items()
        }
        counts = {"bake": self.bake, "vertices": len(self.positions), "triangles": len(self.triangles)}
        return JSONResponse({**counts, "arrays": arrays, "materials": self.materials})

    async def bytes(self, request):
        from starlette.responses import Response

        what, name = request.path_params["what"], request.path_params["name"]
        if what == "geometry":
            body = self.geometry()[name].tobytes()
        elif what == "texture":
            body = self.textures[int(name)]
        else:
            body = self.preview(name) if what == "preview" else packed(self.sky).astype("<u4").tobytes()
        kind = "application/octet-stream" if what in ("geometry", "sky") else "image/png"
        return Response(body, media_type=kind)

    async def talk(self, socket):
        from starlette.websockets import WebSocketDisconnect

        if self.shut:
            await socket.close(1008)
            return
        await socket.accept()
        self.sockets += 1
        try:
            assert json.loads(await socket.receive_text())["type"] == "Hello"
            if self.close_with is not None:
                await socket.close(*self.close_with)
                return
            await socket.send_text(json.dumps(self.greeting()))
            await socket.send_bytes(self.frame())
            while True:
                await self.answer(socket, json.loads(await socket.receive_text()))
        except WebSocketDisconnect:
            pass

    async def answer(self, socket, message: dict[str, Any]) -> None:
        kind = message.pop("type")
        if self.lag:
            await asyncio.sleep(self.lag)
        if kind == "Mark":
            said = {"type": "Marked", "number": message["number"], "sequence": self.state["sequence"]}
            await socket.send_text(json.dumps(said))
            return
        self.received.append({"type": kind, **message})
        if kind in self.replies:
            for reply in self.replies[kind](message):
                send = socket.send_bytes if isinstance(reply, bytes) else socket.send_text
                await send(reply if isinstance(reply, bytes) else json.dumps(reply))
            return
        if kind == "Seen":
            if self.streaming > 0:
                self.streaming -= 1
                await asyncio.sleep(0.012)
                turn = (self.state["rotation_deg"] + 1.0) % 360.0
                self.state |= {"sequence": self.state["sequence"] + 1, "author": None, "rotation_deg": turn}
                await socket.send_text(json.dumps({"type": "State", **self.state}))
                await socket.send_bytes(self.frame())
            return
        if self.refuses is not None:
            await socket.send_text(json.dumps({"type": "Refused", "message": kind, "reason": self.refuses}))
            return
        self.obey(kind, message)
        await socket.send_text(json.dumps({"type": "State", **self.state}))
        await socket.send_bytes(self.frame())

    def obey(self, kind: str, message: dict[str, Any]) -> None:
        message.pop("dragging", None)
        if kind == "SetEnvironment":
            self.state |= {key: value for key, value in message.items() if value is not None}
        elif kind == "SetSun":
            self.state |= {"environment": "daylight", "sun": message["sun"]}
        elif kind == "SetWorld":
            self.state |= {"world": message["world"], "seconds": message["seconds"]}
        elif kind == "SetTimeline":
            self.state |= {"timeline": message["keys"]}
        elif kind in ("SetLamp", "RemoveLamp"):
            name = message["lamp"]["id"] if kind == "SetLamp" else message["id"]
            others = [lamp for lamp in self.state["lamps"] if lamp["id"] != name]
            self.state["lamps"] = others + ([message["lamp"]] if kind == "SetLamp" else [])
        elif kind in ("SetPaint", "RemovePaint", "ClearPaint"):
            name = message["stroke"]["id"] if kind == "SetPaint" else message.get("id")
            others = [one for one in self.state["paint"] if one["id"] != name and kind != "ClearPaint"]
            self.state["paint"] = others + ([message["stroke"]] if kind == "SetPaint" else [])
        elif kind in ("SetDisc", "RemoveDisc"):
            others = [disc for disc in self.state["discs"] if disc["id"] != message["id"]]
            self.state["discs"] = others + ([message] if kind == "SetDisc" else [])
        self.state |= {"sequence": self.state["sequence"] + 1, "author": self.sockets}


def patches(colours: np.ndarray, **more) -> StandIn:
    """A square for each colour (ROWS·COLUMNS, 3), row by row from the top, that fills the picture."""
    j, i = (index.ravel() for index in np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)))
    x, y = j - COLUMNS / 2, ROWS / 2 - i
    corners = np.stack([np.stack([x + a, y - b, 0 * x], axis=1) for b in (0, 1) for a in (0, 1)], axis=1)
    first = 4 * np.arange(len(x))[:, None]
    triangles = np.concatenate([first + np.array([0, 2, 1]), first + np.array([1, 2, 3])])
    rows = np.repeat(colours, 4, axis=0)
    return StandIn(corners.reshape(-1, 3), triangles, lambda _: rows, [STRAIGHT], **more)


@contextmanager
def serving(stand_in: StandIn, *, port: int = 0) -> Iterator[StandIn]:
    """Serve it from a thread until the block ends."""
    import uvicorn
    from starlette.applications import Starlette
    from starlette.routing import Route, WebSocketRoute

    routes = [
        Route("/", stand_in.file),
        Route("/geometry.json", stand_in.index),
        Route("/{what:str}/{name:path}", stand_in.bytes),
        Route("/{name:str}", stand_in.file),
        WebSocketRoute("/socket", stand_in.talk),
    ]
    config = uvicorn.Config(
        Starlette(routes=routes), port=port, log_level="error", ws="websockets-sansio",
        ws_per_message_deflate=False, timeout_graceful_shutdown=1,
    )  # fmt: skip
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        thread.join(0.01)
        assert thread.is_alive(), "the stand-in did not start"
    stand_in.port = server.servers[0].sockets[0].getsockname()[1]
    try:
        yield stand_in
    finally:
        server.should_exit = True
        thread.join(10)

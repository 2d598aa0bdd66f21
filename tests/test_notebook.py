"""The studio in a notebook: widget messages in place of a port, and the same page in a cell's output."""

from __future__ import annotations

import base64
import http.server
import json
import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("anywidget", reason="anywidget is not installed")
from prelight.errors import InputError
from prelight.notebook import View
from prelight.studio.frames import FrameHeader
from prelight.studio.protocol import PROTOCOL_VERSION, Hello, Seen
from prelight.studio.wire import encode

from .studio_bakes import lamps_bake
from .studio_browser import chromium

PATIENCE = 40.0


class Cell:
    """A view whose messages go to a list, as they would to a notebook's front end."""

    def __init__(self, bake: Path) -> None:
        self.view = View(bake, height=300)
        self.sent: list[tuple[dict, list]] = []
        self.view.send = lambda content, buffers=None: self.sent.append((content, buffers or []))  # ty: ignore

    def ask(self, content: object) -> None:
        self.view._handle_custom_msg(content, [])

    def until(self, wanted):
        """The first message that is wanted."""
        ends = time.monotonic() + PATIENCE
        while time.monotonic() < ends:
            for content, buffers in list(self.sent):
                if (found := wanted(content, buffers)) is not None:
                    return found
            time.sleep(0.02)
        raise TimeoutError

    def get(self, path: str) -> tuple[int, bytes]:
        number = 10_000 + len(self.sent)
        self.ask({"get": path, "number": number})
        return self.until(lambda c, b: (c["status"], bytes(b[0])) if c.get("number") == number else None)

    def says(self, kind: str, check=lambda message: True) -> dict:
        def wanted(content, _):
            message = json.loads(content["text"]) if "text" in content else {}
            return message if message.get("type") == kind and check(message) else None

        return self.until(wanted)

    def exact(self, sequence: int) -> np.ndarray:
        def wanted(content, buffers):
            if not content.get("frame"):
                return None
            header = FrameHeader.read(bytes(buffers[0]))
            self.ask({"say": encode(Seen(header.frame))})
            is_it = (header.sequence, header.flags & 1) == (sequence, 1)
            return np.frombuffer(bytes(buffers[0])[32:], np.uint32) if is_it else None

        return self.until(wanted)


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    made = Cell(lamps_bake(tmp_path_factory))
    yield made
    made.view.close()


def test_the_page_and_its_light_come_as_messages(cell: Cell) -> None:
    cell.ask({"open": True})
    cell.ask({"say": encode(Hello(PROTOCOL_VERSION))})
    welcome = cell.says("Welcome")
    assert welcome["takes"] == ["environment", "lamps"]
    status, index = cell.get("/geometry.json")
    assert status == 200
    arrays = json.loads(index)["arrays"]
    positions = np.frombuffer(cell.get(arrays["positions"]["url"])[1], np.float32)
    assert len(positions) == 3 * welcome["vertices"]
    assert len(cell.exact(welcome["state"]["sequence"])) >= welcome["vertices"]
    for path in (
        "/../../etc/passwd",
        "/etc/passwd",
        "etc",
        "/geometry/../../x",
        "/start/socket",
        "/" + "x" * 400,
    ):
        assert cell.get(path)[0] == 404


def test_python_and_the_page_set_the_same_light(cell: Cell) -> None:
    before = cell.says("Welcome")["state"]
    dark = cell.exact(before["sequence"])
    cell.view.sky("stock:sunset", rotate_deg=30)
    told = cell.says("State", lambda m: m["environment"] == "stock:sunset" and m["rotation_deg"] == 30)
    cell.view.lamp("key", position=(0.5, 2.0, 0.3), lumens=3000, kelvin=3000)
    lit = cell.says("State", lambda m: len(m["lamps"]) == 1)
    assert (lit["lamps"][0]["name"], lit["lamps"][0]["strength"]) == ("key", 3000)
    assert lit["sequence"] > told["sequence"]
    assert (cell.exact(lit["sequence"]) != dark).mean() > 0.5
    cell.view.lamp("key", position=(0.5, 2.0, 0.3), target=(0, 0, 0), candela=900)
    spot = cell.says("State", lambda m: m["lamps"] and m["lamps"][0]["kind"] == "spot")
    assert (len(spot["lamps"]), spot["lamps"][0]["strength"]) == (1, 900)
    cell.view.remove_lamp("key")
    cell.says("State", lambda m: m["sequence"] > spot["sequence"] and not m["lamps"])


def test_wrong_values_are_refused_in_python(cell: Cell) -> None:
    for call in (
        lambda: cell.view.lamp("a", position=(0, 0)), lambda: cell.view.lamp("", position=(0, 1, 0)),
        lambda: cell.view.lamp("a", position=(0, 1e9, 0)), lambda: cell.view.lamp("a", position=(0, 1, 0), lumens=-1),
        lambda: cell.view.sky(scale=-1.0), lambda: cell.view.sky(rotate_deg=float("nan")),
    ):  # fmt: skip
        with pytest.raises((InputError, ValueError)):
            call()
    for content in (None, [], "x", {}, {"get": 3, "number": 1}, {"get": "/", "number": "x"}, {"say": 7}):
        cell.ask(content)
    assert cell.get("/geometry.json")[0] == 200


_HOST = """<!doctype html><meta charset="utf-8"><div id="cell"></div><script type="module">
import widget from "/widget.js";
const waiting = [];
const model = {
  get: (name) => window.traits[name],
  on: (_, take) => waiting.push(take), off: () => undefined,
  send: (content) => window.toPython(content),
};
window.fromPython = (content, buffers) => waiting.forEach((take) => take(content, buffers.map(
  (text) => new DataView(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer))));
window.begin = () => widget.render({model, el: document.getElementById("cell")});
window.ready = true;
</script>"""


class _Files(http.server.BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        script = Path(View._esm).read_text() if isinstance(View._esm, Path | str) else str(View._esm)
        body = (script if self.path == "/widget.js" else _HOST).encode()
        self.send_response(200)
        self.send_header("Content-Type", "text/javascript" if self.path == "/widget.js" else "text/html")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        pass


def test_the_same_page_runs_in_a_cells_output(cell: Cell) -> None:
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Files)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 900, "height": 500})
        complaints, requests = [], []
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.expose_function("toPython", cell.ask)
        page.goto(f"http://127.0.0.1:{server.server_port}/")
        page.wait_for_function("window.ready")
        traits = {"_page": cell.view._page, "_script": cell.view._script, "height": 300}
        page.evaluate("traits => { window.traits = traits; window.begin(); }", traits)
        given, ends = len(cell.sent), time.monotonic() + PATIENCE
        frame = None
        while time.monotonic() < ends:
            for content, buffers in cell.sent[given:]:
                page.evaluate("([c, b]) => window.fromPython(c, b)",
                              [content, [base64.b64encode(bytes(b)).decode() for b in buffers]])  # fmt: skip
                given += 1
            frame = next((f for f in page.frames if f != page.main_frame), None)
            shown = "() => !!window.__prelight && __prelight.metrics.ready && __prelight.metrics.updates > 0"
            if frame is not None and frame.evaluate(shown):
                break
            page.wait_for_timeout(30)
        assert frame is not None
        assert frame.evaluate("() => __prelight.metrics.ready"), complaints
        assert frame.get_by_role("region", name="Lamps").is_visible()
        bright = frame.evaluate(
            "() => { const p = __prelight.pixels().data; let s = 0; for (const x of p) s += x; return s / p.length }"
        )
        assert bright > 40
        assert not complaints
        assert all(
            url.startswith((f"http://127.0.0.1:{server.server_port}/", "about:", "blob:")) for url in requests
        )
    server.shutdown()
    server.server_close()

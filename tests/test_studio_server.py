"""The studio as a page meets it: one state for all, the newest light and no queue, and a clean end."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed

from prelight.camera import Camera
from prelight.errors import DamagedBakeError, OutputError
from prelight.storage.bake import Bake
from prelight.studio import hub
from prelight.studio.environments import Environments
from prelight.studio.frames import FrameHeader
from prelight.studio.protocol import Compare, Hello, RemoveDisc, SaveLook, Seen, SetDisc, SetEnvironment, Undo
from prelight.studio.server import Served, Studio
from prelight.studio.visitor import Allowance
from prelight.studio.wire import encode

from .live_studio import LiveStudio, Page, ball_bake, running
from .test_studio_protocol import BAD
from .test_studio_rgb9e5 import unpacked

ROOT = Path(__file__).resolve().parents[1]
LAMP = SetDisc("lamp", -125.0, 35.0, 8.0, (6.0, 5.0, 4.0), 0.5)


@pytest.fixture(scope="module")
def bake(tmp_path_factory) -> Path:
    return ball_bake(tmp_path_factory)


@pytest.fixture(scope="module")
def shared(bake, tmp_path_factory):
    """A studio for tests that leave no trace, or one that others can live with."""
    with running(bake, state_file=tmp_path_factory.mktemp("rig") / "ball.studio.json") as studio:
        yield studio


def sequence_of(page: Page) -> int:
    return page.message("Welcome")["state"]["sequence"]


# ---- What a page is told ---------------------------------------------------------------------------------------


def test_a_page_is_welcomed_and_sees_the_light(shared: LiveStudio, bake) -> None:
    with shared.page() as page:
        welcome = page.message("Welcome")
        assert welcome["bake"] == json.loads(shared.get("/geometry.json"))["bake"]
        assert welcome["receivers"] == welcome["vertices"] == len(Bake.open(bake).receivers)
        assert [c["id"] for c in welcome["environments"]][:2] == ["stock:overcast", "stock:noon"]
        assert Camera.from_dict({k: v for k, v in welcome["cameras"][0].items() if k != "name"})
        radiance = unpacked(np.frombuffer(page.exact(welcome["state"]["sequence"]), np.uint32))
        assert radiance.shape == (welcome["receivers"], 3)
        assert 0.1 < radiance.mean() < 10


def test_the_scene_comes_as_it_is_in_the_bake(shared: LiveStudio, bake) -> None:
    index = json.loads(shared.get("/geometry.json"))
    scene = Bake.open(bake)
    mesh = scene.receivers
    wanted = {"positions": mesh.positions, "normals": mesh.normals, "tint": scene.tint, "albedo": mesh.albedo,
              "triangles": scene.triangles, "material_of": scene.material_of}  # fmt: skip
    assert index["arrays"].keys() == wanted.keys()
    for name, array in wanted.items():
        record = index["arrays"][name]
        data = np.frombuffer(shared.get(record["url"]), "<" + record["type"]).reshape(record["shape"])
        assert (data == array).all(), name
    assert index["materials"] == [{"name": m.name, "texture": None} for m in scene.materials]
    assert shared.get("/preview/stock:sunset").startswith(b"\x89PNG")
    assert len(shared.get("/sky/stock:sunset")) == 4 * 512 * 256
    assert shared.request("GET", "/texture/0").status == 404


def test_pages_of_another_version_are_told_so(shared: LiveStudio) -> None:
    for first in (encode(Hello(999)), encode(LAMP), "nonsense", b"\x00"):
        with shared.connect() as socket:
            socket.send(first)
            with pytest.raises(ConnectionClosed) as closed:
                socket.recv(10)
        assert closed.value.rcvd.code == 1002
        assert "version" in closed.value.rcvd.reason


# ---- One state for all -----------------------------------------------------------------------------------------


def test_all_see_the_same_and_so_after_a_restart(bake, tmp_path) -> None:
    file = tmp_path / "ball.studio.json"
    with running(bake, state_file=file) as studio:
        with studio.page() as first, studio.page() as second:
            start = sequence_of(first)
            assert sequence_of(second) == start
            first.send(SetEnvironment("stock:sunset", 25.0, 0.5, (1.0, 0.9, 0.8)))
            first.send(LAMP)
            seen = [page.exact(start + 2) for page in (first, second)]
            told = [[m for m in page.messages if m["type"] == "State"][-1] for page in (first, second)]
            assert told[0] == told[1]
            assert told[0]["author"] == 1
            assert seen[0] == seen[1]
        with studio.page() as third:
            assert third.message("Welcome")["state"] == told[0]
            assert third.exact(start + 2) == seen[0]
    with running(bake, state_file=file) as studio, studio.page() as again:
        state = again.message("Welcome")["state"]
        volatile = ("sequence", "author", "stops", "undo", "redo")
        assert {k: v for k, v in state.items() if k not in volatile} == {
            k: v for k, v in told[0].items() if k not in volatile
        }
        assert again.exact(0) == seen[0]  # bit for bit, whatever way led to it
        again.send(RemoveDisc("lamp"))
        assert again.exact(1) != seen[0]


def test_a_damaged_rig_is_left_alone(bake, tmp_path) -> None:
    file = tmp_path / "ball.studio.json"
    file.write_text("my own notes")
    with running(bake, state_file=file) as studio, studio.page() as page:
        assert len(studio.notes) == 1
        assert "not a rig kept by the studio" in studio.notes[0]
        start = sequence_of(page)
        page.send(LAMP)
        page.exact(start + 1)
    assert file.read_text() == "my own notes"


def test_a_map_that_is_gone_is_noted(bake, tmp_path) -> None:
    from prelight.studio import kept, rig_state

    state = rig_state.changed(rig_state.initial("gone.hdr"), LAMP, author=None)
    kept.save(state, tmp_path / "a.json")
    with running(bake, state_file=tmp_path / "a.json") as studio, studio.page() as page:
        kept = page.message("Welcome")["state"]
        assert (kept["environment"], len(kept["discs"])) == ("stock:sunset", 1)
        assert "gone.hdr" in studio.notes[0]


# ---- What is refused -------------------------------------------------------------------------------------------


def test_bad_messages_change_nothing(shared: LiveStudio, monkeypatch) -> None:
    """R3 over the socket: each is refused by name, and the state stays bit for bit."""
    monkeypatch.setattr(Allowance, "take", lambda _: True)
    with shared.page() as page:
        start = sequence_of(page)
        page.send(LAMP)
        before = page.exact(start + 1)
        refused = 0
        others = [encode(SetEnvironment("nothing")), encode(SetEnvironment("../a.hdr")), encode(RemoveDisc("none")),
                  encode(Hello(1))]  # fmt: skip
        for text in (*BAD, *others):
            if len(text) > 16_000:
                continue  # those close the socket: below
            page.send(text)
            line = page.message("Refused")["reason"]
            assert len(line) <= 300
            assert line.isprintable()
            refused += 1
        page.socket.send(b"\x00" * 10)  # binary
        page.message("Refused")
        assert refused > 250
        assert not [m for m in page.messages[-refused:] if m["type"] == "State"]
        page.send(SetEnvironment(scale=2.0))
        page.send(SetEnvironment(scale=1.0))
        assert page.exact(start + 3) == before  # and it lives
        page.send(RemoveDisc("lamp"))
        page.exact(start + 4)


def test_a_large_message_closes_the_socket(shared: LiveStudio) -> None:
    with shared.page() as bad, shared.page() as good:
        start = sequence_of(bad)
        with pytest.raises(ConnectionClosed) as closed:
            _send_for_ever(bad, '{"type":"' + "x" * 1_000_000 + '"}', times=1)
        assert closed.value.rcvd.code == 1009
        assert sequence_of(good) == start


def test_a_flood_closes_the_socket(shared: LiveStudio) -> None:
    with shared.page() as bad, shared.page() as good:
        sequence_of(good)
        with pytest.raises(ConnectionClosed) as closed:
            _send_for_ever(bad, '{"type":"RemoveDisc","id":"none"}', times=20_000)
        assert closed.value.rcvd is None or closed.value.rcvd.code == 1008
        good.send(SetEnvironment(scale=1.0))
        good.message("State")


def _send_for_ever(page: Page, text: str, *, times: int) -> None:
    """So often, then listen until the socket is closed."""
    for _ in range(times):
        page.send(text)
    while True:
        page.take()


def test_there_is_room_for_thirty(shared: LiveStudio, monkeypatch) -> None:
    monkeypatch.setattr(hub, "MOST_VISITORS", 2)
    with shared.page() as one, shared.page() as two:
        one.message("Welcome")
        two.message("Welcome")
        with shared.connect() as third, pytest.raises(ConnectionClosed) as closed:
            third.recv(10)
        assert closed.value.rcvd.code == 1013


def test_an_allowance_is_used_up_and_grows_again(monkeypatch) -> None:
    now = [0.0]
    monkeypatch.setattr("prelight.studio.visitor.time.monotonic", lambda: now[0])
    allowance = Allowance(10, 5)
    assert [allowance.take() for _ in range(6)] == [True] * 5 + [False]
    now[0] = 0.2
    assert [allowance.take() for _ in range(3)] == [True, False, False]


# ---- No queue --------------------------------------------------------------------------------------------------


def test_a_drag_is_answered_with_the_newest(shared: LiveStudio) -> None:
    """Two hundred changes at once: far fewer frames, the last of them the last change, exact at rest."""
    with shared.page() as page:
        start = sequence_of(page)
        page.quiet()
        page.frames.clear()
        for k in range(200):
            page.send(SetDisc("lamp", k / 2.0, 35.0, 8.0, (6.0, 5.0, 4.0), dragging=True))
        page.exact(start + 200)
        sequences = [header.sequence for header, _ in page.frames]
        assert sequences == sorted(sequences)
        assert len(sequences) < 150
        page.send(RemoveDisc("lamp"))
        page.exact(start + 201)


def test_exact_comes_when_the_hand_rests(shared: LiveStudio) -> None:
    with shared.page() as page:
        start = sequence_of(page)
        page.quiet()
        page.frames.clear()
        began = time.monotonic()
        page.send(SetEnvironment("stock:noon", rotation_deg=1.0, dragging=True))
        page.exact(start + 1)
        assert time.monotonic() - began >= 0.15
        flags = [header.flags for header, _ in page.frames]
        assert flags == [0, 1]
        page.send(SetEnvironment("stock:sunset", rotation_deg=0.0))
        page.exact(start + 2)


def test_a_slow_reader_has_two_frames_and_then_the_newest(shared: LiveStudio) -> None:
    with shared.page() as good, shared.page(acknowledges=False) as slow:
        start = sequence_of(good)
        good.quiet()
        slow.quiet()
        for k in range(30):
            good.send(SetDisc("lamp", float(k), 35.0, 8.0, (6.0, 5.0, 4.0), dragging=k < 29))
            good.until(lambda got, k=k: isinstance(got, FrameHeader) and got.sequence == start + 1 + k)
        good.exact(start + 30)
        slow.quiet()
        assert len(slow.frames) == 2
        slow.acknowledges = True
        slow.send(Seen(slow.frames[-1][0].frame))
        slow.exact(start + 30)
        assert len(slow.frames) == 3
        good.send(RemoveDisc("lamp"))
        good.exact(start + 31)


def test_what_nobody_has_room_for_is_not_computed(shared: LiveStudio) -> None:
    with shared.page(acknowledges=False) as page:
        start = sequence_of(page)
        page.quiet()
        for k in range(20):
            page.send(SetDisc("lamp", float(k), 35.0, 8.0, (6.0, 5.0, 4.0), dragging=True))
            page.message("State")
            time.sleep(0.01)
        assert len(page.frames) == 2
        assert shared.studio._showing._hub._session._number - page.frames[-1][0].frame <= 1
        page.acknowledges = True
        page.send(Seen(page.frames[-1][0].frame))
        page.exact(start + 20)
        page.send(RemoveDisc("lamp"))
        page.exact(start + 21)


def test_a_page_that_goes_leaves_nothing(shared: LiveStudio) -> None:
    loop = shared.studio._showing._hub._loop
    before, descriptors = len(asyncio.all_tasks(loop)), _descriptors()
    for k in range(20):
        page = shared.page(acknowledges=k % 2 == 0)
        page.message("Welcome")
        if k % 3 == 0:
            page.socket.socket.shutdown(socket.SHUT_RDWR)  # without a word
        page.close()
    ends = time.monotonic() + 5
    while (
        shared.studio._showing._hub._visitors or len(asyncio.all_tasks(loop)) > before
    ) and time.monotonic() < ends:
        time.sleep(0.05)
    assert not shared.studio._showing._hub._visitors
    assert len(asyncio.all_tasks(loop)) <= before
    assert _descriptors() <= descriptors + 2


def _descriptors() -> int:
    return len(os.listdir("/proc/self/fd")) if Path("/proc/self/fd").exists() else 0


# ---- How it begins and ends ------------------------------------------------------------------------------------


def test_a_port_that_is_taken_is_named(shared: LiveStudio, bake, tmp_path) -> None:
    served = Served(Bake.open(bake), Environments(), tmp_path / "a.json", print)
    with pytest.raises(OutputError, match=f"{shared.port}.*in use"):
        Studio(served, port=shared.port)


def test_a_damaged_bake_ends_the_studio(bake, tmp_path) -> None:
    shutil.copytree(bake, tmp_path / "b.prelight")
    tiles = next((tmp_path / "b.prelight").glob("layers/*/tiles/00000/c/*/*/*"))
    data = bytearray(tiles.read_bytes())
    data[40] ^= 1
    tiles.write_bytes(data)
    studio = Studio(
        Served(Bake.open(tmp_path / "b.prelight"), Environments(), tmp_path / "a.json", print), port=0
    )
    with pytest.raises(DamagedBakeError):
        studio.serve()


@pytest.mark.parametrize(("stop", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_it_ends_cleanly(bake, tmp_path, stop, code) -> None:
    shutil.copytree(bake, tmp_path / "b.prelight")
    run = subprocess.Popen(
        [sys.executable, "-c", "from prelight.cli.main import main; main()", "studio",
         str(tmp_path / "b.prelight"), "--json", "--port", "0"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT,
    )  # fmt: skip
    assert run.stdout is not None
    lines = [run.stdout.readline() for _ in range(3)]
    assert json.loads("".join(lines))["url"].startswith("http://127.0.0.1:")
    time.sleep(0.5)
    run.send_signal(stop)
    out, err = run.communicate(timeout=20)
    assert run.returncode == code, err
    assert out == ""
    assert "Traceback" not in err
    assert err == ("prelight: stopped\n" if code else "")


def test_the_page_waits_for_no_compiler() -> None:
    """Nor does the studio need the renderer."""
    code = (
        "import sys, prelight.studio.server; print('numba' in sys.modules);"
        "import prelight.studio.light; print('mitsuba' in sys.modules or 'drjit' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert run.stdout.split() == ["False", "False"]


def test_the_rig_is_behind_the_door_and_looks_are_sent_aside(bake, tmp_path) -> None:
    with running(bake, state_file=tmp_path / "s.json") as studio, studio.page() as page:
        assert studio.request("GET", "/rig.toml", cookie=None).status == 401
        start = sequence_of(page)
        page.send(SaveLook("One"))
        page.send(SetEnvironment(scale=0.0))
        dark = page.exact(start + 2)
        assert not any(dark)
        answer = studio.request("GET", "/rig.toml")
        assert answer.status == 409
        assert b"nothing shines" in answer.content  # type: ignore[attr-defined]
        page.send(Compare("One"))
        compared = page.message("Compared")
        assert (compared["look"], compared["light"]["scale"]) == ("One", 1.0)
        aside = page.until(lambda got: isinstance(got, FrameHeader) and got.flags == 3)
        data = page.frames[-1][1][32:]
        assert aside.count * 4 == len(data)
        assert any(data)
        page.send(Undo())
        assert page.exact(start + 3) == data
        assert b'map = "stock:' in studio.get("/rig.toml")
        page.send(Compare("Two"))
        assert "Two" in page.message("Refused")["reason"]

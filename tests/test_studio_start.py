"""Baking from the start page: what is asked for is done by commands beside the studio, and every visitor sees it."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from prelight.studio import projects, typescript, uploads
from prelight.studio.recipes import recipes, refusal
from prelight.studio.start_protocol import Bake, OpenBake, SetWish, Stop, TakeUpload, Wish

from .start_page import StartStudio, small_ply, starting

STUB = Path(__file__).with_name("stub_command.py")


@pytest.fixture
def stub(tmp_path) -> StartStudio:
    with starting(tmp_path / "work", command=(sys.executable, str(STUB), str(tmp_path))) as studio:
        yield studio


def _begin(studio: StartStudio, name: str = "ball.ply"):
    visitor = studio.visitor()
    upload, status, _ = studio.upload(name, small_ply())
    assert status == 200
    visitor.send(TakeUpload(upload, name))
    return visitor, visitor.message("Taken")["project"]


# ---- What is asked for -----------------------------------------------------------------------------------------


def test_a_wish_is_a_few_commands_of_the_same_vertices() -> None:
    both = recipes(Wish(lamps="transfer", quality="draft", floor=3.0, subdivide=0.1))
    assert [one.kind for one in both] == ["environment", "transfer"]
    assert all(one.arguments[-4:] == ("--floor", "3", "--subdivide", "0.1") for one in both)
    assert (
        len({one.key for wish in (Wish(), Wish(quality="best"), Wish(floor=2.0)) for one in recipes(wish)})
        == 3
    )
    assert recipes(Wish())[0].arguments == ()  # good is what the command does by itself
    assert "nothing" in (refusal(Wish(sky="none"), windows=0) or "")
    assert "no glass" in (refusal(Wish(sky="windows"), windows=0) or "")
    assert "floor" in (refusal(Wish(sky="windows", floor=2.0), windows=3) or "")
    assert refusal(Wish(sky="windows"), windows=3) is None


@pytest.mark.parametrize("kind", ["environment", "portals", "transfer", "cloud"])
def test_every_quality_is_known_to_its_command(kind, prelight, tmp_path) -> None:
    sky = {"environment": "open", "portals": "windows"}.get(kind, "none")
    lamps = kind if sky == "none" else "none"
    for quality in ("draft", "good", "best"):
        (recipe,) = recipes(Wish(sky=sky, lamps=lamps, quality=quality))
        answer = prelight(
            "bake", kind, "nothing.ply", *recipe.arguments, "-o", tmp_path / "x.prelight", "--dry-run"
        )
        assert answer.code == 2
        assert "nothing.ply: no such file" in answer.err, answer.err


def test_the_typescript_is_current() -> None:
    assert typescript.START_TARGET.read_text() == typescript.start_messages_module()


# ---- Baking ----------------------------------------------------------------------------------------------------


def test_cost_progress_stop_and_resume_are_seen_by_all(stub: StartStudio, tmp_path) -> None:
    first, name = _begin(stub)
    ready = first.project(lambda p: p["stage"] == "ready")
    assert (ready["vertices"], ready["layers"][0]["rays"], ready["layers"][0]["seconds"]) == (10, 1000, 4.0)
    first.send(SetWish(name, Wish(lamps="transfer", device="cpu")))
    two = first.project(lambda p: p["stage"] == "ready" and len(p["layers"]) == 2)
    assert [layer["kind"] for layer in two["layers"]] == ["environment", "transfer"]
    first.send(Bake(name))
    second = stub.visitor()
    half = second.project(lambda p: p["stage"] == "baking" and p["share"] >= 0.25)
    assert half["rays_per_second"] is None or half["rays_per_second"] > 0
    assert half["seconds_left"] > 0
    assert first.project(lambda p: p["share"] >= 0.25)["share"] == half["share"]
    second.send(Stop(name))  # whoever: the bake is everybody's
    stopped = first.project(lambda p: p["stage"] == "stopped")
    assert stopped["share"] == 0.25
    partial = next((stub.workshop.work / name / "layers").glob("environment-*.partial"))
    assert (partial / "half").read_text() == "cpu"
    (tmp_path / "go").touch()
    first.send(Bake(name))
    said = first.project(lambda p: p["stage"] == "stopped" and p["reason"] != stopped["reason"])
    first.send(OpenBake(name))
    assert "not baked yet" in first.message("Refused")["reason"]
    assert said["share"] == 1.0  # both layers are there; the stub's are no bakes, and joining them says so
    assert "manifest" in said["reason"] or "bake" in said["reason"]


def test_a_killed_bake_and_a_restarted_studio_go_on(tmp_path) -> None:
    command = (sys.executable, str(STUB), str(tmp_path))
    with starting(tmp_path / "work", command=command) as studio:
        visitor, name = _begin(studio)
        visitor.project(lambda p: p["stage"] == "ready")
        visitor.send(Bake(name))
        visitor.project(lambda p: p["share"] == 0.5)
        (one,) = studio.workshop._projects.values()
        os.kill(one.baker.process.pid, signal.SIGKILL)
        assert "-9" in visitor.project(lambda p: p["stage"] == "stopped")["reason"]
        visitor.send(Bake(name))
        visitor.project(lambda p: p["stage"] == "baking")
        visitor.project(lambda p: one.baker is not None)
    with starting(tmp_path / "work", command=command) as again:  # the first was ended while it baked
        shown = again.visitor().message("Workshop")["projects"]
        assert [(p["id"], p["stage"], p["name"]) for p in shown] == [("ball", "stopped", "ball")]
        (tmp_path / "go").touch()
        later = again.visitor()
        later.send(Bake("ball"))
        assert later.project(lambda p: p["share"] == 1.0)


# ---- What comes from elsewhere ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "status", "said"),
    [
        ("../a.ply", 422, "plain name"), ("a/b.ply", 422, "without folders"), ("..\\a.ply", 422, "plain name"),
        ("/etc/a.ply", 422, "without folders"), (".hidden.ply", 422, "plain name"), ("", 422, "plain name"),
        ("a\x00.ply", 422, "plain name"), ("a\n.ply", 422, "plain name"), ("x" * 200 + ".ply", 422, "plain name"),
        ("scene.xml", 422, "can run code"), ("a.zip", 422, "archives"), ("a.py", 422, "expected a scene"),
        ("a.html", 422, "expected a scene"), ("a.svg", 422, "expected a scene"), ("ply", 422, "expected a scene"),
    ],
)  # fmt: skip
def test_names_that_are_no_plain_scene_files_are_refused(stub: StartStudio, name, status, said) -> None:
    _, got, answer = stub.upload(name, b"data")
    assert (got, said in answer["reason"]) == (status, True), answer
    assert not [p for p in stub.workshop.work.rglob("*") if p.is_file()]


def test_uploads_keep_to_their_limits(stub: StartStudio, monkeypatch) -> None:
    monkeypatch.setattr(uploads, "LARGEST_UPLOAD", 1000)
    monkeypatch.setattr(uploads, "MOST_FILES", 2)
    assert stub.upload("a.ply", b"x" * 1001)[1] == 422
    upload, status, _ = stub.upload("a.ply", b"x" * 600)
    assert status == 200
    assert stub.upload("b.bin", b"x" * 600, upload)[1] == 422  # together too much
    assert stub.upload("a.ply", b"x", upload)[1] == 507  # there already
    assert stub.upload("b.bin", b"x", upload)[1] == 200
    assert "more than 2 files" in stub.upload("c.bin", b"x", upload)[2]["reason"]
    assert stub.request("POST", "/start/file/UPPER", b"x", X_Name="a.ply")[0] == 404
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(1, 1, 1))
    assert stub.upload("a.ply", b"xx")[1] == 507


def test_strangers_can_neither_send_nor_listen(stub: StartStudio) -> None:
    path = f"/start/file/{'0' * 16}"
    cookie = stub.cookie
    for headers, status in [
        ({"Origin": "http://evil.example"}, 403), ({"Origin": "null"}, 403), ({"Host": "evil.example"}, 403),
        ({"Origin": f"http://127.0.0.1:{stub.port + 1}"}, 403), ({"Sec_Fetch_Site": "same-site"}, 403),
        ({"Cookie": "prelight-1=x"}, 401),
    ]:  # fmt: skip
        stub.cookie = headers.pop("Cookie", cookie)
        assert stub.request("POST", path, b"x", X_Name="a.ply", **headers)[0] == status
    stub.cookie = "prelight=none"
    with pytest.raises(InvalidStatus):
        stub.visitor()
    for where in ("/start", "/start/picture/ball", "/start/socket"):
        assert stub.request("GET", where)[0] == 401
    assert not stub.workshop.work.exists()


def test_bad_messages_are_refused_by_name_and_change_nothing(stub: StartStudio) -> None:
    visitor = stub.visitor()
    for text, said in [
        ("[]", "expected an object"), ('{"type": "Bake", "project": "../x"}', "Bake.project"),
        ('{"type": "TakeUpload", "upload": "../../etc", "main": "a.ply"}', "TakeUpload.upload"),
        ('{"type": "SetWish", "project": "x", "wish": {"sky": "all"}}', "SetWish.wish.sky"),
        ('{"type": "SetWish", "project": "x", "wish": {"floor": -1}}', "SetWish.wish.floor"),
        ('{"type": "SetWish", "project": "x", "wish": {"trust": true}}', "SetWish.wish.trust"),
        ('{"type": "ChooseStock", "scene": "stock:no-such"}', "no built-in scene"),
        ('{"type": "ChooseStock", "scene": "/etc/passwd"}', "no built-in scene"),
        ('{"type": "Bake", "project": "not-there"}', "not there"),
        ('{"type": "TakeUpload", "upload": "' + "0" * 16 + '", "main": "a.ply"}', "has not arrived"),
        ('{"type": "Hello", "version": 1}', "already"),
    ]:  # fmt: skip
        visitor.send(text)
        assert said in visitor.message("Refused")["reason"], text
    assert visitor.message("Workshop")["projects"] == [] if visitor.newest.get("projects") else True
    other = stub.visitor()
    other.close()
    strange = stub.visitor()
    strange.send("x" * 70_000)
    with pytest.raises(ConnectionClosed):
        strange.message("Refused", seconds=5)


def test_another_version_is_told_so(stub: StartStudio, monkeypatch) -> None:
    monkeypatch.setattr("tests.start_page.START_VERSION", 99)
    visitor = stub.visitor()
    with pytest.raises(ConnectionClosed, match="99"):
        visitor.message("Workshop")


def test_a_hostile_scene_is_refused_in_one_line_and_not_kept(stub: StartStudio) -> None:
    visitor, _ = _begin(stub, "hostile.ply")
    refused = visitor.project(lambda p: p["stage"] == "refused")
    assert refused["reason"] == "\\x1b[31mhostile.ply: <img src=x onerror=alert(1)>"
    assert not (stub.workshop.work / "hostile").exists()
    visitor.send(SetWish(refused["id"], Wish(quality="draft")))
    assert "could not be read" in visitor.message("Refused")["reason"]


def test_folders_of_others_are_no_projects(tmp_path) -> None:
    work = tmp_path / "work"
    for name, text in [("a", "{"), ("b", "[" * 10_000), ("e", "[]"),
                       ("c", '{"name": "x", "source": "../../etc/passwd", "wish": {}}'),
                       ("D", '{"name": "x", "source": "stock:room", "wish": {}}')]:  # fmt: skip
        (work / name).mkdir(parents=True)
        (work / name / "project.json").write_text(text)
    (work / "good").mkdir()
    (work / "good" / "project.json").write_text(
        '{"name": "x", "source": "stock:room", "wish": {"sky": "open"}}'
    )
    (work / "link").symlink_to(work / "good")
    assert [project.id for project in projects.read_projects(work)] == ["good"]

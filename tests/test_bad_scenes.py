"""Promises about bad scenes, by their numbers: our own files, the public corpus, special paths."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import time
from pathlib import Path

import pytest

from prelight.errors import InputError
from prelight.scene.loading import load_scene

from .bad import make as bad
from .corpus import Outcome, faults, in_child
from .workshop import assert_refusal


def refused(source: object, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        load_scene(source, **options)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


@pytest.mark.parametrize("suffix", ["obj", "ply", "glb", "gltf", "xml"])
def test_L7_special_paths_are_refused_at_once(tmp_path: Path, suffix: str) -> None:
    (tmp_path / f"folder.{suffix}").mkdir()
    os.mkfifo(tmp_path / f"pipe.{suffix}")
    os.symlink("/dev/zero", tmp_path / f"zero.{suffix}")
    os.symlink("absent", tmp_path / f"dangling.{suffix}")
    os.symlink(f"loop.{suffix}", tmp_path / f"loop.{suffix}")
    (tmp_path / f"empty.{suffix}").touch()
    (tmp_path / f"shut.{suffix}").touch(mode=0)
    for name in ("folder", "pipe", "zero", "dangling", "loop", "empty", "shut", "absent", "a" * 300, "a\0"):
        start = time.perf_counter()
        message = refused(tmp_path / f"{name}.{suffix}", trust=True)
        assert time.perf_counter() - start < 1 or suffix == "xml"  # the renderer is imported
        assert message.isprintable()
        assert len(name) > 20 or message.count(f".{suffix}") == 1


def test_our_own_bad_files() -> None:
    """The reason of every refusal, or the note that stands for it; the files are those that `make` writes."""
    rows = [json.loads(line) for line in (bad.HERE / "INDEX.jsonl").read_text(encoding="utf-8").splitlines()]
    assert len(rows) == len(bad.CASES)
    for row in rows:
        path = bad.HERE / row["path"]
        for name, content in bad.CASES[path.parent.name][0].items():
            assert (path.parent / name).read_bytes() == content
        if "refused" in row:
            message = refused(path)
            assert row["refused"] in message, row
            assert message.startswith(f"{path}: ") or len(str(path)) > 140
            assert len(message) <= 300
        else:
            assert any(row["note"] in note for note in load_scene(path).notes), row


def test_L3_the_command_line_says_the_same(prelight, tmp_path: Path) -> None:
    for row in map(json.loads, (bad.HERE / "INDEX.jsonl").read_text(encoding="utf-8").splitlines()):
        if "refused" in row:
            answer = prelight("bake", "environment", bad.HERE / row["path"], "-o", tmp_path / "new.prelight")
            assert_refusal(answer, 2)
            assert row["refused"] in answer.err, row
    assert not list(tmp_path.iterdir())


def test_L1_L2_L3_the_public_corpus_of_bad_files(data: Path) -> None:
    """Each in a child of its own: a scene or one line, in time, in memory, touching nothing else.

    All of it where PRELIGHT_WHOLE_CORPUS is set (about a minute); else every tenth of what has a reader and
    every sixtieth of what has none.
    """
    index = data / "bad" / "INDEX.jsonl"
    if not index.exists():
        pytest.skip("no corpus of bad files in the test data")
    for path in sorted(bad.HERE.glob("*/scene.*")):  # whatever is imported late is imported now
        with contextlib.suppress(InputError):
            load_scene(path)
    rows = [json.loads(line) for line in index.read_text(encoding="utf-8").splitlines()]
    assert len(rows) >= 1900
    ours = [row for row in rows if row["path"].lower().endswith((".obj", ".ply", ".glb", ".gltf"))]
    assert len(ours) >= 450
    if not os.environ.get("PRELIGHT_WHOLE_CORPUS"):
        rows = ours[::10] + [row for row in rows if row not in ours][::60]
    idle = in_child(lambda: None, data).growth
    wrong, scenes = {}, 0
    for row in rows:
        path = data / "bad" / row["path"]
        outcome = in_child(lambda path=path: load_scene(path), path.parent)
        found = faults(outcome, path, idle)
        if row["expect"] == "reject" and outcome.kind == "scene":
            found.append("was read, and must not be")
        if found:
            wrong[row["path"]] = found
        scenes += outcome.kind == "scene"
    assert wrong == {}
    assert scenes > len(rows) // 50


def test_the_corpus_catches_what_it_must(tmp_path: Path) -> None:
    """The test of the test: every fault a reader might have is seen."""
    path, inside = tmp_path / "a.obj", tmp_path / "inside"
    inside.write_bytes(b"x")

    def kill() -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    def refuse(message: str) -> None:
        raise InputError(path if message else "elsewhere", message)

    idle = in_child(lambda: None, tmp_path).growth
    wrongs = {
        "status": kill, "KeyError": lambda: {}["x"], "MB": lambda: bytearray(400 << 20).count(1),
        "touched open /etc": lambda: open("/etc/hostname", "rb").close(), "touched socket": socket.socket,
        "touched subprocess": lambda: subprocess.run(["true"], check=False), "said": lambda: refuse(""),
    }  # fmt: skip
    for reason, wrong in wrongs.items():
        assert any(reason in fault for fault in faults(in_child(wrong, tmp_path), path, idle)), reason
    assert faults(Outcome("scene", "", 2.1, idle, ()), path, idle) == ["took 2.1 s"]
    for right in (lambda: refuse("is bad"), inside.read_bytes, lambda: bytearray(50 << 20)):
        assert faults(in_child(right, tmp_path), path, idle) == []

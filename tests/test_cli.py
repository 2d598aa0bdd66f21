"""The command line in use: help, one JSON object for programs, words for people, exit codes of real processes."""

from __future__ import annotations

import inspect
import json
import os
import shutil
import subprocess
import sys
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from prelight.camera import Camera
from prelight.cli import bake as bake_command
from prelight.cli import compare, demo, doctor, main, relight, studio, verify
from prelight.cli import inspect as inspect_command
from prelight.cli.main import run
from prelight.lighting.rig import Rig
from prelight.relighting.relighter import Relighter
from prelight.storage.bake import Bake

from . import disk
from .disk import copy, quick_bake
from .workshop import Answer, assert_refusal

ROOT = Path(__file__).resolve().parents[1]
FUNCTIONS = {
    "demo": demo.demo,
    "bake environment": bake_command.environment,
    "bake steerable": bake_command.steerable,
    "bake portals": bake_command.portals,
    "bake transfer": bake_command.transfer,
    "bake cloud": bake_command.cloud,
    "relight": relight.relight,
    "studio": studio.studio,
    "compare": compare.compare,
    "inspect": inspect_command.inspect,
    "verify": verify.verify,
    "doctor": doctor.doctor,
}
COMMANDS = ("", "bake", *FUNCTIONS)


def options_of(function) -> list[tuple[str, str]]:
    """Names of a command's options, each with the docstring that explains it; those that bakes share are fields."""
    found = []
    for name, parameter in inspect.signature(function).parameters.items() if function else ():
        if is_dataclass(parameter.default):
            found += [(field.name, type(parameter.default).__doc__) for field in fields(parameter.default)]
        else:
            found.append((name, function.__doc__))
    return found


@pytest.mark.parametrize("command", COMMANDS)
def test_help_teaches(prelight, command):
    """Every option is explained."""
    answer = prelight(*command.split(), "--help")
    assert answer.code == 0
    assert answer.err == ""
    assert "Usage: prelight" in answer.out
    for name, explained in options_of(FUNCTIONS.get(command)):
        assert f"--{name.replace('_', '-')}" in answer.out or name.upper() in answer.out
        assert f"\n    {name}\n        " in explained, f"{name} is not explained"


def test_help_of_a_real_process_survives_ascii(tmp_path):
    ran = in_a_shell("prelight bake environment --help", tmp_path, PYTHONIOENCODING="ascii")
    assert (ran.returncode, ran.stderr) == (0, "")
    assert "--resolution" in ran.stdout


def one_object(answer: Answer) -> dict:
    """The one JSON object that is all of standard output."""
    assert answer.code == 0, answer
    assert answer.err == ""
    return json.loads(answer.out, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


def test_a_bake_from_end_to_end(prelight, workshop, tmp_path):
    """Dry run, bake, inspect, verify, relight: each one JSON object with the names programs depend on."""
    mesh, target = workshop / "ball.ply", tmp_path / "ball.prelight"
    options = ["--resolution", "12", "--floor", "2", "--bounces", "0", "--json"]
    plan = one_object(prelight("bake", "environment", mesh, "-o", target, *options, "--dry-run"))
    assert plan.keys() >= {"rays", "seconds", "memory", "bytes", "receivers", "clusters"}
    assert not list(tmp_path.iterdir())
    made = one_object(prelight("bake", "environment", mesh, "-o", target, *options))
    assert one_object(prelight("inspect", target, "--json")) == made | {"pictures": []}
    (layer,) = made["layers"]
    assert layer.keys() >= {"kind", "basis_lights", "coefficients", "bytes", "seconds", "rays", "parameters"}
    assert plan["receivers"] == made["receivers"] == 86 + 193**2
    for estimate, fact in ((plan["rays"], layer["rays"]), (plan["bytes"], made["bytes"])):
        assert abs(estimate / fact - 1) < 0.3
    whole = one_object(prelight("verify", target, "--json"))
    assert (whole["whole"], whole["bytes"]) == (True, made["bytes"])

    lit = one_object(prelight("relight", target, workshop / "good.exr", "-o", tmp_path / "b.npy", "--json"))
    assert lit.keys() >= {"milliseconds", "bytes_read"}
    radiance = np.load(tmp_path / "b.npy")
    assert (radiance.shape, radiance.dtype) == ((made["receivers"], 3), np.float32)
    light = Relighter(target)
    light.environment = Rig.open(str(workshop / "good.exr")).environment
    np.testing.assert_array_equal(radiance, light.radiance)
    for name, begins in (("b.png", b"\x89PNG"), ("b.exr", b"v/1\x01")):
        camera = ["--camera", workshop / "good.json", "--size", "16x9"]
        one_object(
            prelight("relight", target, workshop / "good.toml", "-o", tmp_path / name, *camera, "--json")
        )
        assert (tmp_path / name).read_bytes().startswith(begins)
    assert_refusal(prelight("bake", "environment", mesh, "-o", target, "--json"), 3, "--force")


def test_words_for_people(prelight, workshop, tmp_path):
    """Without --json the same things in words, and on standard output."""
    bake = workshop / "ball.prelight"
    said = prelight("inspect", bake)
    assert (said.code, said.err) == (0, "")
    for word in ("86 vertices", "619 clusters", "(6×9²)", "tolerance  0.015", "loses"):
        assert word in said.out
    said = prelight("verify", bake)
    assert "whole; 30 chunks" in said.out
    said = prelight(
        "relight", bake, "stock:studio", "-o", tmp_path / "p.png", "--size", "16x9", "--background", "none"
    )
    assert "relit 86 receivers" in said.out
    assert str(tmp_path / "p.png") in said.out


def test_strong_lights_are_told_and_may_be_left_to_clusters(prelight, workshop, tmp_path):
    """Under an even sky there are none; a sun is traced by rays unless told otherwise, and its shadow changes."""
    call = ["relight", workshop / "ball.prelight"]
    assert one_object(prelight(*call, workshop / "good.exr", "--json"))["strong_lights"] == 0
    pictures = {}
    for way in ("rays", "clusters"):
        output = tmp_path / f"{way}.npy"
        lit = one_object(prelight(*call, "stock:sunset", "-o", output, "--strong-lights", way, "--json"))
        assert (lit["strong_lights"] > 0) == (way == "rays")
        pictures[way] = np.load(output)
    assert not np.array_equal(pictures["rays"], pictures["clusters"])
    assert abs(pictures["rays"].mean() / pictures["clusters"].mean() - 1) < 0.1
    assert "traced by rays" in prelight(*call, "stock:sunset").out
    assert "traced" not in prelight(*call, "stock:sunset", "--strong-lights", "clusters").out
    assert_refusal(prelight(*call, "stock:sunset", "--strong-lights", "all"), 2, "rays or clusters")


def test_names_cannot_steer_a_terminal(prelight, workshop, tmp_path, monkeypatch):
    """Escape sequences in file names, scene names, notes and cameras are shown, not sent."""
    evil = "\x1b[31m\x07evil\u202e"
    mesh = tmp_path / f"{evil}.ply"
    shutil.copyfile(workshop / "ball.ply", mesh)
    target = tmp_path / f"{evil}.prelight"
    monkeypatch.chdir(tmp_path)
    answers = [
        prelight("bake", "environment", mesh, "--resolution", "4"),
        prelight("inspect", target),
        prelight("inspect", target, "--json"),
        prelight("verify", target),
        prelight("relight", target, "stock:noon", "-o", tmp_path / f"{evil}.png", "--size", "8x8"),
        prelight("relight", target, "stock:noon", "--camera", evil),
        prelight("relight", target, tmp_path / f"{evil}.hdr"),
        prelight("bake", "environment", mesh, f"--{evil}", "1"),
        prelight(evil),
    ]
    assert [answer.code for answer in answers] == [0, 0, 0, 0, 0, 2, 2, 2, 2]
    for answer in answers:
        assert all(line.isprintable() for line in (answer.out + answer.err).splitlines()), answer
    undecodable = os.fsdecode(os.fsencode(tmp_path) + b"/\xff.prelight")
    copy(target, Path(undecodable))
    for command in ("inspect", "verify"):
        assert prelight(command, undecodable).code == 0
        json.loads(prelight(command, undecodable, "--json").out)


def test_cameras_of_a_bake(prelight, workshop, tmp_path, monkeypatch):
    """A bake's cameras are called by name; the error names those there are."""
    scene, plan = disk.quick_plan()
    cameras = {"front": Camera((0, 1, 4), (0, 0.5, 0)), "top": Camera((0, 4, 0.1), (0, 0, 0))}
    monkeypatch.setattr(disk, "quick_plan", lambda **_: (replace(scene, cameras=cameras), plan))
    bake = quick_bake(tmp_path / "ball.prelight").path
    assert "front, top" in prelight("inspect", bake).out
    assert list(Bake.open(bake).cameras) == ["front", "top"]
    pictures = set()
    for camera in ("front", "top"):
        output = tmp_path / f"{camera}.png"
        assert (
            prelight("relight", bake, "stock:noon", "-o", output, "--camera", camera, "--size", "32x18").code
            == 0
        )
        pictures.add(output.read_bytes())
    assert len(pictures) == 2
    assert_refusal(
        prelight("relight", bake, "stock:noon", "-o", tmp_path / "x.png", "--camera", "back"), 2, "front, top"
    )


def in_a_shell(command: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), **variables}
    environment.pop("PYTHONUNBUFFERED", None)  # what is still in a buffer at the end is a case of its own
    prelight = f'{sys.executable} -c "from prelight.cli.main import main; main()"'
    return subprocess.run(
        ["bash", "-c", command.replace("prelight ", f"{prelight} ", 1)],
        cwd=folder, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("command", "code", "out", "err"),
    [
        ("prelight verify ball.prelight", 0, "whole", ""),
        ("prelight verify missing.prelight", 2, "", "prelight: missing.prelight: no such bake"),
        ("prelight inspect ball.prelight > /dev/full", 3, "", "prelight: standard output: the disk is full"),
        ("prelight inspect ball.prelight | head -c 1; exit ${PIPESTATUS[0]}", 0, "b", ""),
        ("prelight --help | head -c 1; exit ${PIPESTATUS[0]}", 0, "U", ""),
        ("prelight inspect ball.prelight >&-", 0, "", ""),
        ("prelight bake environment 'esc\x1b[31m\n.ply'", 2, "", r"prelight: esc\x1b[31m\n.ply: begins with"),
    ],
)
def test_real_processes(workshop, tmp_path, command, code, out, err):
    ran = in_a_shell(command, workshop)
    assert ran.returncode == code, ran
    assert out in ran.stdout
    assert ran.stderr.startswith(err)
    assert ran.stderr.count("\n") == (1 if err else 0)


def test_a_fault_of_ours_is_one_line_too(prelight, workshop, monkeypatch):
    """And says how to see more: nobody should meet a traceback unasked."""

    def broken(self):
        raise RuntimeError("something\nunforeseen\x1b[31m")

    monkeypatch.setattr(Bake, "summary", broken)
    answer = prelight("inspect", workshop / "ball.prelight")
    assert answer.code == 1
    assert answer.err.count("\n") == 1
    assert "RuntimeError" in answer.err
    assert "PRELIGHT_DEBUG=1" in answer.err
    assert answer.err[:-1].isprintable()
    monkeypatch.setenv("PRELIGHT_DEBUG", "1")
    with pytest.raises(RuntimeError):
        run(["inspect", str(workshop / "ball.prelight")])


@pytest.mark.parametrize(
    ("raised", "code"),
    [(KeyboardInterrupt, 130), (main._Terminated, 143), (MemoryError, 2), (OSError(5, "bad"), 3)],
)
def test_what_may_happen_anywhere(prelight, workshop, monkeypatch, raised, code):
    def broken(self):
        raise raised

    monkeypatch.setattr(Bake, "summary", broken)
    answer = prelight("inspect", workshop / "ball.prelight")
    assert (answer.code, answer.out, answer.err.count("\n")) == (code, "", 1)

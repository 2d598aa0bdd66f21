"""Bad input on the command line: exit code 2, 3 or 4, one line that names it, and nothing left behind (C1, L3)."""

from __future__ import annotations

import pytest

from .disk import copy, tree
from .workshop import MESHES, assert_refusal


@pytest.mark.parametrize(
    "name", [*MESHES, "pipe.ply", "folder.ply", "stock:nothing", "stock:", "stock:../../x"]
)
def test_bad_scenes(prelight, workshop, tmp_path, name):
    scene = name if name.startswith("stock:") else workshop / name
    assert_refusal(prelight("bake", "environment", scene, "-o", tmp_path / "new.prelight"), 2)
    assert not list(tmp_path.iterdir())


BAD_BAKE_OPTIONS = {
    "--resolution": ["0", "4097", "-1", "abc", "1.5", "", "99999999999999999999"],
    "--tolerance": ["0", "nan", "2", "-1", "inf", "x"],
    "--epsilon": ["0", "nan", "2", "x"],
    "--samples-per-side": ["1", "0", "10", "x"],
    "--floor": ["0", "nan", "-1", "inf", "x"],
    "--albedo": ["2", "-1", "nan", "1,2", "x", "1,1,1,1"],
    "--memory": ["banana", "10MB", "-4GB", "", "0", "4 parsecs", "1e5"],
    "--zones": ["0", "-1", "5000", "x", "1.5"],
    "--receivers": ["faces", "", "pixels"],
    "--camera": ["nobody", "missing.json"],
    "--size": ["64x36", "x"],
    "--pixel-samples": ["4", "0"],
    "--subdivide": ["0", "-1", "nan", "1e-9", "x"],
    "--nonsense": ["1"],
    "--no-resume": [""],
}  # fmt: skip


@pytest.mark.parametrize(
    ("option", "value"), [(option, value) for option, values in BAD_BAKE_OPTIONS.items() for value in values]
)
def test_bad_options_of_bake(prelight, workshop, tmp_path, option, value):
    answer = prelight(
        "bake", "environment", workshop / "ball.ply", "-o", tmp_path / "new.prelight", option, value
    )
    assert_refusal(answer, 2)
    assert not list(tmp_path.iterdir())


def test_tolerance_and_epsilon_exclude_each_other(prelight, workshop, tmp_path):
    target = tmp_path / "new.prelight"
    answer = prelight(
        "bake", "environment", workshop / "ball.ply", "-o", target, "--tolerance", ".1", "--epsilon", ".1"
    )
    assert_refusal(answer, 2, "--tolerance", "--epsilon")
    answer = prelight("bake", "environment", workshop / "ball.ply", "-o", target, "--memory", "9" * 400)
    assert_refusal(answer, 2, "--memory")


BAD_LIGHTS = [
    "missing.hdr", "empty.hdr", "text.hdr", "picture.hdr", "huge.hdr", "truncated.hdr", "square-ish.hdr", "pipe.hdr",
    "folder.hdr", "empty.exr", "truncated.exr", "text.exr", "nan.exr", "negative.exr", "infinite.exr",
    "stock:nothing", "stock:", "empty.toml", "text.toml", "unknown.toml", "unknown table.toml", "missing map.toml",
    "nan.toml", "negative.toml", "number.toml", "nul.toml", "loop.toml", "deep.toml", "pipe.toml", "missing.toml",
]  # fmt: skip


@pytest.mark.parametrize("name", BAD_LIGHTS)
def test_bad_lights(prelight, workshop, tmp_path, name):
    light = name if name.startswith("stock:") else workshop / name
    assert_refusal(prelight("relight", workshop / "ball.prelight", light, "-o", tmp_path / "new.png"), 2)
    assert not list(tmp_path.iterdir())


BAD_RELIGHT_OPTIONS = {
    "--size": ["0x0", "0x5", "64", "x", "-1x5", "16385x1", "16384x16384", "99999x99999", "", "1x1x1"],
    "--camera": ["nowhere", ""],
    "--exposure": ["nan", "inf", "x", ""],
    "--curve": ["odd", ""],
    "--scale": ["-1", "nan", "inf", "x", "1e39"],
    "--rotate": ["nan", "inf", "x"],
    "--tint": ["nan", "-1", "1,2", "x", "1,1,1,1", ""],
    "--background": ["nan", "1,2", "odd", ""],
    "--layout": ["odd"],
    "--nonsense": ["1"],
    "-o": ["picture.jpg", "picture", "picture.PNG.txt", ""],
}  # fmt: skip


@pytest.mark.parametrize(
    ("option", "value"),
    [(option, value) for option, values in BAD_RELIGHT_OPTIONS.items() for value in values],
)
def test_bad_options_of_relight(prelight, workshop, tmp_path, monkeypatch, option, value):
    monkeypatch.chdir(tmp_path)
    output = [] if option == "-o" else ["-o", "new.png"]
    answer = prelight("relight", workshop / "ball.prelight", workshop / "good.exr", *output, option, value)
    assert_refusal(answer, 2)
    assert not list(tmp_path.iterdir())


BAD_CAMERAS = [
    "missing.json", "empty.json", "text.json", "list.json", "deep.json", "missing field.json", "extra field.json",
    "nan.json", "huge.json", "two numbers.json", "words.json", "at target.json", "field of view.json",
    "not UTF-8.json", "pipe.json",
]  # fmt: skip


@pytest.mark.parametrize("name", BAD_CAMERAS)
def test_bad_cameras(prelight, workshop, tmp_path, name):
    output = tmp_path / "new.png"
    answer = prelight(
        "relight", workshop / "ball.prelight", "stock:noon", "-o", output, "--camera", workshop / name
    )
    assert_refusal(answer, 2)
    assert not output.exists()


NOT_COMMANDS = [
    ["nonsense"], [""], ["--nonsense"], ["bake", "nonsense"], ["bake", "environment"], ["relight"], ["relight", "x"],
    ["inspect"], ["inspect", "a", "b"], ["verify"], ["verify", "x", "--nonsense"], ["doctor", "x"], ["demo", "x"],
    ["inspect", "missing.prelight"], ["verify", "missing.prelight"], ["relight", "missing.prelight", "stock:noon"],
    ["verify", "nul\0"], ["inspect", "n" * 5000], ["\x1b[2J"], ["inspect", "\x1b[2J\n"], ["verify", "\udcff"],
]  # fmt: skip


@pytest.mark.parametrize("arguments", NOT_COMMANDS, ids=repr)
def test_bad_commands(prelight, tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    assert_refusal(prelight(*arguments), 2)
    assert not list(tmp_path.iterdir())


def test_damaged_bakes_have_a_code_of_their_own(prelight, workshop, tmp_path):
    bake = copy(workshop / "ball.prelight", tmp_path / "ball.prelight")
    chunk = bake / "layers/environment/tiles/00001/c/0/0/0"
    chunk.write_bytes(bytes([chunk.read_bytes()[0] ^ 1]) + chunk.read_bytes()[1:])
    assert_refusal(prelight("verify", bake), 4, "layers/environment/tiles/00001/c/0/0/0")
    assert_refusal(
        prelight("relight", bake, "stock:noon", "--json"), 4, "layers/environment/tiles/00001/c/0/0/0"
    )
    (bake / "manifest.json").unlink()
    assert_refusal(prelight("inspect", bake), 4, "manifest.json")


def test_outputs_that_cannot_be(prelight, workshop, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mesh, bake = workshop / "ball.ply", workshop / "ball.prelight"
    (tmp_path / "file").write_bytes(b"")
    for output in (
        "nowhere/new.prelight",
        "/proc/new.prelight",
        "file/new.prelight",
        "n" * 300 + ".prelight",
    ):
        assert_refusal(prelight("bake", "environment", mesh, "-o", output, "--resolution", "4", "--json"), 3)
    for output in ("nowhere/new.png", "/proc/new.png", "file/new.png", "n" * 300 + ".png"):
        assert_refusal(prelight("relight", bake, "stock:noon", "-o", output, "--size", "8x8"), 3)
    for folder in ("file", "file/demo", "/proc/demo"):
        assert_refusal(prelight("demo", "-o", folder), 3)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_folder_that_may_not_be_written_is_found_out_first(prelight, workshop, tmp_path, monkeypatch):
    """Before the scene is read: root may write anywhere, so the answer of the system is made up here."""
    monkeypatch.setattr("prelight.files.os.access", lambda *_: False)
    answer = prelight("bake", "environment", workshop / "missing.ply", "-o", tmp_path / "new.prelight")
    assert_refusal(answer, 3, "permission denied")


def test_existing_outputs_are_untouched(prelight, workshop, tmp_path):
    bake = copy(workshop / "ball.prelight", tmp_path / "ball.prelight")
    picture = tmp_path / "picture.png"
    picture.write_bytes(b"dear")
    before = tree(tmp_path)
    assert_refusal(prelight("bake", "environment", workshop / "ball.ply", "-o", bake), 3, "--force")
    assert_refusal(
        prelight("bake", "environment", workshop / "ball.ply", "-o", bake, "--resume"), 3, "--force"
    )
    assert_refusal(
        prelight("bake", "environment", workshop / "ball.ply", "-o", picture, "--force"), 3, "not a bake"
    )
    assert_refusal(
        prelight("bake", "environment", workshop / "ball.ply", "-o", tmp_path, "--force"), 3, "not a bake"
    )
    for output in (picture, picture.with_suffix(".PNG")):
        if output.exists():
            assert_refusal(prelight("relight", bake, "stock:noon", "-o", output), 3, "--force")
    assert tree(tmp_path) == before
    assert prelight("relight", bake, "stock:noon", "-o", picture, "--size", "8x8", "--force").code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")

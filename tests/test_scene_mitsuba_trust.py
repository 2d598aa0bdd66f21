"""Mitsuba's scenes are parsed only if trusted, and refused in one line where they are broken."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.scene.loading import load_scene
from prelight.scene.variant import mitsuba


def xml(folder: Path, inner: str, version: str = "3.0.0") -> Path:
    path = folder / "room.xml"
    path.write_text(f'<scene version="{version}">{inner}</scene>')
    return path


def test_without_trust_nothing_is_parsed(tmp_path):
    path = xml(tmp_path, '<shape type="cube"/>')
    with pytest.raises(InputError, match="--trust"):
        load_scene(path)
    with pytest.raises(InputError, match="trust=True"):
        load_scene({"type": "scene", "c": {"type": "cube"}})
    assert len(load_scene(path, trust=True).triangles) == 12


def test_files_are_found_beside_the_scene_from_any_folder(tmp_path, monkeypatch):
    (tmp_path / "meshes").mkdir()
    mitsuba().load_dict({"type": "cube"}).write_ply(str(tmp_path / "meshes" / "cube.ply"))
    (tmp_path / "more.xml").write_text('<scene version="3.0.0"><shape type="sphere" id="ball"/></scene>')
    inner = (
        '<include filename="more.xml"/>'
        '<shape type="ply"><string name="filename" value="meshes/cube.ply"/></shape>'
    )
    path = xml(tmp_path, inner)
    monkeypatch.chdir("/")
    assert len(load_scene(path, trust=True).triangles) > 12
    monkeypatch.chdir(tmp_path)
    assert len(load_scene(Path(path.name), trust=True).triangles) > 12


def test_scenes_of_older_versions_are_read(tmp_path):
    old = '<shape type="cube"><bsdf type="plastic"><rgb name="diffuseReflectance" value="0.1 0.2 0.3"/></bsdf></shape>'
    (material,) = load_scene(xml(tmp_path, old, "0.5.0"), trust=True).materials
    assert material.colour == pytest.approx((0.1, 0.2, 0.3))


TWO_SIDED = '<bsdf type="twosided">'
BROKEN = {
    '<shape type="cube"><bsdf': "damaged XML",
    '<shape type="cubee"/>': "cubee.*line 1",
    '<shape type="cube"><bsdf type="difuse"/></shape>': "difuse",
    '<shape type="cube"><bsdf type="diffuse"><float name="x" value="3"/></bsdf></shape>': "unreferenced",
    '<shape type="ply"><string name="filename" value="none.ply"/></shape>': "none.ply: no such file",
    '<shape type="obj"><string name="filename" value="none.obj"/></shape>': "none.obj.*not found",
    '<shape type="ply"><string name="filename" value="room.xml"/></shape>': "end_header",
    '<shape type="sphere"><float name="radius" value="3x"/></shape>': "3x",
    '<shape type="cube"><ref id="nobody"/></shape>': "nobody",
    '<include filename="room.xml"/>': "recursion",
    '<bsdf id="a" type="twosided"><ref id="b"/></bsdf><bsdf id="b" type="twosided"><ref id="a"/></bsdf>': "circular",
    f'<shape type="cube">{TWO_SIDED * 30}<bsdf type="diffuse"/>{"</bsdf>" * 30}</shape>': "nested",
    "<shape>" * 20_000 + "</shape>" * 20_000: "nested",
    '<shape type="rectangle"><bsdf type="diffuse"><texture name="reflectance" type="bitmap"><string name="filename" '
    'value="none.png"/></texture></bsdf></shape>': "none.png",
    "": "no shapes",
}  # fmt: skip


@pytest.mark.parametrize("inner", BROKEN, ids=[reason.split(".")[0] for reason in BROKEN.values()])
def test_a_broken_scene_is_refused_in_one_line(tmp_path, inner):
    with pytest.raises(InputError, match=BROKEN[inner]) as refusal:
        load_scene(xml(tmp_path, inner), trust=True)
    said = str(refusal.value)
    assert "\n" not in said
    assert "parser.cpp" not in said


def test_every_beginning_of_a_scene_is_refused(tmp_path):
    whole = '<scene version="3.0.0"><shape type="cube"><bsdf type="diffuse"/></shape></scene>'
    path = tmp_path / "cut.xml"
    for end in range(1, len(whole), 5):
        path.write_text(whole[:end])
        with pytest.raises(InputError):
            load_scene(path, trust=True)


@pytest.mark.parametrize(
    "make",
    [
        lambda mi: {},
        lambda mi: {"type": "diffuse"},
        lambda mi: {"type": "scene", "a": {"type": "cube", "b": {"type": "blackhole"}}},
        lambda mi: mi.load_dict({"type": "diffuse"}),
        lambda mi: mi.Bitmap(np.zeros((2, 2, 3), np.float32)),
        lambda mi: {"type": "scene", "a": {"type": "ply", "filename": "/dev/zero"}},
        lambda mi: {"type": "scene", "a": object()},
    ],
)
def test_other_dictionaries_and_objects_are_refused(make: Callable[[Any], object]):
    with pytest.raises(InputError):
        load_scene(make(mitsuba()), trust=True)


def test_the_callers_resolver_and_folder_stay(tmp_path):
    before = str(mitsuba().file_resolver()), os.getcwd()
    load_scene(xml(tmp_path, '<shape type="cube"/>'), trust=True)
    assert (str(mitsuba().file_resolver()), os.getcwd()) == before

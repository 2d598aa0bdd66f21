"""A bake tells when its mesh is too coarse for the light that bounces in it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from prelight.baking.bounced import HELD
from prelight.baking.environment import bake_environment
from prelight.cli.main import run
from prelight.scene.geometry import Scene
from prelight.scene.subdivision import subdivided

_SETTINGS = {"resolution": 4, "tolerance": 0.2, "gather_rays": 64}


def table(edge: float) -> Scene:
    """A board close above a floor: under it an even sky's light falls off within a few hands."""
    floor = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], np.float32)
    positions = np.concatenate([floor, 0.5 * floor + np.float32([0, 0.15, 0])])
    normals = np.tile(np.float32([0, 1, 0]), (8, 1))
    triangles = np.array([[0, 3, 2], [0, 2, 1]], np.int32)
    albedo = np.full((8, 3), 0.5, np.float32)
    scene = Scene("table", positions, normals, np.concatenate([triangles, triangles + 4]), albedo)
    return subdivided(scene, edge)


def test_the_mesh_is_judged_and_a_finer_one_named(tmp_path, capsys):
    told = {}
    for name, edge in (("coarse", 0.7), ("fine", 0.1)):
        bake = bake_environment(table(edge), tmp_path / f"{name}.prelight", **_SETTINGS)
        told[name] = bake.layers["environment"].statistics
        assert run(["inspect", str(tmp_path / f"{name}.prelight")]) == 0
        said = capsys.readouterr().out
        assert ("too coarse for an even sky's light" in said) == (name == "coarse")
    assert told["coarse"]["bounced_held"] < 0.95
    assert told["fine"]["bounced_held"] > HELD
    assert "bounced_edge" not in told["fine"]
    advised = told["coarse"]["bounced_edge"]
    assert 0.01 < advised < 0.7

    better = bake_environment(table(advised), tmp_path / "advised.prelight", **_SETTINGS)
    assert better.layers["environment"].statistics["bounced_held"] >= HELD - 0.01
    assert run(["inspect", str(tmp_path / "coarse.prelight"), "--json"]) == 0
    layer = json.loads(capsys.readouterr().out)["layers"][0]
    assert layer["statistics"]["bounced_edge"] == pytest.approx(advised)

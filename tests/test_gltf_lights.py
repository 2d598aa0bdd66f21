"""Lights of glTF files as rigs: the same light, in our units and places."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from prelight.lighting.ies import LUMENS_PER_WATT, parsed
from prelight.lighting.imported_lights import cone_photometry
from prelight.lighting.rig import Rig

from .gltf_builder import Glb

POINT = {"type": "point", "name": "bulb", "color": [1, 0.5, 0.25], "intensity": 683.0}
SPOT = {"type": "spot", "intensity": 1366.0, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}}
SUN = {"type": "directional", "intensity": 68300.0}


def file_of(folder: Path, *lights: dict, **node: object) -> Path:
    glb = Glb()
    glb.node(glb.primitive())
    glb.json["extensions"] = {"KHR_lights_punctual": {"lights": list(lights)}}
    for k in range(len(lights)):
        glb.node(extensions={"KHR_lights_punctual": {"light": k}}, **node)
    path = folder / "lit.glb"
    path.write_bytes(glb.bytes())
    return path


def test_the_rig_is_the_same_light(prelight, tmp_path):
    scene = file_of(
        tmp_path, POINT, SPOT, SUN, translation=[1, 2, 3], rotation=[-math.sqrt(0.5), 0, 0, math.sqrt(0.5)]
    )
    told = prelight("rig", "lamps", scene, "-o", tmp_path / "rig.toml", "--json")
    assert told.code == 0, told.err
    assert json.loads(told.out)["point"] == 1
    rig = Rig.open(str(tmp_path / "rig.toml"))
    (sun,) = rig.environment.discs
    tables = tomllib.loads((tmp_path / "rig.toml").read_text())
    np.testing.assert_allclose(tables["lamp"][0]["intensity"], [1, 0.5, 0.25], rtol=1e-6)
    np.testing.assert_allclose(tables["lamp"][0]["position"], [1, 2, 3])
    np.testing.assert_allclose(
        tables["spot"][0]["direction"], [0, -1, 0], atol=1e-9
    )  # -Z, turned down about X
    np.testing.assert_allclose(tables["spot"][0]["intensity"], [2, 2, 2], rtol=1e-6)
    np.testing.assert_allclose(sun.direction, [0, 1, 0], atol=1e-6)
    irradiance = np.array(sun.radiance) * math.pi * math.sin(math.radians(sun.radius_deg)) ** 2
    np.testing.assert_allclose(irradiance, 100.0, rtol=1e-5)


def test_a_cone_is_full_inside_and_dark_outside():
    shape = parsed(cone_photometry(20.0, 40.0), name="cone")
    angle = np.radians([0, 10, 19.9, 30, 40.1, 60, 90])
    found = shape.along(np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1))[:, 0]
    middle = (math.cos(angle[3]) - math.cos(math.radians(40))) / (
        math.cos(math.radians(20)) - math.cos(math.radians(40))
    )
    np.testing.assert_allclose(found, [1, 1, 1, middle**2, 0, 0, 0], atol=2e-3)
    assert parsed(cone_photometry(0.0, 90.0), name="cone").candela[0, -1] == 0
    assert LUMENS_PER_WATT == 683


def test_two_cones_of_one_shape_share_a_file(prelight, tmp_path):
    assert prelight("rig", "lamps", file_of(tmp_path, SPOT, SPOT), "-o", tmp_path / "rig.toml").code == 0
    assert len(list(tmp_path.glob("*.ies"))) == 1


@pytest.mark.parametrize(
    ("light", "reason"),
    [
        ({"type": "area"}, "point"),
        ({"type": "point", "intensity": -1}, "greater than or equal"),
        ({"type": "point", "color": [1, -1, 0]}, "negative"),
        ({"type": "spot", "spot": {"innerConeAngle": 0.6, "outerConeAngle": 0.5}}, "not below"),
        ({"type": "spot", "spot": {"outerConeAngle": 3.0}}, "less than or equal"),
        ({"type": "point", "intensity": "bright"}, "number"),
    ],
)
def test_bad_lights_are_one_line(prelight, tmp_path, light, reason):
    told = prelight("rig", "lamps", file_of(tmp_path, light), "-o", tmp_path / "rig.toml")
    assert told.code == 2
    assert reason in told.err
    assert told.err.count("\n") == 1
    assert not (tmp_path / "rig.toml").exists()


def test_what_cannot_be_read_is_refused(prelight, tmp_path):
    glb = Glb()
    glb.node(glb.primitive())
    dark = tmp_path / "dark.glb"
    dark.write_bytes(glb.bytes())
    assert "has no lights" in prelight("rig", "lamps", dark).err
    glb.node(extensions={"KHR_lights_punctual": {"light": 3}})
    dark.write_bytes(glb.bytes())
    assert "there is no light 3" in prelight("rig", "lamps", dark).err
    assert "expected a .glb or .gltf" in prelight("rig", "lamps", tmp_path / "x.obj").err
    scene = file_of(tmp_path, POINT)
    (tmp_path / "rig.toml").write_text("mine")
    assert prelight("rig", "lamps", scene, "-o", tmp_path / "rig.toml").code != 0
    assert (tmp_path / "rig.toml").read_text() == "mine"

"""Materials: what leaves light alike in all directions, and what a stranger's bake may not name."""

from __future__ import annotations

import pytest

from prelight.errors import InputError
from prelight.material import Material, check_bsdf
from prelight.scene.geometry import Scene

from .scenes import plane

GLOSS = {
    "type": "roughplastic",
    "alpha": 0.1,
    "diffuse_reflectance": {"type": "rgb", "value": [0.4, 0.2, 0.1]},
}


@pytest.mark.parametrize(
    ("material", "lambertian"),
    [
        (Material(), True),
        (Material(emission=(1.0, 1.0, 1.0)), True),
        (Material(specular=0.5), False),
        (Material(metallic=1.0), False),
        (Material(transmission=0.3), False),
        (Material(clearcoat=1.0), False),
        (Material(bsdf={"type": "diffuse"}), True),
        (Material(bsdf={"type": "twosided", "inner": {"type": "diffuse"}}), True),
        (Material(bsdf={"type": "twosided", "inner": GLOSS}), False),
        (Material(bsdf=GLOSS, specular=0.0), False),
    ],
)
def test_lambertian(material, lambertian):
    assert material.is_lambertian is lambertian


def test_round_trip():
    texture = {"type": "stored_texture", "index": 1, "raw": True}
    material = Material(
        "pot",
        (0.1, 0.2, 0.3),
        0,
        roughness=0.4,
        bsdf={"type": "twosided", "inner": {**GLOSS, "alpha": texture}},
    )
    assert Material.from_dict(material.to_dict(), textures=2) == material
    assert sorted(material.textures) == [0, 1]
    with pytest.raises(InputError, match="texture 1 of 1"):
        Material.from_dict(material.to_dict(), textures=1)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"colour": [0.1, 0.2]}, "colour"),
        ({"colour": [0.1, 0.2, float("nan")]}, "colour"),
        ({"colour": [0.1, 0.2, 1.5]}, "colour"),
        ({"roughness": -0.1}, "roughness"),
        ({"ior": True}, "ior"),
        ({"emission": "white"}, "emission"),
        ({"colour_texture": 1.0}, "texture"),
        ({"colour_texture": -1}, "texture"),
        ({"name": 3}, "name"),
        ({"shine": 1.0}, "unknown fields shine"),
        ({"bsdf": {"type": "../../evil"}}, "not one of"),
        ({"bsdf": {"type": "bitmap", "filename": "/etc/passwd"}}, "not one of"),
        ({"bsdf": {"type": "diffuse", "filename": "x"}}, "filename"),
        ({"bsdf": {"type": "diffuse", "reflectance": object()}}, "reflectance"),
        (
            {"bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.1, float("inf"), 0]}}},
            "value",
        ),
        ({"bsdf": {"type": "diffuse", "values": [0.0] * 5000}}, "4096"),
    ],
)
def test_refused(changed, words):
    with pytest.raises(InputError, match=words):
        Material.from_dict({**Material().to_dict(), **changed}, textures=1)


def test_depth():
    bsdf = dict(GLOSS)
    for _ in range(10):
        bsdf = {"type": "twosided", "inner": bsdf}
    with pytest.raises(InputError, match="deep"):
        check_bsdf(bsdf)


def test_material_of_vertex():
    scene = plane(3)
    material_of = scene.material_of.copy()
    material_of[0] = 1
    two = Scene(
        "two", scene.positions, scene.normals, scene.triangles, scene.albedo,
        materials=(Material("a"), Material("b")), material_of=material_of,
    )  # fmt: skip
    expected = [0] * len(scene.positions)
    for k in scene.triangles[0]:
        expected[k] = 1
    assert two.material_of_vertex.tolist() == expected
    assert two.digest != scene.digest

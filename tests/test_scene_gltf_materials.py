"""What surfaces of a glTF file are made of: colours, metal, glass and lacquer."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.material import Material
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene

from .gltf_builder import (
    Glb,
    load_bytes,
    textured,
)


@pytest.fixture
def load(tmp_path: Path) -> Callable[[bytes], Scene]:
    return partial(load_bytes, tmp_path)


def material_of(load, **fields) -> tuple[Material, tuple[str, ...]]:
    glb = Glb()
    glb.node(glb.primitive(material=glb.material(**fields)))
    scene = load(glb.bytes())
    return scene.materials[0], scene.notes


def extension(name: str, **fields) -> dict:
    return {"extensions": {f"KHR_materials_{name}": fields}}


def test_base_colours_are_linear_and_exact(load) -> None:
    """0.123456 is no multiple of 1/255; vertex colours multiply it; a missing material is white."""
    glb = Glb()
    pbr = {"baseColorFactor": [0.123456, 1, 0.5, 0.25], "metallicFactor": 0}
    matt = glb.material(name="matt", pbrMetallicRoughness=pbr)
    floats = glb.accessor(np.array([(1, 1, 1), (0.5, 0, 1), (2, 1, 1)], "f4"))
    shorts = glb.accessor(np.array([(65535, 0, 0, 0)] * 3, "u2"), normalized=True)
    bytes_ = glb.accessor(np.array([(255, 51, 0, 9)] * 3, "u1"), normalized=True)
    glb.node(
        glb.primitive(material=matt),
        glb.primitive(material=matt, COLOR_0=floats),
        glb.primitive(COLOR_0=shorts),
        glb.primitive(COLOR_0=bytes_),
        glb.primitive(),
    )
    scene = load(glb.bytes())
    a = 0.123456
    expected = [(a, 1, 0.5)] * 3 + [(a, 1, 0.5), (a / 2, 0, 0.5), (2 * a, 1, 0.5)]
    expected += [(1, 0, 0)] * 3 + [(1, 0.2, 0)] * 3 + [(1, 1, 1)] * 3
    np.testing.assert_array_equal(scene.albedo, np.array(expected, np.float32))
    np.testing.assert_array_equal(scene.material_of, [0, 0, 1, 1, 1])
    assert [m.name for m in scene.materials] == ["matt", "default"]
    assert scene.uv is None
    assert scene.tint is None


def test_the_default_material_is_metal(load) -> None:
    """glTF's defaults: white, metallic 1, roughness 1; without an eye it is matte, and that is said."""
    glb = Glb()
    glb.node(glb.primitive(), glb.primitive(material=glb.material(name="plain")))
    scene = load(glb.bytes())
    assert [(m.name, m.metallic, m.roughness) for m in scene.materials] == [
        ("default", 1, 1),
        ("plain", 1, 1),
    ]
    assert scene.notes == ("metal is matte of its colour in a bake without an eye (materials: 2)",)


def test_equal_materials_are_kept_once_and_unused_ones_not(load) -> None:
    glb = Glb()
    same = {"name": "a", "pbrMetallicRoughness": {"metallicFactor": 0}}
    glb.material(name="unused", normalTexture={"index": 7})
    first, second = glb.material(**same), glb.material(**same)
    third = glb.material(name="b", pbrMetallicRoughness={"metallicFactor": 0})
    glb.node(*(glb.primitive(material=k) for k in (third, first, second, first)))
    scene = load(glb.bytes())
    assert [m.name for m in scene.materials] == ["b", "a"]
    np.testing.assert_array_equal(scene.material_of, [0, 1, 1, 1])
    assert scene.notes == ()


def test_metal_roughness_glass_and_lacquer(load) -> None:
    pbr = {"metallicFactor": 0.25, "roughnessFactor": 0.75, "baseColorFactor": [0.1, 0.2, 0.3, 1]}
    material, _ = material_of(load, name="x", pbrMetallicRoughness=pbr)
    assert material == Material("x", (0.1, 0.2, 0.3), roughness=0.75, metallic=0.25, specular=1.0)
    matt = {"pbrMetallicRoughness": {"metallicFactor": 0}}
    for given, expected in (
        (extension("ior", ior=1.33), {"ior": 1.33}),
        (extension("ior", ior=0), {"ior": 3.0}),
        (extension("transmission", transmissionFactor=0.75), {"transmission": 0.75}),
        (extension("clearcoat", clearcoatFactor=1, clearcoatRoughnessFactor=0.1),
         {"clearcoat": 1.0, "clearcoat_roughness": 0.1}),
        (extension("specular", specularFactor=0.5), {"specular": 0.5}),
        (extension("specular", specularFactor=0.5, specularColorFactor=[0.5] * 3), {"specular": 0.25}),
        (extension("emissive_strength", emissiveStrength=5) | {"emissiveFactor": [1, 0.5, 0]},
         {"emission": (5, 2.5, 0)}),
        (extension("unlit"), {"specular": 0.0, "roughness": 1.0}),
    ):  # fmt: skip
        material, notes = material_of(load, **matt, **given)
        for name, value in expected.items():
            assert getattr(material, name) == pytest.approx(value), (given, name)
        assert material.is_lambertian == ("specular" in expected and expected["specular"] == 0)
        assert notes == (
            () if "unlit" not in str(given) else ("unlit surfaces lit as matte ones (materials: 1)",)
        )


def specular_glossiness(load, **fields) -> Material:
    return material_of(load, **extension("pbrSpecularGlossiness", **fields))[0]


def test_specular_glossiness_is_converted(load) -> None:
    """Known answers: a plastic keeps its diffuse colour, a metal takes its specular one."""
    plastic = specular_glossiness(
        load, diffuseFactor=[0.6, 0.3, 0.1, 1], specularFactor=[0.04] * 3, glossinessFactor=0.25
    )
    assert plastic.colour == pytest.approx((0.6, 0.3, 0.1), abs=1e-6)
    assert (plastic.metallic, plastic.roughness) == pytest.approx((0, 0.75), abs=1e-6)
    gold = specular_glossiness(load, diffuseFactor=[0, 0, 0, 1], specularFactor=[1, 0.77, 0.34])
    assert gold.colour == pytest.approx((1, 0.77, 0.34), abs=1e-6)
    assert (gold.metallic, gold.roughness) == pytest.approx((1, 0))
    chalk = specular_glossiness(load, diffuseFactor=[0.9, 0.8, 0.7, 1], specularFactor=[0, 0, 0])
    assert chalk.colour == pytest.approx((0.9, 0.8, 0.7))
    assert chalk.is_lambertian


def test_a_mixture_of_diffuse_and_specular_keeps_both(load) -> None:
    """Metallic m and colour c reflect 0.04 (1-m) + c m, and scatter c 0.96 (1-m): the greys put in."""
    for diffuse, specular in ((0.5, 0.2), (0.2, 0.5), (0.8, 0.05)):
        m = specular_glossiness(load, diffuseFactor=[diffuse] * 3 + [1], specularFactor=[specular] * 3)
        c = m.colour[0]
        assert 0.04 * (1 - m.metallic) + c * m.metallic == pytest.approx(specular, abs=0.02)
        assert c * 0.96 * (1 - m.metallic) == pytest.approx(diffuse * (1 - specular), abs=0.02)


def test_a_specular_texture_is_not_taken_for_metal(load) -> None:
    """Its factor is mostly 1, which alone would make everything a mirror."""
    glb = textured()
    fields = {"diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 0}}
    glb.json["materials"] = [extension("pbrSpecularGlossiness", **fields)]
    scene = load(glb.bytes())
    np.testing.assert_allclose(scene.albedo, np.eye(3), atol=1e-6)
    assert scene.materials[0].metallic == 0
    assert scene.notes == ("textures not used: specular-glossiness 1",)


def test_factors_out_of_range_are_clipped_and_said(load) -> None:
    pbr = {"baseColorFactor": [1.5, 1.000001, -1, 1], "metallicFactor": -1, "roughnessFactor": 2}
    material, notes = material_of(load, pbrMetallicRoughness=pbr)
    assert material.colour == (1, 1, 0)
    assert (material.metallic, material.roughness) == (0, 1)
    assert notes == ("factors out of range clipped (materials: 1)",)


def test_what_is_not_read_is_said_once_a_kind(load) -> None:
    glb = textured()
    info = {"index": 0}
    for k in range(12):
        glb.node(glb.primitive(material=glb.material(
            name=f"a\x1b{k}", alphaMode="MASK" if k % 2 else "BLEND", normalTexture=info, occlusionTexture=info,
            pbrMetallicRoughness={"baseColorTexture": info},
            **extension("clearcoat", clearcoatFactor=1, clearcoatNormalTexture=info),
        ), TEXCOORD_0=0))  # fmt: skip
    glb.json["extensionsUsed"] = [
        "KHR_materials_sheen",
        "KHR_materials_clearcoat",
        *(f"X_{k}\x1b" for k in range(9)),
    ]
    glb.json["extensionsRequired"] = ["KHR_materials_sheen"]
    glb.json["nodes"][0]["skin"] = 0
    glb.json["meshes"][0]["primitives"] += [glb.primitive(mode=1)]
    glb.json["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 0}]
    scene = load(glb.bytes())
    assert scene.materials[1].name == "a\\x1b0"
    assert scene.notes == (
        "metal is matte of its colour in a bake without an eye (materials: 12)",
        "transparency not read, surfaces are opaque (materials: 12)",
        "textures not used: normal 12, occlusion 12, clearcoat 12",
        "extensions not read: KHR_materials_sheen, "
        + ", ".join(f"X_{k}\\x1b" for k in range(7))
        + " and 2 more",
        "skins not applied: the mesh stands as it was modelled",
        "morph targets not applied: the mesh stands as it was modelled",
        "primitives of points or lines not read: 1",
    )


def test_known_models(data: Path) -> None:
    """Colours of public models, as anyone sees them in a viewer."""
    truck = data / "gltf" / "CesiumMilkTruck" / "CesiumMilkTruck.gltf"
    scene = load_scene(truck)
    assert (len(scene.positions), len(scene.triangles)) == (3_564, 3_624)
    assert [m.name for m in scene.materials] == ["truck", "glass", "window_trim", "wheels"]
    of = scene.material_of_vertex
    top = scene.albedo[(of == 0) & (scene.positions[:, 1] > 2)]
    assert np.median(top) > 0.5 > 0.1 > np.median(scene.albedo[of == 3])  # white lacquer, tyres
    np.testing.assert_allclose(scene.albedo[of == 1][0], (0, 0.0405063, 0.0212407), rtol=1e-5)
    assert scene.notes == ("animations not applied: 1",)
    assert len(scene.textures) == 1
    with pytest.raises(InputError, match=r"KHR_draco_mesh_compression.*export without mesh compression"):
        load_scene(data / "cars" / "sedan.gltf")

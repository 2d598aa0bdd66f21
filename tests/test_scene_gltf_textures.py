"""Textures of a glTF file: where they are looked up, and what is done where they cannot be read."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from prelight.errors import InputError
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene
from prelight.scene.mesh import linear_from_srgb

from .gltf_builder import (
    BLUE,
    GREEN,
    GREY,
    MIDDLES,
    QUARTERS,
    RED,
    TRIANGLE,
    data_uri,
    load_bytes,
    png,
    textured,
)


@pytest.fixture
def load(tmp_path: Path) -> Callable[[bytes], Scene]:
    return partial(load_bytes, tmp_path)


def test_a_texture_multiplies_the_factor_and_the_vertex_colour(load) -> None:
    glb = textured(baseColorFactor=[0.5, 1, 1, 1])
    colours = glb.accessor(np.array([(1, 1, 1), (1, 0.25, 1), (1, 1, 0.75)], "f4"))
    glb.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = colours
    scene = load(glb.bytes())
    np.testing.assert_allclose(scene.albedo, [(0.5, 0, 0), (0, 0.25, 0), (0, 0, 0.75)], atol=1e-6)
    np.testing.assert_allclose(scene.tint, [(0.5, 1, 1), (0.5, 0.25, 1), (0.5, 1, 0.75)])
    np.testing.assert_array_equal(scene.uv, MIDDLES)
    np.testing.assert_array_equal(scene.textures[0], QUARTERS)
    assert scene.materials[0].colour_texture == 0
    grey = load(textured(uv=[(0.75, 0.75)] * 3).bytes())
    np.testing.assert_allclose(grey.albedo[0], linear_from_srgb(np.array(GREY) / 255), rtol=1e-6)
    assert scene.notes == grey.notes == ()


@pytest.mark.parametrize(
    ("transform", "uv"),
    [
        ({"offset": [0.5, 0]}, [(0.75, 0.25), (1.25, 0.25), (0.75, 0.75)]),
        ({"scale": [1, -1], "offset": [0, 1]}, [(0.25, 0.75), (0.75, 0.75), (0.25, 0.25)]),
        # The extension's example: the lower left quarter of the picture, turned.
        (
            {"offset": [0, 1], "rotation": math.pi / 2, "scale": [0.5, 0.5]},
            [(0.125, 0.875), (0.125, 0.625), (0.375, 0.875)],
        ),
        ({"rotation": math.pi / 2, "scale": [2, 1]}, [(0.25, -0.5), (0.25, -1.5), (0.75, -0.5)]),
    ],
)
def test_texture_transforms(load, transform: dict, uv: list) -> None:
    info = {"extensions": {"KHR_texture_transform": transform}}
    scene = load(textured(info).bytes())
    np.testing.assert_allclose(scene.uv, uv, atol=1e-6)


def test_any_set_of_coordinates_can_be_the_one(load) -> None:
    for info, chosen in (
        ({"texCoord": 1}, "TEXCOORD_1"),
        ({"texCoord": 1, "extensions": {"KHR_texture_transform": {"texCoord": 2}}}, "TEXCOORD_2"),
    ):
        glb = textured(info)
        attributes = glb.json["meshes"][0]["primitives"][0]["attributes"]
        attributes[chosen] = glb.accessor((MIDDLES[::-1] * 65535).round().astype("u2"), normalized=True)
        scene = load(glb.bytes())
        np.testing.assert_allclose(scene.uv, MIDDLES[::-1], atol=1e-5)
        del attributes[chosen]
        bare = load(glb.bytes())
        np.testing.assert_array_equal(bare.albedo, np.ones((3, 3)))
        assert bare.uv is None or not bare.uv.any()
        assert bare.materials[0].colour_texture is None
        assert "primitives without the coordinates of their texture drawn without it: 1" in bare.notes


def test_clamped_and_mirrored_textures(load) -> None:
    """Beyond its edge a clamped picture goes on as its edge, a mirrored one backwards."""
    beyond = [(1.75, 0.25), (-0.75, 0.25), (0.25, 1.25)]
    for wrap, colours in (
        (33071, (GREEN, RED, BLUE)),
        (33648, (RED, GREEN, BLUE)),
        (10497, (GREEN, RED, RED)),
    ):
        scene = load(textured(uv=np.array(beyond), sampler={"wrapS": wrap, "wrapT": wrap}).bytes())
        np.testing.assert_allclose(scene.albedo, np.array(colours) / 255, atol=1e-6)
        said = "primitives beyond the edge of a clamped or mirrored texture: 1; folded at vertices"
        assert (said in scene.notes) == (wrap != 10497)
    # At the very edge nothing of the other side is mixed in.
    edge = [(0, 0.25), (1, 0.25), (0.25, 1)]
    scene = load(textured(uv=np.array(edge), sampler={"wrapS": 33071, "wrapT": 33071}).bytes())
    np.testing.assert_allclose(scene.albedo, np.array([RED, GREEN, BLUE]) / 255, atol=1e-6)
    assert scene.notes == ()
    nearest = load(textured(sampler={"magFilter": 9728}).bytes())
    assert nearest.notes == ("textures without filtering looked up with it: 1",)


def test_an_image_is_read_once_whoever_names_it(load, monkeypatch: pytest.MonkeyPatch) -> None:
    import prelight.scene.gltf.textures as textures

    read = []

    def counted(data: bytes, *, name: str):
        read.append(name)
        return original(data, name=name)

    original = textures.read_texture
    monkeypatch.setattr(textures, "read_texture", counted)
    glb = textured()
    glb.json["textures"].append({"source": 0})
    pbr = {"baseColorTexture": {"index": 1}, "metallicRoughnessTexture": {"index": 0}}
    glow = {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 1}}
    glb.node(glb.primitive(material=glb.material(name="b", pbrMetallicRoughness=pbr, **glow), TEXCOORD_0=0))
    glb.material(pbrMetallicRoughness=pbr)
    scene = load(glb.bytes())
    assert read == ["image 0"]
    second = scene.materials[1]
    assert (second.colour_texture, second.roughness_texture, second.emission_texture) == (0, 0, 0)


def test_images_in_files_and_in_the_json(tmp_path: Path) -> None:
    glb = textured()
    path = tmp_path / "scene.gltf"
    (tmp_path / "a b.png").write_bytes(png(QUARTERS))
    Image.fromarray(QUARTERS).resize((64, 64), Image.Resampling.NEAREST).save(tmp_path / "c.jpg", quality=95)
    for uri, tolerance in (
        ("a%20b.png", 1e-6),
        (data_uri(png(QUARTERS), "image/png"), 1e-6),
        ("c.jpg", 0.03),
    ):
        glb.json["images"] = [{"uri": uri}]
        for content in (glb.text(), glb.bytes()):
            path.write_bytes(content)
            scene = load_scene(path if content[:1] == b"{" else path.rename(path.with_suffix(".glb")))
            np.testing.assert_allclose(scene.albedo, np.eye(3), atol=tolerance)
            assert scene.notes == ()


def test_images_that_cannot_be_read_leave_the_factor(load, tmp_path: Path) -> None:
    (tmp_path / "broken.png").write_bytes(png(QUARTERS)[:40])
    (tmp_path / "picture.ktx2").write_bytes(b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(100))
    for image, reason in (
        ({"uri": "absent.png"}, "'absent.png': no such file"),
        ({"uri": "http://localhost/a.png"}, "no address or full path"),
        ({"uri": "../../a.png"}, "leads out of the folder"),
        ({"uri": "broken.png"}, "broken.png: truncated picture"),
        ({"uri": "picture.ktx2"}, "picture.ktx2: neither PNG nor JPEG"),
        ({"uri": "data:image/png;base64,AAAA"}, "image 0: neither PNG nor JPEG"),
        ({"uri": "data:image/png,AAAA"}, "not in base64"),
        ({"bufferView": 99}, "no file and no bufferView"),
        ({}, "no file and no bufferView"),
    ):
        glb = textured(baseColorFactor=[0.5, 0.25, 0.125, 1])
        glb.json["images"] = [image]
        glb.json["materials"][0] |= {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}
        scene = load(glb.text())
        np.testing.assert_array_equal(scene.albedo, [(0.5, 0.25, 0.125)] * 3)
        assert scene.textures == ()
        assert scene.uv is None
        assert scene.materials[0].emission == (0, 0, 0)  # rather no light than light all over
        (note,) = scene.notes
        assert note.startswith("image not read, factors used instead: ")
        assert reason in note
        assert "more" not in note.rpartition(":")[2]


def test_textures_of_other_kinds_are_said_in_one_line(load) -> None:
    glb = textured()
    glb.json["textures"].append({"extensions": {"KHR_texture_basisu": {"source": 0}}})
    for k in range(3):
        glb.node(glb.primitive(material=glb.material(name=str(k), pbrMetallicRoughness={
            "metallicFactor": 0, "baseColorTexture": {"index": 1}})))  # fmt: skip
    assert (
        "image not read, factors used instead: texture 1 is neither PNG nor JPEG" in load(glb.bytes()).notes
    )


def test_textures_with_coordinates_of_their_own(load) -> None:
    """A vertex has one pair of coordinates: the colour's, and whatever else lies on it."""
    glb = textured(metallicRoughnessTexture={"index": 0}, roughnessFactor=0.5)
    moved = {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0]}}}
    glb.json["materials"][0] |= {"emissiveFactor": [1, 1, 1], "emissiveTexture": moved}
    scene = load(glb.bytes())
    (material,) = scene.materials
    assert (material.colour_texture, material.roughness_texture, material.emission_texture) == (0, 0, None)
    assert material.emission == (0, 0, 0)
    assert scene.notes == ("textures not used: emission with coordinates of its own 1",)


def test_a_broken_reference_is_damage(load) -> None:
    for change, where in (
        (
            lambda g: g["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"].update(index=5),
            "/textures",
        ),
        (lambda g: g["textures"][0].update(source=5), "/images"),
        (lambda g: g["textures"][0].update(sampler=5), "/samplers"),
        (
            lambda g: g["meshes"][0]["primitives"][0]["attributes"].update(TEXCOORD_0=1),
            "it is VEC3, expected VEC2",
        ),
    ):
        glb = textured()
        change(glb.json)
        with pytest.raises(InputError, match=re.escape(where)):
            load(glb.bytes())


def test_textures_together_have_a_limit(load, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("prelight.scene.gltf.textures._MOST_TEXELS", 4)
    glb = textured()
    second = glb.texture(QUARTERS)
    pbr = {"metallicFactor": 0, "baseColorTexture": {"index": second}, "baseColorFactor": [0, 1, 0, 1]}
    glb.node(glb.primitive(material=glb.material(pbrMetallicRoughness=pbr), TEXCOORD_0=0))
    scene = load(glb.bytes())
    assert len(scene.textures) == 1
    np.testing.assert_array_equal(scene.albedo[3:], [(0, 1, 0)] * 3)


def test_damaged_pictures_are_not_tried_without_end(load, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand of them, each costly to fail on, must not hang; one of them a thousand times is tried once."""
    import prelight.scene.gltf.textures as textures

    tried = []

    def damaged(data: bytes, *, name: str) -> None:
        tried.append(name)
        raise InputError(name, "damaged")

    monkeypatch.setattr(textures, "read_texture", damaged)
    for views in (1, 1000):
        tried.clear()
        glb = textured()
        view = glb.json["bufferViews"][glb.json["images"][0]["bufferView"]]
        first = len(glb.json["bufferViews"])
        glb.json["bufferViews"] += [view] * views
        glb.json["images"] = [{"bufferView": first + k % views} for k in range(1000)]
        glb.json["textures"] = [{"source": k} for k in range(1000)]
        colours = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": k}}} for k in range(1000)]
        glb.json["materials"] = colours
        part = glb.json["meshes"][0]["primitives"][0]
        glb.json["meshes"][0]["primitives"] = [part | {"material": k} for k in range(1000)]
        notes = load(glb.bytes()).notes
        assert len(tried) == min(views, 16)
        assert sum("image not read" in note for note in notes) == 1


def test_mutations_of_a_textured_file_end_in_a_scene_or_a_refusal(load, rng) -> None:
    text = textured(metallicRoughnessTexture={"index": 0}, sampler={"wrapS": 33071}).text()
    whole = json.loads(text)
    for k in range(300):
        mutated = bytearray(text)
        for _ in range(rng.integers(1, 4)):
            mutated[rng.integers(len(mutated))] = rng.integers(32, 127)
        try:
            scene = load(bytes(mutated))
        except InputError:
            continue
        assert np.isfinite(scene.albedo).all(), k
        assert scene.uv is None or np.isfinite(scene.uv).all()
    assert whole["asset"]
    np.testing.assert_array_equal(load(text).positions, TRIANGLE)

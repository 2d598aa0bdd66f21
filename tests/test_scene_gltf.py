"""Containers, numbers and files of glTF, whole and damaged, from a small builder."""

from __future__ import annotations

import json
import re
import struct
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene

from .gltf_builder import (
    TRIANGLE,
    Glb,
    container,
    data_uri,
    load_bytes,
    refused,
    valid,
)


@pytest.fixture
def load(tmp_path: Path) -> Callable[[bytes], Scene]:
    return partial(load_bytes, tmp_path)


def with_changes(*path: str | int, value: object) -> bytes:
    glb = valid()
    place = glb.json
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return glb.bytes()


PRIMITIVE = ("meshes", 0, "primitives", 0)
WHOLE = valid().bytes()


@pytest.mark.parametrize("kind", ["u1", "u2", "u4", None])
def test_indices_of_every_type_and_none(load, kind: str | None) -> None:
    glb = Glb()
    corners = np.array([2, 1, 0, 3, 4, 5] if kind else range(6))
    more = {"indices": glb.accessor(corners.astype(kind))} if kind else {}
    glb.node(glb.primitive(np.concatenate([TRIANGLE, TRIANGLE + 5]), **more))
    np.testing.assert_array_equal(load(glb.bytes()).triangles.ravel(), corners)


def test_strips_and_fans(load) -> None:
    quad = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], "f4")
    strip, fan = Glb(), Glb()
    strip.node(strip.primitive(quad, mode=5))
    fan.node(fan.primitive(quad[[0, 1, 3, 2]], mode=6))
    np.testing.assert_array_equal(load(strip.bytes()).triangles, [(0, 1, 2), (2, 1, 3)])
    np.testing.assert_array_equal(load(fan.bytes()).triangles, [(0, 1, 2), (0, 2, 3)])
    for glb in (strip, fan):
        np.testing.assert_allclose(load(glb.bytes()).normals, [(0, 0, 1)] * 4)


def test_strides_offsets_and_quantized_positions(load) -> None:
    """Interleaved attributes, an accessor's own offset, and 16-bit positions (KHR_mesh_quantization)."""
    glb = Glb()
    table = np.zeros(3, np.dtype([("pad", "f4"), ("p", "f4", 3), ("n", "f4", 3)]))
    table["p"], table["n"] = TRIANGLE, (0, 0, 2)
    position = glb.accessor(table.view("u1"))
    glb.json["bufferViews"][0]["byteStride"] = 28
    common = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}
    glb.json["accessors"] = [{**common, "byteOffset": 4}, {**common, "byteOffset": 16}]
    glb.node({"attributes": {"POSITION": position, "NORMAL": 1}})
    quantized = np.array([(0, 0, 0, 0), (32767, 0, 0, 0), (0, -32768, 0, 0)], "i2")
    view = glb.accessor(quantized)
    glb.json["accessors"][view] |= {"type": "VEC3", "normalized": True}
    glb.json["bufferViews"][1]["byteStride"] = 8
    glb.node({"attributes": {"POSITION": view}})
    glb.json["extensionsRequired"] = ["KHR_mesh_quantization"]
    scene = load(glb.bytes())
    np.testing.assert_array_equal(scene.positions, [*TRIANGLE, (0, 0, 0), (1, 0, 0), (0, -1, 0)])
    np.testing.assert_array_equal(scene.normals[:3], [(0, 0, 1)] * 3)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (WHOLE[:10], "10 bytes"),
        (WHOLE[:-4], "declares"),
        (WHOLE[:4] + struct.pack("<I", 1) + WHOLE[8:], "version 1, expected 2"),
        (WHOLE[:8] + struct.pack("<I", 2**32 - 1) + WHOLE[12:], "declares 4,294,967,295"),
        (WHOLE[:12] + struct.pack("<I", 2**32 - 4) + WHOLE[16:], "chunk 0"),
        (WHOLE[:12] + struct.pack("<I", 5) + WHOLE[16:], "multiple of 4"),
        (container(b""), "its JSON is empty"),
        (container(b"    "), "its JSON is empty"),
        (container(b"{}", b"abcd").replace(b"JSON", b"JSOM"), "one JSON chunk"),
        (container(b"{}", b"abcd").replace(b"BIN\0", b"JSON"), "one JSON chunk"),
        (container(b"not JSON"), "Invalid JSON"),
        (container(b'{"asset":{"version":"2.0"},"scene":NaN}'), "/scene"),
        (container(b'{"asset":{"version":"2.0"},"nodes":[{"translation":[1e999,0,0]}]}'), "/nodes/0/translation"),
        (container(b'{"asset":{"version":"2.0"},"x":' + b"[" * 65 + b"]" * 65 + b"}"), "deeper than 64"),
        (container(b"[" * 200_000), "deeper than 64"),
        (container(b"[" + b"[]," * 1_000_001 + b"[]]"), "more than 1,000,000 values"),
        (container(b'["' + b'\\"' * 2_000_001), "more than 1,000,000 strings"),
        (container(b'{"asset":{"version":"2.0"},"scene":' + b"9" * 5000 + b"}"), "JSON"),
        (container(b'{"asset":{"version":"1.0"}}'), "glTF version '1.0'"),
        (with_changes("extensionsRequired", value=["KHR_draco_mesh_compression"]), "needs the extension KHR_draco"),
        (with_changes("extensionsRequired", value=["EXT_meshopt_compression"]), "without -c and -cc"),
        (with_changes("extensionsRequired", value=["EXT_unheard_of"]), "export without it"),
        (with_changes("buffers", 0, "uri", value="http://localhost/x.bin"), "no address or full path"),
        (with_changes("buffers", 0, "uri", value="../x.bin"), "leads out of the folder"),
        (with_changes("buffers", 0, "uri", value="%2e%2e/x.bin"), "leads out of the folder"),
        (with_changes("buffers", 0, "uri", value="/etc/hostname"), "no address or full path"),
        (with_changes("buffers", 0, "uri", value="absent.bin"), "no such file"),
        (with_changes("buffers", 0, "uri", value="data:,abc"), "not in base64 (/buffers/0)"),
        (with_changes("buffers", 0, "uri", value="data:;base64,abc"), "base64 is cut short"),
        (with_changes("buffers", 0, "uri", value="data:;base64,AA*AA"), "base64 is cut short or broken"),
        (with_changes("buffers", 0, "uri", value="data:;base64,AAAA"), "bytes, its data 3 (/buffers/0)"),
        (with_changes("buffers", 0, "byteLength", value=1000), "the buffer has 1,000 bytes"),
        (with_changes("bufferViews", 0, "buffer", value=1), "/bufferViews/0"),
        (with_changes("bufferViews", 0, "byteLength", value=2**31 - 1), "ends outside its buffer (/bufferViews/0)"),
        (with_changes("bufferViews", 0, "byteStride", value=3), "/bufferViews/0/byteStride"),
        (with_changes("bufferViews", 0, "byteStride", value=8), "entries of 12 bytes, the next after 8 (/accessors/0)"),
        (with_changes("accessors", 0, "count", value=2**31 - 1), "ends outside its bufferView (/accessors/0)"),
        (with_changes("accessors", 0, "count", value=-1), "/accessors/0/count"),
        (with_changes("accessors", 0, "count", value=3.5), "/accessors/0/count"),
        (with_changes("accessors", 0, "count", value=True), "/accessors/0/count"),
        (with_changes("accessors", 0, "byteOffset", value=4), "ends outside its bufferView (/accessors/0)"),
        (with_changes("accessors", 0, "bufferView", value=9), "no bufferView 9"),
        (with_changes("accessors", 0, "componentType", value=5130), "/accessors/0/componentType"),
        (with_changes("accessors", 0, "type", value="VEC2"), "it is VEC2, expected VEC3"),
        (with_changes("accessors", 0, "sparse", value={"count": 1}), "/accessors/0/sparse/indices"),
        (with_changes("nodes", 0, "camera", value=0), "no camera 0"),
        (with_changes("accessors", 1, "componentType", value=5122), "indices must be unsigned"),
        (with_changes("accessors", 1, "count", value=2), "whole triangles"),
        (with_changes(*PRIMITIVE, "indices", value=9), "no accessor 9"),
        (with_changes(*PRIMITIVE, "material", value=0), "no material 0"),
        (with_changes(*PRIMITIVE, "attributes", "NORMAL", value=9), "no accessor 9"),
        (with_changes(*PRIMITIVE, "mode", value=7), "/meshes/0/primitives/0/mode"),
        (with_changes(*PRIMITIVE, "mode", value=0), "no triangles"),
        (with_changes("meshes", 0, "primitives", value=[]), "/meshes/0/primitives"),
        (with_changes("nodes", 0, "mesh", value=1), "no mesh 1"),
        (with_changes("nodes", 0, "children", value=[0]), "own ancestor"),
        (with_changes("nodes", 0, "children", value=[1]), "no node 1"),
        (with_changes("nodes", value=[{"children": [1]}, {"children": [0]}, {"mesh": 0}]), "own ancestor"),
        (with_changes("nodes", value=[{"children": [2]}, {"children": [2]}, {"mesh": 0}]), "two parents"),
        (with_changes("scenes", 0, "nodes", value=[0, 0]), "twice"),
        (with_changes("scenes", 0, "nodes", value=[7]), "no root"),
        (with_changes("scenes", 0, "nodes", value=[]), "no triangles"),
        (with_changes("scene", value=3), "no scene 3"),
        (with_changes("nodes", 0, "rotation", value=[0, 0, 0, 0]), "unit quaternion"),
        (with_changes("nodes", 0, "matrix", value=[0] * 16), "not affine"),
        (with_changes("nodes", 0, "scale", value=[1e300, 1, 1]), "vertex 1 is at"),
        (with_changes("nodes", 0, "scale", value=[0, 0, 1]), "zero area"),
        (with_changes("nodes", value=[{"mesh": 0}] * 100_001), "at most 100000 items"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)  # fmt: skip
def test_damage_is_refused_in_one_line(load, content: bytes, reason: str) -> None:
    assert reason in refused(load, content)


def test_indices_out_of_range_and_positions_without_data(load) -> None:
    glb = Glb()
    glb.node(glb.primitive(TRIANGLE, indices=glb.accessor(np.array([0, 1, 3], "u1"))))
    assert "index 3 into 3 vertices" in refused(load, glb.bytes())
    glb = valid()
    del glb.json["accessors"][0]["bufferView"]
    glb.json["accessors"][0]["count"] = 2**31 - 1
    assert "no data" in refused(load, glb.bytes())
    glb.json["meshes"][0]["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0}}
    assert "Draco" in refused(load, glb.bytes())
    glb = Glb()
    glb.node(glb.primitive(TRIANGLE, COLOR_0=glb.accessor(np.ones((4, 3), "f4"))))
    assert "COLOR_0 has 4 entries, POSITION 3" in refused(load, glb.bytes())


def test_bytes_after_the_container_and_unknown_chunks_are_passed_over(load) -> None:
    whole = WHOLE + struct.pack("<I4s", 4, b"MORE") + b"abcd"
    length = struct.pack("<I", len(whole))
    for content in (WHOLE + b"trailing", whole[:8] + length + whole[12:]):
        np.testing.assert_array_equal(load(content).positions, TRIANGLE)


def sparse_document(base: bool) -> Glb:
    """Three of five positions replaced; the others are those of a bufferView, or zero."""
    glb = Glb()
    far = np.array([(9, 9, 9)] * 5, "f4")
    positions = glb.accessor(far)
    rows = glb.accessor(np.array([1, 3, 4], "u1"))
    values = glb.accessor(TRIANGLE)
    view = [glb.json["accessors"][k]["bufferView"] for k in (positions, rows, values)]
    if not base:
        del glb.json["accessors"][positions]["bufferView"]
    glb.json["accessors"][positions]["sparse"] = {
        "count": 3,
        "indices": {"bufferView": view[1], "componentType": 5121},
        "values": {"bufferView": view[2]},
    }
    part = {"attributes": {"POSITION": positions}, "indices": glb.accessor(np.array([1, 3, 4], "u2"))}
    glb.node(part)
    return glb


@pytest.mark.parametrize("base", [True, False])
def test_sparse_accessors(load, base: bool) -> None:
    scene = load(sparse_document(base).bytes())
    rest = np.full(3, 9 if base else 0)
    np.testing.assert_array_equal(scene.positions, [rest, TRIANGLE[0], rest, TRIANGLE[1], TRIANGLE[2]])


def test_sparse_accessors_that_lie(load) -> None:
    for change, reason in (
        ({"count": 6}, "6 entries replaced of 5"),
        (
            {"indices": {"bufferView": 9, "componentType": 5121}},
            "no bufferView 9 (/accessors/0/sparse/indices)",
        ),
        (
            {"values": {"bufferView": 2, "byteOffset": 4}},
            "outside its bufferView (/accessors/0/sparse/values)",
        ),
        ({"indices": {"bufferView": 0, "componentType": 5121}}, "into 5 entries"),
    ):
        glb = sparse_document(base=True)
        glb.json["accessors"][0]["sparse"] |= change
        assert reason in refused(load, glb.bytes()), change
    empty = sparse_document(base=False)
    empty.json["accessors"][0]["count"] = 1_000_001
    assert "1,000,001 entries with data for 3" in refused(load, empty.bytes())


def test_gltf_files_and_what_they_name(tmp_path: Path) -> None:
    """The buffer beside the file, its name percent-encoded once; or written into the JSON; shared by two."""
    folder = tmp_path / "models"
    folder.mkdir()
    glb = valid()
    (folder / "a %41.bin").write_bytes(glb.binary)
    (tmp_path / "outside.bin").write_bytes(glb.binary)
    scene = folder / "scene.gltf"
    for uri in ("a%20%2541.bin", "../models/a%20%2541.bin", None):
        scene.write_bytes(glb.text(uri))
        np.testing.assert_array_equal(load_scene(scene).positions, TRIANGLE)
    two = glb.document()
    two["buffers"] = [{"byteLength": len(glb.binary), "uri": data_uri(glb.binary)}] * 2
    two["bufferViews"][1]["buffer"] = 1
    scene.write_bytes(json.dumps(two).encode())
    np.testing.assert_array_equal(load_scene(scene).positions, TRIANGLE)
    two["buffers"][0] = {
        "byteLength": 9,
        "uri": "animation.bin",
    }  # of which nothing is used, so it may be missing
    two["bufferViews"][0]["buffer"] = 1
    two["bufferViews"].append({"buffer": 0, "byteLength": 9})
    scene.write_bytes(json.dumps(two).encode())
    np.testing.assert_array_equal(load_scene(scene).positions, TRIANGLE)
    (folder / "link.bin").symlink_to(tmp_path / "outside.bin")
    (folder / "short.bin").write_bytes(glb.binary[:-1])
    for uri, reason in (
        ("a %2541.bin%00", "control characters"),
        ("../outside.bin", "leads out"),
        ("link.bin", "leads out"),
        ("%252e%252e/outside.bin", "no such file"),
        ("short.bin", f"has {len(glb.binary)} bytes, its data {len(glb.binary) - 1} (/buffers/0)"),
        (".", "leads out"),
        ("file:///etc/hostname", "no address"),
        ("a\\b.bin", "not a backslash"),
    ):
        scene.write_bytes(glb.text(uri))
        with pytest.raises(InputError, match=re.escape(reason)):
            load_scene(scene)
    for content, reason in (
        (b"", "empty"),
        (b" ", "JSON is empty"),
        (b"[1]", "object"),
        (b"\xff{", "Invalid JSON"),
    ):
        scene.write_bytes(content)
        with pytest.raises(InputError, match=reason):
            load_scene(scene)


def test_mutations_end_in_a_scene_or_a_refusal(load, rng) -> None:
    for _ in range(400):
        mutated = bytearray(WHOLE)
        for _ in range(rng.integers(1, 4)):
            mutated[rng.integers(len(mutated))] = rng.integers(256)
        try:
            scene = load(bytes(mutated))
        except InputError:
            continue
        assert np.isfinite(scene.positions).all()


def test_the_public_corpus_of_bad_gltf(data: Path) -> None:
    """Every third file: a scene or one line in under two seconds, and what must be refused is."""
    index = data / "bad" / "INDEX.jsonl"
    if not index.exists():
        pytest.skip("no corpus of bad files in the test data")
    rows = [json.loads(line) for line in index.read_text(encoding="utf-8").splitlines()]
    rows = [row for row in rows if row["path"].endswith(".gltf")]
    assert len(rows) >= 300
    accepted = 0
    for row in rows[1::3]:
        start = time.perf_counter()
        try:
            load_scene(data / "bad" / row["path"])
        except InputError as error:
            message = str(error)
            assert "\n" not in message
            assert len(message) <= 300
        else:
            accepted += 1
            assert row["expect"] != "reject", row
        assert time.perf_counter() - start < 2, row
    assert accepted >= 1

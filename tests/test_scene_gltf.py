"""GLB files made by a small builder, so that every answer is known."""

from __future__ import annotations

import json
import math
import re
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene

CODES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
WIDTHS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
TRIANGLE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], "f4")


class Glb:
    """A document and its binary chunk, growing together."""

    def __init__(self) -> None:
        self.json: dict = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
            "accessors": [], "bufferViews": [], "materials": [], "buffers": [{"byteLength": 0}],
        }  # fmt: skip
        self.binary = b""

    def accessor(self, array: np.ndarray, **more: object) -> int:
        array = np.ascontiguousarray(array)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": array.nbytes}
        self.json["bufferViews"].append(view)
        self.binary += array.tobytes() + bytes(-array.nbytes % 4)
        self.json["buffers"][0]["byteLength"] = len(self.binary)
        width = WIDTHS[1 if array.ndim == 1 else array.shape[1]]
        view_index = len(self.json["bufferViews"]) - 1
        self.json["accessors"].append(
            {"bufferView": view_index, "componentType": CODES[array.dtype.str[1:]], "count": len(array),
             "type": width, **more}
        )  # fmt: skip
        return len(self.json["accessors"]) - 1

    def primitive(self, positions: np.ndarray = TRIANGLE, **more: object) -> dict:
        """Keys in capitals are attributes."""
        attributes = {"POSITION": self.accessor(positions)} | {k: v for k, v in more.items() if k.isupper()}
        return {"attributes": attributes} | {k: v for k, v in more.items() if not k.isupper()}

    def node(self, *primitives: dict, root: bool = True, **more: object) -> int:
        if primitives:
            self.json["meshes"].append({"primitives": list(primitives)})
            more["mesh"] = len(self.json["meshes"]) - 1
        self.json["nodes"].append(more)
        if root:
            self.json["scenes"][0]["nodes"].append(len(self.json["nodes"]) - 1)
        return len(self.json["nodes"]) - 1

    def material(self, **more: object) -> int:
        self.json["materials"].append(more)
        return len(self.json["materials"]) - 1

    def bytes(self) -> bytes:
        text = {k: v for k, v in self.json.items() if v != []}
        return container(json.dumps(text).encode(), self.binary)


def container(text: bytes, binary: bytes = b"") -> bytes:
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if binary:
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


@pytest.fixture
def load(tmp_path: Path) -> Callable[[bytes], Scene]:
    def loaded(content: bytes) -> Scene:
        path = tmp_path / "mesh.glb"
        path.write_bytes(content)
        return load_scene(path)

    return loaded


def refused(load, content: bytes) -> str:
    with pytest.raises(InputError) as caught:
        load(content)
    message = str(caught.value)
    assert re.fullmatch(r"\S*mesh\.\w+: .+", message)
    assert len(message) <= 300
    return message


def test_nodes_are_placed_in_the_order_of_their_indices(load) -> None:
    """Translation · rotation · scale, a child under it, and a matrix given by columns."""
    glb = Glb()
    half = math.sqrt(0.5)
    child = glb.node(glb.primitive(TRIANGLE), root=False, translation=[0, 0, 1])
    turned = {"rotation": [0, half, 0, half], "scale": [1, 2, 1], "translation": [10, 0, 0]}  # 90° about +Y
    glb.node(children=[child], **turned)
    columns = [0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 5, 6, 7, 1]  # x to -z, z to x, then moved to (5, 6, 7)
    glb.node(glb.primitive(TRIANGLE, NORMAL=glb.accessor(np.array([(0, 0, 1)] * 3, "f4"))), matrix=columns)
    scene = load(glb.bytes())
    first = [(11, 0, 0), (11, 0, -1), (11, 2, 0)]
    second = [(5, 6, 7), (5, 6, 6), (5, 7, 7)]
    np.testing.assert_allclose(scene.positions, first + second, atol=1e-6)
    np.testing.assert_array_equal(scene.triangles, [(0, 1, 2), (3, 4, 5)])
    np.testing.assert_allclose(scene.normals, [(1, 0, 0)] * 6, atol=1e-6)
    assert scene.notes == ("vertices without a usable normal: 3; theirs are made from the triangles",)


def test_normals_of_stretched_mirrored_and_flattened_nodes(load) -> None:
    """A normal stays perpendicular to its surface, on the side where the file has it."""
    slope = np.array([(0, 0, 0), (1, 1, 0), (0, 0, 1)], "f4")  # the plane y = x
    up = np.array([(-1, 1, 0)] * 3, "f4") * np.float32(math.sqrt(0.5))
    for scale, expected in (
        ((2, 1, 1), (-1, 2, 0)),
        ((-2, 1, 1), (1, 2, 0)),
        ((1, 1, -3), (-1, 1, 0)),
        ((1, 0, 1), (0, 1, 0)),
    ):
        glb = Glb()
        glb.node(glb.primitive(slope, NORMAL=glb.accessor(up)), scale=list(scale))
        np.testing.assert_allclose(
            load(glb.bytes()).normals, [expected / np.linalg.norm(expected)] * 3, atol=1e-6
        )
        without = Glb()
        without.node(without.primitive(slope[[0, 2, 1]]), scale=list(scale))
        scene = load(without.bytes())
        np.testing.assert_allclose(scene.normals, [expected / np.linalg.norm(expected)] * 3, atol=1e-6)


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


def test_base_colours_are_linear_and_exact(load) -> None:
    """0.123456 is no multiple of 1/255; vertex colours multiply it; a missing material is white."""
    glb = Glb()
    pbr = {"baseColorFactor": [0.123456, 1, 0.5, 0.25], "metallicFactor": 0}
    matt = glb.material(name="matt", pbrMetallicRoughness=pbr)
    floats = glb.accessor(np.array([(1, 1, 1), (0.5, 0, 1), (2, 1, 1)], "f4"))
    shorts = glb.accessor(np.array([(65535, 0, 0, 0)] * 3, "u2"), normalized=True)
    bytes_ = glb.accessor(np.array([(255, 51, 0, 9)] * 3, "u1"), normalized=True)
    old = {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0.3, 0.2, 0.1, 1]}}
    glb.node(
        glb.primitive(material=matt),
        glb.primitive(material=matt, COLOR_0=floats),
        glb.primitive(COLOR_0=shorts),
        glb.primitive(COLOR_0=bytes_),
        glb.primitive(),
        glb.primitive(material=glb.material()),
        glb.primitive(material=glb.material(extensions=old)),
    )
    scene = load(glb.bytes())
    a = 0.123456
    expected = [(a, 1, 0.5)] * 3 + [(a, 1, 0.5), (a / 2, 0, 0.5), (2 * a, 1, 0.5)]
    expected += [(1, 0, 0)] * 3 + [(1, 0.2, 0)] * 3 + [(1, 1, 1)] * 6 + [(0.3, 0.2, 0.1)] * 3
    np.testing.assert_array_equal(scene.albedo, np.array(expected, np.float32))
    assert scene.notes == ()


def test_what_is_not_read_is_said_once_a_kind(load) -> None:
    glb = Glb()
    texture = {"index": 0}
    for k in range(12):
        pbr = {"baseColorTexture": texture, "metallicFactor": 1, "baseColorFactor": [1, 0.5, 0.25, 1]}
        glb.material(name=f"a\x1b{k}", pbrMetallicRoughness=pbr, emissiveFactor=[1, 0, 0], alphaMode="BLEND")
    glb.json["extensionsUsed"] = ["KHR_materials_transmission"]
    glb.json["extensionsRequired"] = ["KHR_materials_transmission"]
    glb.node(glb.primitive(material=0), glb.primitive(mode=1), skin=0)
    glb.json["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 0}]
    notes = load(glb.bytes()).notes
    assert notes[0] == "material 'a\\x1b0': base colour texture not read, its factor 1,0.5,0.25 used"
    assert notes[8] == "base colour textures of 4 more materials not read, their factors used"
    rest = "\n".join(notes[9:])
    assert len(notes) == 16
    for part in (
        "metal",
        "emission",
        "transparency",
        "KHR_materials_transmission",
        "skins",
        "morph",
        "lines",
    ):
        assert rest.count(part) == 1, part


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


def test_only_the_default_scene_is_read(load) -> None:
    glb = Glb()
    glb.node(glb.primitive(TRIANGLE))
    glb.node(glb.primitive(TRIANGLE + 5))
    glb.json["scenes"] = [{"nodes": [0]}, {"nodes": [1]}]
    glb.json["scene"] = 1
    np.testing.assert_array_equal(load(glb.bytes()).positions, TRIANGLE + 5)
    del glb.json["scene"]
    np.testing.assert_array_equal(load(glb.bytes()).positions, TRIANGLE)
    del glb.json["scenes"]
    assert len(load(glb.bytes()).positions) == 6


def test_a_mesh_stands_wherever_a_node_puts_it(load) -> None:
    glb = Glb()
    glb.node(glb.primitive(TRIANGLE))
    for x in (3, 6):
        glb.node(mesh=0, translation=[x, 0, 0])
    scene = load(glb.bytes())
    expected = [TRIANGLE + np.array([x, 0, 0]) for x in (0, 3, 6)]
    np.testing.assert_array_equal(scene.positions, np.concatenate(expected))
    np.testing.assert_array_equal(scene.triangles, np.arange(9).reshape(3, 3))


def valid() -> Glb:
    glb = Glb()
    part = glb.primitive(TRIANGLE)
    part["indices"] = glb.accessor(np.array([0, 1, 2], "u2"))
    glb.node(part)
    return glb


def with_changes(*path: str | int, value: object) -> bytes:
    glb = valid()
    place = glb.json
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return glb.bytes()


PRIMITIVE = ("meshes", 0, "primitives", 0)
WHOLE = valid().bytes()


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (WHOLE[:10], "10 bytes"),
        (WHOLE[:-4], "declares"),
        (WHOLE[:4] + struct.pack("<I", 1) + WHOLE[8:], "version 1, expected 2"),
        (WHOLE[:8] + struct.pack("<I", 2**32 - 1) + WHOLE[12:], "declares 4,294,967,295"),
        (WHOLE[:12] + struct.pack("<I", 2**32 - 4) + WHOLE[16:], "chunk 0"),
        (WHOLE[:12] + struct.pack("<I", 5) + WHOLE[16:], "multiple of 4"),
        (container(b""), "JSON chunk is empty"),
        (container(b"    "), "JSON chunk is empty"),
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
        (with_changes("buffers", 0, "uri", value="http://localhost/x.bin"), "outside its binary chunk"),
        (with_changes("buffers", 0, "byteLength", value=1000), "the buffer has 1,000 bytes"),
        (with_changes("bufferViews", 0, "buffer", value=1), "/bufferViews/0"),
        (with_changes("bufferViews", 0, "byteLength", value=2**31 - 1), "ends outside its buffer (/bufferViews/0)"),
        (with_changes("bufferViews", 0, "byteStride", value=3), "/bufferViews/0/byteStride"),
        (with_changes("accessors", 0, "count", value=2**31 - 1), "ends outside its bufferView (/accessors/0)"),
        (with_changes("accessors", 0, "count", value=-1), "/accessors/0/count"),
        (with_changes("accessors", 0, "count", value=3.5), "/accessors/0/count"),
        (with_changes("accessors", 0, "count", value=True), "/accessors/0/count"),
        (with_changes("accessors", 0, "byteOffset", value=4), "ends outside its bufferView (/accessors/0)"),
        (with_changes("accessors", 0, "bufferView", value=9), "no bufferView 9"),
        (with_changes("accessors", 0, "componentType", value=5130), "/accessors/0/componentType"),
        (with_changes("accessors", 0, "type", value="VEC2"), "it is VEC2, expected VEC3"),
        (with_changes("accessors", 0, "sparse", value={"count": 1}), "sparse accessors are not read"),
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


def test_instances_are_counted_before_memory_is_taken(load, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand nodes with a mesh of 60,000 vertices: 60 million, from a file of 0.8 MB."""
    glb = Glb()
    glb.node(glb.primitive(np.zeros((60_000, 3), "f4")))
    for _ in range(999):
        glb.node(mesh=0)
    content = glb.bytes()
    monkeypatch.setattr("prelight.scene.loading.LARGEST_FILE", 10_000_000)  # reading may reserve that much
    tracemalloc.start()
    try:
        assert "60,000,000 vertices, at most 50,000,000" in refused(load, content)
        assert tracemalloc.get_traced_memory()[1] < 64e6
    finally:
        tracemalloc.stop()


def test_bytes_after_the_container_and_unknown_chunks_are_passed_over(load) -> None:
    whole = WHOLE + struct.pack("<I4s", 4, b"MORE") + b"abcd"
    length = struct.pack("<I", len(whole))
    for content in (WHOLE + b"trailing", whole[:8] + length + whole[12:]):
        np.testing.assert_array_equal(load(content).positions, TRIANGLE)


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

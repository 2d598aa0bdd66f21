"""Where the nodes of a glTF file put things: transforms, instances, cameras."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from prelight.scene.geometry import Scene

from .gltf_builder import (
    TRIANGLE,
    Glb,
    load_bytes,
    refused,
)

METAL = "metal is matte of its colour in a bake without an eye (materials: 1)"


@pytest.fixture
def load(tmp_path: Path) -> Callable[[bytes], Scene]:
    return partial(load_bytes, tmp_path)


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
    assert scene.notes == (METAL, "vertices without a usable normal: 3; theirs are made from the triangles")


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


def test_instances_of_a_node(load) -> None:
    """EXT_mesh_gpu_instancing: translation · rotation · scale of each, under the node's own transform."""
    half = math.sqrt(0.5)
    glb = Glb()
    attributes = {
        "TRANSLATION": glb.accessor(np.array([(0, 0, 0), (10, 0, 0)], "f4")),
        "ROTATION": glb.accessor(np.array([(0, 0, 0, 1), (0, half, 0, half)], "f4")),  # 90° about +Y: x to -z
        "SCALE": glb.accessor(np.array([(1, 1, 1), (-2, 1, 1)], "f4")),
        "_ID": glb.accessor(np.array([0, 1], "f4")),
    }
    part = glb.primitive(TRIANGLE, NORMAL=glb.accessor(np.array([(0, 0, 1)] * 3, "f4")))
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    glb.node(part, extensions=instancing, translation=[0, 5, 0], scale=[3, 1, 1])
    glb.node(mesh=0)
    glb.json["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    scene = load(glb.bytes())
    first, second = [(0, 5, 0), (3, 5, 0), (0, 6, 0)], [(30, 5, 0), (30, 5, 2), (30, 6, 0)]
    np.testing.assert_allclose(scene.positions, [*first, *second, *TRIANGLE], atol=1e-6)
    # Mirrored, so wound the other way: its normal, (0, 0, 1) turned to (1, 0, 0), is still its front.
    np.testing.assert_array_equal(scene.triangles, [(0, 1, 2), (5, 4, 3), (6, 7, 8)])
    np.testing.assert_allclose(scene.normals[3:6], [(1, 0, 0)] * 3, atol=1e-6)
    a, b, c = scene.positions[scene.triangles[1]]
    assert np.cross(b - a, c - a)[0] > 0

    attributes["SCALE"] = glb.accessor(np.ones((3, 3), "f4"))
    assert "differ in number (/nodes/0/extensions" in refused(load, glb.bytes())
    attributes["SCALE"] = 99
    assert "no accessor 99" in refused(load, glb.bytes())
    attributes["SCALE"] = attributes["ROTATION"]
    assert "it is VEC4, expected VEC3" in refused(load, glb.bytes())


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


def test_instances_of_one_node_are_counted_too(load) -> None:
    glb = Glb()
    glb.json["accessors"] = [{"componentType": 5126, "count": 20_000_000, "type": "VEC3"}]
    glb.node(glb.primitive(), extensions={"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}})
    assert "60,000,000 vertices, at most 50,000,000" in refused(load, glb.bytes())
    glb.json["accessors"][0]["count"] = 2
    assert "has no bufferView" in refused(load, glb.bytes())


def test_primitives_that_share_vertices_keep_those_they_use(load) -> None:
    """Otherwise a mesh of a hundred materials over one array would have a hundred times its vertices."""
    glb = Glb()
    quad = glb.accessor(np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (7, 7, 7)], "f4"))
    parts = [
        {"attributes": {"POSITION": quad}, "indices": glb.accessor(np.array(corners, "u1"))}
        for corners in ([0, 1, 2], [3, 2, 1])
    ]
    glb.node(*parts)
    scene = load(glb.bytes())
    expected = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]
    np.testing.assert_array_equal(scene.positions, expected)
    np.testing.assert_array_equal(scene.triangles, [(0, 1, 2), (5, 4, 3)])
    alone = Glb()
    corners = alone.accessor(np.array([0, 1, 2], "u1"))
    alone.node(alone.primitive(np.array([*expected, (7, 7, 7)], "f4"), indices=corners))
    assert len(load(alone.bytes()).positions) == 7  # one primitive's own vertices all stay


def test_cameras_become_views(load) -> None:
    """A camera looks along its own -Z; its target is as far as the middle of the scene is."""
    glb = Glb()
    glb.node(glb.primitive(TRIANGLE))
    view = {"type": "perspective", "perspective": {"yfov": math.radians(40), "znear": 0.1}}
    glb.json["cameras"] = [view | {"name": "front"}, view, {"type": "orthographic", "orthographic": {}}]
    half = math.sqrt(0.5)
    glb.node(camera=0, translation=[0.5, 0.5, 4])
    glb.node(camera=1, name="side", translation=[4, 0, 0], rotation=[0, half, 0, half], scale=[2, 2, 2])
    glb.node(camera=1, name="side")
    glb.node(camera=2)
    glb.node(camera=1, scale=[0, 0, 0])
    scene = load(glb.bytes())
    assert list(scene.cameras) == ["front", "side", "side-2"]
    front, side, _ = scene.cameras.values()
    np.testing.assert_allclose(front.target, (0.5, 0.5, 0), atol=1e-6)
    assert math.isclose(front.vertical_fov_deg, 40)
    np.testing.assert_allclose(side.axes()[2], (1, 0, 0), atol=1e-6)  # backward
    np.testing.assert_allclose(side.axes()[1], (0, 1, 0), atol=1e-6)
    assert "cameras not read, which are not perspective, look nowhere or are too many: 2" in scene.notes


def test_lights_and_hidden_nodes(load) -> None:
    glb = Glb()
    glb.node(glb.primitive(TRIANGLE))
    glb.node(extensions={"KHR_lights_punctual": {"light": 0}})
    below = glb.node(glb.primitive(TRIANGLE + 5), root=False)
    glb.node(children=[below], extensions={"KHR_node_visibility": {"visible": False}})
    glb.json["animations"] = [{"channels": []}]
    scene = load(glb.bytes())
    np.testing.assert_array_equal(scene.positions, TRIANGLE)
    assert scene.notes[1:] == (
        "lights not in the bake: 1; prelight rig lamps makes a rig of them",
        "animations not applied: 1",
    )

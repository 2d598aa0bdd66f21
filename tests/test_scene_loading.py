"""Scenes from every kind of source: known meshes, trimesh objects, the floor, refusals in one line."""

from __future__ import annotations

import itertools
import json
import math
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh

from prelight.errors import InputError
from prelight.scene.floor import with_floor
from prelight.scene.loading import load_scene
from prelight.scene.mesh import DEFAULT_ALBEDO, linear_from_srgb
from prelight.scene.normals import vertex_normals, zero_area

TRIANGLE = b"""ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""


@pytest.fixture
def triangle(tmp_path: Path) -> Path:
    path = tmp_path / "triangle.ply"
    path.write_bytes(TRIANGLE)
    return path


def refused(source: object, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        load_scene(source, **options)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


@pytest.mark.parametrize(
    ("name", "vertices", "triangles", "unused"),
    [
        ("bunny/bun_zipper.ply", 35_947, 69_451, 1_113),
        ("dragon/dragon_vrip_res2.ply", 100_250, 202_520, 43),
        ("cornell/cornell-box_suzanne.glb", 649, 1_040, 0),
        ("gltf/DamagedHelmet.glb", 14_556, 15_452, 0),
    ],
)
def test_known_meshes(data: Path, name: str, vertices: int, triangles: int, unused: int) -> None:
    path = data / name
    if not path.exists():
        pytest.skip(f"no {name} in the test data")
    start = time.perf_counter()
    scene = load_scene(path)
    assert time.perf_counter() - start < 5
    assert (len(scene.positions), len(scene.triangles)) == (vertices, triangles)
    assert vertices - len(np.unique(scene.triangles)) == unused
    lengths = np.linalg.norm(scene.normals, axis=1)
    used = np.isin(np.arange(vertices), scene.triangles)
    assert (lengths[~used] == 0).all()
    assert (np.isclose(lengths, 1, atol=1e-6) | (lengths == 0)).all()


def test_the_bunny_on_its_floor_has_the_receivers_of_the_paper(data: Path) -> None:
    alone, scene = (load_scene(data / "bunny" / "bun_zipper.ply", floor=floor) for floor in (None, 3))
    assert len(scene.positions) == 73_196
    assert len(scene.triangles) == 69_451 + 2 * 192 * 192
    np.testing.assert_array_equal(scene.positions[:35_947], alone.positions)
    assert scene.digest != alone.digest
    assert alone.digest == load_scene(data / "bunny" / "bun_zipper.ply").digest


def test_the_albedo_of_the_cornell_box_is_its_factors_to_the_last_digit(data: Path) -> None:
    path = data / "cornell" / "cornell-box_suzanne.glb"
    if not path.exists():
        pytest.skip("no Cornell box in the test data")
    content = path.read_bytes()
    text = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
    factors = [m["pbrMetallicRoughness"].get("baseColorFactor", [1, 1, 1, 1])[:3] for m in text["materials"]]
    found = np.unique(load_scene(path).albedo, axis=0)
    np.testing.assert_array_equal(found, np.unique(np.array(factors, np.float32), axis=0))


# ---- normals ----


def test_normals_are_those_of_trimesh(data: Path) -> None:
    """Both are angle-weighted; trimesh's are float64, ours are rounded at the end."""
    scene = load_scene(data / "bunny" / "bun_zipper_res4.ply")
    mesh = trimesh.Trimesh(scene.positions, scene.triangles, process=False)
    np.testing.assert_allclose(scene.normals, mesh.vertex_normals, atol=6e-8)


def cube() -> tuple[np.ndarray, np.ndarray]:
    corners = np.array(list(itertools.product((-1, 1), repeat=3)), np.float32)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32)


@pytest.mark.parametrize("scale", [1e-18, 1.0, 1e18])
def test_normals_of_a_cube_point_along_its_diagonals_however_its_faces_are_cut(scale: float) -> None:
    """A corner meets one or two triangles of each face: only weights by angle give the diagonal."""
    corners, triangles = cube()
    normals = vertex_normals(corners * np.float32(scale), triangles)
    np.testing.assert_allclose(normals, corners / math.sqrt(3), atol=1e-12)
    assert not zero_area(corners * np.float32(scale), triangles).any()


def test_normals_do_not_depend_on_how_the_work_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = trimesh.creation.icosphere(2)
    positions, triangles = mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32)
    whole = vertex_normals(positions, triangles)
    np.testing.assert_allclose(whole, positions, atol=0.02)
    monkeypatch.setattr("prelight.scene.normals._BLOCK", 7)
    np.testing.assert_allclose(vertex_normals(positions, triangles), whole, atol=1e-14)
    assert not zero_area(positions, triangles).any()


def test_vertices_between_opposite_triangles_stay_dark_and_it_is_said(triangle: Path) -> None:
    triangle.write_bytes(TRIANGLE.replace(b"face 1", b"face 2") + b"3 0 2 1\n")
    scene = load_scene(triangle)
    np.testing.assert_array_equal(scene.normals, np.zeros((3, 3)))
    assert scene.notes == ("vertices whose triangles face opposite ways: 3; without a normal they stay dark",)


# ---- the floor ----


def test_the_floor_lies_under_the_model_and_faces_up() -> None:
    """Only what triangles use says how large the model is: vertex 8, far away, is used by nothing."""
    corners, triangles = cube()
    positions = np.concatenate([corners * (1, 2, 3) + (10, 20, 30), [(900, -900, 900)]])
    scene = load_scene(trimesh.Trimesh(positions, triangles, process=False), floor=2.5)
    floor = scene.positions[9:]
    assert len(floor) == 193 * 193
    np.testing.assert_array_equal(floor[:, 1], np.float32(18))
    np.testing.assert_allclose(floor.min(axis=0), (10 - 7.5, 18, 30 - 7.5))
    np.testing.assert_allclose(floor.max(axis=0), (10 + 7.5, 18, 30 + 7.5))
    np.testing.assert_array_equal(scene.normals[9:], np.tile((0, 1, 0), (len(floor), 1)))
    np.testing.assert_array_equal(scene.albedo[9:], np.full((len(floor), 3), DEFAULT_ALBEDO, np.float32))
    own = scene.triangles[12:]
    assert own.min() == 9
    a, b, c = (scene.positions[own[:, k]].astype(float) for k in range(3))
    across = np.cross(b - a, c - a)
    np.testing.assert_array_equal(across[:, [0, 2]], 0)
    assert (across[:, 1] > 0).all()
    assert across[:, 1].sum() / 2 == pytest.approx(15 * 15, rel=1e-6)  # covered once, without gaps


@pytest.mark.parametrize("scale", [0, -1, 1000.5, math.nan, math.inf, "3", True, None])
def test_other_floors_are_refused(triangle: Path, scale: object) -> None:
    with pytest.raises(InputError, match=r"^floor: scale is"):
        with_floor(load_scene(triangle), scale)


def test_a_floor_too_large_for_float32_is_refused() -> None:
    corners, triangles = cube()
    assert "larger than float32" in refused(
        trimesh.Trimesh(corners * 1e38, triangles, process=False), floor=1000
    )


# ---- sources ----


def test_a_path_a_string_a_scene_and_a_trimesh_give_the_same(triangle: Path) -> None:
    scene = load_scene(triangle)
    mesh = trimesh.Trimesh(scene.positions, scene.triangles, process=False)
    for source in (str(triangle), scene, mesh, trimesh.Scene([mesh])):
        assert load_scene(source).digest == scene.digest
    assert scene.name == "triangle"


def test_the_magic_number_goes_before_the_name(triangle: Path) -> None:
    other = triangle.rename(triangle.with_suffix(".glb"))
    assert len(load_scene(other).triangles) == 1


def test_one_albedo_for_all(triangle: Path) -> None:
    scene = load_scene(triangle, albedo=(0.1, 0.2, 0.3), floor=1)
    expected = np.tile(np.float32([0.1, 0.2, 0.3]), (3 + 193 * 193, 1))
    np.testing.assert_array_equal(scene.albedo, expected)
    for wrong in ((0.1, 0.2), (0.1, 0.2, 1.5), (math.nan, 0, 0), 0.5, "abc", (-0.1, 0, 0)):
        assert refused(triangle, albedo=wrong).startswith("albedo: is ")


def test_colours_of_trimesh_objects(triangle: Path) -> None:
    scene = load_scene(triangle)

    def mesh(**visual: object) -> trimesh.Trimesh:
        return trimesh.Trimesh(scene.positions, scene.triangles, process=False, **visual)

    colours = np.array([(255, 0, 0, 255), (0, 188, 0, 255), (0, 0, 10, 255)], np.uint8)
    loaded = load_scene(mesh(vertex_colors=colours))
    np.testing.assert_allclose(loaded.albedo, linear_from_srgb(colours[:, :3] / 255), atol=1e-7)
    faces = load_scene(mesh(face_colors=[(255, 0, 0, 255)]))
    np.testing.assert_array_equal(faces.albedo, np.full((3, 3), DEFAULT_ALBEDO, np.float32))
    assert faces.notes == ("face colours not read, grey used (meshes: 1)",)
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[51, 102, 255, 255])
    painted = load_scene(mesh(visual=trimesh.visual.TextureVisuals(material=material)))
    np.testing.assert_allclose(painted.albedo, np.tile([0.2, 0.4, 1], (3, 1)), atol=1e-7)


def test_a_trimesh_scene_is_transformed_and_mirrored(triangle: Path) -> None:
    loaded = load_scene(triangle)
    mesh = trimesh.Trimesh(loaded.positions, loaded.triangles, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(mesh, transform=np.diag([-2.0, 1, 1, 1]))
    scene.add_geometry(trimesh.PointCloud([(0, 0, 0)]))
    found = load_scene(scene)
    np.testing.assert_array_equal(found.positions, [(0, 0, 0), (-2, 0, 0), (0, 1, 0)])
    np.testing.assert_array_equal(found.triangles, [(2, 1, 0)])
    np.testing.assert_array_equal(found.normals, [(0, 0, 1)] * 3)
    assert found.notes == ("points and curves not read (meshes: 1)",)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("a.stl", b"solid x", "STL is not read: convert it to PLY or GLB"),
        ("a.OFF", b"OFF", "OFF is not read: convert it to PLY or GLB"),
        ("a.xml", b"<scene/>", "plug-ins and files anywhere: give --trust (trust=True) if you trust it"),
        ("a.ply", b"solid x", "begins with b'solid x', expected 'ply'"),
        ("a.glb", b"\0\x1b]0;hi\x07", "expected 'glTF'"),
        ("a.dat", b"\x89PNG", "expected a PLY, GLB, glTF or OBJ file"),
        ("a.ply", b"", "the file is empty"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, name: str, content: bytes, reason: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    message = refused(path)
    assert message.startswith(f"{path}: ")
    assert reason in message
    assert message.isprintable()


def test_other_sources_are_refused(tmp_path: Path) -> None:
    assert "no such file" in refused(tmp_path / "absent.ply")
    assert "no such file" in refused(tmp_path / "absent.obj")
    assert "directory" in refused(tmp_path) or "regular file" in refused(tmp_path)
    os.mkfifo(tmp_path / "pipe.ply")
    assert "regular file" in refused(tmp_path / "pipe.ply")
    assert "cannot read" in refused("a\0b.ply")
    for source, kind in ((42, "int"), (None, "NoneType"), (b"a.ply", "bytes")):
        assert f"a {kind} was given" in refused(source)
    assert "no triangles" in refused(trimesh.Scene())
    assert "no triangles" in refused(trimesh.Trimesh())
    broken = trimesh.Trimesh([(0, 0, 0), (math.nan, 0, 0), (0, 1, 0)], [(0, 1, 2)], process=False)
    assert "vertex 1 is at (nan" in refused(broken)


def test_a_readers_stumble_becomes_a_refusal(triangle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for error in (KeyError("x"), IndexError(), RecursionError("deep"), OverflowError("big"), MemoryError()):

        def stumble(data: bytes, error: Exception = error) -> None:
            raise error

        monkeypatch.setattr("prelight.scene.ply.reading.read_ply", stumble)
        message = refused(triangle)
        assert "memory" in message if isinstance(error, MemoryError) else "damaged PLY file: " in message


# ---- Mitsuba, behind trust ----


def test_a_mitsuba_scene_is_read_only_where_it_is_trusted(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    path.write_text('<scene version="3.0.0"><shape type="rectangle"/></scene>', encoding="utf-8")
    table = {"type": "scene", "shape": {"type": "rectangle"}}
    for source, name in ((path, str(path)), (table, "Mitsuba dictionary")):
        message = refused(source)
        assert message.startswith(f"{name}: a Mitsuba scene names plug-ins")
        pytest.importorskip("mitsuba")
        assert len(load_scene(source, trust=True).triangles) == 2


def test_loading_a_mesh_needs_neither_trimesh_nor_the_renderer(triangle: Path) -> None:
    code = (
        "import sys; from prelight.scene.loading import load_scene; load_scene(sys.argv[1]); "
        "print(sorted({'trimesh', 'mitsuba', 'drjit', 'numba', 'pydantic'} & set(sys.modules)))"
    )
    found = subprocess.run(
        [sys.executable, "-c", code, str(triangle)], capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == "[]"

"""OBJ: known scenes, every form of a statement, and what is wrong refused by its line."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.material import GREY
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene
from prelight.scene.mesh import linear_from_srgb

from .obj_files import SQUARE, Folder


@pytest.fixture
def loaded(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


def same(a: Scene, b: Scene) -> bool:
    return all(
        np.array_equal(getattr(a, name), getattr(b, name))
        for name in ("positions", "normals", "triangles", "albedo", "material_of")
    )


# ---- known scenes ----


@pytest.mark.parametrize(
    ("name", "vertices", "triangles", "materials", "textures"),
    [
        ("sibenik/sibenik.obj", 77_008, 75_277, 15, 3),
        ("sponza/sponza_materials.obj", 69_013, 66_453, 17, 11),
        ("cornell/CornellBox-Original.obj", 64, 36, 8, 0),
        ("cornell/CornellBox-Water.obj", 3_830, 7_088, 9, 0),
    ],
)
def test_known_scenes(
    data: Path, name: str, vertices: int, triangles: int, materials: int, textures: int
) -> None:
    if not (data / name).exists():
        pytest.skip(f"no {name} in the test data")
    start = time.process_time()
    scene = load_scene(data / name)
    assert time.process_time() - start < 5
    found = (len(scene.positions), len(scene.triangles), len(scene.materials), len(scene.textures))
    assert found == (vertices, triangles, materials, textures)
    assert len(np.unique(scene.triangles)) == vertices or name.startswith("si")


@pytest.mark.parametrize("kind", ["Original", "Mirror", "Glossy", "Empty-CO", "Empty-RG"])
def test_negative_indices_give_the_scene_of_absolute_ones(data: Path, kind: str) -> None:
    paths = [data / "cornell" / f"CornellBox-{kind}{end}.obj" for end in ("", "_abs")]
    if not all(path.exists() for path in paths):
        pytest.skip("no Cornell boxes in the test data")
    assert same(*map(load_scene, paths))


def test_what_shines_in_the_cornell_boxes(data: Path) -> None:
    if not (data / "cornell" / "CornellBox-Sphere.obj").exists():
        pytest.skip("no Cornell boxes in the test data")
    found = {m.name: m for m in load_scene(data / "cornell" / "CornellBox-Sphere.obj").materials}
    assert (found["leftSphere"].metallic, found["leftSphere"].colour) == (1, (0.95, 0.95, 0.95))
    assert (found["rightSphere"].transmission, found["rightSphere"].ior) == (1, 2.5)
    assert found["floor"].is_lambertian
    assert found["light"].emission == (10, 10, 10)


# ---- statements ----


@pytest.mark.parametrize(
    "faces",
    [
        b"f 1 2 3 4",
        b"f -4 -3 -2 -1",
        b"f 1/1 2/2 3/3 4/4",
        b"f 1// 2// 3// 4//",
        b"f 1/ 2/ 3/ 4/",
        b"f\t1\t2  3 4   ",
        b"f 1 2 3 4 # a comment",
        b"  f 1 2 3 4",
        b"f 1 2 \\\n3 \\\n4",
        b"f 1 2 \\\r\n3 4\r\n",
        b"# a comment \\\nf 1 2 3 4",
        b"# \xff\xfe no text at all\nf 1 2 3 4",
        b"o x\ng a b c\ns 1\ns off\ng\nf 1 2 3 4\n\n\n",
        b"f 1 2 3\nf 1 3 4",
        b"f 1 2 3 4\nf 1 2\nf\nl 1 2 3\np 1",
    ],
)
def test_a_square_is_a_square(loaded, faces: bytes) -> None:
    """However it is written: also with CRLF, lone returns and the mark of UTF-8."""
    text = (SQUARE + faces).replace(b"\r\n", b"\n")
    for spelling in (SQUARE + faces, b"\xef\xbb\xbf" + text, text.replace(b"\n", b"\r\n")):
        scene = loaded(spelling)
        np.testing.assert_array_equal(scene.positions, [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
        np.testing.assert_array_equal(scene.triangles, [(0, 1, 2), (0, 2, 3)])
        np.testing.assert_array_equal(scene.normals, [(0, 0, 1)] * 4)
        np.testing.assert_array_equal(scene.albedo, np.full((4, 3), GREY[0], np.float32))
    if b"\\" not in faces:
        assert same(loaded((SQUARE + faces).replace(b"\n", b"\r")), scene)


def test_numbers_in_every_spelling(loaded) -> None:
    scene = loaded(b"v 1e0 .5 -0.25E+1\nv +1. 2 3 \nv 0 1e-3 00012\nf 1 2 3")
    np.testing.assert_array_equal(scene.positions, np.float32([(1, 0.5, -2.5), (1, 2, 3), (0, 1e-3, 12)]))


def test_vertices_are_distinct_corners_of_a_material_in_order_of_first_use(loaded) -> None:
    """Position 2 is used with two coordinates and in two materials; 9 is used by nothing."""
    faces = (
        b"usemtl a\nf 3/3 1/1 2/2\nf 3/3 2/2 1/4\nusemtl b\nf 2/2 3/3 4/1\nusemtl a\nf 4 3/3 1/1\nv 9 9 9\n"
    )
    scene = loaded(SQUARE + faces)
    corners = [(1, 1), (0, 0), (1, 0), (0, 0), (1, 0), (1, 1), (0, 1), (0, 1)]
    np.testing.assert_array_equal(scene.positions[:, :2], corners)
    np.testing.assert_array_equal(scene.triangles, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (7, 0, 1)])
    np.testing.assert_array_equal(scene.material_of, [0, 0, 1, 0])
    assert [m.name for m in scene.materials] == ["a", "b"]


def test_normals_and_those_that_are_missing(loaded) -> None:
    scene = loaded(SQUARE + b"vn 3 0 0\nvn nan 0 0\nf 1//2 2//-2 3//1\nf 1//2 3//3 4\n")
    np.testing.assert_array_equal(scene.normals, [(1, 0, 0), (1, 0, 0), (0, 0, 1), (0, 0, 1), (0, 0, 1)])
    assert scene.notes == ("vertices without a usable normal: 2; theirs are made from the triangles",)


def test_without_normals_smoothing_groups_are_noted(loaded: Folder) -> None:
    text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\ns 1\nf 1 2 3\n"
    assert loaded(text).notes == (
        "smoothing groups not used: normals are made of all triangles around a vertex",
    )
    assert loaded(b"vn 0 0 1\n" + text).notes == ()


def test_coordinates_and_normals_that_the_file_has_not_are_lost_and_it_is_said(loaded) -> None:
    scene = loaded(SQUARE + b"f 1/9/1 2/-7/2 3/3/-5 4/4/0\n")
    assert len(scene.positions) == 4
    assert scene.notes[0] == "coordinates and normals that faces name but the file has not: 4"


def test_vertex_colours_and_weights(loaded) -> None:
    text = b"v 0 0 0 1 0.5 0\nv 1 0 0\nv 0 1 0 0.5 0.25 0 0\nv 0 0 1 2\nf 1 2 3\nf 1 3 4\n"
    scene = loaded(text)
    expected = linear_from_srgb(np.array([(1, 0.5, 0), (1, 1, 1), (0.25, 0, 0), (1, 1, 1)]))
    np.testing.assert_allclose(scene.albedo, expected, atol=1e-7)
    assert "weights of vertices (w, for curves) not used: 2" in scene.notes
    assert "vertex colours taken as sRGB, as displayed" in scene.notes


@pytest.mark.parametrize("block", [1, 40, 200])
def test_where_the_text_is_cut_changes_nothing(loaded, monkeypatch: pytest.MonkeyPatch, block: int) -> None:
    text = SQUARE + b"usemtl a\nf -4 -3 -2\nv 5 5 5\nusemtl b\nf 1 -1 3\nf 1 2 5\nusemtl a\nf 5 4 3\nq 1\n"
    whole = loaded(text)
    monkeypatch.setattr("prelight.scene.obj.text._BLOCK", block)
    assert same(loaded(text), whole)
    assert loaded(text).notes == whole.notes
    with pytest.raises(InputError, match=r"'x' is no number \(line 19\)"):
        loaded(text + b"v 1 2 x\n")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b"v 0 0 0\n", "no faces (lines 'f' with three corners or more): a mesh is needed"),
        (b"f 1 2 3\n", "index 1 of a vertex, but the file has 0 (line 1)"),
        (SQUARE + b"f 1 2 5\n", "index 5 of a vertex, but the file has 4 (line 10)"),
        (SQUARE + b"f 1 2 -5\n", "index -5 of a vertex, 4 stand above; counted from 1 (line 10)"),
        (SQUARE + b"f 1 2 0\n", "index 0 of a vertex, 4 stand above; counted from 1 (line 10)"),
        (SQUARE + b"f 1 2 99999999999999999999\n", " of a vertex, but the file has 4 (line 10)"),
        (SQUARE + b"f 1 2 3.5\n", "'3.5' is no corner of a face, expected 1, 1/2, 1//3 or 1/2/3 (line 10)"),
        (SQUARE + b"f 1 2 1/2/3/4\n", "'1/2/3/4' is no corner of a face"),
        (SQUARE + b"f 1 2 /3\n", "'/3' is no corner of a face"),
        (SQUARE + b"f 1 2 3///\n", "'3///' is no corner of a face"),
        (SQUARE + b"f 1 2 --3\n", "'--3' is no corner of a face"),
        (b"v 0 0\nf 1 1 1\n", "2 numbers, expected at least 3 (line 1)"),
        (b"\n\nv 0 0 \x1b[2J\n", "'\\x1b[2J' is no number (line 3)"),
        (b"v 0 1.5-3 0\n", "'1.5-3' is no number (line 1)"),
        (b"v 0 1_0 0\n", "'1_0' is no number"),
        (b"v 0 0 0\nv nan 0 0\n", "a coordinate is not finite, expected three finite numbers after v (line 2)"),
        (b"v 0 0 1e999\n", "a coordinate is not finite"),
        (SQUARE + b"v 1e39 0 0\nf 1 2 5", "every coordinate must be finite and below 3.4e38"),
        (SQUARE + b"f 1 1 2\n", "every triangle has zero area"),
        (b"\xff\xfev\x00 \x00", "UTF-16 or binary, expected plain text: save it as UTF-8"),
        (b"v 0 0 0\nv 1\x00", "holds a byte 0, expected plain text (line 2)"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_refused_by_line(loaded, text: bytes, reason: str) -> None:
    for given_text in (text, text.replace(b"\n", b"\r\n"), text.replace(b"\n", b"\r")):
        with pytest.raises(InputError) as caught:
            loaded(given_text)
        assert reason in str(caught.value)
        assert str(caught.value).isprintable()

"""PLY files made by hand, so that every answer is known."""

from __future__ import annotations

import re
import struct
import time
from pathlib import Path

import numpy as np
import pytest

from prelight.errors import InputError
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene
from prelight.scene.mesh import DEFAULT_ALBEDO

XYZ = "property float x\nproperty float y\nproperty float z\n"
CORNERS = "property list uchar int vertex_indices\n"
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (9, 9, 9)]  # the last is used by nothing
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


def header(encoding: str, vertices: int, faces: int, *, columns: str = "", corners: str = CORNERS) -> bytes:
    text = f"ply\nformat {encoding} 1.0\ncomment made by hand\nelement vertex {vertices}\n{XYZ}{columns}"
    return f"{text}element face {faces}\n{corners}end_header\n".encode()


def written(
    encoding: str, faces: list[tuple[int, ...]], *, count: str = "uchar", index: str = "int"
) -> bytes:
    """The square with the given polygons."""
    corners = f"property list {count} {index} vertex_indices\n"
    head = header(encoding, len(SQUARE), len(faces), corners=corners)
    if encoding == "ascii":
        lines = [" ".join(map(str, row)) for row in (*SQUARE, *((len(f), *f) for f in faces))]
        return head + "\n".join(lines).encode() + b"\n"
    codes = {"uchar": "B", "char": "b", "ushort": "H", "short": "h", "int": "i", "uint": "I"}
    order = ORDERS[encoding]
    body = b"".join(struct.pack(order + "3f", *row) for row in SQUARE)
    for face in faces:
        body += struct.pack(order + codes[count], len(face)) + struct.pack(
            f"{order}{len(face)}{codes[index]}", *face
        )
    return head + body


@pytest.fixture
def load(tmp_path: Path):
    def loaded(content: bytes, name: str = "mesh.ply") -> Scene:
        path = tmp_path / name
        path.write_bytes(content)
        return load_scene(path)

    return loaded


def refused(load, content: bytes) -> str:
    """The one line of the refusal."""
    with pytest.raises(InputError) as caught:
        load(content)
    message = str(caught.value)
    assert re.fullmatch(r"\S*mesh\.\w+: .+", message)
    assert len(message) <= 300
    return message


@pytest.mark.parametrize("encoding", ["ascii", *ORDERS])
@pytest.mark.parametrize(
    ("faces", "expected"),
    [
        ([(0, 1, 2), (0, 2, 3)], [(0, 1, 2), (0, 2, 3)]),
        ([(0, 1, 2, 3)], [(0, 1, 2), (0, 2, 3)]),
        ([(0, 1, 2), (0, 1, 2, 3), (1, 2, 3)], [(0, 1, 2), (0, 1, 2), (0, 2, 3), (1, 2, 3)]),
        ([(3, 0, 1, 2, 4), (0, 1, 2)], [(3, 0, 1), (3, 1, 2), (3, 2, 4), (0, 1, 2)]),
        ([(0, 1, 2), (0, 1), (), (0, 2, 3)], [(0, 1, 2), (0, 2, 3)]),
    ],
)
def test_polygons_become_fans_in_file_order(load, encoding: str, faces: list, expected: list) -> None:
    scene = load(written(encoding, faces))
    np.testing.assert_array_equal(scene.positions, np.array(SQUARE, np.float32))
    np.testing.assert_array_equal(scene.triangles, expected)
    assert scene.positions.dtype == scene.normals.dtype == scene.albedo.dtype == np.float32
    assert scene.triangles.dtype == np.int32
    assert scene.name == "mesh"
    assert any("more than three corners" in note for note in scene.notes) == any(len(f) > 3 for f in faces)
    assert any("fewer than three corners" in note for note in scene.notes) == any(len(f) < 3 for f in faces)


@pytest.mark.parametrize("encoding", ["ascii", *ORDERS])
@pytest.mark.parametrize("count", ["uchar", "char", "ushort", "int", "uint"])
@pytest.mark.parametrize("index", ["uchar", "short", "int", "uint"])
@pytest.mark.parametrize("faces", [[(0, 1, 2)], [(0, 1, 2, 3), (0, 1, 2)]])
def test_lists_of_every_type(load, encoding: str, count: str, index: str, faces: list) -> None:
    scene = load(written(encoding, faces, count=count, index=index))
    assert scene.triangles[-1].tolist() == [0, 1, 2]
    assert len(scene.triangles) == sum(len(f) - 2 for f in faces)


def test_normals_are_made_and_unreferenced_vertices_have_none(load) -> None:
    scene = load(written("ascii", [(0, 1, 2, 3)]))
    np.testing.assert_array_equal(scene.normals, [(0, 0, 1)] * 4 + [(0, 0, 0)])
    np.testing.assert_array_equal(scene.albedo, np.full((5, 3), DEFAULT_ALBEDO, np.float32))


@pytest.mark.parametrize("encoding", ["ascii", *ORDERS])
def test_the_files_own_normals_where_they_are_usable(load, encoding: str) -> None:
    """Normalised; zero, NaN and infinity are replaced, huge and tiny ones keep their direction."""
    given = [(0, 0, 2e300), (0, 3e-300, 4e-300), (0, 0, 0), (float("nan"), 0, 1), (0, 1, 0)]
    columns = "property double nx\nproperty double ny\nproperty double nz\n"
    head = header(encoding, 5, 2, columns=columns)
    faces = [(0, 1, 2), (0, 2, 3)]
    if encoding == "ascii":
        rows = [(*p, *n) for p, n in zip(SQUARE, given, strict=True)] + [(3, *f) for f in faces]
        body = "\n".join(" ".join(map(str, row)) for row in rows).encode()
    else:
        order = ORDERS[encoding]
        body = b"".join(struct.pack(order + "3f3d", *p, *n) for p, n in zip(SQUARE, given, strict=True))
        body += b"".join(struct.pack(order + "B3i", 3, *f) for f in faces)
    scene = load(head + body)
    expected = [(0, 0, 1), (0, 0.6, 0.8), (0, 0, 1), (0, 0, 1), (0, 0, 0)]
    np.testing.assert_allclose(scene.normals, expected, atol=1e-7)
    assert scene.notes == ("vertices without a usable normal: 2; theirs are made from the triangles",)


def test_byte_colours_are_srgb_and_decoded(load) -> None:
    columns = "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    rows = "0 0 0 0 10 128\n1 0 0 255 188 64\n0 1 0 1 2 3\n3 0 1 2\n"
    scene = load(header("ascii", 3, 1, columns=columns) + rows.encode())
    # IEC 61966-2-1 at 10/255 (linear part), 128/255, 188/255 (famous for being half the light) and 64/255.
    np.testing.assert_allclose(scene.albedo[0], [0, 10 / 255 / 12.92, 0.215861], atol=1e-6)
    np.testing.assert_allclose(scene.albedo[1], [1, 0.502886, 0.051269], atol=1e-6)


def test_float_colours_are_linear_clipped_and_said_so(load) -> None:
    columns = "property float red\nproperty float green\nproperty float blue\n"
    rows = "0 0 0 0.25 0.5 1\n1 0 0 -1 2 0.5\n0 1 0 0 0 0\n3 0 1 2\n"
    scene = load(header("ascii", 3, 1, columns=columns) + rows.encode())
    np.testing.assert_array_equal(scene.albedo, [(0.25, 0.5, 1), (0, 1, 0.5), (0, 0, 0)])
    assert any("taken as linear" in note for note in scene.notes)
    assert any("clipped: 1 of 3" in note for note in scene.notes)
    assert "colour of vertex 2 is not a number" in refused(
        load, header("ascii", 3, 1, columns=columns) + rows.replace("0 1 0 0 0 0", "0 1 0 0 nan 0").encode()
    )


def test_colours_of_old_scanners_and_columns_in_any_order(load) -> None:
    columns = "".join(f"property uchar diffuse_{c}\n" for c in ("blue", "green", "red"))
    body = b"".join(struct.pack("<3f3B", *SQUARE[k], 0, 0, 255) for k in range(3)) + struct.pack(
        "<B3i", 3, 0, 1, 2
    )
    scene = load(header("binary_little_endian", 3, 1, columns=columns) + body)
    np.testing.assert_array_equal(scene.albedo, [(1, 0, 0)] * 3)


def test_other_elements_and_lists_are_passed_over(load) -> None:
    """Elements before, between and after, with lists of different lengths, whose bytes must be counted right."""
    head = (
        "ply\nformat binary_big_endian 1.0\nobj_info x\nelement junk 2\nproperty list ushort double a\n"
        f"property char b\nelement empty 5\nelement vertex 3\n{XYZ}property list uchar float weights\n"
        f"element face 1\nproperty uchar flag\n{CORNERS}element after 1\nproperty int z\nend_header\n"
    )
    body = struct.pack(">H2dbH0db", 2, 1.0, 2.0, 7, 0, 8)
    for k, weights in enumerate([(0.5,), (), (1.0, 2.0)]):
        body += struct.pack(f">3fB{len(weights)}f", *SQUARE[k], len(weights), *weights)
    body += struct.pack(">BB3ii", 1, 3, 0, 1, 2, 99)
    scene = load(head.encode() + body)
    np.testing.assert_array_equal(scene.positions, SQUARE[:3])
    np.testing.assert_array_equal(scene.triangles, [(0, 1, 2)])
    assert scene.notes == ()
    assert load(head.encode() + body + b"xyz").notes == ("bytes after the last element ignored: 3",)


@pytest.mark.parametrize("ending", [b"\n", b"\r\n", b"\r"])
def test_line_endings(load, ending: bytes) -> None:
    """Binary data may begin with a byte that looks like a line's end: 0x0a as the first byte of x."""
    x = struct.unpack("<f", b"\x0a\x00\x80\x3f")[0]
    body = struct.pack("<9fB3i", x, 0, 0, 0, 1, 0, 0, 0, 1, 3, 0, 1, 2)
    scene = load(header("binary_little_endian", 3, 1).replace(b"\n", ending) + body)
    assert scene.positions[0, 0] == np.float32(x)
    assert len(load(written("ascii", [(0, 1, 2)]).replace(b"\n", ending)).triangles) == 1


def test_zero_area_triangles_are_dropped_at_any_scale(load) -> None:
    body = "0 0 0\n1e-20 0 0\n0 1e-20 0\n2e-20 0 0\n3 0 1 2\n3 0 1 3\n3 1 1 2\n"
    scene = load(header("ascii", 4, 3) + body.encode())
    np.testing.assert_array_equal(scene.triangles, [(0, 1, 2)])
    np.testing.assert_allclose(scene.normals, [(0, 0, 1)] * 3 + [(0, 0, 0)], atol=1e-7)
    assert scene.notes == ("triangles of zero area dropped: 2 of 3; their vertices stay",)


ASCII = header("ascii", 3, 1)
TRIANGLE = b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
BINARY = header("binary_little_endian", 3, 1)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "empty"),
        (b"ply\n", "no end_header"),
        (b"ply\n" + b"comment x\n" * 20_000 + ASCII[4:] + TRIANGLE, "no end_header in the first 64 kB"),
        (ASCII.replace(b"ply\n", b"plx\n") + TRIANGLE, "expected 'ply'"),
        (ASCII.replace(b"format ascii 1.0\n", b"") + TRIANGLE, "format ascii"),
        (ASCII.replace(b"ascii", b"binary_middle_endian") + TRIANGLE, "line 2"),
        (ASCII.replace(b"vertex 3", b"vertex -5") + TRIANGLE, "element count '-5'"),
        (ASCII.replace(b"vertex 3", b"vertex 4000000000") + TRIANGLE, "element count '4000000000'"),
        (ASCII.replace(b"vertex 3", b"vertex 99999999") + TRIANGLE, "at most 50,000,000"),
        (ASCII.replace(b"vertex 3", b"vertex 49999999") + TRIANGLE, "file holds fewer"),
        (ASCII.replace(b"face 1", b"face 49999999") + TRIANGLE, "file holds fewer"),
        (BINARY.replace(b"vertex 3", b"vertex 49999999") + bytes(99), "file holds fewer"),
        (BINARY.replace(b"face 1", b"face 49999999") + bytes(99), "file holds fewer"),
        (BINARY.replace(b"face 1", b"face 9") + struct.pack("<9fB3i", *range(9), 3, 0, 1, 2), "file holds fewer"),
        (BINARY + struct.pack("<9fB3i", *range(9), 3, 0, 1, 2)[:-1], "a list of 3, which does not fit"),
        (BINARY + struct.pack("<9fB3i", *range(9), 200, 0, 1, 2), "a list of 200"),
        (BINARY.replace(b"uchar int", b"char int") + struct.pack("<9fb3i", *range(9), -3, 0, 1, 2), "a list of -3"),
        (BINARY.replace(b"uchar int", b"float int") + bytes(99), "not understood"),
        (BINARY.replace(b"uchar int", b"uchar float") + bytes(99), "vertex_indices"),
        (written("binary_big_endian", [(0, 1, 2), (0, 1, 2, 3), (0, 1, 2)])[:-5], "record 2 of 'face'"),
        (ASCII.replace(b"float x", b"float y") + TRIANGLE, "'y' is declared twice"),
        (ASCII.replace(b"element face", b"element vertex") + TRIANGLE, "'vertex' is declared twice"),
        (ASCII.replace(b"float x", b"float q") + TRIANGLE, "x, y and z"),
        (ASCII.replace(b"float x", b"list uchar float x") + TRIANGLE, "x, y and z"),
        (ASCII.replace(b"float x", b"float128 x") + TRIANGLE, "not understood"),
        (ASCII.replace(b"vertex_indices", b"corners") + TRIANGLE, "vertex_indices"),
        (ASCII.replace(b"comment", b"remark") + TRIANGLE, "no header line"),
        (ASCII.replace(b"face 1", b"face 0") + TRIANGLE, "only points"),
        (ASCII.replace(b"element face 1\n" + CORNERS.encode(), b"") + TRIANGLE, "only points"),
        (ASCII.replace(b"element face", b"element tristrips") + TRIANGLE, "strips are not read"),
        (ASCII.replace(b"element vertex", b"element point") + TRIANGLE, "no vertex element"),
        (ASCII.replace(b"vertex 3", b"vertex 0") + b"3 0 1 2\n", "no vertices"),
        (ASCII, "file holds fewer"),
        (ASCII + b" \n \n", "file holds fewer"),
        (ASCII + TRIANGLE.replace(b"3 0 1 2", b"3 0 1"), "a list of 3, which does not fit"),
        (ASCII + TRIANGLE + b"7\n", "1 values more"),
        (ASCII + TRIANGLE.replace(b"1 0 0", b"1 zero 0"), "not a number"),
        (ASCII + TRIANGLE.replace(b"1 0 0", b"1 \xff 0"), "not a number"),
        (ASCII + TRIANGLE.replace(b"3 0 1 2", b"2.5 0 1 2"), "a list of 2.5"),
        (ASCII + TRIANGLE.replace(b"3 0 1 2", b"nan 0 1 2"), "a list of nan"),
        (ASCII + TRIANGLE.replace(b"3 0 1 2", b"3 0 1 1.5"), "not a whole number"),
        (ASCII + TRIANGLE.replace(b"3 0 1 2", b"3 0 1 inf"), "not a whole number"),
        (ASCII + TRIANGLE.replace(b"3 0 1 2", b"3 0 1 3"), "triangle 0 uses vertex 3, but there are 3"),
        (ASCII + TRIANGLE.replace(b"3 0 1 2", b"3 0 -1 2"), "triangle 0 uses vertex -1"),
        (ASCII + TRIANGLE.replace(b"3 0 1 2", b"3 0 1 1e300"), "triangle 0 uses vertex"),
        (ASCII + TRIANGLE.replace(b"3 0 1 2", b"3 0 1 1"), "zero area"),
        (ASCII + TRIANGLE.replace(b"3 0 1 2", b"2 0 1"), "no triangles"),
        (ASCII + TRIANGLE.replace(b"1 0 0", b"nan 0 0"), "vertex 1 is at (nan, 0, 0)"),
        (ASCII + TRIANGLE.replace(b"1 0 0", b"1 -inf 0"), "vertex 1 is at (1, -inf, 0)"),
        (ASCII.replace(b"float x", b"double x") + TRIANGLE.replace(b"1 0 0", b"1e39 0 0"), "vertex 1 is at (1e+39"),
        (ASCII.replace(b"end_header\n", b"end_header 0\n") + TRIANGLE, "follows end_header"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)  # fmt: skip
def test_damage_is_refused_in_one_line(load, content: bytes, reason: str) -> None:
    assert reason in refused(load, content)


def test_every_truncation_and_many_mutations_end_in_a_scene_or_a_refusal(tmp_path: Path, rng) -> None:
    seeds = [written(encoding, [(0, 1, 2, 3), (0, 1, 2)]) for encoding in ("ascii", *ORDERS)]
    path = tmp_path / "mesh.ply"
    cases = [seed[:n] for seed in seeds for n in range(1, len(seed), 3)]
    for _ in range(600):
        mutated = bytearray(seeds[rng.integers(3)])
        for _ in range(rng.integers(1, 4)):
            mutated[rng.integers(len(mutated))] = rng.integers(256)
        cases.append(bytes(mutated))
    start = time.perf_counter()
    for case in cases:
        path.write_bytes(case)
        try:
            scene = load_scene(path)
        except InputError:
            continue
        assert np.isfinite(scene.positions).all()
    assert time.perf_counter() - start < 20

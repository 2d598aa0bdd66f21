"""MTL: materials as ours, libraries found, textures upright, what is missing noted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from prelight.material import GREY
from prelight.scene.loading import load_scene
from prelight.scene.obj.mtl import parse_map

from .obj_files import SQUARE, Folder, png


@pytest.fixture
def loaded(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


def test_materials_become_ours(loaded) -> None:
    mtl = b"""
newmtl plain
  Kd 0.5 0.25 0.125   # a comment
  illum 1
  Ks 1 1 1
newmtl shiny
  kd .2
  Ks 0.09 0.09 0.09
  Ns 30
newmtl chrome
  Kd 0.01 0.01 0.01
  Ks 0.9 0.8 0.7
  Ns 1000
newmtl glass
  Kd 0 0 0
  Tf 0.9 0.8 0.7
  Ni 1.45
  illum 7
newmtl veil
  Kd 1 2 -1
  d 0.25
newmtl pbr
  Kd 0.1 0.2 0.3
  Pr 0.4
  Pm 0.75
  Pc 0.5
  Pcr 0.125
  Ke 3 2 1
newmtl plain
  Kd 1 0 0
newmtl broken
  Kd nan 0 0
  Ns many
"""
    names = [b"plain", b"shiny", b"chrome", b"glass", b"veil", b"pbr", b"broken", b"absent"]
    faces = b"".join(b"usemtl %s\nf 1 2 3\n" % name for name in names)
    scene = loaded(b"mtllib m.mtl\n" + SQUARE + faces, {"m.mtl": mtl})
    plain, shiny, chrome, glass, veil, pbr, broken, absent = scene.materials
    assert plain.is_lambertian
    assert plain.colour == (0.5, 0.25, 0.125)
    assert shiny.colour == (0.2, 0.2, 0.2)
    assert ((shiny.ior - 1) / (shiny.ior + 1)) ** 2 == pytest.approx(0.09)
    assert shiny.roughness**4 == pytest.approx(2 / 32)  # α² = 2/(Ns + 2), α = roughness²
    assert (chrome.metallic, chrome.colour) == (1, (0.9, 0.8, 0.7))
    assert (glass.transmission, glass.ior, glass.colour) == (1, 1.45, (0.9, 0.8, 0.7))
    assert (veil.transmission, veil.colour) == (0.75, (1, 1, 0))
    assert (pbr.roughness, pbr.metallic, pbr.clearcoat, pbr.clearcoat_roughness) == (0.4, 0.75, 0.5, 0.125)
    assert pbr.emission == (3, 2, 1)
    assert broken.colour == absent.colour == GREY
    np.testing.assert_allclose(scene.albedo[::3], [m.colour for m in scene.materials], rtol=1e-6)
    assert "materials not described, grey used: 'absent'" in scene.notes
    assert any("Kd without numbers (1)" in note and "Kd outside 0 to 1" in note for note in scene.notes)


@pytest.mark.parametrize(
    ("statement", "files"),
    [
        (b"mtllib a.mtl", {"a.mtl": b"newmtl m\nKd 1 0 0"}),
        (b"mtllib ./a.mtl  ", {"a.mtl": b"newmtl m\nKd 1 0 0"}),
        (b"mtllib my own.mtl", {"my own.mtl": b"newmtl m\nKd 1 0 0"}),
        (b"mtllib absent.mtl a.mtl", {"a.mtl": b"newmtl m\nKd 1 0 0"}),
        (b"mtllib a.mtl\nmtllib b.mtl", {"a.mtl": b"newmtl m\nKd 1 0 0", "b.mtl": b"newmtl m\nKd 0 1 0"}),
        (b"mtllib sub\\a.mtl", {"sub/a.mtl": b"\xef\xbb\xbfnewmtl m\r\nKd 1 0 0\r\n"}),
    ],
)
def test_libraries_are_found(tmp_path: Path, statement: bytes, files: dict[str, bytes]) -> None:
    """Also when they are named after the faces, as some programs do."""
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    path = tmp_path / "a.obj"
    for text in (statement + b"\n" + SQUARE, SQUARE):
        path.write_bytes(text + b"usemtl m\nf 1 2 3\n" + statement)
        assert load_scene(path).materials[0].colour == (1, 0, 0)


def test_libraries_beyond_the_limits_are_not_read(loaded: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    text = b"".join(b"mtllib %d.mtl\n" % k for k in range(9)) + SQUARE + b"usemtl m\nf 1 2 3\n"
    files = {f"{k}.mtl": b"newmtl m\nKd 1 0 0\n" for k in range(9)}
    assert loaded(text, files).notes == ("more than 8 material libraries: the others not read",)
    monkeypatch.setattr("prelight.scene.obj.mtl._MOST_TEXT", 40)
    notes = loaded(text, files).notes
    assert notes[0] == "material library '2.mtl' not read: 18 bytes, at most 4 bytes are read"


def test_names_with_spaces(loaded) -> None:
    scene = loaded(
        b"mtllib m.mtl\n" + SQUARE + b"usemtl a b  c   \nf 1 2 3\n", {"m.mtl": b"newmtl  a b  c \nKd 1 0 0\n"}
    )
    assert scene.materials[0].name == "a b  c"
    assert scene.materials[0].colour == (1, 0, 0)


def test_a_texture_stands_upright(loaded) -> None:
    """OBJ counts v upwards: the picture's top row belongs to v = 1."""
    rows = np.zeros((2, 2, 3))
    rows[0, 0], rows[0, 1], rows[1, 0] = (255, 0, 0), (0, 255, 0), (0, 0, 255)
    mtl = b"newmtl m\nKd 0.5 0.5 0.5\nmap_Kd my picture.png\nbump b.png\nmap_Ks x.png\n"
    quarter = SQUARE.replace(
        b"vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1", b"vt .25 .25\nvt .75 .25\nvt .75 .75\nvt .25 .75"
    )
    files = {"m.mtl": mtl, "my picture.png": png(rows)}
    scene = loaded(b"mtllib m.mtl\n" + quarter + b"usemtl m\nf 1/1 2/2 3/3 4/4\n", files)
    np.testing.assert_allclose(scene.albedo, [(0, 0, 0.5), (0, 0, 0), (0, 0.5, 0), (0.5, 0, 0)], atol=1e-6)
    np.testing.assert_array_equal(scene.tint, np.full((4, 3), 0.5, np.float32))
    assert scene.notes == ("of materials not used: bump (1), map_ks (1)",)
    turned = mtl.replace(b"map_Kd", b"map_Kd -s -1 1 1 -o 0.5 0 -clamp on")
    scene = loaded(b"mtllib m.mtl\n" + quarter + b"usemtl m\nf 1/1 2/2 3/3 4/4\n", {"m.mtl": turned})
    np.testing.assert_allclose(scene.albedo, [(0, 0, 0.5), (0, 0, 0), (0, 0.5, 0), (0.5, 0, 0)], atol=1e-6)
    assert "-clamp of a map (1)" in scene.notes[0]


@pytest.mark.parametrize(
    ("rest", "file", "scale", "offset"),
    [
        ("diffuse.jpg", "diffuse.jpg", (1, 1), (0, 0)),
        ("-o 0.1 diffuse.jpg", "diffuse.jpg", (1, 1), (0.1, 0)),
        ("-s 0.1 0.2 0.3 a b.jpg", "a b.jpg", (0.1, 0.2), (0, 0)),
        ("-s 2 3 4 5", "5", (2, 3), (0, 0)),
        ("-s 2 7", "7", (2, 1), (0, 0)),
        ("-blendu on -imfchan r -mm 0 1 x.png -bm 1.5", "x.png", (1, 1), (0, 0)),
        ("-type sphere -clamp off x.png", "x.png", (1, 1), (0, 0)),
        ("-s", "", (1, 1), (0, 0)),
    ],
)
def test_options_of_maps(rest: str, file: str, scale: tuple, offset: tuple) -> None:
    found = parse_map(rest)
    assert (found.file, found.scale, found.offset) == (file, scale, offset)


def test_missing_and_bad_textures_cost_a_note(loaded) -> None:
    mtl = b"newmtl a\nmap_Kd absent.png\nnewmtl b\nKd 1 0 0\nmap_Kd bad.png\nnewmtl c\nmap_Kd good.png\n"
    faces = b"usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\nusemtl c\nf 1 2 3\n"
    files = {"bad.png": png(np.zeros((9, 9, 3)))[:60], "good.png": png(np.full((1, 1, 3), 255))}
    scene = loaded(b"mtllib m.mtl\n" + SQUARE + faces, {**files, "m.mtl": mtl})
    assert [m.colour_texture for m in scene.materials] == [None, None, 0]
    np.testing.assert_allclose(scene.albedo, np.repeat([GREY, (1, 0, 0), GREY], 3, axis=0), atol=1e-6)
    assert scene.notes[0] == "texture 'absent.png' not read (no such file): plain colour used"
    assert scene.notes[1].startswith("texture 'bad.png' not read (truncated picture")
    assert "vertices under a texture without coordinates: 3; (0, 0) used" in scene.notes

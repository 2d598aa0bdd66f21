"""OpenEXR pictures: what is read, what is refused, and a decoder that may die without harm."""

from __future__ import annotations

import ast
import io
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import given
from hypothesis import strategies as st

from prelight.errors import InputError, OutputError
from prelight.images import exr_child, exr_header, formats, openexr

SCANLINES = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
REC2020 = (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329)


def picture_of(rng: np.random.Generator, height: int = 20, width: int = 33) -> np.ndarray:
    return rng.lognormal(0.0, 2.0, (height, width, 3)).astype(np.float32)


def file_of(channels: dict[str, np.ndarray], **header: object) -> bytes:
    out = io.BytesIO()
    OpenEXR.File({**SCANLINES, **header}, channels).write(out)
    return out.getvalue()


def read(folder: Path, content: bytes) -> np.ndarray:
    path = folder / "map of a sky.exr"
    path.write_bytes(content)
    return formats.read_radiance_map(path)


def window(*corners: int) -> tuple[np.ndarray, np.ndarray]:
    return np.array(corners[:2], np.int32), np.array(corners[2:], np.int32)


def never(*_: object, **__: object) -> None:
    raise AssertionError("no decoder may be started for this file")


def test_what_is_written_reads_back_and_opens_elsewhere(tmp_path, rng) -> None:
    picture = picture_of(rng)
    formats.write_exr(tmp_path / "a.exr", picture)
    np.testing.assert_array_equal(formats.read_radiance_map(tmp_path / "a.exr"), picture)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert set(file.channels()) == {"R", "G", "B"}
        np.testing.assert_array_equal(file.channels()["G"].pixels, picture[..., 1])
        assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.uint32])
@pytest.mark.parametrize("compression", [OpenEXR.NO_COMPRESSION, OpenEXR.PIZ_COMPRESSION])
def test_every_type_of_value_is_read(tmp_path, rng, kind, compression) -> None:
    picture = (picture_of(rng) if kind != np.uint32 else rng.integers(0, 1 << 24, (4, 5, 3))).astype(kind)
    channels = {name: np.ascontiguousarray(picture[..., k]) for k, name in enumerate("RGB")}
    channels["A"] = np.zeros(picture.shape[:2], np.float16)
    got = read(tmp_path, file_of(channels, compression=compression))
    assert got.dtype == np.float32
    assert got.flags.writeable
    assert got.flags.c_contiguous
    np.testing.assert_array_equal(got, picture.astype(np.float32))


def test_tiles_and_grey_are_read(tmp_path, rng) -> None:
    tiles = OpenEXR.TileDescription()
    tiles.xSize, tiles.ySize, tiles.mode = 16, 8, OpenEXR.ONE_LEVEL
    picture = picture_of(rng)
    tiled = file_of({"RGB": picture}, type=OpenEXR.tiledimage, tiles=tiles)
    np.testing.assert_array_equal(read(tmp_path, tiled), picture)
    grey = read(tmp_path, file_of({"Y": picture[..., 0].copy()}, chromaticities=REC2020))
    np.testing.assert_array_equal(grey, np.repeat(picture[..., :1], 3, axis=2))


def test_of_several_levels_the_finest_is_read(tmp_path) -> None:
    """Written by hand from the description of the format: no library here writes such files."""

    def attribute(name: str, kind: str, value: bytes) -> bytes:
        return f"{name}\0{kind}\0".encode() + struct.pack("<i", len(value)) + value

    channels = (
        b"".join(name + b"\0" + struct.pack("<iiii", 2, 0, 1, 1) for name in (b"B", b"G", b"R")) + b"\0"
    )
    box = struct.pack("<4i", 0, 0, 3, 3)
    header = struct.pack("<II", 20000630, 2 | 0x200)
    header += attribute("channels", "chlist", channels) + attribute("compression", "compression", b"\0")
    header += attribute("dataWindow", "box2i", box) + attribute("displayWindow", "box2i", box)
    header += attribute("lineOrder", "lineOrder", b"\0")
    header += attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
    header += attribute("screenWindowCenter", "v2f", bytes(8))
    header += attribute("screenWindowWidth", "float", struct.pack("<f", 1))
    header += attribute("tiles", "tiledesc", struct.pack("<IIB", 4, 4, 1)) + b"\0"
    levels = [
        np.arange(side * side * 3, dtype="<f4").reshape(side, side, 3) + 100 * side for side in (4, 2, 1)
    ]
    offsets, chunks, at = b"", b"", len(header) + 3 * 8
    for number, level in enumerate(levels):
        pixels = level[..., ::-1].transpose(0, 2, 1).tobytes()  # each line: all of B, of G, of R
        chunk = struct.pack("<5i", 0, 0, number, number, len(pixels)) + pixels
        offsets += struct.pack("<Q", at)
        chunks, at = chunks + chunk, at + len(chunk)
    np.testing.assert_array_equal(read(tmp_path, header + offsets + chunks), levels[0])


def test_the_first_part_with_colours_is_read(tmp_path, rng) -> None:
    picture, depth = picture_of(rng), np.full((20, 33), 2.0, np.float32)
    out = io.BytesIO()
    OpenEXR.File(
        [
            OpenEXR.Part(dict(SCANLINES), {"Z": depth}, "depth"),
            OpenEXR.Part(dict(SCANLINES), {"RGB": picture}, "beauty"),
        ]
    ).write(out)
    np.testing.assert_array_equal(read(tmp_path, out.getvalue()), picture)


def test_a_damaged_part_is_not_replaced_by_the_next(tmp_path, rng) -> None:
    out = io.BytesIO()
    OpenEXR.File(
        [OpenEXR.Part(dict(SCANLINES), {"RGB": picture_of(rng)}, name) for name in ("left", "right")]
    ).write(out)
    content = bytearray(out.getvalue())
    read(tmp_path, bytes(content))
    chunk = content.index(
        struct.pack("<iii", 0, 0, 16 * 33 * 12)
    )  # of part 0, line 0: noise is stored as it is
    content[chunk + 4] = 99
    with pytest.raises(InputError, match="damaged or truncated"):
        read(tmp_path, bytes(content))


def test_a_large_data_window_is_cropped_to_the_display(tmp_path, rng) -> None:
    picture = picture_of(rng)
    content = file_of({"RGB": picture}, dataWindow=window(-3, -2, 29, 17), displayWindow=window(0, 0, 19, 9))
    np.testing.assert_array_equal(read(tmp_path, content), picture[2:12, 3:23])


def test_rows_keep_their_order_over_many_blocks(tmp_path, monkeypatch, rng) -> None:
    script = tmp_path / "child.py"
    script.write_text(Path(exr_child.__file__).read_text().replace("1 << 20", "100"))
    monkeypatch.setattr(openexr, "_CHILD", str(script))
    picture = picture_of(rng, 50, 33)
    np.testing.assert_array_equal(read(tmp_path, file_of({"RGB": picture})), picture)


def test_other_primaries_are_converted(tmp_path) -> None:
    picture = np.array([[[1, 1, 1], [1, 0.5, 0.5], [1, 0, 0]]], np.float32)
    got = read(tmp_path, file_of({"RGB": picture}, chromaticities=REC2020))[0]
    red = np.array([1.6605, -0.1246, -0.0182])  # of Rec.2020 in Rec.709, ITU-R BT.2087
    np.testing.assert_allclose(got[:2], [[1, 1, 1], 0.5 + 0.5 * red], atol=2e-4)
    np.testing.assert_allclose(got[2], [1.6605, 0, 0], atol=2e-4)


REFUSED = {
    "layers only": (lambda p: {"sky.R": p, "sky.G": p, "sky.B": p}, {}, "outside any layer"),
    "no colours": (lambda p: {"Z": p}, {}, "channels Z, expected R, G and B"),
    "luminance-chroma": (lambda p: {"Y": p, "RY": p, "BY": p}, {}, "luminance-chroma"),
    "cropped": (lambda p: {"Y": p}, {"displayWindow": window(0, 0, 40, 40)}, "save the whole map"),
    "nonsense primaries": (
        lambda p: {"R": p, "G": p, "B": p}, {"chromaticities": (0.3,) * 8}, "span no colour space",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_read_is_refused_before_decoding(tmp_path, monkeypatch, rng, case) -> None:
    channels, header, reason = REFUSED[case]
    monkeypatch.setattr(subprocess, "run", never)
    with pytest.raises(InputError, match=reason):
        read(tmp_path, file_of(channels(picture_of(rng)[..., 0].copy()), **header))


def test_values_that_no_light_has_are_refused(tmp_path, rng) -> None:
    picture = picture_of(rng)
    picture[3, 4, 0], picture[7, 1, 2] = np.inf, -1.0
    with pytest.raises(InputError, match=r"1 infinite, 1 negative.*row 3, column 4"):
        read(tmp_path, file_of({"RGB": picture}))


def with_box(content: bytes, name: bytes, corners: tuple[int, ...]) -> bytes:
    at = content.index(name + b"\0box2i\0") + len(name) + 11
    return content[:at] + struct.pack("<4i", *corners) + content[at + 16 :]


@pytest.mark.parametrize(
    ("corners", "reason"),
    [
        ((0, 0, 12_000, 12_000), "cut short"),
        ((0, 0, 31_999, 5_999), "cut short"),
        ((0, 0, 40_000, 10), "at most 32,768"),
        ((-(2**31), -(2**31), 2**31 - 1, 2**31 - 1), "at most 32,768"),
        ((5, 5, 4, 4), "at least 1×1"),
    ],
)
@pytest.mark.parametrize("compression", [OpenEXR.NO_COMPRESSION, OpenEXR.ZIP_COMPRESSION])
def test_a_size_that_lies_is_refused_before_decoding(
    tmp_path, monkeypatch, rng, corners, reason, compression
) -> None:
    content = file_of({"RGB": picture_of(rng)}, compression=compression)
    for name in (b"dataWindow", b"displayWindow"):
        content = with_box(content, name, corners)
    monkeypatch.setattr(subprocess, "run", never)
    with pytest.raises(InputError, match=reason):
        read(tmp_path, content)


def test_a_file_cut_short_is_refused(tmp_path, rng) -> None:
    whole = file_of({"RGB": picture_of(rng)})
    for length in (len(whole) - 1, len(whole) // 2, whole.index(b"dataWindow") + 5, 9, 4):
        with pytest.raises(InputError):
            read(tmp_path, whole[:length])


def test_damaged_pixels_are_refused(tmp_path, rng) -> None:
    whole = bytearray(file_of({"RGB": np.ones((40, 40, 3), np.float32)}))
    whole[-30:-10] = bytes(20)
    with pytest.raises(InputError, match="damaged or truncated OpenEXR"):
        read(tmp_path, bytes(whole))


@given(st.data())
def test_a_changed_header_is_parsed_or_refused(data) -> None:
    whole = bytearray(file_of({"RGB": np.ones((3, 4, 3), np.float32)}))
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(4, 360))
        whole[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=4))
    try:
        parts = exr_header.read_parts("map", bytes(whole))
    except InputError:
        return
    assert all(0 < part.pixels <= 192 * 1024 * 1024 for part in parts)


CHILDREN = {
    "dies": ("import os; os.abort()", InputError, "the decoder died .signal 6"),
    "fails": ("raise SystemExit(3)", InputError, "damaged or truncated"),
    "is late": ("import time; time.sleep(30)", InputError, "not decoded within 1 s"),
    "writes too little": ("", InputError, "damaged or truncated"),
    "has no room": ("raise SystemExit(6)", OutputError, "no room"),
}


@pytest.mark.parametrize("case", CHILDREN)
def test_whatever_happens_to_the_decoder_ends_in_one_line(tmp_path, monkeypatch, case) -> None:
    code, error, reason = CHILDREN[case]
    (tmp_path / "child.py").write_text(code)
    monkeypatch.setattr(openexr, "_CHILD", str(tmp_path / "child.py"))
    monkeypatch.setattr(openexr, "_SECONDS", 1.0)
    with pytest.raises(error, match=reason):
        read(tmp_path, file_of({"RGB": np.ones((3, 4, 3), np.float32)}))


def test_the_decoder_has_bounded_memory_and_time(tmp_path) -> None:
    folder = str(Path(exr_child.__file__).parent)
    programs = (
        "bytearray(1 << 30)",
        "while True: pass",
        "os.write(os.open('large', os.O_CREAT | os.O_WRONLY), bytes(300)) == 300 or exit(1)",
    )
    for program in programs:
        run = subprocess.run(
            [
                sys.executable,
                "-c",
                f"import os, sys; sys.path.insert(0, {folder!r}); import exr_child\n"
                f"exr_child._limit(1 << 29, 1, 100)\n{program}",
            ],
            capture_output=True,
            check=False,
            timeout=20,
            cwd=tmp_path,
        )
        assert run.returncode != 0
        assert b"ModuleNotFound" not in run.stderr


def test_the_decoder_starts_without_prelight() -> None:
    tree = ast.parse(Path(exr_child.__file__).read_text())
    modules = {
        module
        for node in ast.walk(tree)
        for module in ([a.name for a in node.names] if isinstance(node, ast.Import) else [])
        + ([node.module] if isinstance(node, ast.ImportFrom) else [])
    }
    assert modules <= {"__future__", "contextlib", "json", "os", "sys", "resource", "numpy", "OpenEXR"}


def test_a_public_map_reads_as_in_this_process(data) -> None:
    path = data / "probes" / "grace_latlong.exr"
    with OpenEXR.File(str(path), separate_channels=True) as file:
        theirs = np.stack([file.channels()[name].pixels for name in "RGB"], axis=2).astype(np.float32)
    ours = formats.read_radiance_map(path)
    np.testing.assert_array_equal(ours, theirs)
    assert ours.shape == (512, 1024, 3)
    assert ours.max() == pytest.approx(18.375)

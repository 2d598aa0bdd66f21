"""Textures from files: every kind as 8-bit RGB, damage and bombs refused in one line before they cost anything."""

from __future__ import annotations

import io
import json
import struct
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from prelight.errors import InputError
from prelight.images.textures import read_texture, sample

from .corpus import faults, in_child


def encoded(image: Image.Image, kind: str, **options: object) -> bytes:
    out = io.BytesIO()
    image.save(out, kind, **options)
    return out.getvalue()


@pytest.fixture
def pixels(rng: np.random.Generator) -> np.ndarray:
    return rng.integers(0, 256, (5, 7, 3), np.uint8)


def refused(data: bytes, name: str = "a.png") -> str:
    with pytest.raises(InputError) as caught:
        read_texture(data, name=name)
    message = str(caught.value)
    assert message.startswith(f"{name}: ")
    assert message.isprintable()
    return message


@pytest.mark.parametrize(("kind", "name"), [("PNG", "x"), ("BMP", "x.png"), ("TGA", "a.TGA")])
def test_lossless_kinds_are_told_by_their_bytes(pixels: np.ndarray, kind: str, name: str) -> None:
    found = read_texture(encoded(Image.fromarray(pixels), kind), name=name)
    np.testing.assert_array_equal(found, pixels)
    assert found.dtype == np.uint8
    assert found.flags.c_contiguous
    found[0] = 0  # the caller's own


def test_run_lengths_of_tga(pixels: np.ndarray) -> None:
    data = encoded(Image.fromarray(pixels), "TGA", compression="tga_rle")
    np.testing.assert_array_equal(read_texture(data, name="a.tga"), pixels)


@pytest.mark.parametrize("mode", ["RGB", "L", "CMYK"])
def test_jpeg(mode: str) -> None:
    smooth = np.broadcast_to(np.linspace(40, 200, 32, dtype=np.uint8)[:, None, None], (32, 32, 3))
    image = Image.fromarray(np.ascontiguousarray(smooth)).convert(mode)
    found = read_texture(encoded(image, "JPEG", quality=95), name="a.jpg")
    assert np.abs(found.astype(int) - smooth).max() <= 6


@pytest.mark.parametrize("mode", ["L", "1", "P", "RGBA", "LA", "PA"])
def test_other_modes_become_rgb(pixels: np.ndarray, mode: str) -> None:
    image = Image.fromarray(pixels).convert(mode)
    expected = np.asarray(image.convert("RGB"))
    data = (
        encoded(image, "PNG")
        if mode != "PA"
        else encoded(image.convert("P"), "PNG", transparency=b"\x10\x80")
    )
    np.testing.assert_array_equal(read_texture(data, name="x"), expected)


def test_16_bits_become_8_and_not_white() -> None:
    wide = np.array([[0, 128, 257, 32896, 65535]], np.uint16)
    found = read_texture(encoded(Image.fromarray(wide), "PNG"), name="x")
    np.testing.assert_array_equal(found, np.repeat([[[0], [0], [1], [128], [255]]], 3, axis=2))


def test_the_first_row_is_v_0() -> None:
    picture = np.zeros((2, 2, 3), np.uint8)
    picture[0, 1] = 255
    found = sample(
        read_texture(encoded(Image.fromarray(picture), "PNG"), name="x"),
        np.array([(0.75, 0.25), (0.25, 0.75)]),
    )
    np.testing.assert_array_equal(found[:, 0], [255, 0])


# ---- refusals ----


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "BMP", "TGA"])
def test_no_beginning_of_a_file_is_a_picture(pixels: np.ndarray, kind: str) -> None:
    """Wherever it is cut off; but no pixel is in a JPEG's last marker, a BMP's padding, a TGA's footer."""
    data = encoded(Image.fromarray(pixels), kind)
    spare = {"PNG": 0, "JPEG": 2, "BMP": 3, "TGA": 26 if data.endswith(b"TRUEVISION-XFILE.\0") else 0}[kind]
    for end in range(len(data) - spare):
        refused(data[:end], "a.tga" if kind == "TGA" else "a")


def chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png(width: int, height: int, packed: bytes, extra: bytes = b"") -> bytes:
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + extra + chunk(b"IDAT", packed) + chunk(b"IEND", b"")
    )


def sized_jpeg(width: int, height: int, pixels: np.ndarray) -> bytes:
    data = bytearray(encoded(Image.fromarray(pixels), "JPEG"))
    at = data.index(b"\xff\xc0")
    data[at + 5 : at + 9] = struct.pack(">HH", height, width)
    return bytes(data)


def test_L6_bombs_are_refused_before_they_are_decoded(pixels: np.ndarray) -> None:
    """By the size in the header, and by what so few bytes can hold at all."""
    zeros = zlib.compress(bytes(10_000_000), 9)
    bombs = [
        (png(60_000, 60_000, zeros), "60,000×60,000 pixels, at most 16,384 a side and 64 Mpx"),
        (png(16_385, 1, zeros), "16,385×1 pixels"),
        (png(16_000, 16_000, zeros), "16,000×16,000 pixels"),
        (png(8_000, 8_000, zeros), "claims 8,000×8,000 pixels in 9,"),
        (png(0, 5, zeros), "damaged"),
        (sized_jpeg(65_500, 65_500, pixels), "65,500×65,500 pixels"),
        (sized_jpeg(8_000, 8_000, pixels), "claims 8,000×8,000"),
        (b"BM" + struct.pack("<IHHIIiiHHIIiiII", 0, 0, 0, 54, 40, 60_000, 60_000, 1, 24, 0, 0, 1, 1, 0, 0),
         "60,000×60,000"),
    ]  # fmt: skip
    read_texture(encoded(Image.fromarray(pixels), "PNG"), name="x")
    for data, reason in bombs:
        tracemalloc.start()
        message = refused(data)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert reason in message
        assert peak < 1 << 20


def test_other_bombs_are_refused(pixels: np.ndarray) -> None:
    text = chunk(b"zTXt", b"a\0\0" + zlib.compress(bytes(100_000_000), 9))
    assert "damaged" in refused(png(1, 1, zlib.compress(bytes(4)), text))
    scans = encoded(Image.fromarray(pixels), "JPEG", progressive=True)
    assert "more than 100 scans" in refused(scans + b"\xff\xda" * 100)
    runs = bytearray(encoded(Image.fromarray(pixels).convert("P"), "BMP"))
    runs[30] = 1
    assert "a compressed BMP" in refused(bytes(runs))


@pytest.mark.parametrize(
    ("data", "name"),
    [(b"", "a.png"), (b"GIF89a", "a.gif"), (b"II*\0", "a.tif"), (b"RIFF0000WEBP", "a.webp"), (b"<svg/>", "a.svg"),
     (b"%!PS", "a.eps"), (b"\x89PNG", "a.png"), (b"qoif", "a.tga.png")],
)  # fmt: skip
def test_other_kinds_are_refused(data: bytes, name: str) -> None:
    assert "neither PNG nor JPEG, BMP or TGA; save the texture as PNG" in refused(data, name)


def test_pictures_of_the_corpus(data: Path, pixels: np.ndarray) -> None:
    """All of them through the decoder, each in a child: a picture or one line, at little cost."""
    index = data / "bad" / "INDEX.jsonl"
    if not index.exists():
        pytest.skip("no corpus of bad files in the test data")
    rows = [json.loads(line) for line in index.read_text(encoding="utf-8").splitlines()]
    paths = [data / "bad" / row["path"] for row in rows if row["kind"] == "image"]
    assert len(paths) >= 30
    for kind in ("PNG", "JPEG"):
        read_texture(encoded(Image.fromarray(pixels), kind), name="x")
    idle = in_child(lambda: None, data).growth
    wrong, seen = {}, set()
    for path in paths:
        outcome = in_child(lambda path=path: read_texture(path.read_bytes(), name=str(path)), path.parent)
        wrong[path.name] = faults(outcome, path, idle)
        seen.add(outcome.kind)
    assert {name: found for name, found in wrong.items() if found} == {}
    assert seen == {"scene", "refused"}

"""Which files are read, what is said of the others, and pictures written whole or not at all."""

from __future__ import annotations

import io
import json
import os
import time

import numpy as np
import pytest
from PIL import Image

from prelight.errors import InputError, OutputError
from prelight.images import formats, map_checks

OTHERS = {
    "png": (b"\x89PNG\r\n\x1a\n", "a PNG file, an 8-bit display image; an environment needs HDR or EXR"),
    "jpeg": (b"\xff\xd8\xff\xe0", "a JPEG file, an 8-bit display image; an environment needs HDR or EXR"),
    "tiff": (b"II*\0", "TIFF"),
    "text": (b"hello", "neither of the two"),
    "one byte": (b"#", "neither of the two"),
    "empty": (b"", "empty"),
}


@pytest.mark.parametrize("case", OTHERS)
def test_other_files_are_refused_whatever_their_name(tmp_path, case) -> None:
    content, reason = OTHERS[case]
    for name in ("map.hdr", "map.exr"):
        (tmp_path / name).write_bytes(content + bytes(100) * bool(content[1:]))
        with pytest.raises(InputError, match=reason):
            formats.read_radiance_map(tmp_path / name)


def test_the_content_counts_not_the_name(tmp_path, rng) -> None:
    picture = rng.random((4, 9, 3), np.float32)
    formats.write_exr(tmp_path / "a.hdr", picture)
    np.testing.assert_array_equal(formats.read_radiance_map(tmp_path / "a.hdr"), picture)


def test_what_is_not_a_regular_file_is_refused_at_once(tmp_path) -> None:
    os.mkfifo(tmp_path / "pipe.hdr")
    (tmp_path / "dangling.hdr").symlink_to(tmp_path / "nothing")
    (tmp_path / "folder.hdr").mkdir()
    begin = time.monotonic()
    for name in ("pipe.hdr", "dangling.hdr", "folder.hdr", "missing.hdr", "/dev/zero", "a\0b.hdr"):
        with pytest.raises(InputError):
            formats.read_radiance_map(tmp_path / name)
    assert time.monotonic() - begin < 2


def test_a_file_too_large_is_not_read(tmp_path) -> None:
    with open(tmp_path / "large.hdr", "wb") as file:
        file.write(b"#?RADIANCE\n")
        file.truncate(1 << 42)  # sparse
    with pytest.raises(InputError, match="at most"):
        formats.read_radiance_map(tmp_path / "large.hdr")


def test_png_keeps_every_byte(tmp_path, rng) -> None:
    display = rng.integers(0, 256, (30, 20, 3), np.uint8)
    formats.write_png(tmp_path / "a.png", display)
    with Image.open(tmp_path / "a.png") as image:
        assert image.mode == "RGB"
        assert image.info["srgb"] == 0
        np.testing.assert_array_equal(np.asarray(image), display)


def test_npy_keeps_every_bit(tmp_path, rng) -> None:
    array = rng.random((7, 3)).astype(np.float32)[::2]
    formats.write_npy(tmp_path / "a.npy", array)
    again = np.load(tmp_path / "a.npy", allow_pickle=False)
    assert again.dtype == np.float32
    np.testing.assert_array_equal(again, array)
    with pytest.raises(InputError, match="objects"):
        formats.write_npy(tmp_path / "b.npy", np.array([{}], dtype=object))


@pytest.mark.parametrize(
    "array", [np.zeros((3, 4)), np.zeros((3, 4, 4)), np.zeros((0, 4, 3)), np.zeros((3, 4, 3))]
)
def test_arrays_that_are_no_picture_are_refused(tmp_path, array) -> None:
    for write, dtype in (
        (formats.write_exr, np.float32),
        (formats.write_hdr, np.float32),
        (formats.write_png, np.uint8),
    ):
        wrong = array.astype(np.float64 if array.shape == (3, 4, 3) else dtype)
        with pytest.raises(InputError, match="cannot write"):
            write(tmp_path / "a", wrong)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_missing_is_one_line(tmp_path) -> None:
    with pytest.raises(OutputError, match="no such file"):
        formats.write_png(tmp_path / "nowhere" / "a.png", np.zeros((2, 2, 3), np.uint8))


def peak_megabytes() -> float:
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmHWM")) / 1024


def test_hostile_images_end_in_one_line(data, tmp_path) -> None:
    """A sample of the public collection of images that broke decoders; all of them with PRELIGHT_ALL=1."""
    index = data / "bad" / "INDEX.jsonl"
    if not index.is_file():
        pytest.skip("no bad/INDEX.jsonl in the test data")
    entries = [json.loads(line) for line in io.StringIO(index.read_text())]
    images = [entry for entry in entries if entry["kind"] in ("hdr", "exr", "image")]
    if not os.environ.get("PRELIGHT_ALL"):
        images = [entry for i, entry in enumerate(images) if i % 4 == 0 or "synthetic" in entry["path"]]
    assert len(images) >= 60
    formats.write_hdr(tmp_path / "first.hdr", np.ones((2, 9, 3), np.float32))
    formats.read_radiance_map(tmp_path / "first.hdr")  # compiles, which takes memory of its own
    before, messages = peak_megabytes(), []
    for entry in images:
        begin = time.monotonic()
        try:
            picture = formats.read_radiance_map(data / "bad" / entry["path"])
        except InputError as error:
            messages.append(str(error))
        else:
            assert entry["expect"] != "reject"
            map_checks.check_radiance(entry["path"], picture)
        assert time.monotonic() - begin < 5, entry  # 0.2 s where nobody else uses the machine
    assert len(messages) > 50
    assert all("\n" not in message and len(message) <= 300 for message in messages)
    assert peak_megabytes() - before < 64

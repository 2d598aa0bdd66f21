"""Bakes that were damaged: found out, or harmless; never wrong light, never a crash (reliability P5)."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from prelight.encoding.sparse_tiles import PANEL
from prelight.errors import DamagedBakeError
from prelight.storage.bake import Bake
from prelight.storage.manifest import NAME

from .disk import copy, light_of, quick_bake, refusal, tree

LAYER = "layers/environment"
FLIPS_IN_CHUNKS, FLIPS_IN_MANIFEST = 300, 200


@pytest.fixture(scope="module")
def original(tmp_path_factory) -> Path:
    return quick_bake(tmp_path_factory.mktemp("original") / "ball.prelight").path


@pytest.fixture(scope="module")
def chunks(original) -> list[str]:
    return sorted(Bake.open(original).manifest.chunks)


@pytest.fixture(scope="module")
def expected(original) -> np.ndarray:
    return light_of(original)


@pytest.fixture
def bake(original, tmp_path) -> Path:
    """A copy to be damaged."""
    return copy(original, tmp_path / "ball.prelight")


def assert_harmless_or_found(path: Path, expected: np.ndarray, *, names: str = "") -> bool:
    """Whether the damage was found; if not, the light is the same to the bit."""
    error = refusal(lambda: np.testing.assert_array_equal(light_of(path), expected))
    if error is not None:
        assert isinstance(error, DamagedBakeError)
        assert names in str(error)
    return error is not None


def test_bits_that_flip_in_chunks(bake, chunks, expected, rng):
    for _ in range(FLIPS_IN_CHUNKS):
        key = chunks[rng.integers(len(chunks))]
        path = bake / key
        data = bytearray(path.read_bytes())
        whole = bytes(data)
        data[rng.integers(len(data))] ^= 1 << rng.integers(8)
        path.write_bytes(data)
        assert assert_harmless_or_found(bake, expected, names=key), key
        error = refusal(lambda: list(Bake.open(bake).verify()))
        assert isinstance(error, DamagedBakeError)
        assert key in str(error)
        path.write_bytes(whole)
    np.testing.assert_array_equal(light_of(bake), expected)


def test_bits_that_flip_in_the_manifest(bake, expected, rng):
    whole = (bake / NAME).read_bytes()
    found = 0
    for _ in range(FLIPS_IN_MANIFEST):
        data = bytearray(whole)
        data[rng.integers(len(data))] ^= 1 << rng.integers(8)
        (bake / NAME).write_bytes(data)
        found += assert_harmless_or_found(bake, expected)
    assert found > 0.99 * FLIPS_IN_MANIFEST  # the case of an escaped letter's digits may change, say
    for end in (0, 1, 100, len(whole) // 2, len(whole) - 1):
        (bake / NAME).write_bytes(whole[:end])
        assert assert_harmless_or_found(bake, expected, names="manifest")
    for tail in (b"\0", b"}", b"{}", b" \n"):
        (bake / NAME).write_bytes(whole + tail)
        assert assert_harmless_or_found(bake, expected) or tail.isspace()


def test_bits_that_flip_in_zarr_metadata(bake, expected):
    """Other programs read it, we do not; `verify` checks it all the same."""
    for k, name in enumerate(Bake.open(bake).manifest.metadata()):
        path = bake / name
        whole = path.read_bytes()
        damages = (whole[:-1], whole + b" ", whole.replace(b"3", b"2"), b"", None)
        for damage in (damages[k % 5], damages[(k + 2) % 5]):
            path.unlink() if damage is None else path.write_bytes(damage)
            assert not assert_harmless_or_found(bake, expected)
            error = refusal(lambda: list(Bake.open(bake).verify()))
            assert isinstance(error, DamagedBakeError)
            assert name in str(error)
        path.write_bytes(whole)
    assert refusal(lambda: list(Bake.open(bake).verify())) is None


DAMAGES: dict[str, Callable[[bytes], bytes | None]] = {
    "deleted": lambda data: None,
    "emptied": lambda data: b"",
    "truncated": lambda data: data[:-1],
    "truncated to its checksum": lambda data: data[-4:],
    "extended": lambda data: data + b"\0",
    "zeros": lambda data: bytes(len(data)),
    "shifted": lambda data: data[1:] + data[:1],
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_every_chunk_damaged(bake, chunks, expected, damage):
    for key in chunks:
        path = bake / key
        whole = path.read_bytes()
        changed = DAMAGES[damage](whole)
        path.unlink() if changed is None else path.write_bytes(changed)
        assert assert_harmless_or_found(bake, expected, names=key), key
        assert isinstance(refusal(lambda: list(Bake.open(bake).verify())), DamagedBakeError), key
        path.write_bytes(whole)


def test_chunks_that_change_places(bake, chunks, expected):
    """Each is whole by itself: only the manifest knows which belongs where."""
    swapped = 0
    for a in chunks:
        for b in chunks:
            one, two = (bake / a).read_bytes(), (bake / b).read_bytes()
            if a >= b or len(one) != len(two) or one == two:
                continue
            (bake / a).write_bytes(two)
            (bake / b).write_bytes(one)
            assert assert_harmless_or_found(bake, expected), (a, b)
            (bake / a).write_bytes(one)
            assert assert_harmless_or_found(bake, expected, names=b), f"{a} also in the place of {b}"
            (bake / b).write_bytes(two)
            swapped += 1
    assert swapped >= 3


def test_chunks_of_another_bake(bake, chunks, expected, tmp_path):
    other = quick_bake(tmp_path / "other.prelight", tolerance=0.02).path
    foreign = [
        key
        for key in chunks
        if (other / key).exists() and (other / key).read_bytes() != (bake / key).read_bytes()
    ]
    assert foreign, "the other bake is the same"
    for key in foreign:
        whole = (bake / key).read_bytes()
        shutil.copyfile(other / key, bake / key)
        assert assert_harmless_or_found(bake, expected, names=key), key
        (bake / key).write_bytes(whole)
    shutil.copyfile(other / NAME, bake / NAME)
    assert assert_harmless_or_found(bake, expected)


def test_strangers_in_the_folder_are_not_read(bake, expected):
    (bake / LAYER / "tiles" / "00002").mkdir()
    (bake / "scene" / "positions" / "c" / "1").write_bytes(b"x")
    (bake / "journal.jsonl").write_bytes(b"x")
    assert not assert_harmless_or_found(bake, expected)


@pytest.mark.parametrize("what", ["link", "pipe", "folder", "device", "link to a pipe"])
def test_chunks_that_are_no_files(bake, chunks, what):
    """L7: nothing blocks, and nothing outside is followed."""
    outside = bake.with_name("outside")
    for key in chunks:
        path = bake / key
        whole = path.read_bytes()
        path.unlink()
        if what == "link":
            outside.write_bytes(whole)
            path.symlink_to(outside)
        elif what == "pipe":
            os.mkfifo(path)
        elif what == "folder":
            path.mkdir()
        elif what == "device":
            path.symlink_to("/dev/zero")
        else:
            outside.unlink(missing_ok=True)
            os.mkfifo(outside)
            path.symlink_to(outside)
        for act in (lambda: light_of(bake), lambda: list(Bake.open(bake).verify())):
            error = refusal(act)
            assert isinstance(error, DamagedBakeError), key
            assert key in str(error)
        path.rmdir() if what == "folder" else path.unlink()
        path.write_bytes(whole)


@pytest.mark.parametrize("what", ["pipe", "folder", "device", "dangling", "missing"])
def test_manifests_that_are_no_files(bake, what):
    path = bake / NAME
    path.unlink()
    if what == "pipe":
        os.mkfifo(path)
    elif what == "folder":
        path.mkdir()
    elif what != "missing":
        path.symlink_to({"device": "/dev/zero", "dangling": "nowhere"}[what])
    assert isinstance(refusal(lambda: Bake.open(bake)), DamagedBakeError)


def test_links_to_folders_lead_to_the_same_bytes_or_nowhere(bake, expected, tmp_path):
    """A folder inside may be a link, as users move things; what lies there must have the right hash."""
    moved = tmp_path / "elsewhere"
    (bake / "layers").rename(moved)
    (bake / "layers").symlink_to(moved)
    assert not assert_harmless_or_found(bake, expected)
    chunk = moved / "environment" / "order" / "c" / "0"
    chunk.write_bytes(chunk.read_bytes()[::-1])
    assert assert_harmless_or_found(bake, expected, names="order/c/0")


def test_the_whole_bake_may_be_a_link_or_read_only(bake, expected, tmp_path):
    (tmp_path / "link.prelight").symlink_to(bake)
    assert not assert_harmless_or_found(tmp_path / "link.prelight", expected)
    before = tree(bake)
    for path in [*bake.rglob("*"), bake]:
        path.chmod(0o500 if path.is_dir() else 0o400)
    try:
        assert not assert_harmless_or_found(bake, expected)
    finally:
        for path in [bake, *bake.rglob("*")]:
            path.chmod(0o700)
    assert tree(bake) == before


def test_the_yardstick_sees_every_array(original):
    """`light_of` must use all that is in a bake, or the tests above prove less than they say."""
    used = set()
    real = Bake.array

    def noted(self, name):
        used.add(name)
        return real(self, name)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Bake, "array", noted)
        light_of(original)
    assert used == set(Bake.open(original).manifest.arrays)
    assert Bake.open(original).layers["environment"].coefficients > PANEL

"""A bake that is killed, starved or interrupted goes on to the same bytes, and is never seen half-made."""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import subprocess
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numba
import pytest

from prelight.errors import InputError, InterruptedBakeError, OutputError
from prelight.files import publish
from prelight.storage.bake import Bake
from prelight.storage.journal import BakeWriter, partial_folder

from .disk import ERRORS, Disk, Killed, copy, tree
from .disk import quick_bake as bake_of_two_zones

KILLS = int(os.environ.get("PRELIGHT_KILLS", "8"))  # of a real process
THOROUGH = KILLS >= 200  # before a release: every step on the disk, not every seventh or ninth
ROOT = Path(__file__).resolve().parents[1]
PARCELS = 4  # of two zones, each in two
quick_bake = partial(bake_of_two_zones, small_parcels=True)


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> Iterator[None]:
    """Kernels this small only wait for each other; and the bytes may not depend on it."""
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    yield
    numba.set_num_threads(threads)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> dict[str, str]:
    """The tree of a bake that nothing disturbed."""
    target = tmp_path_factory.mktemp("whole") / "ball.prelight"
    quick_bake(target)
    return tree(target)


@pytest.fixture(scope="module")
def other(tmp_path_factory) -> Path:
    """A bake of other settings, to be replaced."""
    return quick_bake(tmp_path_factory.mktemp("other") / "ball.prelight", tolerance=0.02).path


def refusal(target: Path) -> OutputError | None:
    """What the disk's refusal became; None if the bake could do without what failed."""
    try:
        quick_bake(target)
    except OutputError as error:
        return error
    return None


def is_one_line(error: Exception) -> bool:
    return str(error).isprintable() and len(str(error)) <= 300


def written(calls: list[str], array: str) -> int:
    return sum(call.startswith("replace") and f"/{array}/" in call and "/c/" in call for call in calls)


def lines_kept(calls: list[str]) -> int:
    """Lines that were on disk before the last call, which did not happen."""
    return sum(call.startswith("fsync") and call.endswith("journal.jsonl") for call in calls[:-1])


@pytest.mark.parametrize("power_cut", [False, True], ids=["killed", "power cut"])
def test_killed_at_every_step(tmp_path, whole, power_cut):
    """P1: whatever the process was doing, no half bake, the same bytes, and one parcel of work lost at most."""
    target = tmp_path / "ball.prelight"
    for step in range(1 + power_cut, 2000, 1 if THOROUGH else 7):
        with Disk(tmp_path, at=step, power_cut=power_cut) as disk, contextlib.suppress(Killed):
            quick_bake(target)
        if not disk.dead:
            break
        where = f"step {step}: {disk.calls[-1]}"
        if target.exists():
            assert tree(target) == whole, where
        else:
            with Disk(tmp_path) as again:
                quick_bake(target, resume=True)
            assert tree(target) == whole, where
            kept = lines_kept(disk.calls)  # those of parcels first, that of bounced light last
            assert written(again.calls, "tiles") <= PARCELS - min(kept, PARCELS), where
            assert written(again.calls, "modes") <= PARCELS + 1 - kept, where
        assert not partial_folder(target).exists(), where
        shutil.rmtree(target)
    assert step > 400, "the disk was hardly touched: is it still written through os?"
    assert tree(target) == whole


def test_everything_that_is_published_was_synced(tmp_path, whole):
    with Disk(tmp_path, power_cut=True):
        quick_bake(tmp_path / "ball.prelight")
    assert tree(tmp_path / "ball.prelight") == whole


def test_every_call_fails_once(tmp_path, whole):
    """P3: a refusal of the disk is one line and exit code 3, and what was done is not lost."""
    target = tmp_path / "ball.prelight"
    refused = 0
    for step in range(1, 2000, 1 if THOROUGH else 9):
        with Disk(tmp_path, at=step, error=ERRORS[step % len(ERRORS)]) as disk:
            error = refusal(target)
        if error:
            assert error.exit_code == 3
            assert is_one_line(error)
            refused += 1
        if not disk.struck:
            break
        where = f"step {step}: {disk.calls[step - 1]}"
        leftover = [p.name for p in tmp_path.rglob("*.tmp")]
        assert not leftover or disk.calls[step - 1].startswith("unlink"), where
        if not target.exists():
            with Disk(tmp_path):
                quick_bake(target, resume=True)
        assert tree(target) == whole, where
        shutil.rmtree(target)
        shutil.rmtree(partial_folder(target), ignore_errors=True)
    assert refused > 45


@pytest.mark.parametrize("exchange", [True, False], ids=["exchanged", "renamed"])
def test_force_replaces_only_at_the_end(tmp_path, whole, other, exchange, monkeypatch):
    """Killed at any step, the old bake or the new one is whole; in its place, where the system can exchange."""
    if not exchange:
        monkeypatch.setattr("prelight.files.ctypes.CDLL", lambda *_, **__: object())
    target, old = tmp_path / "ball.prelight", tree(other)
    copy(other, target)
    with Disk(tmp_path) as disk:
        quick_bake(target, force=True)
    swap = next(i for i, call in enumerate(disk.calls, 1) if call.startswith("swap"))
    for step in [*range(1, swap, 61), *range(swap - 4, swap + 5), *range(swap + 5, len(disk.calls) + 1, 23)]:
        copy(other, target)
        with Disk(tmp_path, at=step) as disk, contextlib.suppress(Killed):
            quick_bake(target, force=True)
        where = f"step {step}: {disk.calls[-1]}"
        aside = list(tmp_path.glob(".*.replaced"))
        seen = tree(target) if target.exists() else None
        if step <= swap:
            assert seen == old, where
        elif exchange:
            assert seen == whole, where
        else:
            assert seen in (old, whole) or [tree(path) for path in aside] == [old], where
        with Disk(tmp_path):
            quick_bake(target, force=True, resume=True)
        assert tree(target) == whole, where
        for path in (target, partial_folder(target), *aside):
            shutil.rmtree(path, ignore_errors=True)


def test_a_failed_exchange_puts_the_old_bake_back(tmp_path, other, monkeypatch):
    monkeypatch.setattr("prelight.files.ctypes.CDLL", lambda *_, **__: object())
    target = copy(other, tmp_path / "ball.prelight")
    with Disk(tmp_path) as disk:
        quick_bake(target, force=True)
    copy(other, target)
    swap = next(i for i, call in enumerate(disk.calls, 1) if call.startswith("swap"))
    with Disk(tmp_path, at=swap + 2, error=ERRORS[0]), pytest.raises(OutputError):
        quick_bake(target, force=True)
    assert tree(target) == tree(other)


def test_torn_and_damaged_work_is_made_again(tmp_path, whole):
    """A journal that ends in the middle of a line, and a chunk that is not what its line says."""
    target = tmp_path / "ball.prelight"
    partial = partial_folder(target)
    with Disk(tmp_path) as disk:
        quick_bake(target)
    last = max(
        i for i, call in enumerate(disk.calls, 1) if call.endswith("journal.jsonl") and call[:5] == "fsync"
    )
    shutil.rmtree(target)
    for damage in ("torn", "flipped", "chunk", "gone", "short", "garbage", "nothing"):
        with Disk(tmp_path, at=last + 1), contextlib.suppress(Killed):
            quick_bake(target)
        journal, chunk = partial / "journal.jsonl", partial / "layers/environment/scales/00000/c/0/0"
        lines = journal.read_bytes()
        if damage == "torn":
            journal.write_bytes(lines[:-20])
        elif damage == "flipped":
            journal.write_bytes(lines.replace(b'"rays": ', b'"rays": 1', 1))
        elif damage == "chunk":
            chunk.write_bytes(bytes([chunk.read_bytes()[0] ^ 1]) + chunk.read_bytes()[1:])
        elif damage == "gone":
            chunk.unlink()
        elif damage == "short":
            chunk.write_bytes(chunk.read_bytes()[:-1])
        elif damage == "garbage":
            journal.write_bytes(lines + b"\xff\x00" * 50)
        else:
            journal.unlink()
        (partial / "layers" / "stray").mkdir()
        (partial / "stray.bin").write_bytes(b"x")
        (partial / "scene").mkdir(exist_ok=True)
        (partial / "scene" / "stray").symlink_to(tmp_path)
        quick_bake(target, resume=True)
        assert tree(target) == whole, damage
        shutil.rmtree(target)


@pytest.mark.parametrize("block", [1, 7, 4096])
def test_the_bytes_do_not_depend_on_how_the_walk_was_cut(tmp_path, whole, block):
    """P2: blocks of any size, and a walk taken up again behind a parcel with blocks of another."""
    target = tmp_path / "ball.prelight"
    quick_bake(target, replay=False, block=block)
    assert tree(target) == whole
    shutil.rmtree(target)
    with Disk(tmp_path) as disk:
        quick_bake(target)
    first = next(
        i for i, call in enumerate(disk.calls, 1) if call[:5] == "fsync" and call.endswith("journal.jsonl")
    )
    shutil.rmtree(target)
    with Disk(tmp_path, at=first + 3), contextlib.suppress(Killed):
        quick_bake(target, replay=False, block=block)
    with Disk(tmp_path) as disk:
        quick_bake(target, replay=False, block=33, resume=True)
    assert tree(target) == whole
    assert written(disk.calls, "tiles") == PARCELS - 1


def test_other_settings_are_refused(tmp_path, whole):
    target = tmp_path / "ball.prelight"
    with Disk(tmp_path) as disk:
        quick_bake(target)
    shutil.rmtree(target)
    for step in (
        len(disk.calls) // 2,
        len(disk.calls) - 2,
    ):  # among the chunks, and with the manifest in place
        with Disk(tmp_path, at=step), contextlib.suppress(Killed):
            quick_bake(target)
        before = tree(partial_folder(target))
        with pytest.raises(InputError, match=r"begun with tolerance = 0\.015, now 0\.02.*--force") as caught:
            quick_bake(target, resume=True, tolerance=0.02)
        assert caught.value.exit_code == 2
        assert is_one_line(caught.value)
        after = tree(partial_folder(target))
        assert after == before
        with pytest.raises(OutputError, match="--resume"):
            quick_bake(target)
        assert tree(partial_folder(target)) == before
        quick_bake(target, tolerance=0.02, resume=True, force=True)
        assert Bake.open(target).layers["environment"].parameters["tolerance"] == 0.02
        shutil.rmtree(target)


def test_existing_output_is_untouched(tmp_path, other):
    target = copy(other, tmp_path / "ball.prelight")
    before, times = tree(target), {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*")}
    for options in ({}, {"resume": True}):
        with pytest.raises(OutputError, match=r"already exists.*--force"):
            quick_bake(target, **options)
    assert tree(target) == before
    assert {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*")} == times


def test_a_file_is_replaced_whole(tmp_path):
    """Pictures go the same way as chunks: killed or failing at any step, the old file or the new one is there."""
    path, old, new = tmp_path / "picture.png", b"old" * 1000, b"new" * 2000
    for step in range(1, 100):
        for error in (None, *ERRORS):
            path.write_bytes(old)
            with (
                Disk(tmp_path, at=step, error=error, power_cut=True) as disk,
                contextlib.suppress(Killed, OutputError),
            ):
                publish(path, new)
            assert path.read_bytes() in (old, new), disk.calls
            if error:
                assert os.listdir(tmp_path) == ["picture.png"], disk.calls
            for leftover in tmp_path.glob(".*.tmp"):
                leftover.unlink()
        if not disk.struck:
            break
    assert step > 4
    assert path.read_bytes() == new


def test_force_replaces_bakes_only(tmp_path, other):
    """A slip of the hand must not cost a folder of photographs."""
    home = tmp_path / "home"
    home.mkdir()
    (home / "photo.jpg").write_bytes(b"dear")
    (home / "manifest.json").write_bytes(b"{}")
    (tmp_path / "file.prelight").write_bytes(b"dear")
    (tmp_path / "link.prelight").symlink_to(copy(other, tmp_path / "linked"))
    before = tree(tmp_path)
    for name in ("home", "file.prelight", "link.prelight", "home/..", "."):
        with pytest.raises(OutputError, match="bake") as caught:
            quick_bake(tmp_path / name, force=True)
        assert is_one_line(caught.value)
    (tmp_path / "new.prelight.partial").symlink_to(home)
    for options in ({}, {"force": True}, {"resume": True}):
        with pytest.raises(OutputError, match="in the way"):
            quick_bake(tmp_path / "new.prelight", **options)
    (tmp_path / "new.prelight.partial").unlink()
    with pytest.raises(OutputError, match="folder"):
        quick_bake(tmp_path / "nowhere" / "ball.prelight")
    with pytest.raises(OutputError):
        quick_bake(tmp_path / ("n" * 300 + ".prelight"))
    with pytest.raises(OutputError):
        quick_bake(tmp_path / "nul\0.prelight")
    assert tree(tmp_path) == before
    (tmp_path / "empty.prelight").mkdir()
    assert quick_bake(tmp_path / "empty.prelight", force=True).layers


def test_output_that_appears_meanwhile_is_not_replaced(tmp_path, whole, other, monkeypatch):
    target = tmp_path / "ball.prelight"
    publish = BakeWriter.publish

    def late(writer, manifest):
        copy(other, target)
        publish(writer, manifest)

    monkeypatch.setattr(BakeWriter, "publish", late)
    with pytest.raises(OutputError, match="already exists"):
        quick_bake(target)
    assert tree(target) == tree(other)
    monkeypatch.undo()
    quick_bake(target, resume=True, force=True)
    assert tree(target) == whole


def test_a_refused_bake_keeps_no_lock(tmp_path):
    target = tmp_path / "ball.prelight"
    BakeWriter(target, settings={"a": 1}, resume=False, force=False).close()
    for _ in range(2):
        with pytest.raises(InputError, match="begun with a = 1"):
            BakeWriter(target, settings={"a": 2}, resume=True, force=False)
    BakeWriter(target, settings={"a": 1}, resume=True, force=False).close()


def test_ctrl_c_anywhere_can_be_resumed(tmp_path, whole, monkeypatch):
    target = tmp_path / "ball.prelight"
    append = BakeWriter.append

    def interrupted(writer, entry):
        append(writer, entry)
        raise KeyboardInterrupt

    monkeypatch.setattr(BakeWriter, "append", interrupted)
    with pytest.raises(InterruptedBakeError, match="--resume") as caught:
        quick_bake(target)
    assert caught.value.exit_code == 130
    monkeypatch.undo()
    assert not target.exists()
    quick_bake(target, resume=True)
    assert tree(target) == whole


def test_a_file_too_large_for_the_system(tmp_path, whole):
    """A limit on file size stands for a disk that is full in the middle of a chunk."""
    target = tmp_path / "ball.prelight"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
    try:
        with pytest.raises(OutputError, match="too large") as caught:
            quick_bake(target)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert is_one_line(caught.value)
    assert not target.exists()
    quick_bake(target, resume=True)
    assert tree(target) == whole


def test_a_disk_that_is_really_full(tmp_path, whole):
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = shutil.which("mount")
    made = mount and subprocess.run(
        [mount, "-t", "tmpfs", "-o", "size=64k", "none", disk], capture_output=True, check=False
    )
    if not made or made.returncode:
        pytest.skip("a small disk cannot be mounted here")
    try:
        target = disk / "ball.prelight"
        with pytest.raises(OutputError, match="the disk is full; free some space and run again"):
            quick_bake(target)
        assert not target.exists()
        subprocess.run([mount, "-o", "remount,size=4m", disk], check=True)
        quick_bake(target, resume=True)
        assert tree(target) == whole
    finally:
        subprocess.run(["umount", disk], check=True)

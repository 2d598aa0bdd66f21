"""Bakes made without a renderer in a few milliseconds, and disks that die, fill up or lie under them."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
import stat
import time
import tracemalloc
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from prelight.baking import environment as baking
from prelight.baking import layer_receivers, layer_writer
from prelight.baking.bounced import BouncedPart
from prelight.baking.clustering import Clusters, cluster_lights
from prelight.baking.environment_plan import Cut, EnvironmentPlan
from prelight.baking.environment_settings import EnvironmentSettings
from prelight.baking.first_bounce import FirstBounce
from prelight.baking.light_cells import light_cells
from prelight.errors import DamagedBakeError, InputError, PrelightError
from prelight.lighting.environment import Environment
from prelight.relighting.relighter import Relighter
from prelight.scene.geometry import Scene
from prelight.storage import journal
from prelight.storage.bake import Bake
from prelight.storage.environment_layer import tree_size
from prelight.storage.manifest import NAME
from prelight.transport import direct

from .scenes import ball_on_floor

RESOLUTION, TOLERANCE = 9, 0.015  # in one zone 326 clusters, of up to 3×3 texels
_TRIES = 3
ZONES = 2
BALL, RADIUS = np.array([0.0, 0.6, 0.0], np.float32), np.float32(0.4)


class BallVisibility:
    """What `prelight.transport.visibility.Visibility` says of a ball over a floor, by arithmetic."""

    def __init__(self, occluders, *, origins, normals) -> None:
        self.receivers = len(origins)
        self._normals = normals
        self._outward = origins - BALL
        self._is_floor = np.linalg.norm(self._outward, axis=1) > RADIUS * 1.01

    def trace(self, directions, *, lanes: int = 0) -> tuple[np.ndarray, np.ndarray]:
        facing = directions @ self._normals.T > 0
        along = directions @ self._outward.T
        closest = (self._outward**2).sum(axis=1) - along**2
        hit = (along < 0) & (closest < RADIUS**2) & self._is_floor
        bits = np.packbits(facing & ~hit, axis=1, bitorder="little")
        return bits, facing.sum(axis=1).astype(np.int32)


class _Replayed:
    """The clusters of a walk, kept: what matters here is what becomes of them on disk."""

    def __init__(self) -> None:
        self._kept: dict[tuple, list] = {}

    def __call__(self, transfer, test, *, covered, **options):
        key = (transfer.by_axis.tobytes(), test)
        if key not in self._kept:
            self._kept[key] = list(cluster_lights(transfer, test, covered=covered[:0], **options))
        skip = len(covered)
        for group, progress in self._kept[key]:
            drop = min(skip, len(group.leaves))
            skip -= drop
            parts = (getattr(group, name)[drop:] for name in ("leaves", "columns", "scale", "rays"))
            yield Clusters(*parts), progress


class _StandInBounces:
    """Some bounced light, without a ray: three smooth modes, and little of it."""

    def __init__(self, layer, **_) -> None:
        self._layer = layer

    def found(self, *, lanes: int) -> BouncedPart:
        place = self._layer.scene.positions
        x = 0.005 + 0.002 * np.stack([np.sin(place[:, 0]), np.cos(place[:, 2]), np.tanh(place[:, 1])], axis=1)
        cells = light_cells(self._layer.settings.resolution)
        weights = np.stack([1 + 0.2 * np.sin(np.arange(len(cells)) * k) for k in (0.1, 0.2, 0.3)])
        colours = np.array([1.0, 0.7, 0.4])[:, None, None]
        return BouncedPart(
            cells=cells, modes=x.astype(np.float32), weights=(colours * weights).astype(np.float32),
            sources=(colours * (6.0 + 0 * x) / len(x)).astype(np.float32),
            bounces=5, remaining=5e-4, left_out=0.01, rays=700, entries=9, first=_stand_in_first(len(x)),
            held=1.0, edge=float("inf"),
        )  # fmt: skip


def _stand_in_first(vertices: int) -> FirstBounce:
    """Two entries a row, made up."""
    row = np.ones(vertices, np.float32)
    return FirstBounce(
        order=np.arange(vertices, dtype=np.int32), left=np.full(tree_size(vertices), 0.5, np.float32),
        colours=np.repeat(0.5 * row[:, None], 3, axis=1), sums=0.1 * row, scales=1e-6 * row,
        counts=np.full(vertices, 2, np.uint16), steps=np.tile(np.uint16([1, 3]), vertices),
        codes=np.tile(np.int8([100, -90]), vertices), threshold=5e-4, error=0.02,
    )  # fmt: skip


_replayed = _Replayed()
_software = cache(layer_writer.software)


def quick_plan(
    *, tolerance: float = TOLERANCE, block: int = 32, zones: int = ZONES, bounces: int | None = None
) -> tuple[Scene, EnvironmentPlan]:
    """A small scene, and a plan of it without the estimate."""
    scene = ball_on_floor(side=6, rings=5)
    settings = EnvironmentSettings(resolution=RESOLUTION, tolerance=tolerance, zones=zones, bounces=bounces)
    figures = dict.fromkeys(("clusters", "rays", "receiver_directions", "seconds", "memory", "bytes"), 1)
    return scene, EnvironmentPlan(
        settings=settings,
        receivers=len(scene.positions),
        triangles=len(scene.triangles),
        zones=zones,
        tolerance=tolerance,
        cuts=(Cut(1 << 20, block),) * zones,
        **figures,
    )


def quick_bake(
    target: Path,
    *,
    replay: bool = True,
    small_parcels: bool = False,
    block: int = 32,
    tolerance: float = TOLERANCE,
    zones: int = ZONES,
    bounces: int | None = None,
    **options,
) -> Bake:
    """A bake of a small scene in two zones; options as for `bake_planned`.

    With ``replay`` the clusters are found once in a process and written again each time. A zone is one parcel,
    or two with ``small_parcels``, which a relighter does not expect.
    """
    scene, plan = quick_plan(tolerance=tolerance, block=block, zones=zones, bounces=bounces)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(direct, "Visibility", BallVisibility)
        patch.setattr(layer_receivers, "Occluders", lambda *_: None)
        patch.setattr(layer_receivers, "vantage_points", lambda scene, _: scene.positions)
        patch.setattr(layer_writer, "BouncedLight", _StandInBounces)
        patch.setattr(layer_writer, "software", _software)
        if small_parcels:
            patch.setattr(layer_writer, "panels_of_parcel", lambda *_: 1)
        if replay:
            patch.setattr(layer_writer, "cluster_lights", _replayed)
        return baking.bake_planned(scene, target, plan=plan, **options)


def tree(folder: Path) -> dict[str, str]:
    """sha256 of every file in a folder, by name; folders and links by what they are."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_symlink():
            found[name] = f"link to {os.readlink(path)}"
        else:
            found[name] = "folder" if path.is_dir() else hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def light_of(path: Path) -> np.ndarray:
    """Everything a relighter reads of a bake, down to the picture."""
    light = Relighter(path)
    assert isinstance(light.bake.triangles, np.ndarray)
    assert light.bake.material_of.max() < len(light.bake.materials)
    assert np.isfinite(light.bake.tint).all()
    light.environment = Environment.constant((1.0, 0.5, 0.25))
    for face in range(6):
        light.edit(face, slice(face, face + 2), slice(1, 3), np.array([face, 2.0, 9.0]))
    light.camera()
    return light.radiance


def _error_of(act: Callable[[], object]) -> PrelightError | None:
    try:
        act()
    except PrelightError as error:
        return error
    return None


def refusal(act: Callable[[], object]) -> PrelightError | None:
    """The one-line error of an act that takes under a second's work and little memory; None if it succeeds.

    Memory is traced in a run of its own, which makes it several times slower. What takes too long is timed again:
    a busy machine charges a thread for what others do to its caches, too much work is too much every time.
    """
    for _ in range(_TRIES):
        started, worked = time.perf_counter(), time.thread_time()
        error = _error_of(act)
        assert time.perf_counter() - started < 10  # a busy machine; a pipe would block for ever
        worked = time.thread_time() - worked
        if worked < 1:
            break
    assert worked < 1
    tracemalloc.start()
    again = _error_of(act)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert type(again) is type(error)
    assert peak < 64e6, f"{peak / 1e6:.0f} MB"
    if error is not None:
        assert str(error).isprintable()
        assert len(str(error)) <= 300
        assert isinstance(error, DamagedBakeError | InputError), repr(error)
    return error


def rewrite_manifest(folder: Path, change: Callable[[dict], object]) -> None:
    """Change the manifest and give it the right sha256 again, as an attacker would."""
    manifest = json.loads((folder / NAME).read_bytes())
    del manifest["sha256"]
    change(manifest)
    canonical = json.dumps(manifest, sort_keys=True, separators=(",", ":")).encode()
    manifest["sha256"] = hashlib.sha256(canonical).hexdigest()
    (folder / NAME).write_text(json.dumps(manifest, sort_keys=True, indent=1))


class Killed(BaseException):
    """The process is no more: nothing it would still do to the disk happens."""


class Disk:
    """Counts what is done to files inside ``folder`` and stops, or fails, at the ``at``-th.

    With ``error`` (an errno) that call fails, and later ones work. Without it the process dies there, a
    write half done; with ``power_cut`` all that was not synced is lost as well. Nothing is really synced.
    """

    CALLS = ("open", "write", "fsync", "replace", "rename", "mkdir", "unlink", "rmdir", "close")

    def __init__(
        self, folder: Path, *, at: int = 0, error: int | None = None, power_cut: bool = False
    ) -> None:
        self.folder, self.at, self.error, self.power_cut = str(folder), at, error, power_cut
        self.calls: list[str] = []
        self.dead = False
        self._handles: dict[int, str] = {}
        self._begun: set[int] = set()
        self._dirty: set[str] = set()
        self._synced: dict[str, int] = {}  # bytes of a file that are safe
        self._real: dict[str, Callable] = {}

    @property
    def struck(self) -> bool:
        return 0 < self.at <= len(self.calls)

    def __enter__(self) -> Disk:
        self._real = {name: getattr(os, name) for name in self.CALLS}
        for name in self.CALLS:
            setattr(os, name, getattr(self, f"_{name}"))
        self._swap = journal.swap_folders
        journal.swap_folders = self._swap_folders
        return self

    def __exit__(self, *_: object) -> None:
        for name, call in self._real.items():
            setattr(os, name, call)
        journal.swap_folders = self._swap
        for handle in list(self._handles):
            os.close(handle)
        if self.power_cut:
            for path in self._dirty:
                if os.path.isfile(path):
                    os.truncate(path, self._synced.get(path, 0))

    def _ours(self, path: object, dir_fd: int | None) -> str | None:
        if isinstance(path, int):
            return self._handles.get(path)
        text = os.fsdecode(path)
        if dir_fd is not None:
            return os.path.join(self._handles[dir_fd], text) if dir_fd in self._handles else None
        return text if text.startswith(self.folder) else None

    def _step(self, call: str, half: Callable[[], object] | None = None) -> None:
        if self.dead:
            raise Killed
        self.calls.append(call)
        if len(self.calls) == self.at:
            if half:
                half()
            if self.error is not None:
                raise OSError(self.error, os.strerror(self.error))
            self.dead = True
            raise Killed

    def _open(self, path, flags, mode=0o777, *, dir_fd=None):
        ours = self._ours(path, dir_fd)
        if ours and flags & (os.O_CREAT | os.O_WRONLY | os.O_RDWR):
            self._step(f"open {ours}")
        handle = self._real["open"](path, flags, mode, dir_fd=dir_fd)
        writes = flags & (os.O_CREAT | os.O_WRONLY | os.O_RDWR)
        if ours and (writes or stat.S_ISDIR(os.fstat(handle).st_mode)):
            self._handles[handle] = ours
            if flags & os.O_CREAT:
                self._dirty.add(ours)
        return handle

    def _close(self, handle):
        self._handles.pop(handle, None)
        self._begun.discard(handle)
        self._real["close"](handle)

    def _write(self, handle, data):
        if handle in self._handles:
            self._step(
                f"write {self._handles[handle]}", lambda: self._real["write"](handle, data[: len(data) // 2])
            )
            self._dirty.add(self._handles[handle])
            if handle not in self._begun:
                self._begun.add(handle)
                data = data[: max(1, 2 * len(data) // 3)]  # a system may take less than it is given
        return self._real["write"](handle, data)

    def _fsync(self, handle):
        if handle not in self._handles:
            return self._real["fsync"](handle)
        self._step(f"fsync {self._handles[handle]}")
        self._dirty.discard(self._handles[handle])
        self._synced[self._handles[handle]] = os.fstat(handle).st_size

    def _moved(self, call, source, target):
        ours = self._ours(source, None)
        if ours:
            self._step(f"{call} {target}")
        self._real[call](source, target)
        if ours:
            a, b = os.fsdecode(source), os.fsdecode(target)
            moved = {
                p: b + p[len(a) :]
                for p in self._dirty | self._synced.keys()
                if p == a or p.startswith(a + "/")
            }
            self._dirty = {moved.get(p, p) for p in self._dirty - {b}}
            self._synced = {moved.get(p, p): size for p, size in self._synced.items() if p != b}

    def _replace(self, source, target, **_):
        self._moved("replace", source, target)

    def _rename(self, source, target, **_):
        self._moved("rename", source, target)

    def _named(self, call, path, *arguments, dir_fd=None):
        ours = self._ours(path, dir_fd)
        if ours:
            self._step(f"{call} {ours}")
            self._dirty.discard(ours)
        self._real[call](path, *arguments, dir_fd=dir_fd)

    def _mkdir(self, path, mode=0o777, *, dir_fd=None):
        self._named("mkdir", path, mode, dir_fd=dir_fd)

    def _unlink(self, path, *, dir_fd=None):
        self._named("unlink", path, dir_fd=dir_fd)

    def _rmdir(self, path, *, dir_fd=None):
        self._named("rmdir", path, dir_fd=dir_fd)

    def _swap_folders(self, new, old):
        self._step(f"swap {old}")
        self._swap(new, old)


def copy(folder: Path, to: Path) -> Path:
    """A second copy of a bake, at ``to``."""
    shutil.rmtree(to, ignore_errors=True)
    return Path(shutil.copytree(folder, to, symlinks=True))


ERRORS = (errno.ENOSPC, errno.EIO, errno.EINTR, errno.EACCES, errno.EDQUOT)

"""The journal of an unfinished bake: what has been done, so that a killed one goes on.

``NAME.prelight.partial/`` holds chunks as they are made and ``journal.jsonl``: a first line with the
settings, then one line for each finished parcel, each ending in its own crc32c. A line is written only
after the chunks it names. On resuming, a torn line or a chunk that does not match ends the part that
counts; what lies behind is made again, to the same bytes. ``.NAME.prelight.lock`` beside it is held by
the one process that writes; the system lets go of it when the process dies.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import shutil
from pathlib import Path
from typing import Any

import google_crc32c
import numpy as np

from ..errors import InputError, OutputError, PrelightError
from ..files import explain, publish, read_regular, refuse_existing, swap_folders, sync_folder, write_all
from .chunks import ArraySpec, ChunkRecord, check_hash, chunk_key, encode
from .manifest import NAME, Manifest

_JOURNAL = "journal.jsonl"


def partial_folder(target: Path) -> Path:
    """Where the unfinished bake of ``target`` lives."""
    return target.with_name(target.name + ".partial")


def refuse_target(target: Path, *, force: bool) -> None:
    """Raises OutputError unless a bake may be published as ``target``; ``force`` gives up a bake, nothing else."""
    refuse_existing(target, force=force)
    if target.name in ("", ".."):
        raise OutputError(target, "is no name for a bake; expected NAME.prelight")
    if not os.path.lexists(target):
        return
    is_folder = os.path.isdir(target) and not os.path.islink(target)
    if not is_folder or (os.listdir(target) and not all((target / x).is_file() for x in (NAME, "zarr.json"))):
        raise OutputError(target, "is not a bake, and --force replaces nothing else; choose another name")


class BakeWriter:
    """The one owner of an unfinished bake, from its first chunk to its publication.

    Parameters
    ----------
    target
        The final folder, ``NAME.prelight``.
    settings
        Everything the bytes depend on; a resumed bake must have been begun with the same.
    resume
        Go on with the partial bake, if there is one.
    force
        Begin anew over a partial bake, and replace a finished one when publishing.
    replacing
        Replace a finished one when publishing, but leave a partial one alone.

    Raises
    ------
    OutputError
        The target exists and ``force`` is not set, a partial bake exists and neither is set,
        another process is baking it, or the disk refuses.
    InputError
        The partial bake was begun with other settings.
    """

    def __init__(
        self, target: Path, *, settings: dict[str, Any], resume: bool, force: bool, replacing: bool = False
    ) -> None:
        self._may_replace = force or replacing
        refuse_target(target, force=self._may_replace)
        self.target, self.partial, self.force = target, partial_folder(target), force
        self._lock = self._journal = -1
        try:
            self._take_lock()
            refuse_target(target, force=self._may_replace)  # again: whoever held the lock may have published
            self._begin(settings, resume)
        except BaseException as error:
            self.close()
            if isinstance(error, OSError | ValueError) and not isinstance(error, PrelightError):
                raise OutputError(self.partial, f"cannot write: {explain(error)}") from None
            raise

    @property
    def _lock_path(self) -> Path:
        return self.target.with_name(f".{self.target.name}.lock")

    def _take_lock(self) -> None:
        """Become the only writer. A lock file that its holder has just removed does not count."""
        while True:
            self._lock = os.open(self._lock_path, os.O_CREAT | os.O_RDWR | os.O_NOFOLLOW, 0o666)
            try:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                os.close(self._lock)
                self._lock = -1  # another's: not ours to remove
                if error.errno not in (errno.EAGAIN, errno.EACCES):
                    raise
                what = "another process is writing this bake; wait for it or choose another name"
                raise OutputError(self.target, what) from None
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(self._lock), os.stat(self._lock_path)):
                    return
            os.close(self._lock)
            self._lock = -1

    def _begin(self, settings: dict[str, Any], resume: bool) -> None:
        if os.path.lexists(self.partial):
            if self.partial.is_symlink() or not self.partial.is_dir():
                raise OutputError(self.partial, "is in the way, and not an unfinished bake; remove it")
            if not (resume or self.force):
                what = "an unfinished bake is here; pass --resume to go on or --force to begin anew"
                raise OutputError(self.partial, what)
            if not resume:
                shutil.rmtree(self.partial)
        self.partial.mkdir(exist_ok=True)
        self.complete: Manifest | None = None
        self.entries: list[dict[str, Any]] = []
        try:
            self.complete = self._complete_manifest(settings)
            self.entries = self._read(settings)
        except InputError:
            if not self.force:
                raise
            shutil.rmtree(self.partial)
            self.partial.mkdir()
        lines = [self._line({"settings": settings}), *(self._line(entry) for entry in self.entries)]
        publish(self.partial / _JOURNAL, b"".join(lines))
        self._journal = os.open(self.partial / _JOURNAL, os.O_WRONLY | os.O_APPEND)

    def _complete_manifest(self, settings: dict[str, Any]) -> Manifest | None:
        """The manifest of a bake that was stopped between its last chunk and its publication."""
        if not (self.partial / NAME).is_file():
            return None
        try:
            manifest = Manifest.open(self.partial)
            for key, record in manifest.chunks.items():
                check_hash(self.partial, key, record.size, record.sha256)
        except ValueError:
            return None
        self._refuse_others(manifest.settings, settings)
        return manifest

    def _refuse_others(self, begun: dict[str, Any], settings: dict[str, Any]) -> None:
        for name in sorted(settings.keys() | begun.keys()):
            if settings.get(name) != begun.get(name):
                raise InputError(
                    self.partial,
                    f"this bake was begun with {name} = {begun.get(name)}, now {settings.get(name)}; "
                    "use the same settings, or --force to begin anew",
                )

    @staticmethod
    def _line(entry: dict[str, Any]) -> bytes:
        text = json.dumps(entry, sort_keys=True)
        return f"{text}\t{google_crc32c.value(text.encode()):08x}\n".encode()

    def _read(self, settings: dict[str, Any]) -> list[dict[str, Any]]:
        """Entries of an earlier run whose chunks are all there and whole."""
        try:
            lines = (self.partial / _JOURNAL).read_bytes().splitlines(keepends=True)
        except FileNotFoundError:
            return []
        entries: list[dict[str, Any]] = []
        for line in lines:
            text, _, crc = line.decode("utf-8", "replace").rpartition("\t")
            if not line.endswith(b"\n") or f"{google_crc32c.value(text.encode()):08x}" != crc.strip():
                break
            entries.append(json.loads(text))
        if not entries:
            return []
        self._refuse_others(entries.pop(0).get("settings", {}), settings)
        for count, entry in enumerate(entries):
            try:
                for key, record in entry["chunks"].items():
                    check_hash(self.partial, key, record["size"], record["sha256"])
            except ValueError:
                return entries[:count]
        return entries

    def write_chunk(
        self, array: str, index: tuple[int, ...], values: np.ndarray, spec: ArraySpec
    ) -> tuple[str, ChunkRecord]:
        """Write one chunk whole; its key and record."""
        key = chunk_key(array, index)
        path = self.partial / key
        data, record = encode(values, spec)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(path, f"cannot write: {explain(error)}") from None
        publish(path, data)
        return key, record

    def adopt(self, key: str, record: ChunkRecord, *, root: Path, its_key: str) -> None:
        """Take over a whole chunk of the bake at ``root``: the same bytes, by a link where the disk can.

        Raises DamagedBakeError if it is not whole, OutputError if the disk refuses.
        """
        check_hash(root, its_key, record.size, record.sha256)
        path = self.partial / key
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(root / its_key, path)
            except OSError:  # another disk, or one without links
                publish(path, read_regular(root / its_key, limit=record.size))
        except OutputError:
            raise
        except OSError as error:
            raise OutputError(path, f"cannot write: {explain(error)}") from None

    def append(self, entry: dict[str, Any]) -> None:
        """Add a line to the journal; the chunks it names are already durable."""
        try:
            write_all(self._journal, self._line(entry))
            os.fsync(self._journal)
        except OSError as error:
            raise OutputError(self.partial / _JOURNAL, f"cannot write: {explain(error)}") from None
        self.entries.append(entry)

    def publish(self, manifest: Manifest) -> None:
        """Write metadata and manifest, remove what belongs to the making, rename the folder into place."""
        manifest.check(self.partial)
        metadata = manifest.metadata()
        for name, data in metadata.items():
            publish(self.partial / name, data)
        publish(self.partial / NAME, manifest.to_bytes())
        try:
            self._remove_strangers({NAME, *metadata, *manifest.chunks})
            for folder, _, _ in os.walk(self.partial, topdown=False):
                sync_folder(Path(folder))
            if os.path.lexists(self.target):
                refuse_target(self.target, force=self._may_replace)
                swap_folders(self.partial, self.target)
                shutil.rmtree(self.partial, ignore_errors=True)  # the old one; the new one is in place
            else:
                os.rename(self.partial, self.target)
            sync_folder(self.target.parent)
        except OSError as error:
            if isinstance(error, OutputError):
                raise
            raise OutputError(self.target, f"cannot publish the bake: {explain(error)}") from None
        self.close()

    def _remove_strangers(self, kept: set[str]) -> None:
        """Leave nothing but the bake: the journal and what a killed run may have left go."""
        for folder, folders, names in os.walk(self.partial, topdown=False):
            here = Path(folder)
            for path in [*(here / name for name in names), *(here / name for name in folders)]:
                if path.is_symlink() or not path.is_dir():
                    if path.relative_to(self.partial).as_posix() not in kept:
                        path.unlink()
                elif not any(path.iterdir()):
                    path.rmdir()

    def close(self) -> None:
        """Let go of the lock; the partial bake stays for ``--resume``."""
        if self._lock >= 0:
            with contextlib.suppress(OSError):
                os.unlink(self._lock_path)
        for handle in (self._journal, self._lock):
            if handle >= 0:
                with contextlib.suppress(OSError):
                    os.close(handle)
        self._journal = self._lock = -1

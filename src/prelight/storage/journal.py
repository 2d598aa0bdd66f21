"""The journal of an unfinished bake: what has been done, so that a killed one goes on.

``NAME.prelight.partial/`` holds chunks as they are made and ``journal.jsonl``: a first line with the
settings, then one line for each finished panel, each ending in its own crc32c. A line is written only
after the chunks it names. On resuming, a torn line or a chunk that does not match ends the part that
counts; what lies behind is made again, to the same bytes.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from pathlib import Path
from typing import Any

import google_crc32c
import numpy as np

from ..errors import InputError, OutputError
from ..files import explain, publish, swap_folders, sync_folder
from .chunks import ArraySpec, ChunkRecord, check_hash, chunk_key, encode
from .manifest import NAME, Manifest

_JOURNAL = "journal.jsonl"
_LOCK = "lock"


def partial_folder(target: Path) -> Path:
    """Where the unfinished bake of ``target`` lives."""
    return target.with_name(target.name + ".partial")


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

    Raises
    ------
    OutputError
        The target exists and ``force`` is not set, a partial bake exists and neither is set,
        another process is baking it, or the disk refuses.
    InputError
        The partial bake was begun with other settings.
    """

    def __init__(self, target: Path, *, settings: dict[str, Any], resume: bool, force: bool) -> None:
        self.target, self.partial, self.force = target, partial_folder(target), force
        if os.path.lexists(target) and not force:
            raise OutputError(target, "already exists; choose another name or pass --force to replace it")
        try:
            self._begin(settings, resume)
        except OSError as error:
            if isinstance(error, OutputError):
                raise
            raise OutputError(self.partial, f"cannot write: {explain(error)}") from None

    def _begin(self, settings: dict[str, Any], resume: bool) -> None:
        existed = self.partial.is_dir()
        if existed and not (resume or self.force):
            raise OutputError(
                self.partial, "an unfinished bake is here; pass --resume to go on or --force to begin anew"
            )
        self.partial.mkdir(exist_ok=True)
        self._lock = os.open(self.partial / _LOCK, os.O_CREAT | os.O_RDWR, 0o666)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._lock)
            raise OutputError(
                self.partial, "another process is writing this bake; wait for it or choose another name"
            ) from None
        if existed and not resume:
            self._clear()
        self.complete = self._complete_manifest(settings)
        try:
            self.entries = self._read(settings)
        except InputError:
            if not self.force:
                raise
            self._clear()
            self.entries = []
        lines = [self._line({"settings": settings}), *(self._line(entry) for entry in self.entries)]
        publish(self.partial / _JOURNAL, b"".join(lines))
        self._journal = os.open(self.partial / _JOURNAL, os.O_WRONLY | os.O_APPEND)

    def _clear(self) -> None:
        for entry in self.partial.iterdir():
            if entry.name != _LOCK:
                shutil.rmtree(entry) if entry.is_dir() and not entry.is_symlink() else entry.unlink()

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
        return manifest if manifest.settings == settings else None

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
        begun = entries.pop(0).get("settings", {})
        for name in sorted(settings.keys() | begun.keys()):
            if settings.get(name) != begun.get(name):
                raise InputError(
                    self.partial,
                    f"this bake was begun with {name} = {begun.get(name)}, now {settings.get(name)}; "
                    "use the same settings, or --force to begin anew",
                )
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

    def append(self, entry: dict[str, Any]) -> None:
        """Add a line to the journal; the chunks it names are already durable."""
        try:
            os.write(self._journal, self._line(entry))
            os.fsync(self._journal)
        except OSError as error:
            raise OutputError(self.partial / _JOURNAL, f"cannot write: {explain(error)}") from None
        self.entries.append(entry)

    def publish(self, manifest: Manifest) -> None:
        """Write metadata and manifest, remove what belongs to the making, rename the folder into place."""
        manifest.check(self.partial)
        folders = {self.partial}
        for name, spec in manifest.arrays.items():
            publish(self.partial / name / "zarr.json", spec.zarr_metadata(), durable=False)
            folders.update((self.partial / name).parents[: name.count("/") + 1])
        group = b'{"attributes": {}, "node_type": "group", "zarr_format": 3}'
        for folder in sorted(folders):
            if folder.is_relative_to(self.partial):
                publish(folder / "zarr.json", group, durable=False)
        publish(self.partial / NAME, manifest.to_bytes())
        try:
            self._remove_strangers(manifest)
            for folder, _, _ in os.walk(self.partial, topdown=False):
                sync_folder(Path(folder))
            if os.path.lexists(self.target):
                swap_folders(self.partial, self.target)
                shutil.rmtree(self.partial)
            else:
                os.rename(self.partial, self.target)
            sync_folder(self.target.parent)
        except OSError as error:
            raise OutputError(self.target, f"cannot publish the bake: {explain(error)}") from None
        self.close()

    def _remove_strangers(self, manifest: Manifest) -> None:
        """Leave nothing but the bake: journal, lock, and temporary files of a killed run go."""
        kept = {self.partial / NAME, *(self.partial / key for key in manifest.chunks)}
        for folder, _, names in os.walk(self.partial):
            for name in names:
                path = Path(folder) / name
                if path not in kept and name not in ("zarr.json", _JOURNAL):
                    path.unlink()
        (self.partial / _JOURNAL).unlink(missing_ok=True)

    def close(self) -> None:
        """Let go of the lock; the partial bake stays for ``--resume``."""
        for handle in (self._journal, self._lock):
            if handle >= 0:
                os.close(handle)
        self._journal = self._lock = -1

"""Writing files whole or not at all, and reading only what is a regular file.

The only door through which Prelight writes to disk; fault-injection tests replace ``os`` calls here. Files
that a file names are read through `Resolver` alone.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import re
import secrets
import stat
from pathlib import Path
from urllib.parse import unquote

from .errors import InputError, OutputError


def explain(error: OSError | ValueError) -> str:
    """The operating system's reason in words, with what to do for the common ones."""
    if not isinstance(error, OSError):
        return str(error)  # a name that no file can have
    remedy = {
        errno.ENOSPC: "the disk is full; free some space and run again",
        errno.EACCES: "permission denied; choose a folder you may write to",
        errno.EROFS: "the file system is read-only; choose another folder",
        errno.EDQUOT: "the disk quota is used up; free some space and run again",
    }
    return remedy.get(error.errno or 0) or (error.strerror or str(error)).lower()


def refuse_existing(path: Path, *, force: bool) -> None:
    """Raises OutputError if something is at ``path`` and ``force`` is not set, or its folder is not there."""
    if os.path.lexists(path) and not force:
        raise OutputError(path, "already exists; choose another name or pass --force to replace it")
    if not os.path.isdir(path.parent):
        raise OutputError(path, "there is no such folder to write it to; make it first")
    if not os.access(path.parent, os.W_OK):
        raise OutputError(path, "permission denied; choose a folder you may write to")


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_all(handle: int, data: bytes | memoryview) -> None:
    """Write every byte: the system may take fewer at a time than it is given."""
    view = memoryview(data).cast("B")
    while view:
        view = view[os.write(handle, view[: 1 << 26]) :]


def publish(path: Path, data: bytes | memoryview, *, durable: bool = True) -> None:
    """Write ``data`` to a new name beside ``path``, sync it, then rename it over ``path``.

    Raises OutputError; on failure ``path`` is as it was and nothing is left beside it.
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        handle = os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
        try:
            try:
                write_all(handle, data)
                if durable:
                    os.fsync(handle)
            finally:
                os.close(handle)
            os.replace(temporary, path)
            if durable:
                sync_folder(path.parent)
        except BaseException:
            with contextlib.suppress(OSError):
                os.unlink(temporary)
            raise
    except (OSError, ValueError) as error:
        raise OutputError(path, f"cannot write: {explain(error)}") from None


def read_regular(path: str | Path, *, limit: int) -> bytes:
    """All bytes of a regular file of at most ``limit`` bytes.

    Raises InputError for what is missing, not a regular file (a folder, pipe or device), empty or too large.
    """
    return _read(path, limit=limit, flags=os.O_RDONLY | os.O_NONBLOCK)


def _read(path: str | Path, *, limit: int, flags: int) -> bytes:
    try:
        handle = os.open(path, flags)
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            os.close(handle)
            raise InputError(path, "expected a regular file, not a folder, pipe or device")
        with os.fdopen(handle, "rb") as file:
            if status.st_size == 0:
                raise InputError(path, "the file is empty")
            if status.st_size > limit:
                size, most = (
                    f"{n / 1e6:.0f} MB" if limit >= 1e6 else f"{n:,} bytes" for n in (status.st_size, limit)
                )
                raise InputError(path, f"{size}, at most {most} are read")
            return file.read(status.st_size)  # not ``limit``, which would be allocated first
    except FileNotFoundError:
        raise InputError(path, "no such file") from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(path, f"cannot read: {getattr(error, 'strerror', None) or error}") from None


_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")  # of a URI, or a drive letter


class Resolver:
    """Reads the files that a file names: regular files inside one folder and nothing else, never a network.

    Parameters
    ----------
    root
        The folder, usually that of the naming file. Links inside it are followed as long as they stay inside.
    """

    def __init__(self, root: str | Path) -> None:
        self.root = Path(os.path.realpath(root))

    def path(self, name: str, *, uri: bool = False) -> Path:
        """Where ``name`` lies, links resolved; the file itself is not touched.

        ``uri``: percent escapes are decoded, once. Raises InputError, whose ``path`` is ``name``, for what is
        absolute, a URL, written with backslashes or control characters, or leads out of the folder.
        """
        plain = unquote(name, errors="strict") if uri and "%" in name else name
        if not plain or not plain.isprintable():
            raise InputError(name, "expected a file's name without control characters")
        if plain.startswith("/") or _SCHEME.match(plain):
            raise InputError(
                name, "expected a name relative to the file that names it, no address or full path"
            )
        if "\\" in plain:
            raise InputError(name, "expected a name with / between folders, not a backslash")
        found = Path(os.path.realpath(self.root / plain))
        if found == self.root or not found.is_relative_to(self.root):
            raise InputError(name, "leads out of the folder of the file that names it, so it is not read")
        return found

    def read(self, name: str, *, limit: int, uri: bool = False) -> bytes:
        """All bytes of the file called ``name``, at most ``limit``.

        Raises InputError, whose ``path`` is ``name``, as `path` and `read_regular` do.
        """
        try:
            # Not a link any more: one that appears in between is refused.
            flags = os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW
            return _read(self.path(name, uri=uri), limit=limit, flags=flags)
        except InputError as error:
            raise InputError(name, error.reason) from None
        except ValueError:
            raise InputError(name, "expected a file's name in UTF-8") from None


def swap_folders(new: Path, old: Path) -> None:
    """Exchange two folders in one step where the system can, else by renames of which a kill may leave some."""
    exchange = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    at_cwd, rename_exchange = -100, 2
    if exchange and exchange(at_cwd, os.fsencode(new), at_cwd, os.fsencode(old), rename_exchange) == 0:
        return
    aside = old.with_name(f".{old.name}.{secrets.token_hex(4)}.replaced")
    os.rename(old, aside)
    try:
        os.rename(new, old)
    except BaseException:
        os.rename(aside, old)
        raise
    os.rename(aside, new)

"""Files that a page sends: streamed into the work folder, under limits, and never served again.

They come one by one into ``WORK/.arriving-UPLOAD/`` under their own plain names, which is how the files of a scene name
each other; the scene is read later, by a process of its own.
"""

from __future__ import annotations

import asyncio
import os
import re
import shutil
from collections.abc import AsyncIterator
from pathlib import Path
from urllib.parse import unquote

from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response

from ..errors import InputError, OutputError, printable
from ..files import explain
from .start_protocol import LARGEST_UPLOAD, MOST_FILES

SCENES = (".glb", ".gltf", ".obj", ".ply")
_BESIDE = (".bin", ".mtl", ".png", ".jpg", ".jpeg")
_NOT_READ = {
    ".xml": "a Mitsuba scene can run code: bake it at the command line, with --trust",
    ".zip": "archives are not opened: drop the files themselves",
    ".blend": "Blender's own files are not read: export as .glb",
    ".fbx": "FBX is not read: convert it to .glb",
    ".stl": "STL is not read: convert it to .ply or .glb",
    ".usd": "USD is not read: convert it to .glb",
}
_PREFIX = ".arriving-"
_IDLE = 30.0  # seconds without a byte
_AT_ONCE = 2  # uploads
_LONGEST_NAME = 120
_ROOM = 3  # times the size that must be free


def checked_name(name: str) -> str:
    """A plain name of a file that may belong to a scene. Raises InputError."""
    shown = name[:60]
    if not name or len(name) > _LONGEST_NAME or not name.isprintable() or name.startswith("."):
        raise InputError("file", f"{shown!r}, expected a plain name of at most {_LONGEST_NAME} letters")
    if re.search(r'[/\\:*?"<>|]', name):
        raise InputError("file", f"{shown!r}, expected a name without folders")
    suffix = Path(name).suffix.lower()
    if suffix not in (*SCENES, *_BESIDE):
        known = f"expected a scene ({', '.join(SCENES)}) and what belongs to it ({', '.join(_BESIDE)})"
        raise InputError(shown, _NOT_READ.get(suffix, known))
    return name


class Uploads:
    """What is being sent to a work folder. Lives on the event loop."""

    def __init__(self, work: Path) -> None:
        self._work = work
        self._running = 0
        if work.is_dir():
            for left in work.glob(_PREFIX + "*"):  # of a studio that has ended
                shutil.rmtree(left, ignore_errors=True)

    def taken(self, upload: str, main: str) -> Path:
        """The folder of an upload that has arrived. Raises InputError unless ``main`` is a scene in it."""
        folder = self._work / (_PREFIX + upload)
        if Path(checked_name(main)).suffix.lower() not in SCENES:
            raise InputError(main[:60], f"is no scene; expected one of {', '.join(SCENES)}")
        if not (folder / main).is_file():
            raise InputError(main[:60], "has not arrived; drop it again")
        return folder

    async def receive(self, request: Request) -> Response:
        """``POST /start/file/UPLOAD`` with the header ``X-Name``, percent-encoded."""
        upload: str = request.path_params["upload"]
        if not re.fullmatch(r"[0-9a-f]{16}", upload, re.ASCII):
            return _said(404, "there is no such thing here")
        if self._running >= _AT_ONCE:
            return _said(503, "other files are being sent; try again in a moment")
        self._running += 1
        try:
            await self._receive(request, self._work / (_PREFIX + upload))
        except InputError as error:
            return _said(422, printable(error))
        except OutputError as error:
            return _said(507, printable(error))
        except (ClientDisconnect, TimeoutError):
            return _said(408, "the file did not arrive")
        finally:
            self._running -= 1
        return JSONResponse({"ok": True})

    async def _receive(self, request: Request, folder: Path) -> None:
        try:
            name = checked_name(unquote(request.headers.get("x-name", ""), errors="strict"))
        except UnicodeDecodeError:
            raise InputError("file", "its name is not UTF-8") from None
        size = _declared(request)
        try:
            self._work.mkdir(parents=True, exist_ok=True)
            folder.mkdir(exist_ok=True)
            there = list(folder.iterdir())
            free = shutil.disk_usage(folder).free
            if len(there) >= MOST_FILES:
                raise InputError("file", f"more than {MOST_FILES} files; make one .glb of the scene")
            if size + sum(file.stat().st_size for file in there) > LARGEST_UPLOAD:
                raise InputError(
                    name, f"more than {LARGEST_UPLOAD / 1e6:,.0f} MB; bake it at the command line"
                )
            if free < _ROOM * size:
                raise OutputError(self._work, f"{size / 1e6:,.0f} MB come in, {free / 1e6:,.0f} MB are free")
            await _write(folder / name, request.stream(), size)
        except OSError as error:
            if isinstance(error, OutputError):
                raise
            raise OutputError(self._work, f"cannot write: {explain(error)}") from None


async def _write(path: Path, parts: AsyncIterator[bytes], size: int) -> None:
    """As many bytes as were said, or nothing. Raises InputError for more or fewer."""
    handle = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_NOFOLLOW, 0o666)
    come = 0
    try:
        with os.fdopen(handle, "wb") as file:
            while True:
                part = await asyncio.wait_for(anext(parts, None), _IDLE)
                if part is None:
                    break
                come += len(part)
                if come > size:
                    break
                await asyncio.to_thread(file.write, part)
        if come != size:
            raise InputError(path.name, f"{come:,} bytes came, {size:,} were announced; drop it again")
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def _declared(request: Request) -> int:
    text = request.headers.get("content-length", "")
    if not re.fullmatch(r"[0-9]{1,12}", text, re.ASCII) or not 0 < int(text) <= LARGEST_UPLOAD:
        most = f"{LARGEST_UPLOAD / 1e6:,.0f} MB"
        raise InputError("file", f"its size is {text[:20] or 'not said'}, expected at most {most}")
    return int(text)


def _said(status: int, reason: str) -> Response:
    return JSONResponse({"reason": reason}, status)

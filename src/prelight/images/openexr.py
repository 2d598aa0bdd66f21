"""OpenEXR pictures: read in a process of its own, written in this one.

Read are flat files, scan-line or tiled (the finest level), any compression, half, float or uint, with
channels R, G and B, or Y alone (grey); of several parts the first that has them. Layers (``name.R``),
luminance-chroma and deep files are refused, in one line each. The map is the display window: a larger
data window is cropped, a smaller one refused, since nobody can say what is missing. A file's
``chromaticities``, where they differ from Rec.709's by more than 0.02, give the matrix to Rec.709.
"""

from __future__ import annotations

import io
import json
import mmap
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import IO

import numpy as np

from .. import files
from ..arrays import Picture
from ..errors import InputError, MissingExtraError, OutputError
from . import chromaticities, exr_child
from .exr_header import MAGIC, Part, read_parts
from .map_checks import MAX_SIDE

__all__ = ["MAGIC", "decode_exr", "encode_exr"]

_CHILD = str(Path(exr_child.__file__))
_MEMORY = 4 << 30  # address space of the child beyond what the pixels need
_SECONDS, _BYTES_PER_SECOND = 10.0, 2_500_000  # how long the child may take, and for each decoded byte
_THREADS_FROM = 4 << 20  # pixels from which more than one thread is worth its start
_DAMAGED = "damaged or truncated OpenEXR file"


def _choose(path: object, parts: list[Part]) -> tuple[int, list[str]]:
    """The first part with R, G and B, else with Y alone; its number and channels."""
    for wanted in (["R", "G", "B"], ["Y"]):
        for number, part in enumerate(parts):
            if part.names >= set(wanted) and not part.names & {"RY", "BY"}:
                if any(channel.subsampled for channel in part.channels if channel.name in wanted):
                    raise InputError(
                        path, "its channels are subsampled, expected full R, G and B; save it anew"
                    )
                return number, wanted
    names = [channel.name for part in parts for channel in part.channels]
    if {"RY", "BY"} & set(names):
        raise InputError(path, "a luminance-chroma OpenEXR file, expected R, G and B; save it as RGB")
    shown = ", ".join(names[:8]) + (" …" if len(names) > 8 else "")
    raise InputError(path, f"channels {shown or '(none)'}, expected R, G and B (or Y) outside any layer")


def _crop(path: object, part: Part) -> list[int]:
    """The display window inside the data window: top, left, height, width."""
    left, top, right, bottom = part.data_window
    x0, y0, x1, y1 = part.display_window
    if x0 < left or y0 < top or x1 > right or y1 > bottom:
        raise InputError(
            path,
            f"only {right - left + 1}×{bottom - top + 1} pixels (its data window) of a picture of "
            f"{x1 - x0 + 1}×{y1 - y0 + 1} are in the file; save the whole map",
        )
    return [y0 - top, x0 - left, y1 - y0 + 1, x1 - x0 + 1]


def _scratch(path: object, content: bytes = b"") -> IO[bytes]:
    """A nameless file, in memory where the system can, at its beginning. Raises OutputError if there is no room."""
    try:
        if hasattr(os, "memfd_create"):
            file = os.fdopen(os.memfd_create("prelight"), "w+b")
        else:
            file = tempfile.TemporaryFile()  # noqa: SIM115
        file.write(content)
        file.seek(0)
    except OSError as error:
        raise OutputError(path, f"no room to decode it: {files.explain(error)}") from None
    return file


def _run_child(path: object, job: dict, handles: tuple[int, int], *, deadline: float) -> None:
    """Run the decoder to its end. Raises InputError if it fails, dies or is late."""
    command = [sys.executable, "-P", _CHILD, json.dumps(job)]  # -P: this folder stays off its import path
    try:
        status = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=handles,
            timeout=deadline,
            check=False,
        ).returncode
    except subprocess.TimeoutExpired:
        raise InputError(path, f"{_DAMAGED}: not decoded within {deadline:.0f} s") from None
    except OSError as error:
        raise OutputError(path, f"cannot start a process to decode it: {error.strerror}") from None
    if status == exr_child.NO_DECODER:
        raise MissingExtraError("reading OpenEXR needs the package OpenEXR: pip install OpenEXR")
    if status == exr_child.CANNOT_WRITE:
        raise OutputError(path, "no room for the decoded map; free some memory or temporary space")
    if status == exr_child.OUT_OF_MEMORY:
        raise InputError(path, f"{_DAMAGED}: decoding it takes more memory than its size allows")
    if status != 0:
        raise InputError(path, _DAMAGED if status > 0 else f"{_DAMAGED}: the decoder died (signal {-status})")


def decode_exr(path: object, data: bytes) -> tuple[Picture, chromaticities.Matrix | None]:
    """Linear values of an OpenEXR file, row 0 at the top, and the matrix to Rec.709 still to be applied, if any.

    Header and sizes are checked here; pixels are decoded by a child process with bounded memory and time,
    so that a damaged file ends in InputError, whatever it does to the decoder. Values are not checked.

    Raises
    ------
    InputError
        If the file is damaged, too large or of a kind not read here (see the module).
    MissingExtraError
        If the package OpenEXR is not installed.
    """
    parts = read_parts(path, data)
    number, wanted = _choose(path, parts)
    part = parts[number]
    matrix = (
        chromaticities.rgb_to_rec709(part.chromaticities, path)
        if part.chromaticities and len(wanted) > 1
        else None
    )
    crop = _crop(path, part)
    left, top, right, bottom = part.data_window
    decoded = sum(p.decoded_bytes for p in parts)
    with _scratch(path, data) as source, _scratch(path) as target:
        job = {
            "source": source.fileno(),
            "target": target.fileno(),
            "parts": len(parts),
            "part": number,
            "channels": wanted,
            "shape": [bottom - top + 1, right - left + 1],
            "crop": crop,
            "max_side": MAX_SIDE,
            "threads": min(4, os.cpu_count() or 1) if part.pixels >= _THREADS_FROM else 0,
            "memory": _MEMORY + 2 * decoded,
            "seconds": 3 + decoded // (2 * _BYTES_PER_SECOND),
        }
        _run_child(
            path, job, (source.fileno(), target.fileno()), deadline=_SECONDS + decoded / _BYTES_PER_SECOND
        )
        size = crop[2] * crop[3] * 12
        if os.fstat(target.fileno()).st_size != size:
            raise InputError(path, _DAMAGED)
        pixels = mmap.mmap(target.fileno(), size)
    return np.frombuffer(pixels, np.float32).reshape(crop[2], crop[3], 3), matrix


def encode_exr(picture: Picture) -> bytes:
    """A scan-line OpenEXR file, ZIP, float32 channels R, G and B, chromaticities of Rec.709."""
    try:
        import OpenEXR
    except ImportError:
        raise MissingExtraError("writing OpenEXR needs the package OpenEXR: pip install OpenEXR") from None
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "chromaticities": chromaticities.REC709,
    }
    out = io.BytesIO()
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(picture, np.float32)}).write(out)
    return out.getvalue()

"""Maps and pictures, from files and to files. What a file is shows in its first bytes, not in its name.

Read: Radiance (.hdr, .pic) and OpenEXR (.exr), scene-linear. Written: those two, PNG and NPY, each whole
or not at all. The caller decides about existing files (``files.refuse_existing``).
"""

from __future__ import annotations

import contextlib
import io
import os
import stat
from collections.abc import Callable
from pathlib import Path

import numpy as np

from .. import files
from ..arrays import Bytes, Picture
from ..errors import InputError
from . import chromaticities, openexr, radiance_hdr
from .map_checks import MAX_PIXELS, check_radiance

_ACCEPTED = "expected a Radiance (.hdr) or OpenEXR (.exr) map"
_REFUSED = {
    b"\x89PNG": "PNG",
    b"\xff\xd8\xff": "JPEG",
    b"GIF8": "GIF",
    b"BM": "BMP",
}
_LONGEST_FILE = MAX_PIXELS * 16 + (1 << 20)  # the largest map with four float channels, not compressed


def _first_bytes(path: str | Path) -> bytes:
    """The beginning of a regular file, or nothing: then reading all of it gives the reason."""
    with contextlib.suppress(OSError, ValueError):
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        with os.fdopen(handle, "rb") as file:
            return file.read(16) if stat.S_ISREG(os.fstat(file.fileno()).st_mode) else b""
    return b""


def _decoder(
    path: object, first: bytes
) -> Callable[[object, bytes], tuple[Picture, chromaticities.Matrix | None]]:
    """What decodes a file that begins with these bytes. Raises InputError for any other kind."""
    if first.startswith(radiance_hdr.MAGIC):
        return radiance_hdr.decode_radiance_hdr
    if first.startswith(openexr.MAGIC):
        return openexr.decode_exr
    for magic, name in _REFUSED.items():
        if first.startswith(magic):
            raise InputError(path, f"a {name} file, an 8-bit display image; an environment needs HDR or EXR")
    if first.startswith((b"II*\0", b"MM\0*")):
        raise InputError(path, f"a TIFF or raw camera file, {_ACCEPTED}; convert it")
    raise InputError(path, f"neither of the two kinds of map, {_ACCEPTED}")


def read_radiance_map(path: str | Path) -> Picture:
    """Scene-linear Rec.709 radiance (H, W, 3) of a Radiance or OpenEXR file, row 0 at the top.

    Radiance: a component is m·2^(e−136) (see ``radiance_hdr``); EXPOSURE and COLORCORR are divided out; all
    eight orientations; flat, old and new run lengths; XYZE converted. OpenEXR: see ``openexr``. Other
    primaries are converted to Rec.709, white to white, components below 0 set to 0. At most 32,768 pixels
    a side and 201 million in all.

    Returns
    -------
    Finite and not negative, up to a common exposure; contiguous and writable.

    Raises
    ------
    InputError
        If the file is missing, of another kind, damaged or too large, or if a pixel is NaN, infinite or
        negative: the message counts them and names the first row and column.
    """
    first = _first_bytes(path)
    decode = _decoder(path, first) if first else None
    data = files.read_regular(path, limit=_LONGEST_FILE)
    picture, matrix = (decode or _decoder(path, data[:16]))(path, data)
    check_radiance(path, picture)
    if matrix is not None:
        chromaticities.convert(picture, matrix)
        check_radiance(path, picture)
    return picture


def _check_picture(path: object, picture: np.ndarray, dtype: type) -> None:
    shape = getattr(picture, "shape", None)
    if shape is None or len(shape) != 3 or shape[2] != 3 or min(shape) < 1 or picture.dtype != dtype:
        given = f"{getattr(picture, 'dtype', type(picture).__name__)} {shape or ''}".strip()
        raise InputError(
            path, f"cannot write {given} as a picture, expected {np.dtype(dtype).name} (height, width, 3)"
        )


def write_exr(path: str | Path, picture: Picture) -> None:
    """Write linear radiance as OpenEXR: float32, ZIP, channels R, G and B, primaries of Rec.709.

    Raises InputError for an array of another shape or type, OutputError if it cannot be written.
    """
    _check_picture(path, picture, np.float32)
    files.publish(Path(path), openexr.encode_exr(picture))


def write_hdr(path: str | Path, picture: Picture) -> None:
    """Write linear radiance as Radiance RGBE with run lengths; the error is up to 1/256 of a pixel's largest.

    Raises InputError for another shape or type, or values that are NaN, infinite or negative.
    """
    _check_picture(path, picture, np.float32)
    check_radiance(path, picture)
    files.publish(Path(path), radiance_hdr.encode_radiance_hdr(picture))


def write_png(path: str | Path, display: Bytes) -> None:
    """Write display values (H, W, 3) uint8 as PNG, marked as sRGB.

    Raises InputError for an array of another shape or type, OutputError if it cannot be written.
    """
    from PIL import Image, PngImagePlugin

    _check_picture(path, display, np.uint8)
    info = PngImagePlugin.PngInfo()
    info.add(b"sRGB", b"\0")  # perceptual intent
    out = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(display)).save(out, "PNG", pnginfo=info, compress_level=6)
    files.publish(Path(path), out.getbuffer())


def write_npy(path: str | Path, array: np.ndarray) -> None:
    """Write an array of numbers as NPY (version 1.0, little-endian as in memory, no pickle).

    Raises InputError for an array of objects, OutputError if it cannot be written.
    """
    if array.dtype.hasobject:
        raise InputError(path, "cannot write an array of objects, expected numbers")
    out = io.BytesIO()
    np.lib.format.write_array(out, np.ascontiguousarray(array), allow_pickle=False)
    files.publish(Path(path), out.getbuffer())

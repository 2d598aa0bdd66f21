"""Radiance pictures (.hdr, .pic): the header, and RGBE pixels to linear values and back.

A component is m·2^(e−136) for mantissa byte m and exponent byte e, and exactly 0 for e = 0, as OpenCV,
Mitsuba and most programs read it. (Radiance's own colr_color adds half a unit, (m + ½)·2^(e−136).)

References
----------
G. Ward, "Real Pixels", Graphics Gems II, 1991.  Radiance, "File Formats", section Picture File Format (.hdr).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Float32, Picture, UInt8
from ..errors import InputError
from . import chromaticities
from .map_checks import check_size

MAGIC = b"#?"
_LONGEST_HEADER = 65_536
_LARGEST = 255 * 2.0**119
_RESOLUTION = re.compile(r"([+-])([XY]) *(\d{1,9}) +([+-])([XY]) *(\d{1,9})\s*")


@dataclass
class _Header:
    lines: int = 0  # scan-lines
    width: int = 0  # pixels along a scan-line
    columns_first: bool = False  # scan-lines run down the picture, not across
    flip: tuple[bool, bool] = (False, False)  # rows, columns of the finished picture
    exposure: list[float] = field(default_factory=lambda: [1.0, 1.0, 1.0])
    xyz: bool = False
    primaries: list[float] | None = None
    end: int = 0  # first byte of the pixels


def _numbers(path: object, line: str, count: int) -> list[float]:
    name, _, text = line.partition("=")
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(v) for v in values):
        raise InputError(path, f"header line {name}={text.strip()[:40]!r}, expected {count} finite number(s)")
    return values


def _read_variable(path: object, line: str, header: _Header) -> None:
    """One line of the header into ``header``; lines of unknown meaning are passed over."""
    if line.startswith("FORMAT="):
        value = line[7:].strip()
        if value not in ("32-bit_rle_rgbe", "32-bit_rle_xyze"):
            raise InputError(path, f"FORMAT={value[:40]!r}, expected 32-bit_rle_rgbe or 32-bit_rle_xyze")
        header.xyz = value.endswith("xyze")
    elif line.startswith(("EXPOSURE=", "COLORCORR=")):
        factors = _numbers(path, line, 1 if line.startswith("E") else 3)
        if min(factors) <= 0:
            raise InputError(path, f"header line {line[:60]!r}, expected numbers above 0")
        header.exposure = [
            old * new for old, new in zip(header.exposure, factors * (3 // len(factors)), strict=True)
        ]
    elif line.startswith("GAMMA="):
        if abs((gamma := _numbers(path, line, 1)[0]) - 1.0) > 1e-3:
            raise InputError(
                path, f"GAMMA={gamma:g}, expected linear values; save the map without gamma correction"
            )
    elif line.startswith("PRIMARIES="):
        primaries = _numbers(path, line, 8)
        header.primaries = primaries if any(primaries) else None  # Photoshop writes eight zeros


def _read_resolution(path: object, line: str, header: _Header) -> None:
    match = _RESOLUTION.fullmatch(line)
    if not match or match[2] == match[5]:
        raise InputError(path, f"resolution line {line[:40]!r}, expected one like '-Y 512 +X 1024'")
    header.lines, header.width = int(match[3]), int(match[6])
    header.columns_first = match[2] == "X"
    sign = {match[2]: match[1], match[5]: match[4]}
    header.flip = (sign["Y"] == "+", sign["X"] == "-")  # +Y counts from the bottom, +X from the left
    height, width = (header.width, header.lines) if header.columns_first else (header.lines, header.width)
    check_size(path, width, height)


def _read_header(path: object, data: bytes) -> _Header:
    header = _Header()
    head = data[:_LONGEST_HEADER]
    at, blank = 0, False
    while True:
        end = head.find(b"\n", at)
        if end < 0:
            reason = (
                "no resolution line in the first 64 KB"
                if len(data) > len(head)
                else "the file ends in its header"
            )
            raise InputError(path, f"{reason}; it is damaged or no Radiance picture")
        line = head[at:end].decode("latin-1").rstrip("\r")
        at = end + 1
        if blank:
            _read_resolution(path, line, header)
            header.end = at
            return header
        blank = not line
        if line and not line.startswith("#"):
            _read_variable(path, line, header)


def _scale(exposure: list[float]) -> Float32[np.ndarray, "256 3"]:
    """What one unit of the mantissa is worth, by exponent byte and channel."""
    units = np.ldexp(1.0, np.arange(256) - 136)
    units[0] = 0.0
    with np.errstate(over="ignore"):  # an absurd exposure gives infinities, refused with all others
        return np.divide.outer(units, exposure).astype(np.float32)


def decode_radiance_hdr(path: object, data: bytes) -> tuple[Picture, chromaticities.Matrix | None]:
    """Linear values of a Radiance picture, row 0 at the top, EXPOSURE and COLORCORR divided out.

    The second is the matrix to Rec.709, still to be applied, where the picture is XYZE or its primaries
    differ from Rec.709's by more than 0.02. The run lengths are followed to the end before anything is
    allocated. Values are not checked here.

    Raises
    ------
    InputError
        If the header or the pixels are not as the format says, or the map is too large.
    """
    from . import rgbe_kernels as kernels  # imports Numba, which programs that only write PNG do without

    header = _read_header(path, data)
    matrix = chromaticities.xyz_to_rec709() if header.xyz else None
    if header.primaries and not header.xyz:
        matrix = chromaticities.rgb_to_rec709(header.primaries, path)
    pixels = np.frombuffer(data, np.uint8)
    starts = np.empty(header.lines, np.int64)
    state, line, byte = kernels.find_scanlines(pixels, header.end, header.width, starts)
    if state != kernels.OK:
        reason = {
            kernels.CUT_SHORT: f"the file ends in scan-line {line} of {header.lines}; it is cut short",
            kernels.RUN_TOO_LONG: f"damaged: a run goes past the end of scan-line {line}",
            kernels.OTHER_WIDTH: f"damaged: scan-line {line} says another width than the header",
            kernels.NOTHING_TO_REPEAT: f"damaged: scan-line {line} begins with a repeat",
        }[state]
        raise InputError(path, reason, f"byte {byte}")
    picture = np.empty((header.lines, header.width, 3), np.float32)
    kernels.decode(pixels, starts, _scale(header.exposure), picture)
    if header.columns_first:
        picture = picture.transpose(1, 0, 2)
    rows, columns = (slice(None, None, -1 if flip else 1) for flip in header.flip)
    return np.ascontiguousarray(picture[rows, columns]), matrix


def to_rgbe(picture: Picture) -> UInt8[np.ndarray, "height width 4"]:
    """Shared-exponent bytes of linear values, rounded to nearest.

    The error of a component is at most 1/256 of the pixel's largest; pixels below 2⁻¹²⁷ become 0, values
    above 255·2¹¹⁹ become that. Values must be finite and not negative.
    """
    picture = np.minimum(picture, np.float32(_LARGEST))
    _, exponent = np.frexp(picture.max(axis=-1))
    mantissa = np.rint(np.ldexp(picture, 8 - exponent[..., None]))
    carried = mantissa.max(axis=-1) > 255  # 255.5 and more round to 256: one exponent up
    exponent = exponent + carried
    mantissa[carried] = np.rint(np.ldexp(picture[carried], 8 - exponent[carried][:, None]))
    out = np.empty((*picture.shape[:2], 4), np.uint8)
    out[..., :3] = mantissa
    out[..., 3] = np.maximum(exponent + 128, 0)
    out[(exponent <= -127) | (mantissa.max(axis=-1) == 0)] = 0
    return out


def encode_radiance_hdr(picture: Picture) -> bytes:
    """A Radiance picture in new run lengths (flat where the format allows no other: width below 8 or above 32,767)."""
    from . import rgbe_kernels as kernels

    pixels = to_rgbe(picture)
    height, width = pixels.shape[:2]
    header = f"#?RADIANCE\nSOFTWARE=Prelight\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    if not kernels.SHORTEST_NEW <= width <= kernels.LONGEST_NEW:
        return header + pixels.tobytes()
    out = np.empty(height * (4 + 4 * (width + width // 128 + 1)), np.uint8)
    return header + out[: kernels.encode(pixels, out)].tobytes()

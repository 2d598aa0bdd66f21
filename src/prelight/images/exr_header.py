"""The header of an OpenEXR file in plain Python, so that nothing native sees a size nobody has checked.

References
----------
OpenEXR, "OpenEXR File Layout" (magic, version flags, attributes, chunk offset tables).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from ..errors import InputError
from .map_checks import check_size

MAGIC = b"\x76\x2f\x31\x01"
_LONGEST_HEADER = 1 << 20
_MOST_DECODED_BYTES = 16 * 192 * 1024 * 1024  # the largest map with four float channels
_TILED, _LONG_NAMES, _DEEP, _MULTIPART = 0x200, 0x400, 0x800, 0x1000
_BYTES_PER_VALUE = {0: 4, 1: 2, 2: 4}  # uint, half, float
# Of each compression: scan-lines in a chunk, and the most it can shrink data (0: without limit worth testing).
_COMPRESSIONS = {
    0: (1, 1), 1: (1, 64), 2: (1, 1032), 3: (16, 1032), 4: (32, 0), 5: (16, 1400), 6: (32, 0), 7: (32, 0),
    8: (32, 0), 9: (256, 0), 10: (256, 0), 11: (32, 0),
}  # fmt: skip
_SMALLEST_CHUNK = 8 + 4 + 4 + 1  # its place in the table, its coordinate, its size, one byte

Box = tuple[int, int, int, int]  # left, top, right, bottom; the last two included


@dataclass(frozen=True)
class Channel:
    name: str
    value_bytes: int
    subsampled: bool


@dataclass(frozen=True)
class Part:
    """One picture of a file, as far as it matters here."""

    channels: tuple[Channel, ...]
    data_window: Box
    display_window: Box
    compression: int
    tile: tuple[int, int] | None
    chromaticities: tuple[float, ...] | None

    @property
    def names(self) -> set[str]:
        return {channel.name for channel in self.channels}

    @property
    def pixels(self) -> int:
        left, top, right, bottom = self.data_window
        return (right - left + 1) * (bottom - top + 1)

    @property
    def decoded_bytes(self) -> int:
        return self.pixels * sum(channel.value_bytes for channel in self.channels)

    @property
    def fewest_bytes(self) -> int:
        """What the chunks of this part take in a file at the very least."""
        left, top, right, bottom = self.data_window
        width, height = right - left + 1, bottom - top + 1
        lines, ratio = _COMPRESSIONS.get(self.compression, (height, 0))
        across, down = self.tile or (width, lines)
        chunks = -(-width // across) * -(-height // down)
        whole = all(not channel.subsampled for channel in self.channels)
        return max(chunks * _SMALLEST_CHUNK, self.decoded_bytes // ratio if ratio and whole else 0)


class _Reader:
    """A place in the header; every read is compared with the end first."""

    def __init__(self, path: object, data: bytes) -> None:
        self.path, self.data, self.at = path, data[:_LONGEST_HEADER], 0

    def damaged(self, reason: str) -> InputError:
        return InputError(self.path, f"damaged OpenEXR header: {reason}", f"byte {self.at}")

    def take(self, count: int) -> bytes:
        if count < 0 or self.at + count > len(self.data):
            raise self.damaged("it is longer than the file, or than 1 MB")
        self.at += count
        return self.data[self.at - count : self.at]

    def numbers(self, layout: str) -> tuple:
        return struct.unpack(layout, self.take(struct.calcsize(layout)))

    def name(self) -> str:
        end = self.data.find(b"\0", self.at, self.at + 256)
        if end < 0:
            raise self.damaged("a name has no end")
        return self.take(end + 1 - self.at)[:-1].decode("utf-8", "replace")


def _read_channels(reader: _Reader, end: int) -> tuple[Channel, ...]:
    channels = []
    while name := reader.name():
        kind, _, across, down = reader.numbers("<iIii")
        if kind not in _BYTES_PER_VALUE or across < 1 or down < 1:
            raise reader.damaged(f"channel {name[:40]!r} has an unknown type or sampling")
        channels.append(Channel(name, _BYTES_PER_VALUE[kind], across > 1 or down > 1))
    if reader.at != end:
        raise reader.damaged("the list of channels has another length than it says")
    return tuple(channels)


_PLAIN = {  # the attributes that matter, their type and layout
    "dataWindow": ("box2i", "<4i"),
    "displayWindow": ("box2i", "<4i"),
    "compression": ("compression", "<B"),
    "tiles": ("tiledesc", "<IIB"),
    "chromaticities": ("chromaticities", "<8f"),
}


def _read_attributes(reader: _Reader) -> dict:
    """The attributes of one part that matter here, by name."""
    found: dict = {}
    while name := reader.name():
        kind = reader.name()
        (size,) = reader.numbers("<i")
        end = reader.at + size
        if name == "channels":
            found[name] = _read_channels(reader, end)
        elif name in _PLAIN:
            expected, layout = _PLAIN[name]
            if kind != expected or size != struct.calcsize(layout):
                raise reader.damaged(f"attribute {name} has another type or size than it should")
            found[name] = reader.numbers(layout)
        elif name == "type":
            found[name] = reader.take(size)
        else:
            reader.take(size)
    return found


def _read_part(reader: _Reader, *, tiled: bool) -> Part | None:
    """The next part, or None at the empty header that ends a list of parts."""
    begin = reader.at
    found = _read_attributes(reader)
    if not found and reader.at == begin + 1:
        return None
    for name in ("channels", "dataWindow", "displayWindow", "compression"):
        if name not in found:
            raise reader.damaged(f"no attribute {name}")
    for name in ("dataWindow", "displayWindow"):
        left, top, right, bottom = found[name]
        check_size(reader.path, right - left + 1, bottom - top + 1)
    tile = None
    if found.get("type", b"tiledimage" if tiled else b"") == b"tiledimage":
        tile = found.get("tiles", (0, 0))[:2]
        if min(tile) < 1:
            raise reader.damaged("its tiles have no size")
    return Part(
        channels=found["channels"],
        data_window=found["dataWindow"],
        display_window=found["displayWindow"],
        compression=found["compression"][0],
        tile=tile,
        chromaticities=found.get("chromaticities"),
    )


def read_parts(path: object, data: bytes) -> list[Part]:
    """The parts of an OpenEXR file, sizes checked against the limits and against the file's own length.

    Raises InputError for what is damaged, deep, larger than a map may be or longer than the file.
    """
    reader = _Reader(path, data)
    reader.take(len(MAGIC))
    (version,) = reader.numbers("<I")
    if version & 0xFF != 2 or version & ~(0xFF | _TILED | _LONG_NAMES | _DEEP | _MULTIPART):
        raise reader.damaged(f"version field {version:#x}, expected version 2 with known flags")
    if version & _DEEP:
        raise InputError(
            path, "a deep OpenEXR file (many samples a pixel), expected a flat one; flatten it first"
        )
    parts: list[Part] = []
    while part := _read_part(reader, tiled=bool(version & _TILED)):
        parts.append(part)
        if not version & _MULTIPART:
            break
    if not parts:
        raise reader.damaged("no picture in it")
    fewest = reader.at + sum(part.fewest_bytes for part in parts)
    if fewest > len(data):
        raise InputError(
            path, f"the file is cut short: {len(data):,} bytes, its header asks for {fewest:,} or more"
        )
    if (decoded := sum(part.decoded_bytes for part in parts)) > _MOST_DECODED_BYTES:
        raise InputError(
            path,
            f"all its channels together are {decoded / 1e9:.1f} GB, at most {_MOST_DECODED_BYTES / 1e9:.1f} GB "
            "are decoded; keep only R, G and B",
        )
    return parts

"""Radiance frames: what the studio sends as binary, a header and a word for each row."""

from __future__ import annotations

import struct
from typing import NamedTuple

from ..errors import InputError

FRAME_MAGIC = 0x31524C50  # "PLR1"
FRAME_EXACT = 1  # flag: the exact light, until something changes; otherwise a first answer
FRAME_ASIDE = 2  # flag: of a look to compare with, not of what is lit; needs no ``Seen``
FRAME_VIEW = 4  # flag: what depends on the eye, the answer to ``LookFrom``; with FRAME_ASIDE, of a look
FRAME_SHINE = (
    8  # flag of such: it begins with two words a vertex, four half floats, the first three to be added
)
FRAME_WORLD = 16  # flag of such: it ends with a map of what is outside, WORLD_WIDTH × WORLD_HEIGHT rgb9e5
FRAME_TRACED = 32  # flag: a picture by the path tracer, row by row from the top; needs no ``Seen``
WORLD_WIDTH, WORLD_HEIGHT = 512, 256
HEADER_BYTES = 32
_HEADER = struct.Struct("<IIIIfI8x")


class FrameHeader(NamedTuple):
    """The first 32 bytes of a binary frame, little-endian; then ``count`` words, uint32, as the flags say.

    Without a flag that says else these are rgb9e5, one for each row. The header: uint32 magic, frame, sequence (of
    the state), count; float32 milliseconds; uint32 flags; 8 bytes of zeros.
    """

    frame: int
    sequence: int
    count: int
    milliseconds: float
    flags: int

    def write(self, into: bytearray | memoryview) -> None:
        """Fill the first 32 bytes."""
        _HEADER.pack_into(into, 0, FRAME_MAGIC, *self)

    @classmethod
    def read(cls, data: bytes | memoryview) -> FrameHeader:
        """Raises InputError unless ``data`` is a whole frame."""
        if len(data) >= HEADER_BYTES:
            magic, *fields = _HEADER.unpack_from(data)
            header = cls(*fields)
            if magic == FRAME_MAGIC and len(data) == HEADER_BYTES + 4 * header.count:
                return header
        raise InputError("frame", f"{len(data)} bytes that are no whole radiance frame")

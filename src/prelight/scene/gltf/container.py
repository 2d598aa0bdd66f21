"""The container of a GLB file: its chunks; and a guard before any glTF's JSON is parsed."""

from __future__ import annotations

import re
import struct

import numpy as np

from ..mesh import UnreadableMesh

_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_LARGEST_JSON = 64_000_000
_DEEPEST = 64
_MOST_VALUES = 1_000_000
_MOST_CHUNKS = 1000
# A string, or the rest of the text where one is not closed: linear time whatever the input.
_STRING = re.compile(rb'"[^"\\]*(?:\\.[^"\\]*)*(?:"|\\?\Z)', re.DOTALL)
_NOT_STRUCTURE = bytes(set(range(256)) - set(b"[]{},"))


def read_chunks(data: bytes) -> tuple[bytes, memoryview]:
    """The JSON text and the binary chunk (empty where there is none). Raises UnreadableMesh."""
    if len(data) < 12:
        raise UnreadableMesh(f"damaged glTF file: {len(data)} bytes, the header alone has 12")
    _, version, length = struct.unpack_from("<4sII", data)
    if version != 2:
        raise UnreadableMesh(f"glTF version {version}, expected 2: export the scene again", "byte 4")
    if not 20 <= length <= len(data):
        reason = f"damaged glTF file: declares {length:,} bytes, expected 20 to {len(data):,}"
        raise UnreadableMesh(reason, "byte 8")
    text, binary, at, number = b"", memoryview(b""), 12, 0
    while at < length:
        if at + 8 > length:
            raise UnreadableMesh("damaged glTF file: it ends inside a chunk's header", f"byte {at}")
        size, kind = struct.unpack_from("<II", data, at)
        where, at = f"byte {at}", at + 8
        if size % 4 or size > length - at:
            raise UnreadableMesh(
                f"damaged glTF file: chunk {number} has {size:,} bytes, {length - at:,} are left "
                "(expected a multiple of 4)",
                where,
            )
        if (kind == _JSON) != (number == 0) or (kind == _BINARY and number != 1):
            raise UnreadableMesh("damaged glTF file: expected one JSON chunk, then one binary chunk", where)
        if kind == _JSON:
            text = data[at : at + size]
        elif kind == _BINARY:
            binary = memoryview(data)[at : at + size]
        at, number = at + size, number + 1
        if number > _MOST_CHUNKS:
            raise UnreadableMesh(f"damaged glTF file: more than {_MOST_CHUNKS} chunks", where)
    check_json_size(text)
    return text, binary


def check_json_size(text: bytes) -> None:
    """Refuse JSON that would take much memory or depth to parse, before anything parses it."""
    if not text.strip():
        raise UnreadableMesh("damaged glTF file: its JSON is empty")
    if len(text) > _LARGEST_JSON:
        size = f"{len(text) / 1e6:.0f} MB"
        raise UnreadableMesh(f"its JSON has {size}, at most 64 MB are read: export as GLB")
    if text.count(b'"') > 2 * _MOST_VALUES:
        raise UnreadableMesh(f"its JSON has more than {_MOST_VALUES:,} strings")
    structure = _STRING.sub(b"", text).translate(None, _NOT_STRUCTURE)
    if len(structure) - structure.count(b"]") - structure.count(b"}") > _MOST_VALUES:
        raise UnreadableMesh(f"its JSON has more than {_MOST_VALUES:,} values")
    marks = np.frombuffer(structure, np.uint8)
    opened = np.isin(marks, list(b"[{")).astype(np.int32) - np.isin(marks, list(b"]}"))
    if len(marks) and np.cumsum(opened).max() > _DEEPEST:
        raise UnreadableMesh(f"its JSON is nested deeper than {_DEEPEST} levels")

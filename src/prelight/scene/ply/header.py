"""The header of a PLY file: which tables it declares and where they start."""

from __future__ import annotations

from dataclasses import dataclass

from ..mesh import UnreadableMesh, short_name

_LONGEST_HEADER = 64 * 1024
_MOST_ELEMENTS, _MOST_PROPERTIES, _MOST_RECORDS = 32, 256, 100_000_000
_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8",
}  # fmt: skip
_ENCODINGS = {"ascii": "text", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class Property:
    """One column of an element; a list where ``count_type`` is set. Types are NumPy's, without byte order."""

    name: str
    type: str
    count_type: str | None = None


@dataclass(frozen=True)
class Element:
    """A table of the file, such as the vertices."""

    name: str
    count: int
    properties: tuple[Property, ...]


@dataclass(frozen=True)
class Header:
    """What the header declares, and where the body starts."""

    encoding: str  # "text", "<" or ">"
    elements: tuple[Element, ...]
    body: int  # byte offset


def read_header(data: bytes) -> Header:
    """Parse the header; raises UnreadableMesh with the line."""
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    if end < 0:
        raise UnreadableMesh(f"damaged PLY file: no end_header in the first {_LONGEST_HEADER // 1024} kB")
    lines = data[:end].decode("utf-8", "replace").splitlines()
    encoding, elements = None, []
    for number, line in enumerate(lines[1:], start=2):
        where, words = f"line {number}", line.split()
        match words:
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", kind, "1.0"] if kind in _ENCODINGS and encoding is None:
                encoding = _ENCODINGS[kind]
            case ["element", name, count]:
                elements.append(_element(name, count, elements, where))
            case ["property", *rest] if elements:
                elements[-1][2].append(_property(rest, elements[-1], where))
            case _:
                raise UnreadableMesh(f"'{short_name(line)}' is no header line of a PLY file", where)
    if encoding is None:
        raise UnreadableMesh(
            "the header has no line 'format ascii|binary_little_endian|binary_big_endian 1.0'"
        )
    tables = tuple(Element(name, count, tuple(properties)) for name, count, properties in elements)
    return Header(encoding, tables, _after_line(data, end + len(b"end_header")))


def _element(name: str, count: str, known: list, where: str) -> tuple[str, int, list[Property]]:
    if not (count.isascii() and count.isdigit() and len(count) <= 18 and int(count) <= _MOST_RECORDS):
        raise UnreadableMesh(f"element count '{short_name(count)}', expected 0 to {_MOST_RECORDS:,}", where)
    if name in {other for other, _, _ in known}:
        raise UnreadableMesh(f"element '{short_name(name)}' is declared twice", where)
    if len(known) == _MOST_ELEMENTS:
        raise UnreadableMesh(f"more than {_MOST_ELEMENTS} elements", where)
    return name, int(count), []


def _property(words: list[str], element: tuple[str, int, list[Property]], where: str) -> Property:
    match words:
        case [kind, name] if kind in _TYPES:
            found = Property(name, _TYPES[kind])
        case ["list", count_kind, kind, name] if kind in _TYPES and _TYPES.get(count_kind, "f")[0] != "f":
            found = Property(name, _TYPES[kind], _TYPES[count_kind])
        case _:
            raise UnreadableMesh(f"'property {short_name(' '.join(words))}' is not understood", where)
    if found.name in {p.name for p in element[2]}:
        raise UnreadableMesh(f"property '{short_name(found.name)}' is declared twice", where)
    if len(element[2]) == _MOST_PROPERTIES:
        raise UnreadableMesh(f"more than {_MOST_PROPERTIES} properties in one element", where)
    return found


def _after_line(data: bytes, at: int) -> int:
    """The offset after the line of end_header, which ends in \\n, \\r\\n, or \\r if the first line does."""
    while data[at : at + 1] in (b" ", b"\t"):
        at += 1
    lone_return = data[3:4] == b"\r" and data[4:5] != b"\n"
    for ending in (b"\n", b"\r") if lone_return else (b"\n", b"\r\n", b"\r"):
        if data.startswith(ending, at):
            return at + len(ending)
    if at == len(data):
        return at
    raise UnreadableMesh("damaged PLY file: something follows end_header on its line", f"byte {at}")

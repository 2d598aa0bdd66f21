"""MTL files: which materials they describe, as words; and what stands on a line that names a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ...errors import InputError
from ...files import Resolver
from ..mesh import short_name

_MOST_LIBRARIES, _MOST_TEXT = 8, 8_000_000  # of all libraries of an OBJ together
_MOST_NAMED = 32  # mtllib lines
# Options of a map statement and the most numbers each takes; the rest of the line is the file's name.
_OPTIONS = {
    "-blendu": 1, "-blendv": 1, "-bm": 1, "-boost": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1, "-mm": 2,
    "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-type": 1, "-colorspace": 1,
}  # fmt: skip
_WORDS = {"-blendu", "-blendv", "-cc", "-clamp", "-imfchan", "-type", "-colorspace"}


@dataclass
class Entry:
    """One ``newmtl``: its statements, keywords in lower case, each with the rest of its line."""

    name: str
    statements: dict[str, str] = field(default_factory=dict)

    def numbers(self, keyword: str) -> list[float] | None:
        """The finite numbers after a keyword, or None where there is no such line or anything else on it."""
        words = self.statements.get(keyword, "").split()
        found = [number(word) for word in words]
        return None if not found or None in found else [value for value in found if value is not None]


@dataclass(frozen=True)
class MapStatement:
    """The picture that a ``map_…`` line names, and how its coordinates are scaled and moved."""

    file: str
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    ignored: tuple[str, ...] = ()


def number(word: str) -> float | None:
    """A finite number, or None."""
    try:
        value = float(word)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def read_libraries(statements: list[str], resolver: Resolver, notes: list[str]) -> dict[str, Entry]:
    """All materials by name; where two files describe one, the file named first has the word.

    ``statements`` are what stands after each ``mtllib``: one name with spaces or several names. A file that
    cannot be read costs a note, never the scene.
    """
    found: dict[str, Entry] = {}
    done: set[str] = set()
    left = _MOST_TEXT
    distinct = list(dict.fromkeys(statements))
    if len(distinct) > _MOST_NAMED:
        notes.append(f"more than {_MOST_NAMED} lines of mtllib: the others not read")
    for names in distinct[:_MOST_NAMED]:
        for name, text in _texts(names, resolver, left, done, notes):
            if len(done) > _MOST_LIBRARIES:
                notes.append(f"more than {_MOST_LIBRARIES} material libraries: the others not read")
                return found
            left -= len(text)
            entries = parse_library(text)
            if not entries:
                notes.append(f"material library '{short_name(name)}' holds no material")
            for entry in entries:
                found.setdefault(entry.name, entry)
    return found


def _texts(
    names: str, resolver: Resolver, left: int, done: set[str], notes: list[str]
) -> list[tuple[str, bytes]]:
    """The libraries of one mtllib line that were not read before: the whole line as a name, else its words."""
    whole = names.replace("\\", "/")
    words = [word for word in whole.split() if word != whole] if len(whole.split()) <= _MOST_LIBRARIES else []
    texts = []
    for candidates in ([whole], words):
        for name in candidates:
            if name in done:
                continue
            try:
                text = resolver.read(name, limit=max(left, 1))
            except InputError as error:
                if candidates is words or not words:
                    notes.append(f"material library '{short_name(name)}' not read: {error.reason}")
            else:
                texts.append((name, text))
                done.add(name)
        if texts or whole in done:
            break
    return texts


def parse_library(text: bytes) -> list[Entry]:
    """The materials of an MTL file in order; whatever is no statement of one is passed over."""
    entries: list[Entry] = []
    plain = text.removeprefix(b"\xef\xbb\xbf").replace(b"\r", b"\n").decode("utf-8", "replace")
    for line in plain.split("\n"):
        parts = line.split(None, 1)
        if not parts or parts[0][0] == "#":
            continue
        rest = parts[1].strip() if len(parts) > 1 else ""
        keyword = parts[0].lower()
        if keyword == "newmtl":
            entries.append(Entry(rest))
        elif entries:
            rest = rest.split(" #")[0].split("\t#")[0].rstrip()
            entries[-1].statements[keyword] = rest
    return entries


def parse_map(rest: str) -> MapStatement:
    """What follows ``map_Kd``: options with their numbers, before or after a name that may hold spaces."""
    words, name = rest.split(), []
    scale, offset, ignored = [1.0, 1.0], [0.0, 0.0], []
    at = 0
    while at < len(words):
        option = words[at].lower()
        at += 1
        if option not in _OPTIONS:
            name.append(words[at - 1])
            continue
        values: list[float] = []
        if option in _WORDS:
            if words[at : at + 1] != ["off"] or option == "-cc":
                ignored.append(option)
            at += 1
            continue
        while at < len(words) and len(values) < _OPTIONS[option]:
            value = number(words[at])
            if value is None or (at == len(words) - 1 and not name):
                break  # the last word is the file, even if its name is a number
            values.append(value)
            at += 1
        if option in ("-s", "-o"):
            target = scale if option == "-s" else offset
            target[: len(values)] = values[:2]
            del target[2:]
        else:
            ignored.append(option)
    return MapStatement(
        " ".join(name), (scale[0], scale[1]), (offset[0], offset[1]), tuple(dict.fromkeys(ignored))
    )

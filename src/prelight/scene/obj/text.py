"""The text of an OBJ file as bytes in arrays: its lines by their first word, words and numbers on them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..mesh import UnreadableMesh

_BLOCK = 8 << 20
SPACE, NEWLINE, HASH = 32, 10, ord("#")
_PLAIN = bytes.maketrans(b"\r\t\v\f", b"\n   ")
_COMMENT_ENDING_IN_BACKSLASH = re.compile(rb"(?m)^ *#[^\n]*\\ ?$")


@dataclass
class Lines:
    """Where the lines of a block begin (at the first mark that is not a space) and end (the newline)."""

    text: np.ndarray
    first: np.ndarray
    ends: np.ndarray
    second: np.ndarray  # the byte after the first
    third: np.ndarray

    def of(self, word: str) -> np.ndarray:
        """Numbers of the lines that begin with a word of one or two letters."""
        marks = [self.text[self.first], self.second, self.third]
        found = np.ones(len(self.first), bool)
        for mark, wanted in zip(marks, word.encode(), strict=False):
            found &= mark == wanted
        after = marks[len(word)]
        return np.flatnonzero(found & ((after == SPACE) | (after == NEWLINE)))

    def body(self, of: np.ndarray, word: int) -> np.ndarray:
        """The bytes of some lines without comments and their first word, of so many letters; newlines stay."""
        body = self.text[_inside(self.first[of] + word, self.ends[of] + 1, len(self.text))]
        hashes = np.flatnonzero(body == HASH)
        hashes = hashes[body[hashes - 1] == SPACE]
        if len(hashes):
            ends = np.flatnonzero(body == NEWLINE)
            line, first = np.unique(np.searchsorted(ends, hashes), return_index=True)
            body[_inside(hashes[first], ends[line], len(body))] = SPACE
        return body


def _inside(starts: np.ndarray, ends: np.ndarray, length: int) -> np.ndarray:
    """(length,) bool: whether a place lies in one of the ranges [start, end), which do not overlap."""
    steps = np.zeros(length + 1, np.int8)
    steps[starts] += 1
    steps[ends] -= 1
    return np.cumsum(steps[:-1], dtype=np.int8).view(bool)


def words_of(body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where words begin, and how many stand on each line."""
    ink = body > SPACE
    starts = np.flatnonzero(ink & ~np.concatenate([[False], ink[:-1]]))
    return starts, np.diff(np.searchsorted(starts, np.flatnonzero(body == NEWLINE)), prepend=0)


def parsed(body: bytes, dtype: type, expected: int) -> np.ndarray | None:
    """All numbers, or None if a word is none."""
    if expected == 0:
        return np.empty(0, dtype)
    try:
        found = np.fromstring(body, dtype, sep=" ")
    except ValueError:
        return None
    return found if len(found) == expected else None


def line_of(data: bytes, offset: int) -> str:
    """Which line of the file holds a byte, as errors say it."""
    head = data[:offset]
    return f"line {(head.count(10) or head.count(13)) + 1}"


def plain_text(data: bytes) -> bytes:
    """Newlines alone end lines, spaces alone part words, continued lines are one; every byte keeps its place."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in data[:4]:
        raise UnreadableMesh("UTF-16 or binary, expected plain text: save it as UTF-8")
    if (at := data.find(b"\0")) >= 0:
        raise UnreadableMesh("holds a byte 0, expected plain text", line_of(data, at))
    text = data.replace(b"\xef\xbb\xbf", b"   ", 1) if data[:3] == b"\xef\xbb\xbf" else data
    text = text.replace(b"\r\n", b" \n").translate(_PLAIN)
    if b"\\" in text:
        text = _COMMENT_ENDING_IN_BACKSLASH.sub(lambda found: b"#".ljust(len(found[0])), text)
        text = text.replace(b"\\\n", b"  ").replace(b"\\ \n", b"   ")
    return text + b"\n"


def blocks(text: bytes) -> Iterator[tuple[int, np.ndarray]]:
    at, whole = 0, np.frombuffer(text, np.uint8)
    while at < len(text):
        end = text.find(b"\n", min(at + _BLOCK, len(text) - 1)) + 1
        yield at, whole[at:end]
        at = end


def lines_of(text: np.ndarray) -> Lines:
    ends = np.flatnonzero(text == NEWLINE)
    first = np.concatenate([[0], ends[:-1] + 1])
    indented = text[first] == SPACE
    if indented.any():
        ink = np.flatnonzero(text != SPACE)
        first[indented] = ink[np.searchsorted(ink, first[indented])]
    padded = np.concatenate([text, [NEWLINE] * 3])  # a word may begin with the last mark
    return Lines(text, first, ends, padded[first + 1], padded[first + 2])

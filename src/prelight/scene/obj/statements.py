"""The statements of an OBJ file as arrays: all lines of a kind at once, in blocks of a few megabytes."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from ..mesh import UnreadableMesh, check_counts, short_name
from .text import HASH, NEWLINE, Lines, blocks, line_of, lines_of, parsed, plain_text, words_of

_MOST_SWITCHES = 300_000  # usemtl and mtllib lines
_ABSENT = -1
_SLASH = ord("/")


@dataclass
class Statements:
    """Vertex data in file order and faces, their indices from 0; -1 where a corner names none."""

    positions: np.ndarray  # (v lines, 3) float64
    colours: np.ndarray | None  # (v lines, 3) as written; NaN where a line has none
    coordinates: np.ndarray  # (vt lines, 2)
    normals: np.ndarray  # (vn lines, 3)
    corners: np.ndarray  # (C, 3) int32: position, texture coordinate, normal
    sizes: np.ndarray  # (F,) corners of each face, at least 3
    material_of: np.ndarray  # (F,) index into ``materials``; -1 before the first usemtl
    materials: list[str]  # names after usemtl, in the order of the file
    libraries: list[str]  # what stands after each mtllib
    notes: list[str]


@dataclass
class _Gathered:
    """What the blocks gave so far."""

    data: bytes
    rows: dict[str, list[np.ndarray]] = field(default_factory=lambda: {"v": [], "vt": [], "vn": []})
    counts: Counter[str] = field(default_factory=Counter)
    corners: list[np.ndarray] = field(default_factory=list)
    sizes: list[np.ndarray] = field(default_factory=list)
    offsets: list[np.ndarray] = field(default_factory=list)  # of face lines, to name one in a refusal
    material_of: list[np.ndarray] = field(default_factory=list)
    materials: list[str] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    current: int = _ABSENT
    first_unknown: str | None = None

    def where(self, offset: int) -> str:
        """The line of the file that holds a byte."""
        return line_of(self.data, offset)


def read_statements(data: bytes) -> Statements:
    """Parse the text. Raises UnreadableMesh with the line."""
    gathered = _Gathered(data)
    text = plain_text(data)
    for offset, block in blocks(text):
        _read_block(gathered, block, offset)
    positions, colours = _split_colours(gathered)
    corners = _joined(gathered.corners, (0, 3), np.int32)
    offsets = _joined(gathered.offsets, (0,), np.int64)
    sizes = _joined(gathered.sizes, (0,), np.int64)
    _check_indices(gathered, corners, np.repeat(offsets, sizes))
    coordinates = _joined(gathered.rows["vt"], (0, 3), np.float64)[:, :2]
    normals = _joined(gathered.rows["vn"], (0, 3), np.float64)
    keep = sizes >= 3
    notes = _notes(gathered, int((~keep).sum()))
    return Statements(
        positions, colours, coordinates, normals, corners[np.repeat(keep, sizes)], sizes[keep],
        _joined(gathered.material_of, (0,), np.int64)[keep], gathered.materials, gathered.libraries, notes,
    )  # fmt: skip


def _joined(parts: list[np.ndarray], empty: tuple[int, ...], dtype: type) -> np.ndarray:
    return np.concatenate(parts) if parts else np.empty(empty, dtype)


# ---- one block ----


def _read_block(gathered: _Gathered, text: np.ndarray, offset: int) -> None:
    lines = lines_of(text)
    before = dict(gathered.counts)
    numbers: dict[str, np.ndarray] = {}
    for word, least in (("v", 3), ("vt", 1), ("vn", 3)):
        of = numbers[word] = lines.of(word)
        if len(of):
            gathered.rows[word].append(_rows(gathered, lines, of, word=word, least=least, offset=offset))
            gathered.counts[word] += len(of)
    check_counts(gathered.counts["v"], 0)
    faces = lines.of("f")
    switches = _read_names(gathered, lines, offset)
    if len(faces):
        _read_faces(gathered, lines, faces, numbers=numbers, before=before, offset=offset)
        names = np.array([gathered.current, *(index for _, index in switches)])
        at = np.searchsorted([line for line, _ in switches], faces) if switches else np.zeros(len(faces), int)
        gathered.material_of.append(names[at])
        gathered.offsets.append(lines.first[faces] + offset)
    if switches:
        gathered.current = switches[-1][1]


def _read_names(gathered: _Gathered, lines: Lines, offset: int) -> list[tuple[int, int]]:
    """Libraries and ignored lines counted; the lines that switch to a material, and its number."""
    mark = lines.text[lines.first]
    for word, what in (("l", "lines"), ("p", "points"), ("s", "groups")):
        gathered.counts[what] += len(lines.of(word))
    silent = [lines.of(word) for word in ("v", "vt", "vn", "f", "l", "p", "g", "o", "s")]
    rest = np.ones(len(mark), bool)
    rest[np.concatenate(silent)] = False
    rest &= (mark != NEWLINE) & (mark != HASH)
    named = np.flatnonzero(rest & ((mark == ord("u")) | (mark == ord("m"))))
    gathered.counts["named"] += len(named)
    if gathered.counts["named"] > _MOST_SWITCHES:
        raise UnreadableMesh(f"more than {_MOST_SWITCHES:,} lines of usemtl and mtllib")
    known, switches = {name: k for k, name in enumerate(gathered.materials)}, []
    for line in named.tolist():
        raw = lines.text[lines.first[line] : lines.ends[line]].tobytes()
        word, _, name = raw.decode("utf-8", "replace").partition(" ")
        if word == "usemtl":
            name = name.strip()
            if name not in known:
                known[name] = len(gathered.materials)
                gathered.materials.append(name)
            switches.append((line, known[name]))
        elif word == "mtllib":
            gathered.libraries.append(name.strip())
        else:
            continue
        rest[line] = False
    unknown = np.flatnonzero(rest)
    gathered.counts["unknown"] += len(unknown)
    if len(unknown) and gathered.first_unknown is None:
        at = int(lines.first[unknown[0]])
        word = lines.text[at : min(at + 40, lines.ends[unknown[0]])].tobytes().decode("utf-8", "replace")
        gathered.first_unknown = f"'{short_name(word.split(' ')[0])}', {gathered.where(offset + at)}"
    return switches


def _rows(
    gathered: _Gathered, lines: Lines, of: np.ndarray, *, word: str, least: int, offset: int
) -> np.ndarray:
    """(lines, columns) float64; positions with a colour have six columns, NaN where a line has none."""
    body = lines.body(of, len(word))
    counts = words_of(body)[1]
    values = parsed(body.tobytes(), np.float64, int(counts.sum()))
    if values is None or counts.min() < least:
        raise _bad_row(gathered, body, counts, least=least, offsets=lines.first[of] + offset)
    starts = np.cumsum(counts) - counts
    if word == "v":
        table = _position_rows(gathered, values, starts, counts)
        if not np.isfinite(table[:, :3]).all():
            line = int(np.argmin(np.isfinite(table[:, :3]).all(axis=1)))
            reason = "a coordinate is not finite, expected three finite numbers after v"
            raise UnreadableMesh(reason, gathered.where(int(lines.first[of[line]]) + offset))
        return table
    table = np.zeros((len(of), 3))
    for column in range(3):
        has = counts > column
        table[has, column] = values[starts[has] + column]
    return table


def _position_rows(
    gathered: _Gathered, values: np.ndarray, starts: np.ndarray, counts: np.ndarray
) -> np.ndarray:
    coloured, weighted = counts >= 6, (counts == 4) | (counts == 7)
    table = np.full((len(counts), 6 if coloured.any() else 3), np.nan)
    table[:, :3] = values[starts[:, None] + np.arange(3)]
    if coloured.any():
        table[coloured, 3:] = values[(starts + counts - 3)[coloured, None] + np.arange(3)]
    gathered.counts["weights"] += int((values[starts[weighted] + 3] != 1).sum())
    return table


def _bad_row(
    gathered: _Gathered, body: np.ndarray, counts: np.ndarray, *, least: int, offsets: np.ndarray
) -> UnreadableMesh:
    """The refusal of the first line with too few numbers or a word that is none."""
    for k, line in enumerate(body.tobytes().split(b"\n")[: len(counts)]):
        where = gathered.where(int(offsets[k]))
        for word in line.split():
            if parsed(word, np.float64, 1) is None:
                return UnreadableMesh(f"'{short_name(word.decode('utf-8', 'replace'))}' is no number", where)
        if counts[k] < least:
            return UnreadableMesh(f"{counts[k]} numbers, expected at least {least}", where)
    return UnreadableMesh("vertex lines hold something that is no number")


# ---- faces ----


def _read_faces(
    gathered: _Gathered,
    lines: Lines,
    of: np.ndarray,
    *,
    numbers: dict[str, np.ndarray],
    before: dict[str, int],
    offset: int,
) -> None:
    """Corners of the faces: indices from 0, negative ones counted from what stands above the face."""
    body = lines.body(of, 1)
    starts, sizes = words_of(body)
    slashes = np.searchsorted(starts, np.flatnonzero(body == _SLASH), side="right") - 1
    parts = np.bincount(slashes, minlength=len(starts)) + 1
    raw = body.tobytes().replace(b"//", b"/0/").replace(b"/ ", b"/0 ").replace(b"/\n", b"/0\n")
    values = parsed(raw.replace(b"/", b" "), np.int64, int(parts.sum()))
    if values is None or parts.max(initial=0) > 3 or (body[starts] == _SLASH).any():
        raise _bad_face(gathered, body, lines.first[of] + offset)
    at = np.cumsum(parts) - parts
    corners = np.full((len(starts), 3), _ABSENT, np.int32)
    face = np.repeat(np.arange(len(of)), sizes)
    for column, word in enumerate(("v", "vt", "vn")):
        has = parts > column
        index = values[at[has] + column]
        above = before.get(word, 0) + np.searchsorted(numbers[word], of)[face[has]]
        absolute = np.where(index > 0, index - 1, np.where(index < 0, above + index, _ABSENT))
        if word == "v" and absolute.min(initial=0) < 0:
            k = int(np.argmin(absolute))
            where = gathered.where(int(lines.first[of[face[k]]]) + offset)
            raise UnreadableMesh(
                f"index {index[k]} of a vertex, {above[k]:,} stand above; counted from 1", where
            )
        gathered.counts["lost"] += int(((absolute < 0) & (index != 0)).sum())
        corners[has, column] = np.clip(absolute, _ABSENT, np.iinfo(np.int32).max)
    gathered.corners.append(corners)
    gathered.sizes.append(sizes)
    check_counts(0, sum(map(len, gathered.corners)) // 3)


_CORNER = re.compile(rb"[+-]?\d+(?:/(?:[+-]?\d*)){0,2}")


def _bad_face(gathered: _Gathered, body: np.ndarray, offsets: np.ndarray) -> UnreadableMesh:
    for k, line in enumerate(body.tobytes().split(b"\n")):
        for word in line.split():
            if not _CORNER.fullmatch(word):
                name = short_name(word.decode("utf-8", "replace"))
                reason = f"'{name}' is no corner of a face, expected 1, 1/2, 1//3 or 1/2/3"
                return UnreadableMesh(reason, gathered.where(int(offsets[k])))
    return UnreadableMesh("face lines hold something that is no index")


def _check_indices(gathered: _Gathered, corners: np.ndarray, offsets: np.ndarray) -> None:
    """Refuse vertices that the file does not have; coordinates and normals are only lost."""
    outside = corners[:, 0] >= gathered.counts["v"]
    if outside.any():
        k = int(np.argmax(outside))
        reason = f"index {int(corners[k, 0]) + 1:,} of a vertex, but the file has {gathered.counts['v']:,}"
        raise UnreadableMesh(reason, gathered.where(int(offsets[k])))
    for column, word in ((1, "vt"), (2, "vn")):
        outside = corners[:, column] >= gathered.counts[word]
        gathered.counts["lost"] += int(outside.sum())
        corners[outside, column] = _ABSENT


# ---- the end ----


def _split_colours(gathered: _Gathered) -> tuple[np.ndarray, np.ndarray | None]:
    blocks = gathered.rows["v"]
    positions = _joined([block[:, :3] for block in blocks], (0, 3), np.float64)
    if all(block.shape[1] == 3 for block in blocks):
        return positions, None
    none = [np.full((len(block), 3), np.nan) if block.shape[1] == 3 else block[:, 3:] for block in blocks]
    return positions, np.concatenate(none)


def _notes(gathered: _Gathered, too_small: int) -> list[str]:
    counts, notes = gathered.counts, []
    if too_small:
        notes.append(f"faces of fewer than three corners dropped: {too_small:,}")
    if counts["lines"] or counts["points"]:
        notes.append(f"points and lines not read: {counts['lines'] + counts['points']:,}")
    if counts["groups"] and not counts["vn"]:
        notes.append("smoothing groups not used: normals are made of all triangles around a vertex")
    if counts["weights"]:
        notes.append(f"weights of vertices (w, for curves) not used: {counts['weights']:,}")
    if counts["lost"]:
        notes.append(f"coordinates and normals that faces name but the file has not: {counts['lost']:,}")
    if counts["unknown"]:
        notes.append(f"statements not read: {counts['unknown']:,} (first {gathered.first_unknown})")
    return notes

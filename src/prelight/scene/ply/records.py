"""The body of a PLY file: tables of records, some of varying length, as columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ..mesh import UnreadableMesh
from .header import Element, Property


@dataclass(frozen=True)
class Lists:
    """A column of lists: all values one after another, and how many belong to each record."""

    counts: np.ndarray  # (N,) int64
    values: np.ndarray  # (sum of counts,)


@dataclass(frozen=True)
class Table:
    """The wanted columns of an element."""

    plain: dict[str, np.ndarray]  # (N,) each
    lists: dict[str, Lists]


@dataclass(frozen=True)
class _Column:
    """How a property lies in the body."""

    name: str
    type: np.dtype
    count_type: np.dtype | None  # of a list


def read_elements(
    body: np.ndarray, elements: Iterable[Element], encoding: str, *, wanted: Mapping[str, set[str]]
) -> tuple[dict[str, Table], int]:
    """The wanted columns of every element, and how much of the body is left after the last one.

    Parameters
    ----------
    body
        (bytes,) uint8; for text, the bytes of all its numbers as float64.
    encoding
        "<" or ">" (byte order), or "text" (what is left is then counted in numbers).
    wanted
        Names of columns by name of element.

    Every count is checked against the body before memory is taken for it. Raises UnreadableMesh.
    """
    found, at = {}, 0
    for element in elements:
        columns = [_column(p, encoding) for p in element.properties]
        if element.count == 0 or not columns:
            table = Table({}, {})
        else:
            names = wanted.get(element.name, set())
            table, at = _read_element(body, at, columns, element=element, wanted=names)
        found[element.name] = table
    return found, (len(body) - at) // (8 if encoding == "text" else 1)


def _column(declared: Property, encoding: str) -> _Column:
    def lying(kind: str) -> np.dtype:
        return np.dtype("f8" if encoding == "text" else encoding + kind)

    count_type = lying(declared.count_type) if declared.count_type else None
    return _Column(declared.name, lying(declared.type), count_type)


def _read_element(
    body: np.ndarray, at: int, columns: list[_Column], *, element: Element, wanted: set[str]
) -> tuple[Table, int]:
    least = sum((c.count_type or c.type).itemsize for c in columns)
    if element.count * least > len(body) - at:
        raise _too_short(element)
    layout = _layout_of_first(body, at, columns, element=element)
    end = at + element.count * layout.itemsize
    lists = [c for c in columns if c.count_type]
    if end <= len(body):
        records = np.frombuffer(body, layout, element.count, at)
        if all((records[f"{c.name} count"] == records[f"{c.name} count"][0]).all() for c in lists):
            return _table_of(records, columns, wanted), end
    if not lists:
        raise _too_short(element)
    return _read_varying(body, at, columns, element=element, wanted=wanted)


def _table_of(records: np.ndarray, columns: list[_Column], wanted: set[str]) -> Table:
    table = Table({}, {})
    for c in columns:
        if c.name in wanted and c.count_type:
            table.lists[c.name] = Lists(
                records[f"{c.name} count"].astype(np.int64), records[c.name].reshape(-1)
            )
        elif c.name in wanted:
            table.plain[c.name] = records[c.name]
    return table


def _too_short(element: Element) -> UnreadableMesh:
    return UnreadableMesh(
        f"damaged PLY file: the header declares {element.count:,} of '{element.name}', the file holds fewer"
    )


def _layout_of_first(body: np.ndarray, at: int, columns: list[_Column], *, element: Element) -> np.dtype:
    """The record type if every list were as long as in the first record (names hold no spaces)."""
    fields, offset = [], at
    for c in columns:
        if c.count_type is None:
            fields.append((c.name, c.type))
            offset += c.type.itemsize
            continue
        if offset + c.count_type.itemsize > len(body):
            raise _too_short(element)
        count = float(np.frombuffer(body, c.count_type, 1, offset)[0])
        offset += c.count_type.itemsize
        if not (0 <= count * c.type.itemsize <= len(body) - offset and count == int(count)):
            what = f"record 0 of '{element.name}' has a list of {count:g}"
            raise UnreadableMesh(f"damaged PLY file: {what}, which does not fit into the file")
        fields += [(f"{c.name} count", c.count_type), (c.name, c.type, (int(count),))]
        offset += int(count) * c.type.itemsize
    return np.dtype(fields)


def _read_varying(
    body: np.ndarray, at: int, columns: list[_Column], *, element: Element, wanted: set[str]
) -> tuple[Table, int]:
    """Records of different length: walked once for each wanted column, by compiled code."""
    from .walking import copy_items, walk_records  # Numba: only for files that need it

    counted = [c.count_type for c in columns if c.count_type]
    steps = np.array([_step(c) for c in columns], np.int64)
    numbers = body.view(np.float64) if counted[0].kind == "f" else np.empty(0)
    big = any(kind.str[0] == ">" for kind in counted)  # a count of one byte has no order
    table, end = Table({}, {}), at
    # At least one walk, for the checks and the end.
    for k in [k for k, c in enumerate(columns) if c.name in wanted] or [0]:
        c = columns[k]
        starts, counts = np.empty(element.count, np.int64), np.empty(element.count, np.int64)
        end = int(walk_records(body, numbers, steps, np.array([at, k, big], np.int64), starts, counts))
        if end < 0:
            raise UnreadableMesh(
                f"damaged PLY file: record {-1 - end:,} of '{element.name}' does not fit into the file"
            )
        if c.name in wanted:
            items = np.empty(int(counts.sum()) * c.type.itemsize, np.uint8)
            copy_items(body, starts, counts * c.type.itemsize, items)
            if c.count_type:
                table.lists[c.name] = Lists(counts, items.view(c.type))
            else:
                table.plain[c.name] = items.view(c.type)
    return table, end


def _step(column: _Column) -> tuple[int, int, bool]:
    """What `walk_records` must know of a property."""
    if column.count_type is None:
        return 0, column.type.itemsize, False
    return column.count_type.itemsize, column.type.itemsize, column.count_type.kind == "i"

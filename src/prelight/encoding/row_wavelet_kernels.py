"""Rows of a sparse matrix in the basis of a tree over its columns: taken apart, thinned, kept in bytes, multiplied.

A row is made by one thread: the same bytes for any number of threads. An entry is a node's number, as the step from
the one before it, and a signed byte b that stands for scale · b · |b|: steps that are finer where numbers are small.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from .row_sum_code import row_sum

LONGEST_STEP = 65535
_LEVELS = 127
_ROWS = 64  # a task
_ROOTS = 64  # nodes whose subtrees are tasks

f4, i1, i4, i8, u2 = types.float32, types.int8, types.int32, types.int64, types.uint16


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


_MATRIX = types.Tuple((_read_only(i8, 1), _read_only(i4, 1), _read_only(f4, 1)))
_TREE = types.Tuple((_read_only(i4, 1), _read_only(f4, 1)))


@njit(cache=True)
def _kept_of(columns, values, place, left, threshold, node, queue, found):
    """Nodes of one row whose halves differ by more than the threshold, ascending: how many, and the row's sum.

    Their numbers replace the first of ``queue``, what their left halves have beyond their share is in ``found``.
    ``node`` is zero before and after.
    """
    size = len(left)
    for e in range(len(columns)):
        k = place[columns[e]] + size
        while k > 0:
            node[k] += values[e]
            k >>= 1
    whole = node[1]
    queue[0], head, tail, kept = 1, 0, 1, 0
    while head < tail:  # level after level, so numbers ascend, and what is kept never overtakes what is read
        k = queue[head]
        head += 1
        if k < size and node[k] > threshold:
            more = node[2 * k] - node[k] * left[k]
            queue[tail], queue[tail + 1] = 2 * k, 2 * k + 1
            tail += 2
            if abs(more) > threshold:
                queue[kept], found[kept] = k, more
                kept += 1
    for e in range(len(columns)):
        k = place[columns[e]] + size
        while k > 0:
            node[k] = 0
            k >>= 1
    return kept, whole


@njit([types.void(_MATRIX, _TREE, f4, types.float64[:, ::1])], cache=True)
def add_dropped(matrix, tree, threshold, weights):
    """Of rows that keep nothing of a node, what all give to it and to its left half is added to weights (size, 2)."""
    rows, columns, values = matrix
    place, left = tree
    size = len(left)
    node = np.zeros(2 * size, np.float32)
    for i in range(len(rows) - 1):
        for e in range(rows[i], rows[i + 1]):
            k = place[columns[e]] + size
            while k > 0:
                node[k] += values[e]
                k >>= 1
        for e in range(rows[i], rows[i + 1]):
            k = (place[columns[e]] + size) >> 1
            while k > 0 and node[k] >= 0:  # each once: what was looked at is turned negative
                if node[k] <= threshold or abs(abs(node[2 * k]) - node[k] * left[k]) <= threshold:
                    weights[k, 0] += node[k]
                    weights[k, 1] += abs(node[2 * k])
                node[k] = -node[k]
                k >>= 1
        for e in range(rows[i], rows[i + 1]):
            k = place[columns[e]] + size
            while k > 0:
                node[k] = 0
                k >>= 1


@njit(cache=True)
def _steps_to(numbers, count):
    """Entries that it takes, with those between that only bridge a step that is too long."""
    entries, last = count, 0
    for j in range(count):
        entries += (numbers[j] - last - 1) // LONGEST_STEP
        last = numbers[j]
    return entries


@njit(cache=True)
def _write_row(numbers, found, count, steps, codes):
    """One row's entries; returns its scale."""
    most = np.float32(0)
    for j in range(count):
        most = max(most, abs(found[j]))
    scale = most / np.float32(_LEVELS * _LEVELS)
    place, last = 0, 0
    for j in range(count):
        step = numbers[j] - last
        last = numbers[j]
        while step > LONGEST_STEP:
            steps[place], codes[place] = LONGEST_STEP, 0
            step -= LONGEST_STEP
            place += 1
        level = np.sqrt(abs(found[j]) / scale)
        steps[place] = step
        codes[place] = np.int8(np.rint(level if found[j] > 0 else -level))
        place += 1
    return scale


@njit(cache=True)
def _some_rows(begin, end, matrix, tree, threshold, starts, out):
    rows, columns, values = matrix
    place, left = tree
    counts, sums, scales, steps, codes = out
    node = np.zeros(2 * len(left), np.float32)
    queue = np.empty(2 * len(left) + 2, np.int32)
    found = np.empty(len(left) + 1, np.float32)
    for i in range(begin, end):
        part = slice(rows[i], rows[i + 1])
        kept, whole = _kept_of(columns[part], values[part], place, left, threshold, node, queue, found)
        if len(starts) == 0:
            counts[i] = _steps_to(queue, kept)
        else:
            to = slice(starts[i], starts[i + 1])
            sums[i], scales[i] = whole, _write_row(queue, found, kept, steps[to], codes[to])


_out = types.Tuple((i8[::1], f4[::1], f4[::1], u2[::1], i1[::1]))


@njit([types.void(_MATRIX, _TREE, f4, _read_only(i8, 1), _out)], parallel=True, cache=True)
def thin_rows(matrix, tree, threshold, starts, out):
    """Rows (starts, columns, values) in the basis of a tree (leaf of each column, left shares), without what is small.

    With no ``starts`` how many entries each row takes is written to the counts of ``out`` (counts, sums, scales,
    steps, codes); with them, all else.
    """
    rows = len(matrix[0]) - 1
    for part in prange((rows + _ROWS - 1) // _ROWS):
        _some_rows(part * _ROWS, min(rows, (part + 1) * _ROWS), matrix, tree, threshold, starts, out)


@njit(cache=True)
def _halves_below(root, light, colours, order, left, means, out):
    """``colour_halves`` of a node and all below it; means are written down to the leaves."""
    size, first, last = len(left), root, root + 1
    while first < size:
        first, last = 2 * first, 2 * last
    for k in range(first, last):
        v = order[k - size] if k - size < len(order) else -1
        for c in range(3):
            means[k, c] = light[v, c] * colours[v, c] if v >= 0 else f4(0)
        means[k, 3] = 0
    while first > root:
        first, last = first // 2, last // 2
        for k in range(last - 1, first - 1, -1):
            for c in range(4):
                right = means[2 * k + 1, c]
                out[k, c] = means[2 * k, c] - right
                means[k, c] = out[k, c] * left[k] + right


@njit(
    [types.void(*[_read_only(f4, 2)] * 2, _read_only(i4, 1), _read_only(f4, 1), f4[:, ::1], f4[:, ::1])],
    parallel=True,
    cache=True,
    nogil=True,
)
def colour_halves(light, colours, order, left, means, out):
    """``vertex_tree.halves`` of light · colours (vertices, 3), quickly: out (size, 4), the last channel 0.

    ``means`` (2 · size, 4) is written too.
    """
    roots = min(_ROOTS, len(left))
    for part in prange(roots):
        _halves_below(roots + part, light, colours, order, left, means, out)
    for k in range(roots - 1, 0, -1):
        for c in range(4):
            right = means[2 * k + 1, c]
            out[k, c] = means[2 * k, c] - right
            means[k, c] = out[k, c] * left[k] + right
    out[0] = means[1]


@njit(cache=True)
def _multiply_rows(begin, end, starts, steps, codes, sums, scales, values, light, least, out):
    row = np.empty(4, np.float32)
    for i in range(begin, end):
        first = starts[i]
        row_sum(
            steps.ctypes.data + 2 * first, codes.ctypes.data + first, starts[i + 1] - first,
            values.ctypes.data, light.ctypes.data, row.ctypes.data,
        )  # fmt: skip
        for c in range(3):
            out[i, c] = max(least, sums[i] * light[0, c] + scales[i] * row[c])


_rows = types.Tuple(
    (_read_only(i8, 1), _read_only(u2, 1), _read_only(i1, 1), _read_only(f4, 1), _read_only(f4, 1))
)


@njit([types.void(_rows, _read_only(f4, 2), f4, f4[:, ::1])], parallel=True, cache=True, nogil=True)
def multiply_rows(rows, light, least, out):
    """out (rows, 3) = rows (starts, steps, codes, sums, scales) times light as ``colour_halves`` (size, 4).

    What is below ``least`` becomes that: 0 where light is light, for rows that are thinned may fall a little below.
    """
    starts, steps, codes, sums, scales = rows
    values = np.empty(256, np.float32)
    for code in range(-128, 128):
        values[code & 255] = code * abs(code)
    for part in prange((len(out) + _ROWS - 1) // _ROWS):
        _multiply_rows(
            part * _ROWS, min(len(out), (part + 1) * _ROWS),
            starts, steps, codes, sums, scales, values, light, least, out,
        )  # fmt: skip


@njit([i8(_read_only(i8, 1), _read_only(u2, 1), i8)], cache=True)
def first_wrong_row(starts, steps, size):
    """The first row whose numbers do not rise or leave 1 … size − 1; −1 if there is none."""
    for i in range(len(starts) - 1):
        k = 0
        for e in range(starts[i], starts[i + 1]):
            if steps[e] == 0:
                return i
            k += steps[e]
        if k >= size:
            return i
    return -1

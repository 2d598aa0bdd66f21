"""Kernels of ``pulse_or_haar``: a row as runs of bytes, either way, and what a row of light makes of it.

A row is made by one thread: the same bytes for any number of threads.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

PULSES, HAAR = 0, 1
GAP = 4  # zeros that cost no more inside a run than a new run does
RUN_BYTES = 4
_ROWS = 256  # of a thread at a time

f4, f8, i4, i8, u1, u2 = (
    types.float32, types.float64, types.int32, types.int64, types.uint8, types.uint16,
)  # fmt: skip


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


@njit(cache=True)
def _transform(face, R, line):
    """Orthonormal two-dimensional Haar transform of one face, in place: sums in the first half, again and again."""
    half = np.float32(np.sqrt(0.5))
    size = R
    while size > 1:
        for i in range(size):
            for j in range(size // 2):
                a, b = face[i * R + 2 * j], face[i * R + 2 * j + 1]
                line[j], line[size // 2 + j] = half * (a + b), half * (a - b)
            for j in range(size):
                face[i * R + j] = line[j]
        for j in range(size):
            for i in range(size // 2):
                a, b = face[2 * i * R + j], face[(2 * i + 1) * R + j]
                line[i], line[size // 2 + i] = half * (a + b), half * (a - b)
            for i in range(size):
                face[i * R + j] = line[i]
        size //= 2


@njit([types.void(f4[:, ::1], i8)], parallel=True, cache=True)
def haar_transforms(rows, R):
    """Every face of rows (n, 6·R²) transformed in place; R is a power of two."""
    for k in prange(len(rows) * 6):
        _transform(rows[k // 6, (k % 6) * R * R : (k % 6 + 1) * R * R], R, np.empty(R, np.float32))


@njit(cache=True)
def _in_runs(bytes_, data, runs):
    """Runs of bytes with no more than GAP zeros between: how many runs and bytes."""
    count = size = 0
    last = -GAP - 2  # the last byte that was not zero
    for k in range(len(bytes_)):
        if bytes_[k] == 0:
            continue
        if k - last - 1 > GAP or count == 0:
            runs[count, 0], runs[count, 1] = k, 0
            count += 1
        else:
            for _ in range(last + 1, k):
                data[size] = 0
                size += 1
                runs[count - 1, 1] += 1
        data[size] = bytes_[k]
        size += 1
        runs[count - 1, 1] += 1
        last = k
    return count, size


@njit(cache=True)
def _pulses(dense, bytes_):
    """Unsigned bytes, value ≈ scale · byte: scale, and the square of the error."""
    most = np.float32(0)
    for k in range(len(dense)):
        most = max(most, dense[k])
    scale, error = most / np.float32(255), 0.0
    for k in range(len(dense)):
        b = np.rint(dense[k] / scale)
        bytes_[k] = np.uint8(b)
        error += np.float64(dense[k] - b * scale) ** 2
    return scale, error


@njit(cache=True)
def _haar(coefficients, bytes_):
    """Signed bytes, value ≈ scale · b·|b|: fine where numbers are small. Scale, and the square of the error."""
    most = np.float32(0)
    for k in range(len(coefficients)):
        most = max(most, abs(coefficients[k]))
    scale, error = most / np.float32(127 * 127), 0.0
    for k in range(len(coefficients)):
        value = coefficients[k] / scale
        b = np.rint(np.sqrt(abs(value)))
        near = abs(value)
        if b > 0 and abs((b - 1) * (b - 1) - near) < abs(b * b - near):
            b -= 1
        if value < 0:
            b = -b
        bytes_[k] = np.uint8(np.int8(b))
        error += np.float64(coefficients[k] - scale * b * abs(b)) ** 2
    return scale, error


@njit(cache=True)
def _encode_row(cells, weights, R, data, runs, figures):
    """One row into its slot. figures: kind, scale, runs, bytes, size of either, squares of their errors and of all."""
    n = 6 * R * R
    dense = np.zeros(n, np.float32)
    for k in range(len(cells)):
        dense[cells[k]] += weights[k]
    energy = 0.0
    for k in range(n):
        energy += np.float64(dense[k]) ** 2
    figures[:] = 0
    if energy == 0:
        return
    bytes_, other = np.empty(n, np.uint8), np.empty(n, np.uint8)
    scale, error = _pulses(dense, bytes_)
    line = np.empty(R, np.float32)
    for face in range(6):
        _transform(dense[face * R * R : (face + 1) * R * R], R, line)
    haar_scale, haar_error = _haar(dense, other)
    count, size = _in_runs(other, data, runs)
    haar_size = RUN_BYTES * count + size
    pulse_count, pulse_size = _in_runs(bytes_, data, runs)
    figures[4], figures[5] = RUN_BYTES * pulse_count + pulse_size, haar_size
    figures[6], figures[7], figures[8] = error, haar_error, energy
    figures[0], figures[1], figures[2], figures[3] = PULSES, scale, pulse_count, pulse_size
    if haar_size < figures[4]:
        count, size = _in_runs(other, data, runs)
        figures[0], figures[1], figures[2], figures[3] = HAAR, haar_scale, count, size


@njit(
    [
        types.void(
            _read_only(i8, 1), _read_only(i4, 1), _read_only(f4, 1), i8, u1[:, ::1], u2[:, :, ::1], f8[:, ::1]
        )
    ],
    parallel=True,
    cache=True,
)
def encode_rows(starts, cells, weights, R, data, runs, figures):
    """Rows, one for each pair of samples ``starts`` (n + 1), into slots ``data`` (n, 6R²) and ``runs`` (n, r, 2)."""
    for k in prange(len(starts) - 1):
        part = slice(starts[k], starts[k + 1])
        _encode_row(cells[part], weights[part], R, data[k], runs[k], figures[k])


@njit(cache=True)
def _three_of_row(data, runs, table, signed):
    """Σ value · table over the runs of a row, three channels; ``data`` begins with the row."""
    red = green = blue = np.float32(0)
    at = 0
    for k in range(len(runs)):
        first = np.int64(runs[k, 0])
        for j in range(np.int64(runs[k, 1])):
            byte = data[at + j]
            value = np.float32(byte)
            if signed:
                b = np.float32(np.int8(byte))
                value = b * abs(b)
            red += value * table[first + j, 0]
            green += value * table[first + j, 1]
            blue += value * table[first + j, 2]
        at += np.int64(runs[k, 1])
    return red, green, blue


@njit(cache=True)
def _six_of_row(data, runs, table, signed):
    """The same of a table of two lights: the first, and from its fifth channel on the second."""
    red = green = blue = more_red = more_green = more_blue = np.float32(0)
    at = 0
    for k in range(len(runs)):
        first = np.int64(runs[k, 0])
        for j in range(np.int64(runs[k, 1])):
            byte = data[at + j]
            value = np.float32(byte)
            if signed:
                b = np.float32(np.int8(byte))
                value = b * abs(b)
            red += value * table[first + j, 0]
            green += value * table[first + j, 1]
            blue += value * table[first + j, 2]
            more_red += value * table[first + j, 4]
            more_green += value * table[first + j, 5]
            more_blue += value * table[first + j, 6]
        at += np.int64(runs[k, 1])
    return red, green, blue, more_red, more_green, more_blue


@njit(cache=True)
def _some_rows(layer, tables, out, more, begin, end):
    kind, scale, row_runs, row_bytes, runs, data = layer
    for r in range(begin, end):
        own, table = runs[row_runs[r] : row_runs[r + 1]], tables[kind[r]]
        if len(more) == 0:
            red, green, blue = _three_of_row(data[row_bytes[r] :], own, table, kind[r] == HAAR)
        else:
            red, green, blue, r2, g2, b2 = _six_of_row(data[row_bytes[r] :], own, table, kind[r] == HAAR)
            more[r, 0], more[r, 1], more[r, 2] = scale[r] * r2, scale[r] * g2, scale[r] * b2
        out[r, 0], out[r, 1], out[r, 2] = scale[r] * red, scale[r] * green, scale[r] * blue


_LAYER = types.Tuple((
    _read_only(u1, 1), _read_only(f4, 1), _read_only(i8, 1), _read_only(i8, 1), _read_only(u2, 2), _read_only(u1, 1),
))  # fmt: skip


@njit(
    [types.void(_LAYER, _read_only(f4, 3), f4[:, ::1], f4[:, ::1], i8, i8)], parallel=True, cache=True, nogil=True
)  # fmt: skip
def light_rows(layer, tables, out, more, begin, end):
    """out (rows, 3), rows begin … end: times light ``tables`` (2, 6R², 4), as it is and as Haar coefficients.

    ``layer``: kind, scale, first run and first byte of each row (and one beyond), runs, bytes. ``more`` (rows, 3), if
    it has rows, is of a second light, channels 4 to 6 of the tables (2, 6R², 8): a row is read once for both.
    """
    for part in prange((end - begin + _ROWS - 1) // _ROWS):
        first = begin + part * _ROWS
        _some_rows(layer, tables, out, more, first, min(end, first + _ROWS))


@njit([types.void(_read_only(u2, 2), u2[::1])], cache=True, nogil=True)
def lay_flat(runs, cells):
    """``cells`` (bytes,): which cell or coefficient each byte of runs (r, 2) is of."""
    at = 0
    for k in range(len(runs)):
        for j in range(np.int64(runs[k, 1])):
            cells[at] = np.int64(runs[k, 0]) + j
            at += 1


@njit(cache=True)
def _some_flat_rows(layer, tables, out, more, begin, end):
    kind, scale, row_bytes, cells, data = layer
    for r in range(begin, end):
        table, signed = tables[kind[r]], kind[r] == HAAR
        a = b = c = d = e = f = g = h = np.float32(0)  # eight, so that they are summed as two vectors
        for n in range(row_bytes[r], row_bytes[r + 1]):
            value, light = np.float32(data[n]), table[cells[n]]
            if signed:
                byte = np.float32(np.int8(data[n]))
                value = byte * abs(byte)
            a, b, c, d = (
                a + value * light[0],
                b + value * light[1],
                c + value * light[2],
                d + value * light[3],
            )
            if len(more):
                e, f, g, h = (
                    e + value * light[4],
                    f + value * light[5],
                    g + value * light[6],
                    h + value * light[7],
                )
        out[r, 0], out[r, 1], out[r, 2] = scale[r] * a, scale[r] * b, scale[r] * c
        if len(more):
            more[r, 0], more[r, 1], more[r, 2] = scale[r] * e, scale[r] * f, scale[r] * g


_FLAT = types.Tuple(
    (_read_only(u1, 1), _read_only(f4, 1), _read_only(i8, 1), _read_only(u2, 1), _read_only(u1, 1))
)


@njit(
    [types.void(_FLAT, _read_only(f4, 3), f4[:, ::1], f4[:, ::1], i8, i8)], parallel=True, cache=True, nogil=True
)  # fmt: skip
def light_flat_rows(layer, tables, out, more, begin, end):
    """``light_rows`` of rows laid flat: kind, scale, first byte of each row (and one beyond), cells, bytes."""
    for part in prange((end - begin + _ROWS - 1) // _ROWS):
        first = begin + part * _ROWS
        _some_flat_rows(layer, tables, out, more, first, min(end, first + _ROWS))


@njit(cache=True)
def _columns_of_rows(layer, tables, out, begin, end):
    kind, scale, row_runs, row_bytes, runs, data = layer
    total = np.empty(out.shape[1], np.float32)
    for r in range(begin, end):
        at, table, signed = row_bytes[r], tables[kind[r]], kind[r] == HAAR
        total[:] = 0
        for k in range(row_runs[r], row_runs[r + 1]):
            first = np.int64(runs[k, 0])
            for j in range(np.int64(runs[k, 1])):
                byte = data[at]
                at += 1
                b = np.float32(np.int8(byte))
                value = b * abs(b) if signed else np.float32(byte)
                if value != 0:
                    row = table[first + j]
                    for c in range(len(total)):
                        total[c] += value * row[c]
        for c in range(len(total)):
            out[r - begin, c] = scale[r] * total[c]


@njit([types.void(_LAYER, _read_only(f4, 3), f4[:, ::1], i8, i8)], parallel=True, cache=True)
def rows_times(layer, tables, out, begin, end):
    """out (end − begin, n) = rows begin … end times ``tables`` (2, 6R², n)."""
    for part in prange((end - begin + _ROWS - 1) // _ROWS):
        first = begin + part * _ROWS
        last = min(end, first + _ROWS)
        _columns_of_rows(layer, tables, out[first - begin : last - begin], first, last)


@njit(cache=True)
def _copy_slot(data, runs, count, size, into_data, into_runs):
    into_runs[:count] = runs[:count]
    into_data[:size] = data[:size]


@njit(
    [types.void(
        _read_only(u1, 1), _read_only(u2, 2), _read_only(i8, 1), _read_only(i8, 1), _read_only(i8, 1),
        _read_only(i8, 1), _read_only(i8, 1), u1[::1], u2[:, ::1],
    )],
    parallel=True,
    cache=True,
)  # fmt: skip
def copy_rows(data, runs, from_bytes, from_runs, chosen, to_bytes, to_runs, out_data, out_runs):
    """Rows ``chosen``, one after another: row k from its places in ``data`` and ``runs`` to those in ``out_…``."""
    for k in prange(len(chosen)):
        r = chosen[k]
        out_data[to_bytes[k] : to_bytes[k + 1]] = data[
            from_bytes[r] : from_bytes[r] + to_bytes[k + 1] - to_bytes[k]
        ]
        out_runs[to_runs[k] : to_runs[k + 1]] = runs[
            from_runs[r] : from_runs[r] + to_runs[k + 1] - to_runs[k]
        ]

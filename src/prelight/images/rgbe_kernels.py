"""Run lengths of Radiance pictures, compiled.

A scan-line of RGBE pixels is flat (4 bytes a pixel), in old run lengths (a pixel 1,1,1,n repeats the
last one n times; consecutive repeats count in base 256) or in new run lengths (2, 2, width in two
bytes, then each of the four components by itself: a byte above 128 is a run of that minus 128, else
that many literal bytes). Every index is compared with the end of the data before it is read.
"""

from __future__ import annotations

import numpy as np
from numba import njit

OK, CUT_SHORT, RUN_TOO_LONG, OTHER_WIDTH, NOTHING_TO_REPEAT = range(5)
SHORTEST_NEW, LONGEST_NEW = 8, 32_767


@njit(cache=True)
def _is_new(data: np.ndarray, at: int, width: int) -> bool:
    if width < SHORTEST_NEW or width > LONGEST_NEW or at + 4 > data.size:
        return False
    return data[at] == 2 and data[at + 1] == 2 and data[at + 2] < 128


@njit(cache=True)
def _walk_new(data: np.ndarray, at: int, width: int) -> tuple[int, int]:
    """Where a scan-line of new run lengths ends: (state, byte)."""
    if (np.int64(data[at + 2]) << 8 | np.int64(data[at + 3])) != width:
        return OTHER_WIDTH, at
    at += 4
    for _ in range(4):
        column = 0
        while column < width:
            if at >= data.size:
                return CUT_SHORT, at
            code = np.int64(data[at])
            literal = code <= 128
            count = code if literal else code - 128
            if count == 0 or column + count > width:
                return RUN_TOO_LONG, at
            column += count
            at += 1 + (count if literal else 1)  # ty: ignore[invalid-assignment]
    return (OK if at <= data.size else CUT_SHORT), at


@njit(cache=True)
def _walk_old(data: np.ndarray, at: int, width: int) -> tuple[int, int]:
    """Where a flat scan-line or one of old run lengths ends: (state, byte)."""
    column, shift = 0, 0
    while column < width:
        if at + 4 > data.size:
            return CUT_SHORT, at
        if data[at] == 1 and data[at + 1] == 1 and data[at + 2] == 1:
            if column == 0:
                return NOTHING_TO_REPEAT, at
            count = np.int64(data[at + 3]) << shift if shift <= 16 else np.int64(width)
            if column + count > width:
                return RUN_TOO_LONG, at
            column += count
            shift += 8
        else:
            column += 1
            shift = 0
        at += 4
    return OK, at


@njit(cache=True)
def find_scanlines(data: np.ndarray, at: int, width: int, starts: np.ndarray) -> tuple[int, int, int]:
    """Fill ``starts`` (count,) with the byte at which each scan-line begins, without decoding any.

    Gives (state, scan-line, byte); where the state is OK, ``decode`` may read without further tests.
    """
    for line in range(starts.size):
        starts[line] = at
        state, at = _walk_new(data, at, width) if _is_new(data, at, width) else _walk_old(data, at, width)
        if state != OK:
            return state, line, at
    return OK, starts.size, at


@njit(cache=True)
def _decode_new(data: np.ndarray, at: int, line: np.ndarray) -> None:
    width = line.shape[1]
    at += 4
    for component in range(4):
        column = 0
        while column < width:
            code = np.int64(data[at])
            literal = code <= 128
            count = code if literal else code - 128
            for k in range(count):  # loops, not slices: a tenth of the time to compile
                line[component, column + k] = data[at + 1 + k] if literal else data[at + 1]
            column += count
            at += 1 + (count if literal else 1)  # ty: ignore[invalid-assignment]


@njit(cache=True)
def _decode_old(data: np.ndarray, at: int, line: np.ndarray) -> None:
    width = line.shape[1]
    column, shift = 0, 0
    while column < width:
        if data[at] == 1 and data[at + 1] == 1 and data[at + 2] == 1:
            for _ in range(np.int64(data[at + 3]) << shift):
                for component in range(4):
                    line[component, column] = line[component, column - 1]
                column += 1
            shift += 8
        else:
            for component in range(4):
                line[component, column] = data[at + component]
            column += 1
            shift = 0
        at += 4


@njit(cache=True)
def decode(data: np.ndarray, starts: np.ndarray, scale: np.ndarray, picture: np.ndarray) -> None:
    """Scan-lines found before, to linear values.

    ``scale`` (256, 3) float32: what one unit of the mantissa is worth, by exponent byte and channel.
    ``picture`` (lines, width, 3) float32 is filled.
    """
    width = picture.shape[1]
    line = np.empty((4, width), np.uint8)
    for i in range(starts.size):
        if _is_new(data, starts[i], width):
            _decode_new(data, starts[i], line)
        else:
            _decode_old(data, starts[i], line)
        for j in range(width):
            for channel in range(3):
                picture[i, j, channel] = line[channel, j] * scale[line[3, j], channel]


@njit(cache=True)
def _run_length(values: np.ndarray, at: int) -> int:
    """How often the value at this place repeats, at most 127 times."""
    end = at + 1
    while end < values.size and end - at < 127 and values[end] == values[at]:
        end += 1
    return end - at


@njit(cache=True)
def encode(pixels: np.ndarray, out: np.ndarray) -> int:
    """RGBE pixels (lines, width, 4), 8 ≤ width ≤ 32,767, to new run lengths; gives the bytes used of ``out``.

    ``out`` must hold lines · (4 + 4·(width + width // 128 + 1)) bytes.
    """
    lines, width = pixels.shape[:2]
    at = 0
    for i in range(lines):
        out[at], out[at + 1], out[at + 2], out[at + 3] = 2, 2, width >> 8, width & 255
        at += 4
        for component in range(4):
            values = pixels[i, :, component]
            column = 0
            while column < width:
                run = _run_length(values, column)
                if run >= 3:
                    out[at], out[at + 1] = 128 + run, values[column]
                    column += run
                    at += 2
                    continue
                begin = column
                while column < width and column - begin < 128 and _run_length(values, column) < 3:
                    column += 1
                out[at] = column - begin
                for k in range(begin, column):
                    out[at + 1 + k - begin] = values[k]
                at += 1 + column - begin
    return at

"""Numba kernels that walk records of varying length."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)
def walk_records(body, numbers, steps, place, starts, counts):
    """Where one property lies in every record; the offset after the last record.

    ``body``     (bytes,) u1        ``numbers``  the same as float64, empty unless the counts are float64
    ``steps``    (P, 3) i8          bytes of the count (0: no list), of an item, whether the count is signed
    ``place``    offset of the first record, the property wanted, whether bytes are big-endian
    ``starts``, ``counts``  (N,) i8, written: byte offset of the first item, how many items

    Returns -1 - i if record i does not fit into the body.
    """
    at, wanted, big = place[0], place[1], place[2] != 0
    for i in range(len(starts)):
        for p in range(len(steps)):
            width, item = steps[p, 0], steps[p, 1]
            count = np.int64(1)
            if at + width > len(body):
                return -1 - i
            if width == 8:
                value = numbers[at // 8]
                if not (value >= 0 and value <= len(body)) or value != np.floor(value):
                    return -1 - i
                count = np.int64(value)
            elif width > 0:
                count = np.int64(0)
                for b in range(width):
                    byte = np.int64(body[at + (b if big else width - 1 - b)])
                    count = count * 256 + byte
                if steps[p, 2] != 0 and count >= np.int64(1) << (8 * width - 1):
                    return -1 - i
            at += width
            if count * item > len(body) - at:
                return -1 - i
            if p == wanted:
                starts[i] = at
                counts[i] = count
            at += count * item
    return at


@numba.njit(cache=True, nogil=True)
def copy_items(body, starts, lengths, items):
    """Gather the byte ranges [starts, starts + lengths) of ``body`` one after another into ``items``."""
    to = 0
    for i in range(len(starts)):
        for b in range(lengths[i]):
            items[to + b] = body[starts[i] + b]
        to += lengths[i]

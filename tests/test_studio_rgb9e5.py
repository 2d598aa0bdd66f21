"""Radiance in four bytes, beside a plain reference written from the specification."""

from __future__ import annotations

import math

import numpy as np
import pytest

from prelight.studio.rgb9e5_kernels import LARGEST, pack

NOTHING = np.zeros((1, 3), np.float32)


def packed(
    rows: np.ndarray, *, gain=(1, 1, 1), discs: np.ndarray | None = None, chunks: int = 2
) -> np.ndarray:
    out = np.full(len(rows), 0xDEADBEEF, np.uint32)
    discs = np.zeros_like(rows) if discs is None else discs
    pack(rows, np.array(gain, np.float32), discs, out, chunks)
    return out


def unpacked(words: np.ndarray) -> np.ndarray:
    exponent = (words >> 27).astype(np.float64)
    return np.stack([(words >> shift & 511) * 2.0 ** (exponent - 24) for shift in (0, 9, 18)], axis=-1)


def reference(colour: list[float]) -> int:
    """The specification's own steps (EXT_texture_shared_exponent), in exact arithmetic."""
    red, green, blue = (min(max(c, 0.0), 65408.0) for c in colour)
    largest = max(red, green, blue)
    exponent = max(-16, math.floor(math.log2(largest)) if largest > 0 else -16) + 16
    if math.floor(largest / 2.0 ** (exponent - 24) + 0.5) == 512:
        exponent += 1
    r, g, b = (math.floor(c / 2.0 ** (exponent - 24) + 0.5) for c in (red, green, blue))
    return exponent << 27 | b << 18 | g << 9 | r


@pytest.fixture(scope="module")
def colours() -> np.ndarray:
    random = np.random.default_rng(5)
    wide = 10.0 ** random.uniform(-9, 6, (20_000, 3))
    near = 2.0 ** random.integers(-17, 17, (2_000, 1)) * (1 + random.uniform(-2e-3, 2e-3, (2_000, 3)))
    return np.concatenate([wide, near, [[0, 0, 0], [1, 0, 0], [0, 2**-25, 0]]]).astype(np.float32)


def test_it_is_the_specification(colours) -> None:
    assert packed(colours).tolist() == [reference(c) for c in colours.tolist()]


def test_the_error_is_half_a_step(colours) -> None:
    true = np.minimum(colours.astype(np.float64), LARGEST)
    largest = true.max(axis=1)
    error = np.abs(unpacked(packed(colours)) - true).max(axis=1)
    assert (error <= np.maximum(largest * 2.0**-9, 2.0**-25)).all()
    assert error.max() > 0


def test_zeros_are_exact_and_nothing_is_not_a_number() -> None:
    odd = np.array(
        [[0, 0, 0], [-0.0, -1, -np.inf], [np.nan] * 3, [np.nan, 256, np.inf], [1e38, 0, 65409], [1e-40, 0, 0]],
        np.float32,
    )  # fmt: skip
    assert packed(odd)[:3].tolist() == [0, 0, 0]
    assert unpacked(packed(odd))[3:].tolist() == [[0, 256, LARGEST], [LARGEST, 0, LARGEST], [0, 0, 0]]


def test_gain_and_discs_are_added_before(colours) -> None:
    discs = colours[::-1].copy()
    gain = np.array([2.0, 0.5, 0.0], np.float32)
    assert (packed(colours, gain=gain, discs=discs) == packed(colours * gain + discs)).all()
    assert (packed(np.full((2, 3), np.inf, np.float32), gain=(0, 1, 0)) >> 9 & 511 == 511).all()  # ∞ · 0 is 0


def test_parts_make_no_difference(colours) -> None:
    whole = packed(colours, chunks=1)
    assert all((packed(colours, chunks=n) == whole).all() for n in (2, 3, 7, 100_000))

"""Rows over a cube map as pulses or Haar coefficients: what they give back, and which are smaller."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.encoding.pulse_or_haar import (
    Choice,
    RunRows,
    check_resolution,
    encoded,
    light_tables,
    lit,
    size_of,
    tables_of,
)
from prelight.errors import InputError

R = 16
CELLS = 6 * R * R


def rows_of(dense: np.ndarray) -> tuple[RunRows, np.ndarray, np.ndarray]:
    row, cell = np.nonzero(dense)
    starts = np.searchsorted(row, np.arange(len(dense) + 1)).astype(np.int64)
    return encoded(starts, cell.astype(np.int32), dense[row, cell].astype(np.float32), R)


def windows(rng, count: int = 40, *, size: int = 6, noise: float = 0.2) -> np.ndarray:
    """Rows lit in one rectangle of a face."""
    dense = np.zeros((count, 6, R, R), np.float32)
    for row in dense:
        face, top, left = rng.integers(6), *rng.integers(0, R - size, 2)
        row[face, top : top + size, left : left + size] = 1 + noise * rng.random((size, size))
    return dense.reshape(count, -1)


def test_rows_come_back_within_half_a_step(rng) -> None:
    dense = windows(rng)
    rows, kept, figures = rows_of(dense)
    assert (kept == np.arange(len(dense))).all()
    assert (rows.kind == 0).all()
    back = rows.dense(np.arange(len(rows)))
    step = dense.max(axis=1, keepdims=True) / 255
    assert (np.abs(back - dense) <= 0.5001 * step).all()
    assert ((back == 0) | (dense > 0)).all()
    assert abs(Choice.of(figures).error - np.linalg.norm(back - dense) / np.linalg.norm(dense)) < 1e-5


def test_a_row_that_fills_faces_evenly_is_smaller_in_haar(rng) -> None:
    even = np.ones((3, CELLS), np.float32)
    smooth = even * (1 + 0.5 * np.linspace(0, 1, R)[None, :].repeat(6 * R, axis=0).ravel())
    rows, _, figures = rows_of(np.concatenate([even, smooth, windows(rng, 4)]))
    assert rows.kind.tolist() == [1] * 6 + [0] * 4
    choice = Choice.of(figures)
    assert choice.haar_rows == 6
    assert choice.bytes == size_of(rows) < min(choice.pulse_bytes, choice.haar_bytes)
    back = rows.dense(np.arange(6))
    assert np.abs(back[:3] - 1).max() < 1e-3
    assert np.abs(back[3:] - smooth).max() < 0.05


def test_samples_of_one_cell_are_added(rng) -> None:
    del rng
    starts = np.array([0, 3, 3, 4])
    rows, kept, _ = encoded(starts, np.int32([7, 7, 9, 0]), np.float32([1, 2, 6, 0.5]), R)
    assert kept.tolist() == [0, 2]
    back = rows.dense(np.arange(2))
    assert np.allclose(back[0, [7, 9]], (3, 6), atol=0.02)
    assert back[1].sum() == pytest.approx(0.5)


def test_products_are_those_of_the_rows(rng) -> None:
    dense = np.concatenate([windows(rng), np.ones((2, CELLS), np.float32)])
    rows, _, _ = rows_of(dense)
    shell = rng.random((6, R, R, 3)).astype(np.float32)
    known = rows.dense(np.arange(len(rows))) @ shell.reshape(-1, 3)
    assert np.allclose(rows.times(shell.reshape(-1, 3)), known, rtol=1e-4)
    out = np.full((len(rows), 3), -1, np.float32)
    lit(rows.layer(), [(light_tables(shell), out)], 5, len(rows))
    assert np.allclose(out[5:], known[5:], rtol=1e-4)
    assert (out[:5] == -1).all(), "rows that were not asked for stay"
    other, one, two = rng.random((6, R, R, 3)).astype(np.float32), np.empty_like(out), np.empty_like(out)
    lit(rows.layer(), [(light_tables(shell), one), (light_tables(other), two)], 0, len(rows))
    assert (one[5:] == out[5:]).all(), "beside another light as alone"
    assert np.allclose(two, rows.times(other.reshape(-1, 3)), rtol=1e-4)


def test_one_column_is_not_changed_by_its_product(rng) -> None:
    rows, _, _ = rows_of(windows(rng, 2))
    column = rng.random((CELLS, 1)).astype(np.float32)
    before = column.copy()
    assert np.allclose(rows.times(column), rows.dense(np.arange(2)) @ before, rtol=1e-5)
    assert (column == before).all()


def test_haar_is_orthonormal(rng) -> None:
    light = rng.standard_normal((CELLS, 5)).astype(np.float32)
    plain, turned = tables_of(light, R)
    assert np.allclose(plain.T @ plain, turned.T @ turned, rtol=1e-4, atol=1e-2)
    faces = turned.reshape(6, R, R, 5)
    assert np.allclose(faces[:, 0, 0], plain.reshape(6, R * R, 5).sum(axis=1) / R, atol=1e-3)


def test_chosen_rows_keep_what_they_are(rng) -> None:
    rows, _, _ = rows_of(np.concatenate([windows(rng), np.ones((2, CELLS), np.float32)]))
    order = rng.permutation(len(rows))[:17]
    assert (rows.chosen(order).dense(np.arange(17)) == rows.dense(order)).all()


@pytest.mark.parametrize("resolution", [0, 1, 5, 33, 128])
def test_resolutions_that_cannot_be_halved_are_refused(resolution) -> None:
    with pytest.raises(InputError, match="expected 4, 8, 16, 32 or 64"):
        check_resolution(resolution)


def test_rows_laid_flat_are_lit_to_the_same_bits(rng) -> None:
    """Short runs; both kinds of rows, one light and two."""
    dense = windows(rng, 30, size=2) * (rng.random((30, CELLS)) < 0.7)
    rows, _, _ = rows_of(np.concatenate([dense, np.ones((2, CELLS), np.float32)]))
    assert set(rows.kind.tolist()) == {0, 1}
    assert len(rows.lit_layer()) != len(rows.layer())
    tables = [light_tables(rng.random((6, R, R, 3), dtype=np.float32)) for _ in range(2)]
    for count in (1, 2):
        found = []
        for layer in (rows.layer(), rows.lit_layer()):
            found.append([np.zeros((len(rows), 3), np.float32) for _ in range(count)])
            lit(layer, list(zip(tables[:count], found[-1], strict=True)), 0, len(rows))
        np.testing.assert_array_equal(found[0], found[1])
        assert (found[0][0] > 0).all()

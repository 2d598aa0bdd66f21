"""Rows over a cube map in few bytes: pulses or Haar coefficients, whichever take less (portals paper, section 4.1.2).

Either is quantised to 8 bits by the row's maximum, and kept as runs of bytes (start, length): through a portal the
cells that are lit lie side by side. A pulse is an unsigned byte, value = scale · byte. A Haar coefficient is a signed
byte, value = scale · b·|b|: finer steps for small ones, since the sum of a face is 32 times as large as a cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Float32, Int32, Int64, UInt8, UInt16
from ..errors import InputError
from .pulse_or_haar_kernels import (
    GAP,
    HAAR,
    RUN_BYTES,
    copy_rows,
    encode_rows,
    haar_transforms,
    lay_flat,
    light_flat_rows,
    light_rows,
    rows_times,
)

MOST_RESOLUTION = 64  # cells are numbered by 16 bits
_SLOTS = 64 << 20  # bytes of rows that are made side by side
_RUN_PARTS = 6  # of a layer of runs
_FLAT_BYTES = 2  # as many times as the numbers of runs: what the cells of flat rows may take
_CELLS_AT_ONCE = 256  # that rows are read back for


@dataclass(frozen=True)
class RunRows:
    """Rows of numbers over the 6·R² cells of a cube map.

    Attributes
    ----------
    resolution
        R.
    kind, scale
        ``(n,)`` 0 pulses, 1 Haar; and the factor of its bytes.
    row_runs
        ``(n + 1,)`` where the runs of each row begin.
    runs, data
        ``(r, 2)`` first cell or coefficient and how many, and their bytes, run after run.
    """

    resolution: int
    kind: UInt8[np.ndarray, "n"]
    scale: Float32[np.ndarray, "n"]
    row_runs: Int64[np.ndarray, "n_and_one"]
    runs: UInt16[np.ndarray, "runs 2"]
    data: UInt8[np.ndarray, "bytes"]

    def __len__(self) -> int:
        return len(self.kind)

    @property
    def row_bytes(self) -> Int64[np.ndarray, "n_and_one"]:
        """Where the bytes of each row begin."""
        after = np.concatenate([[0], np.cumsum(self.runs[:, 1], dtype=np.int64)])
        return after[self.row_runs]

    def layer(self) -> tuple:
        """As kernels take it."""
        arrays = (self.kind, self.scale, self.row_runs, self.row_bytes, self.runs, self.data)
        return tuple(_frozen(a) for a in arrays)

    def lit_layer(self) -> tuple:
        """As ``lit`` takes it: short runs are laid flat, where that takes at most twice as much memory."""
        if 2 * len(self.data) > _FLAT_BYTES * RUN_BYTES * len(self.runs):
            return self.layer()
        cells = np.empty(len(self.data), np.uint16)
        lay_flat(_frozen(self.runs), cells)
        return flat_layer(self.scale, self.row_bytes, cells, self.data, kind=self.kind)

    def chosen(self, rows: np.ndarray) -> RunRows:
        """Some rows, in that order."""
        from_bytes, runs = self.row_bytes, np.diff(self.row_runs)[rows]
        to_runs = np.concatenate([[0], np.cumsum(runs)])
        to_bytes = np.concatenate([[0], np.cumsum(np.diff(from_bytes)[rows])])
        data, own = np.empty(to_bytes[-1], np.uint8), np.empty((to_runs[-1], 2), np.uint16)
        copy_rows(
            _frozen(self.data), _frozen(self.runs), _frozen(from_bytes), _frozen(self.row_runs),
            _frozen(np.asarray(rows, np.int64)), _frozen(to_bytes), _frozen(to_runs), data, own,
        )  # fmt: skip
        return replace(
            self, kind=self.kind[rows], scale=self.scale[rows], row_runs=to_runs, runs=own, data=data
        )

    def times(
        self, columns: Float32[np.ndarray, "cells n"], begin: int = 0, end: int | None = None
    ) -> Float32[np.ndarray, "rows n"]:
        """Rows begin … end times light (6·R², n)."""
        end = len(self) if end is None else end
        out = np.empty((end - begin, columns.shape[1]), np.float32)
        rows_times(self.layer(), _frozen(tables_of(columns, self.resolution)), out, begin, end)
        return out

    def dense(self, rows: np.ndarray) -> Float32[np.ndarray, "rows cells"]:
        """Some rows in full, as they were read back: for tests and figures."""
        some, cells = self.chosen(rows), 6 * self.resolution**2
        blocks = []
        for first in range(0, cells, _CELLS_AT_ONCE):
            ones = np.eye(cells, min(_CELLS_AT_ONCE, cells - first), -first, dtype=np.float32)
            blocks.append(some.times(ones))
        return np.concatenate(blocks, axis=1)


@dataclass(frozen=True)
class Choice:
    """How the choice between pulses and Haar went.

    Attributes
    ----------
    rows, haar_rows
        How many, and how many are kept as Haar coefficients.
    bytes, pulse_bytes, haar_bytes
        Of the rows as kept, and if all were one or the other.
    pulse_error, haar_error
        RMS error of all rows, as a share of their RMS, if all were one or the other.
    error
        The same as they are kept.
    """

    rows: int
    haar_rows: int
    bytes: int
    pulse_bytes: int
    haar_bytes: int
    pulse_error: float
    haar_error: float
    error: float

    @classmethod
    def of(cls, figures: np.ndarray) -> Choice:
        """From what ``encoded`` says of its rows."""
        there = figures[figures[:, 8] > 0]
        is_haar = there[:, 0] == HAAR
        kept = np.where(is_haar, there[:, 7], there[:, 6]).sum()
        pulses, haar, whole = there[:, 6].sum(), there[:, 7].sum(), max(there[:, 8].sum(), 1e-300)
        sizes = np.where(is_haar, there[:, 5], there[:, 4])
        return cls(
            len(there), int(is_haar.sum()), int(sizes.sum()), int(there[:, 4].sum()), int(there[:, 5].sum()),
            float(np.sqrt(pulses / whole)), float(np.sqrt(haar / whole)), float(np.sqrt(kept / whole)),
        )  # fmt: skip


def check_resolution(resolution: int) -> int:
    """R as Haar's halves want it; raises InputError."""
    if resolution not in (4, 8, 16, 32, MOST_RESOLUTION):
        raise InputError(
            "cube", f"{resolution!r}, expected 4, 8, 16, 32 or {MOST_RESOLUTION} cells along a face"
        )
    return resolution


def slots_for(resolution: int) -> int:
    """How many rows ``encoded`` is to be given at once."""
    return max(64, _SLOTS // (14 * resolution * resolution))


def encoded(
    starts: Int64[np.ndarray, "n_and_one"],
    cells: Int32[np.ndarray, "samples"],
    weights: Float32[np.ndarray, "samples"],
    resolution: int,
) -> tuple[RunRows, Int64[np.ndarray, "kept"], np.ndarray]:
    """Rows of summed samples; which of the n they are (those that are not all zero), and figures for ``Choice``.

    Row k has samples ``starts[k]`` up to the next start: a weight, not below 0, for a cell.
    """
    count, cells_of_row = len(starts) - 1, 6 * resolution**2
    data = np.empty((count, cells_of_row), np.uint8)
    runs = np.empty((count, cells_of_row // (GAP + 2) + 2, 2), np.uint16)
    figures = np.zeros((count, 9))
    encode_rows(*(_frozen(a) for a in (starts, cells, weights)), resolution, data, runs, figures)
    kept = np.flatnonzero(figures[:, 8] > 0)
    of_runs, of_bytes = figures[kept, 2].astype(np.int64), figures[kept, 3].astype(np.int64)
    row_runs, row_bytes = (np.concatenate([[0], np.cumsum(x)]) for x in (of_runs, of_bytes))
    out, own = np.empty(row_bytes[-1], np.uint8), np.empty((row_runs[-1], 2), np.uint16)
    first = np.arange(count, dtype=np.int64)
    copy_rows(
        _frozen(data.reshape(-1)), _frozen(runs.reshape(-1, 2)), _frozen(first * data.shape[1]),
        _frozen(first * runs.shape[1]), _frozen(kept), _frozen(row_bytes), _frozen(row_runs), out, own,
    )  # fmt: skip
    rows = RunRows(
        resolution, figures[kept, 0].astype(np.uint8), figures[kept, 1].astype(np.float32), row_runs, own, out
    )
    return rows, kept, figures


def tables_of(columns: Float32[np.ndarray, "cells n"], resolution: int) -> Float32[np.ndarray, "2 cells n"]:
    """Light over the cells, and its Haar coefficients: what pulses and what Haar rows are multiplied with."""
    turned = np.array(columns.T, np.float32, order="C")  # a copy even of one column
    haar_transforms(turned, resolution)
    return np.stack([np.ascontiguousarray(columns, np.float32), turned.T])


def light_tables(
    shell: Float32[np.ndarray, "6 R R 3"], *, haar: bool = True
) -> Float32[np.ndarray, "2 cells 4"]:
    """The tables of a shell's radiance, filled up to four channels; the second is 0 where no row is of ``haar``."""
    R = shell.shape[1]
    wide = np.zeros((2, 6 * R * R, 4), np.float32)
    if haar:
        wide[:, :, :3] = tables_of(shell.reshape(-1, 3), R)
    else:
        wide[0, :, :3] = shell.reshape(-1, 3)
    return wide


def flat_layer(
    scale: np.ndarray,
    starts: np.ndarray,
    cells: np.ndarray,
    data: np.ndarray,
    *,
    kind: np.ndarray | None = None,
) -> tuple:
    """Rows as ``lit`` takes them: of each its factor (n,) and where it begins (n + 1,); of each byte its cell. All are
    pulses, if no kind (n,) is given."""
    kind = np.zeros(len(scale), np.uint8) if kind is None else kind
    arrays = kind, scale.astype(np.float32), starts.astype(np.int64), cells.astype(np.uint16), data
    return tuple(map(_frozen, arrays))


def lit(rows_layer: tuple, lights: Sequence[tuple[np.ndarray, np.ndarray]], begin: int, end: int) -> None:
    """Of one light or two, each ``light_tables`` and what of it is written, (rows, 3), rows begin … end.

    ``rows_layer`` is ``RunRows.lit_layer()``; the sums are the same however the rows lie.
    """
    tables = np.concatenate([table for table, _ in lights], axis=2) if len(lights) > 1 else lights[0][0]
    more = lights[1][1] if len(lights) > 1 else np.empty((0, 3), np.float32)
    kernel = light_rows if len(rows_layer) == _RUN_PARTS else light_flat_rows
    kernel(rows_layer, _frozen(tables), lights[0][1], more, begin, end)


def size_of(rows: RunRows) -> int:
    """Bytes of runs and bytes."""
    return RUN_BYTES * len(rows.runs) + len(rows.data)


def _frozen(a: np.ndarray) -> np.ndarray:
    view = np.ascontiguousarray(a).view()
    view.flags.writeable = False
    return view

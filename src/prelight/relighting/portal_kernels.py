"""What panes bring to vertices, added up."""

from __future__ import annotations

from numba import njit, prange, types

_VERTICES = 1024  # of a thread at a time

f4, i4, i8 = types.float32, types.int32, types.int64


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


@njit(cache=True)
def _some_vertices(starts, rows, pane, factors, light, out, begin, end):
    for v in range(begin, end):
        for k in range(starts[v], starts[v + 1]):
            r, p = rows[k], pane[k]
            out[v, 0] += factors[p, 0] * light[r, 0]
            out[v, 1] += factors[p, 1] * light[r, 1]
            out[v, 2] += factors[p, 2] * light[r, 2]


_ROWS_OF_VERTICES = _read_only(i8, 1), _read_only(i4, 1), _read_only(i4, 1)


@njit(
    [types.void(*_ROWS_OF_VERTICES, _read_only(f4, 2), _read_only(f4, 2), f4[:, ::1])],
    parallel=True,
    cache=True,
    nogil=True,
)  # fmt: skip
def add_panes(starts, rows, pane, factors, light, out):
    """out (V, 3) += Σ factor of the pane · light of the row, over the rows of each vertex, in their order.

    Vertex v has entries ``starts[v]`` up to the next start: a row of ``light`` and its pane.
    """
    for part in prange((len(out) + _VERTICES - 1) // _VERTICES):
        _some_vertices(
            starts, rows, pane, factors, light, out, part * _VERTICES, min(len(out), (part + 1) * _VERTICES)
        )


@njit(cache=True)
def _some_groups(sums, scales, out, begin, end):
    for g in range(begin, end):
        for i in range(min(32, len(out) - 32 * g)):
            v = 32 * g + i
            for c in range(3):
                out[v, c] = scales[v] * sums[g, 32 * c + i]


@njit([types.void(_read_only(f4, 2), _read_only(f4, 1), f4[:, ::1])], parallel=True, cache=True, nogil=True)
def write_scaled(sums, scales, out):
    """out (V, 3) = scales · sums (groups, 3 · 32), written."""
    groups = len(sums)
    for part in prange((groups + 31) // 32):
        _some_groups(sums, scales, out, part * 32, min(groups, (part + 1) * 32))

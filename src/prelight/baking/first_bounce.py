"""One bounce alone, thinned until it is small enough to keep beside the modes of all bounces.

A patch of sun is bright and of any shape: few modes do not hold its first bounce, but do all that follow it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Float32, Int32, Int64
from ..encoding.row_wavelet_kernels import add_dropped, colour_halves, multiply_rows, thin_rows
from ..encoding.vertex_tree import left_shares, vertex_order
from ..scene.geometry import Scene
from ..transport.direct import DiffuseTransfer
from ..transport.gathering import Gathering
from .entry_weights import EntryWeights

MOST_ENTRIES = 224  # a row, in the mean
BYTES_PER_VERTEX, BYTES_PER_ENTRY = 30, 3  # on disk
_SMALLEST = 0.5  # rays: less is their noise
_SMALLEST_WEIGHED = (
    0.05  # of entries that are weighed by light: so much dimmer than the mean is a ray for some
)
_LADDER = 2**0.25
_TRIED_ROWS = 4096
_ADJUSTMENTS = 2
_TRUST = 1e-6  # of all masses: below it a node's shares stay those of all rows
_DIRECTIONS, _LIGHTS = 256, 8  # looked for, and measured
_REACHES = 0.05  # of the light of the brightest sun: what others bring at least
_LEAST_MASS = 1e-6  # of the mean: of vertices that no ray meets


@dataclass(frozen=True)
class FirstBounce:
    """Rows of G in the basis of a tree over vertices, as docs/bake-format.md tells it."""

    order: Int32[np.ndarray, "vertices"]
    left: Float32[np.ndarray, "size"]
    colours: Float32[np.ndarray, "vertices 3"]
    sums: Float32[np.ndarray, "vertices"]
    scales: Float32[np.ndarray, "vertices"]
    counts: np.ndarray  # uint16
    steps: np.ndarray  # (entries,) uint16
    codes: np.ndarray  # (entries,) int8
    threshold: float
    error: float = 0.0  # RMS of a bounce of suns

    def bounce(self, D: Float32[np.ndarray, "vertices 3"]) -> Float32[np.ndarray, "vertices 3"]:
        """One bounce of direct irradiance / π."""
        nodes, means = (
            np.empty((len(self.left), 4), np.float32),
            np.empty((2 * len(self.left), 4), np.float32),
        )
        colour_halves(D, self.colours, self.order, self.left, means, nodes)
        out = np.empty_like(D)
        starts = np.concatenate([[0], np.cumsum(self.counts, dtype=np.int64)])
        multiply_rows((starts, self.steps, self.codes, self.sums, self.scales), nodes, np.float32(0), out)
        return out


def first_bounce(
    gathering: Gathering, scene: Scene, transfer: DiffuseTransfer, *, rays: int, lanes: int
) -> FirstBounce:
    """Thin the operator of so many rays a row, and measure what that loses, on suns that reach the scene."""
    first = thinned_operator(gathering, scene, rays=rays)
    return replace(first, error=_error(first, gathering, transfer, lanes))


def thinned_operator(
    gathering: Gathering,
    scene: Scene,
    *,
    rays: int,
    most: float = MOST_ENTRIES,
    weights: EntryWeights | None = None,
) -> FirstBounce:
    """The operator of so many rays a row, with at most so many entries a row in the mean; its error not measured."""
    return thinned_operators(gathering, scene, rays=rays, most=(most,), weights=weights)[0]


def thinned_operators(
    gathering: Gathering,
    scene: Scene,
    *,
    rays: int,
    most: tuple[float, ...],
    weights: EntryWeights | None = None,
) -> list[FirstBounce]:
    """The same several times, finer and coarser; ``weights`` of entries, where it is known what light is likely."""
    order = vertex_order(scene.positions, scene.normals)
    weights = weights or EntryWeights()
    masses, colours, tried = _columns(gathering, weights)
    place = np.empty(len(order), np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    trust = masses.sum(dtype=np.float64) * _TRUST
    cuts = []
    for entries in most:
        tree = place, left_shares(order, masses)
        threshold = (_SMALLEST if weights.columns is None else _SMALLEST_WEIGHED) / rays
        while _counts(tried, tree, threshold).mean() > entries:
            threshold *= _LADDER
        for _ in range(_ADJUSTMENTS):
            tree = place, _shares_of_dropped(tried, tree, threshold, trust)
        cuts.append((tree, threshold))
    parts: list[list] = [[] for _ in most]
    for rows, matrix, _ in weights.tiles(gathering):
        for found, (tree, threshold) in zip(parts, cuts, strict=True):
            counts, sums, scales, *entries = thinned(matrix, tree, threshold)
            found.append((counts, weights.of_row(sums, rows), weights.of_row(scales, rows), *entries))
    out, colours = [], weights.of_column(colours)
    for found, (tree, threshold) in zip(parts, cuts, strict=True):
        counts, sums, scales, steps, codes = (np.concatenate(each) for each in zip(*found, strict=True))
        counts = counts.astype(np.uint16)
        out.append(FirstBounce(order, tree[1], colours, sums, scales, counts, steps, codes, threshold))
    return out


def _columns(gathering: Gathering, weights: EntryWeights) -> tuple[np.ndarray, np.ndarray, tuple]:
    """How much all rows see of each vertex, its mean colour as they see it, and some rows to try thresholds on."""
    V = gathering.columns
    seen = np.zeros((max(1, gathering.coloured_entries), V))
    rows = np.unique(np.linspace(0, V - 1, min(_TRIED_ROWS, V)).astype(np.int64))
    counts, columns, values = [], [], []
    for of_tile, (starts, leads_to, grey), of_channels in weights.tiles(gathering):
        for c, of_channel in enumerate(of_channels):
            seen[c] += np.bincount(leads_to, of_channel, minlength=V)
        for row in (
            rows[(rows >= of_tile.start) & (rows < of_tile.stop)] - of_tile.start
        ):  # a thousand at most
            part = slice(starts[row], starts[row + 1])
            counts.append(part.stop - part.start)
            columns.append(leads_to[part].copy())
            values.append(grey[part].copy())
    mass = seen.mean(axis=0)
    floor = _LEAST_MASS * mass.mean() or 1.0
    colours = np.divide(seen, mass, out=np.ones_like(seen), where=mass > 0).T
    if gathering.coloured_entries == 0:
        colours = gathering.albedo
    starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    tried = starts, np.concatenate(columns), np.concatenate(values)
    wide = np.ascontiguousarray(np.broadcast_to(colours, (V, 3)), np.float32)
    return np.maximum(mass, floor).astype(np.float32), wide, tried


def _shares_of_dropped(
    tried: tuple, tree: tuple, threshold: float, trust: float
) -> Float32[np.ndarray, "size"]:
    """How rows that keep nothing of a node divide it: with the shares of all, what is thinned would be too dark
    where few rows see most of it."""
    left = tree[1]
    weights = np.zeros((len(left), 2))
    add_dropped(tried, tree, threshold, weights)
    return ((weights[:, 1] + trust * left) / (weights[:, 0] + trust)).astype(np.float32)


def _counts(matrix: tuple, tree: tuple, threshold: float) -> Int64[np.ndarray, "rows"]:
    counts = np.zeros(len(matrix[0]) - 1, np.int64)
    none = np.zeros(0, np.float32)
    out = counts, none, none, np.zeros(0, np.uint16), np.zeros(0, np.int8)
    thin_rows(matrix, tree, threshold, np.zeros(0, np.int64), out)
    return counts


def thinned(matrix: tuple, tree: tuple, threshold: float) -> tuple[np.ndarray, ...]:
    """counts, sums, scales, steps and codes of some rows (starts, columns, values); see ``row_wavelet_kernels``."""
    counts = _counts(matrix, tree, threshold)
    starts = np.concatenate([[0], np.cumsum(counts)])
    sums, scales = np.empty((2, len(counts)), np.float32)
    steps, codes = np.empty(starts[-1], np.uint16), np.empty(starts[-1], np.int8)
    out = counts, sums, scales, steps, codes
    thin_rows(matrix, tree, threshold, starts, out)
    return out


def _error(first: FirstBounce, gathering: Gathering, transfer: DiffuseTransfer, lanes: int) -> float:
    """RMS over vertices and some suns, as a share of the bounce itself."""
    directions = _spread(_DIRECTIONS)
    rows, _ = transfer.trace(directions, lanes=lanes)
    T = transfer.values(rows, directions)[:, 0]
    reach = T.mean(axis=1)
    lit = np.flatnonzero(reach > _REACHES * max(float(reach.max()), 1e-30))
    if not len(lit):
        return 0.0
    chosen = lit[np.unique(np.linspace(0, len(lit) - 1, _LIGHTS).astype(int))]
    D = np.repeat(T[chosen].T[:, :, None], 3, axis=2)
    truth = gathering.bounce(np.ascontiguousarray(D))
    lost = whole = 0.0
    for j in range(D.shape[1]):
        found = first.bounce(np.ascontiguousarray(D[:, j]))
        lost += float(np.square(found - truth[:, j], dtype=np.float64).sum())
        whole += float(np.square(truth[:, j], dtype=np.float64).sum())
    return float(np.sqrt(lost / whole)) if whole > 0 else 0.0


def _spread(count: int) -> Float32[np.ndarray, "count 3"]:
    """Directions evenly over the sphere."""
    y = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    r = np.sqrt(1 - y * y)
    return np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=1).astype(np.float32)

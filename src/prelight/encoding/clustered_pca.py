"""Clustered principal components (Sloan, Hall, Hart and Snyder 2003): receivers in clusters with bases of their own.

A receiver's row is its cluster's mean and a few of its cluster's components: x ≈ m + Σ b_i z_i. Which receivers are in
which cluster, and how many components each has, follow from what is left over.

References
----------
Kambhatla and Leen, Dimension reduction by local principal component analysis, 1997. Kristensen, Akenine-Möller and
Jensen, Precomputed local radiance transfer for real-time lighting design, 2005 (section 5).
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Int32

ROUNDS = 30
_NEGLIGIBLE = (
    1e-8  # of the squares of all rows: dimensions below it, all together, are left out from the beginning
)
_ROUGHLY = 1e-5  # the same, while clusters are being found
_SEED = 8
_LLOYD = 8  # rounds of k-means to begin with

Rows = Float32[np.ndarray, "channels receivers columns"]


@dataclass(frozen=True)
class Cluster:
    """Some receivers and what approximates their rows, channel by channel.

    Attributes
    ----------
    rows
        Receivers, ascending.
    means
        ``(columns,)`` of each channel.
    basis
        ``(components, columns)`` of each channel, orthonormal, the most important first.
    coordinates
        ``(components, rows)`` of each channel.
    """

    rows: Int32[np.ndarray, "rows"]
    means: list[Float32[np.ndarray, "columns"]]
    basis: list[Float32[np.ndarray, "components columns"]]
    coordinates: list[Float32[np.ndarray, "components rows"]]

    def approximation(self, channel: int) -> Float32[np.ndarray, "rows columns"]:
        """What is kept of the rows."""
        return self.means[channel] + self.coordinates[channel].T @ self.basis[channel]


def clustered_components(
    X: Rows,
    *,
    clusters: int,
    mean_components: float,
    error: float | None = None,
    rounds: int = ROUNDS,
) -> list[Cluster]:
    """Rows X (channels, receivers, columns) in at most so many clusters.

    Parameters
    ----------
    clusters
        Fewer where a cluster becomes empty. All channels share them.
    mean_components
        Coefficients of a receiver in the mean, over all receivers and channels.
    error
        Stop adding components when the RMS of what is left over, as a share of the rows', is below this; there are
        still no more than ``mean_components``.
    rounds
        Of clustering by what is left over, at most: fewer where no receiver changes its cluster.
    """
    spaces = [_Space(x) for x in X]
    rough = [space.rough() for space in spaces]
    receivers = X.shape[1]
    count = max(1, min(clusters, receivers))
    of = _by_means(np.concatenate([space.rows for space in rough], axis=1), count)
    budget = mean_components * receivers * len(X)
    # The number of components grows with the rounds, as clusters find their receivers.
    growing = max(1, min(rounds // 2, int(np.ceil(mean_components)))) if count > 1 else 1
    for turn in range(rounds if count > 1 else 0):
        share = min(1.0, (turn + 1) / growing)
        fitted = _fitted(rough, of, budget=budget * share, error=error)
        left = np.stack([_left_over(rough, bases) for bases in fitted], axis=1)
        new = left.argmin(axis=1)
        if turn + 1 >= growing and (new == of).all():
            break
        of = np.unique(new, return_inverse=True)[1]
    fitted = _fitted(spaces, of, budget=budget, error=error)
    return [_cluster(spaces, np.flatnonzero(of == k), bases) for k, bases in enumerate(fitted)]


class _Space:
    """Rows of one channel in the few dimensions that hold all but a negligible part of them."""

    def __init__(self, x: Float32[np.ndarray, "receivers columns"]) -> None:
        x = x.astype(np.float64)
        small = x.T @ x if x.shape[1] <= x.shape[0] else x @ x.T
        squares, vectors = np.linalg.eigh(small)
        squares, vectors = np.maximum(squares[::-1], 0), vectors[:, ::-1]
        rest = squares[::-1].cumsum()[::-1]
        keep = max(1, int(np.count_nonzero(rest > _NEGLIGIBLE * max(rest[0], 1e-300))))
        if x.shape[1] <= x.shape[0]:
            self.axes = np.ascontiguousarray(vectors[:, :keep].T)  # (dimensions, columns)
        else:
            self.axes = vectors[:, :keep].T @ x / np.sqrt(np.maximum(squares[:keep], 1e-300))[:, None]
        self.rows = x @ self.axes.T
        self.total = float(squares.sum())
        self._rough = max(1, int(np.count_nonzero(rest > _ROUGHLY * max(rest[0], 1e-300))))

    def rough(self) -> _Space:
        """The same in its leading dimensions."""
        found = object.__new__(_Space)
        found.axes, found.rows, found.total = (
            self.axes[: self._rough],
            self.rows[:, : self._rough],
            self.total,
        )
        return found


_Bases = list[tuple[np.ndarray, np.ndarray]]  # of each channel: mean and components in its space


def _fitted(spaces: list[_Space], of: np.ndarray, *, budget: float, error: float | None) -> list[_Bases]:
    """Mean and components of every cluster and channel: the next component goes where it gains most a receiver."""
    count = int(of.max()) + 1
    sizes = np.bincount(of, minlength=count)
    means, vectors, queue, left = {}, {}, [], 0.0
    for k in range(count):
        for c, space in enumerate(spaces):
            own = space.rows[of == k]
            means[k, c] = own.mean(axis=0)
            centred = own - means[k, c]
            squares, axes = np.linalg.eigh(centred.T @ centred)
            squares = np.maximum(squares[::-1], 0)
            vectors[k, c] = axes[:, ::-1].T, squares
            left += float(squares.sum())
            queue.append((-squares[0] / sizes[k], k, c, 0))
    heapq.heapify(queue)
    kept = dict.fromkeys(means, 0)
    bound = 0.0 if error is None else error**2 * sum(space.total for space in spaces)
    while queue and left > bound:
        gain, k, c, n = heapq.heappop(queue)
        if gain == 0 or sizes[k] > budget:
            continue
        budget -= sizes[k]
        kept[k, c], squares = n + 1, vectors[k, c][1]
        left -= squares[n]
        if n + 1 < min(len(squares), sizes[k]):
            heapq.heappush(queue, (-squares[n + 1] / sizes[k], k, c, n + 1))
    return [[(means[k, c], vectors[k, c][0][: kept[k, c]]) for c in range(len(spaces))] for k in range(count)]


def _left_over(spaces: list[_Space], bases: _Bases) -> Float64[np.ndarray, "receivers"]:
    """Squares of what a cluster's mean and components leave of every receiver."""
    left = np.zeros(len(spaces[0].rows))
    for space, (mean, components) in zip(spaces, bases, strict=True):
        centred = space.rows - mean
        left += np.einsum("ij,ij->i", centred, centred)
        along = centred @ components.T
        left -= np.einsum("ij,ij->i", along, along)
    return left


def _cluster(spaces: list[_Space], rows: np.ndarray, bases: _Bases) -> Cluster:
    means, basis, coordinates = [], [], []
    for space, (mean, components) in zip(spaces, bases, strict=True):
        means.append((mean @ space.axes).astype(np.float32))
        basis.append((components @ space.axes).astype(np.float32))
        coordinates.append(np.ascontiguousarray(components @ (space.rows[rows] - mean).T, np.float32))
    return Cluster(rows.astype(np.int32), means, basis, coordinates)


def _by_means(rows: Float64[np.ndarray, "receivers n"], count: int) -> np.ndarray:
    """Lloyd's k-means from receivers far apart (k-means++, a fixed seed); no cluster is empty."""
    if count == 1:
        return np.zeros(len(rows), np.int64)
    chance = np.random.default_rng(_SEED)
    centres = rows[chance.integers(len(rows))][None]
    nearest = ((rows - centres[0]) ** 2).sum(axis=1)
    for _ in range(count - 1):
        total = nearest.sum()
        if not total > 0:
            break
        pick = np.searchsorted(np.cumsum(nearest), chance.random() * total)
        centres = np.concatenate([centres, rows[min(pick, len(rows) - 1)][None]])
        nearest = np.minimum(nearest, ((rows - centres[-1]) ** 2).sum(axis=1))
    of = np.zeros(len(rows), np.int64)
    for _ in range(_LLOYD):
        square = (centres**2).sum(axis=1) - 2 * rows @ centres.T
        of = np.unique(square.argmin(axis=1), return_inverse=True)[1]
        sums = np.zeros((of.max() + 1, rows.shape[1]))
        np.add.at(sums, of, rows)
        centres = sums / np.bincount(of)[:, None]
    return of

"""Clustered principal components (Sloan, Hall, Hart and Snyder 2003): receivers in clusters with bases of their own.

A receiver's row is its cluster's mean and a few of its cluster's components: x ≈ m + Σ b_i z_i. Which receivers are in
which cluster, and how many components each has, follow from what is left over. All colours of a receiver are in one
cluster and share its mean and components, each with coordinates of its own: they answer to light much alike, and
where three colours share a basis, clusters can be three times as small for the same bytes.

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
# Shares of the squares of all rows: dimensions below, all together, are left out from the beginning, and while
# clusters are being found.
_NEGLIGIBLE, _ROUGHLY = 1e-8, 1e-5
_SEED = 8
_LLOYD = 8  # rounds of k-means to begin with

Rows = Float32[np.ndarray, "channels receivers columns"]


@dataclass(frozen=True)
class Cluster:
    """Some receivers and what approximates their rows.

    Attributes
    ----------
    rows
        Receivers, ascending.
    mean
        ``(columns,)``.
    basis
        ``(components, columns)``, orthonormal, the most important first.
    coordinates
        ``(channels, components, rows)``.
    gains
        ``(components,)``: what every component takes from the squares left over, importance counted.
    left
        Squares that all of them leave.
    """

    rows: Int32[np.ndarray, "rows"]
    mean: Float32[np.ndarray, "columns"]
    basis: Float32[np.ndarray, "components columns"]
    coordinates: Float32[np.ndarray, "channels components rows"]
    gains: Float64[np.ndarray, "components"]
    left: float

    def approximation(self, channel: int) -> Float32[np.ndarray, "rows columns"]:
        """What is kept of the rows."""
        return self.mean + self.coordinates[channel].T @ self.basis

    def first(self, components: int) -> Cluster:
        """With so many of its components and no more."""
        n = components
        left = self.left + float(self.gains[n:].sum())
        return Cluster(
            self.rows, self.mean, self.basis[:n], self.coordinates[:, :n].copy(), self.gains[:n], left
        )


def clustered_components(
    X: Rows,
    *,
    clusters: int,
    mean_components: float,
    error: float | None = None,
    importance: Float32[np.ndarray, "receivers"] | None = None,
    rounds: int = ROUNDS,
) -> list[Cluster]:
    """Rows X (channels, receivers, columns) in at most so many clusters.

    Parameters
    ----------
    clusters
        Fewer where a cluster becomes empty.
    mean_components
        Coefficients of a receiver and channel, in the mean.
    error
        Stop adding components when the RMS of what is left over, as a share of the rows', is below this; there are
        still no more than ``mean_components``.
    importance
        Of squares left over at each receiver, above 0: the surface around it, say. All alike if not given.
    rounds
        Of clustering by what is left over, at most: fewer where no receiver changes its cluster.
    """
    receivers = X.shape[1]
    weights = np.ones(receivers) if importance is None else importance.astype(np.float64)
    space = _Space.of(X, weights)
    rough = space.rough()
    count = max(1, min(clusters, receivers))
    of = _by_means(np.concatenate(list(rough.rows), axis=1), count)
    budget = mean_components * receivers
    # The number of components grows with the rounds, as clusters find their receivers.
    growing = max(1, min(rounds // 2, int(np.ceil(mean_components)))) if count > 1 else 1
    for turn in range(rounds if count > 1 else 0):
        share = min(1.0, (turn + 1) / growing)
        bases = _fitted(rough, of, budget=budget * share, error=error)
        new = np.stack([_left_over(rough, base) for base in bases], axis=1).argmin(axis=1)
        if turn + 1 >= growing and (new == of).all():
            break
        of = np.unique(new, return_inverse=True)[1]
    bases = _fitted(space, of, budget=budget, error=error)
    return [_cluster(space, np.flatnonzero(of == k), base) for k, base in enumerate(bases)]


def allocated(
    clusters: list[Cluster], *, mean_components: float, error: float | None = None, total: float = 0.0
) -> list[Cluster]:
    """The components among those of many clusters that gain most for each coefficient they take.

    As ``clustered_components`` does within its clusters, for all zones of a scene together: a zone that is evenly lit
    leaves its coefficients to others. ``total`` are the squares that ``error`` is a share of.
    """
    budget = mean_components * sum(len(cluster.rows) for cluster in clusters)
    left = sum(cluster.left + float(cluster.gains.sum()) for cluster in clusters)
    bound = 0.0 if error is None else error**2 * total
    queue = sorted(
        (-float(gain) / len(cluster.rows), n, k)
        for k, cluster in enumerate(clusters)
        for n, gain in enumerate(cluster.gains)
    )
    kept = [0] * len(clusters)
    for gain, n, k in queue:
        size = len(clusters[k].rows)
        if left <= bound or gain == 0:
            break
        if size > budget or n != kept[k]:
            continue
        kept[k], budget, left = n + 1, budget - size, left + gain * size
    return [cluster.first(n) for cluster, n in zip(clusters, kept, strict=True)]


@dataclass(frozen=True)
class _Space:
    """Rows in the few dimensions that hold all but a negligible part of them.

    ``axes`` (dimensions, columns), the most important first; ``rows`` (channels, receivers, dimensions); ``total``
    squares, importance counted; ``few`` dimensions roughly hold them.
    """

    axes: np.ndarray
    rows: np.ndarray
    weights: np.ndarray
    total: float
    few: int

    @classmethod
    def of(cls, X: Rows, weights: np.ndarray) -> _Space:
        channels, receivers, columns = X.shape
        x = X.reshape(-1, columns).astype(np.float64)
        is_tall = columns <= len(x)
        squares, vectors = np.linalg.eigh(x.T @ x if is_tall else x @ x.T)
        squares, vectors = np.maximum(squares[::-1], 0), vectors[:, ::-1]
        rest = squares[::-1].cumsum()[::-1]
        keep, few = (
            max(1, int(np.count_nonzero(rest > share * max(rest[0], 1e-300))))
            for share in (_NEGLIGIBLE, _ROUGHLY)
        )
        if is_tall:
            axes = np.ascontiguousarray(vectors[:, :keep].T)
        else:
            axes = vectors[:, :keep].T @ x / np.sqrt(np.maximum(squares[:keep], 1e-300))[:, None]
        rows = (x @ axes.T).reshape(channels, receivers, keep)
        total = float(np.einsum("v,cvd,cvd->", weights, rows, rows, optimize=True))
        return cls(axes, rows, weights, total, few)

    def rough(self) -> _Space:
        """The same in its leading dimensions."""
        few = self.few
        return _Space(self.axes[:few], self.rows[:, :, :few].copy(), self.weights, self.total, few)


_Base = tuple[
    np.ndarray, np.ndarray, np.ndarray, float
]  # mean, components, what each takes off, what they leave


def _fitted(space: _Space, of: np.ndarray, *, budget: float, error: float | None) -> list[_Base]:
    """Mean and components of every cluster: the next component goes where it gains most a receiver."""
    count, channels = int(of.max()) + 1, len(space.rows)
    sizes = np.bincount(of, minlength=count)
    means, vectors, queue, left = [], [], [], 0.0
    for k in range(count):
        mine = of == k
        own = space.rows[:, mine].reshape(-1, space.rows.shape[2])
        weights = np.tile(space.weights[mine], channels)
        means.append(weights @ own / weights.sum())
        centred = own - means[k]
        squares, axes = np.linalg.eigh(centred.T @ (centred * weights[:, None]))
        squares = np.maximum(squares[::-1], 0)
        vectors.append((axes[:, ::-1].T, squares))
        left += float(squares.sum())
        queue.append((-squares[0] / sizes[k], k, 0))
    heapq.heapify(queue)
    kept = [0] * count
    bound = 0.0 if error is None else error**2 * space.total
    while queue and left > bound:
        gain, k, n = heapq.heappop(queue)
        if gain == 0 or sizes[k] > budget:
            continue
        budget -= sizes[k]
        kept[k], squares = n + 1, vectors[k][1]
        left -= squares[n]
        if n + 1 < min(len(squares), channels * sizes[k]):
            heapq.heappush(queue, (-squares[n + 1] / sizes[k], k, n + 1))
    return [
        (mean, axes[:n], squares[:n], float(squares[n:].sum()))
        for mean, (axes, squares), n in zip(means, vectors, kept, strict=True)
    ]


def _left_over(space: _Space, base: _Base) -> Float64[np.ndarray, "receivers"]:
    """Squares of what a cluster's mean and components leave of every receiver, all channels together."""
    centred = space.rows - base[0]
    along = centred @ base[1].T
    squares = np.einsum("cvd,cvd->v", centred, centred)
    return squares - np.einsum("cvn,cvn->v", along, along)


def _cluster(space: _Space, rows: np.ndarray, base: _Base) -> Cluster:
    mean, components, gains, left = base
    along = (space.rows[:, rows] - mean) @ components.T
    return Cluster(
        rows.astype(np.int32), (mean @ space.axes).astype(np.float32), (components @ space.axes).astype(np.float32),
        np.ascontiguousarray(along.transpose(0, 2, 1), np.float32), gains, left,
    )  # fmt: skip


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

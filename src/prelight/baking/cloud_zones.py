"""One zone of a cloud: its lights clustered, its vertices' rows compressed. One is in memory at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Int32, Positions
from ..encoding.clustered_pca import Cluster, clustered_components
from ..encoding.light_clustering import Groups, Pairs, merged, pair_distances
from .cloud_columns import CloudColumns
from .cloud_plan import VERTICES_A_CLUSTER
from .cloud_settings import CloudSettings
from .cloud_trials import Trials


def zones_of(positions: Positions, most: int) -> list[Int32[np.ndarray, "some"]]:
    """Vertices in boxes of at most so many, split across their longest side; each ascending."""
    done, todo = [], [np.arange(len(positions), dtype=np.int32)]
    while todo:
        part = todo.pop()
        if len(part) <= most:
            done.append(part)
            continue
        across = positions[part, int(np.ptp(positions[part], axis=0).argmax())]
        order = np.argsort(across, kind="stable")
        half = len(part) // 2
        todo += [np.sort(part[order[half:]]), np.sort(part[order[:half]])]
    return done


@dataclass(frozen=True)
class Lost:
    """Squares of lamps' light, summed over vertices and colours, and of what each step leaves wrong of it.

    Five rows: the light itself, what interpolation, clustering of lights and components lose, and all of them.
    """

    squares: Float64[np.ndarray, "5 lamps"]

    def shares(self) -> dict[str, float]:
        """RMS of each step's error as a share of the light's, the median over lamps; and of all steps the worst."""
        lit = self.squares[0] > 1e-9 * self.squares[0].max(initial=0.0)
        ratios = np.sqrt(self.squares[1:, lit] / self.squares[0, lit])
        if not ratios.size:
            ratios = np.zeros((4, 1))
        names = ("interpolation_error", "merged_error", "components_error", "error")
        found = {name: float(np.median(row)) for name, row in zip(names, ratios, strict=True)}
        return found | {"worst_error": float(ratios[3].max())}


@dataclass(frozen=True)
class Zone:
    """A zone as it is kept.

    ``clusters`` name rows among ``vertices``; their bases have a number for each group of lights, then for each patch.
    """

    vertices: Int32[np.ndarray, "vertices"]
    groups: Groups
    clusters: list[Cluster]
    lost: Lost | None  # not measured without patches


def make_zone(
    columns: CloudColumns,
    vertices: Int32[np.ndarray, "some"],
    pairs: Pairs,
    *,
    w2: float,
    lamps: tuple[tuple[float, float], Trials] | None,
) -> Zone:
    """Cluster the lights by equation 9, then the vertices by what of their rows components leave over.

    ``lamps``: how much a light and a patch usually have to say, and lamps (the columns ``held``) that errors are
    measured on. Without them every light counts alike, as in the paper.
    """
    settings = columns.plan.settings
    answers = columns.rows("lights", vertices)
    groups = merged(pair_distances(pairs, answers, w2=w2))
    means = _merged_answers(answers, groups, settings.merge)
    if columns.patches:
        means = np.concatenate([means, columns.rows("patches", vertices)])
    X = np.ascontiguousarray(means.transpose(2, 1, 0))
    if lamps is None:
        return Zone(vertices, groups, _clusters(X, settings), None)
    weights = np.repeat(np.array(lamps[0], np.float32), [groups.count, columns.patches])
    clusters = [_unweighted(c, weights) for c in _clusters(X * weights, settings)]
    lost = _lost(columns, vertices, groups, lamps[1], answers=answers, X=X, clusters=clusters)
    return Zone(vertices, groups, clusters, lost)


def _lost(
    columns: CloudColumns,
    vertices: np.ndarray,
    groups: Groups,
    lamps: Trials,
    *,
    answers: np.ndarray,
    X: np.ndarray,
    clusters: list[Cluster],
) -> Lost:
    """What lamps that were solved in full lose, step by step."""
    true = columns.rows("held", vertices).transpose(2, 1, 0).astype(np.float64)
    own = answers.transpose(2, 1, 0)
    lights = len(groups.group_of)
    dense = own @ lamps.weights[:lights] + X[:, :, groups.count :] @ lamps.weights[lights:]
    of_groups = lamps.of_groups(groups.group_of, groups.count)
    grouped = X @ of_groups
    kept = np.empty_like(grouped)
    for cluster in clusters:
        for c in range(len(X)):
            kept[c, cluster.rows] = cluster.approximation(c) @ of_groups
    a = columns.areas[vertices][None, :, None].astype(np.float64)

    steps = (true, dense - true, grouped - dense, kept - grouped, kept - true)
    return Lost(np.stack([(a * np.square(step)).sum(axis=(0, 1)) for step in steps]))


def _clusters(X: Float32[np.ndarray, "colours vertices columns"], settings: CloudSettings) -> list[Cluster]:
    count = settings.clusters or max(1, round(X.shape[1] / VERTICES_A_CLUSTER))
    return clustered_components(
        X, clusters=count, mean_components=settings.coefficients, error=settings.error
    )


def _merged_answers(answers: np.ndarray, groups: Groups, merge: str) -> np.ndarray:
    """What vertices answer to each group: the mean over its lights; where all are above 0, if wanted, the harmonic."""
    means = groups.means(answers)
    if merge == "mean":
        return means
    with np.errstate(divide="ignore"):
        harmonic = 1 / groups.means(1 / np.maximum(answers, 0))
    lowest = np.full_like(means, np.inf)
    np.minimum.at(lowest, groups.group_of, answers)
    return np.where(lowest > 0, harmonic, means).astype(np.float32)


def _unweighted(cluster: Cluster, weights: Float32[np.ndarray, "columns"]) -> Cluster:
    return Cluster(
        cluster.rows, [m / weights for m in cluster.means], [b / weights for b in cluster.basis], cluster.coordinates
    )  # fmt: skip

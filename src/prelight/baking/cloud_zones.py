"""One zone of a cloud: its lights clustered, its vertices' rows compressed. One is in memory at a time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Float32, Float64, Int32
from ..encoding.clustered_pca import Cluster, allocated, clustered_components
from ..encoding.light_clustering import Groups, Pairs, kept_apart, merged, pair_distances
from .cloud_columns import CloudColumns
from .cloud_plan import VERTICES_A_CLUSTER
from .cloud_settings import CloudSettings
from .cloud_trials import Metric, Trials, bright_for


@dataclass(frozen=True)
class Lost:
    """Squares of lamps' light, summed over vertices and colours, and of what each step leaves wrong of it.

    Five rows: the light itself, what interpolation, clustering of lights and components lose, and all of them.
    """

    squares: Float64[np.ndarray, "5 lamps"]

    def shares(self) -> dict[str, float]:
        """RMS of each step's error as a share of the light's: the median over lamps, and the worst of them."""
        lit = self.squares[0] > 1e-9 * self.squares[0].max(initial=0.0)
        ratios = np.sqrt(self.squares[1:, lit] / self.squares[0, lit])
        if not ratios.size:
            ratios = np.zeros((4, 1))
        names = ("interpolation_error", "merged_error", "components_error", "error")
        found = {name: float(np.median(row)) for name, row in zip(names, ratios, strict=True)}
        return found | {f"worst_{name}": float(row.max()) for name, row in zip(names, ratios, strict=True)}


@dataclass(frozen=True)
class Zone:
    """A zone as it is kept.

    ``clusters`` name rows among ``vertices``; their bases have a number for each group of lights, then for each
    of the zone's ``modes``. ``total``: squares of the zone's rows, as clusters count what they leave over.
    """

    vertices: Int32[np.ndarray, "vertices"]
    groups: Groups
    modes: slice
    clusters: list[Cluster]
    total: float


@dataclass(frozen=True)
class Lamps:
    """What is known of lamps in a scene with modes.

    Attributes
    ----------
    usual
        Lamps that tell how much lights and modes have to say.
    lights
        ``(lights,)`` how bright each light of the grid is.
    brought, squares
        ``(lights, modes)`` what they bring of each mode; ``(modes,)`` how much light a mode is.
    held
        Lamps (the columns ``held``) that errors are measured on.
    """

    usual: Trials
    lights: Float64[np.ndarray, "lights"]
    brought: Float32[np.ndarray, "lights modes"]
    squares: Float64[np.ndarray, "modes"]
    held: Trials


def make_zone(
    columns: CloudColumns,
    vertices: Int32[np.ndarray, "some"],
    pairs: Pairs,
    *,
    w2: float,
    lamps: Lamps | None,
) -> Zone:
    """Cluster the lights by equation 9, then the vertices by what of their rows components leave over.

    Lights whose own light would change by more than a share of it stay apart, whatever equation 9 says.
    There are more components than wanted: ``thinned`` chooses among those of all zones. Without ``lamps`` every light
    counts alike, as in the paper.
    """
    settings = columns.plan.settings
    answers = columns.rows("lights", vertices)
    areas, modes = columns.areas[vertices], columns.modes_of(vertices)
    distances = pair_distances(pairs, answers, w2=w2)
    if lamps is not None:
        allowed = MERGED_ERROR * lamps.lights / np.sqrt(len(columns.zones))
        distances = kept_apart(distances, answers * np.sqrt(areas)[:, None], allowed)
    groups = merged(distances)
    X = _columns_of(columns, vertices, answers, groups)
    metric = None
    if lamps is not None:
        weights = lamps.usual.of_groups(groups, lamps.brought, modes)
        lights = bright_for(lamps.lights, lamps.brought, lamps.squares, modes)
        metric = Metric.of(weights / lamps.usual.bright_in(lamps.squares, modes), lights, groups)
        X = metric.weighed(X)
    own = settings.clusters or max(1, round(len(vertices) / VERTICES_A_CLUSTER))
    clusters = clustered_components(
        X, clusters=own, mean_components=_SPARE * settings.coefficients, error=settings.error, importance=areas,
    )  # fmt: skip
    total = float(np.einsum("v,cvn,cvn->", areas, X, X, dtype=np.float64, optimize=True))
    if metric is not None:
        clusters = [
            replace(cluster, mean=metric.unweighed(cluster.mean), basis=metric.unweighed(cluster.basis))
            for cluster in clusters
        ]
    return Zone(vertices, groups, modes, clusters, total)


MERGED_ERROR = 0.04  # of a light, that two lights of a group may differ by in all zones together, RMS
_SPARE = 1.5  # times the coefficients wanted: what a zone may have more than others


def thinned(zones: list[Zone], settings: CloudSettings) -> list[Zone]:
    """With the coefficients wanted, where they gain most in the whole scene."""
    every = [cluster for zone in zones for cluster in zone.clusters]
    total = sum(zone.total for zone in zones)
    kept = iter(allocated(every, mean_components=settings.coefficients, error=settings.error, total=total))
    return [replace(zone, clusters=[next(kept) for _ in zone.clusters]) for zone in zones]


def lost(columns: CloudColumns, zone: Zone, lamps: Lamps) -> Lost:
    """What lamps that were solved in full lose in a zone, step by step."""
    vertices, groups = zone.vertices, zone.groups
    true = columns.rows("held", vertices).transpose(2, 1, 0).astype(np.float64)
    answers = columns.rows("lights", vertices)
    X = _columns_of(columns, vertices, answers, groups)
    rows = np.concatenate([answers.transpose(2, 1, 0), X[:, :, groups.count :]], axis=2)
    dense = rows @ lamps.held.of_lights(lamps.brought, zone.modes)
    of_groups = lamps.held.of_groups(groups, lamps.brought, zone.modes)
    grouped = X @ of_groups
    kept = np.empty_like(grouped)
    for cluster in zone.clusters:
        for c in range(len(X)):
            kept[c, cluster.rows] = cluster.approximation(c) @ of_groups
    a = columns.areas[vertices][None, :, None].astype(np.float64)
    steps = (true, dense - true, grouped - dense, kept - grouped, kept - true)
    return Lost(np.stack([(a * np.square(step)).sum(axis=(0, 1)) for step in steps]))


def _columns_of(
    columns: CloudColumns, vertices: np.ndarray, answers: np.ndarray, groups: Groups
) -> Float32[np.ndarray, "colours vertices columns"]:
    means = _merged_answers(answers, groups, columns.plan.settings.merge)
    if columns.modes:
        means = np.concatenate([means, columns.rows("modes", vertices)[columns.modes_of(vertices)]])
    return np.ascontiguousarray(means.transpose(2, 1, 0))


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

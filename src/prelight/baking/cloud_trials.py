"""Lamps here and there in a cloud, tried while it is baked.

They tell how much lights and modes have to say, so that components err where it matters least; on some of them,
solved in full, errors are measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Positions
from ..encoding.light_clustering import Groups
from ..encoding.light_fit import FITTED, bounded, fitted, kernel, nearest, prior
from ..rays.segments import SOLID
from ..transport.lamps import SphereLamps, lamp_light
from .cloud_modes import Sources
from .cloud_plan import CloudGround, CloudPlan

TRIALS = 384
_DIM = 0.05  # of a usual lamp's light: lamps that bring less count less
_DARK = 1e-3  # share of a lamp's light in a zone, at least, that errors are counted by
_LEAST = 1e-3  # of what is asked of the columns, of each by itself
_SEED = 40
_AT_ONCE = 32  # lamps whose direct light is made together


def trial_places(plan: CloudPlan, *, seed: int, count: int) -> Float64[np.ndarray, "count 3"]:
    """Places in the cloud's box that are inside no solid; fewer where there is hardly any room."""
    chance, grid = np.random.default_rng([_SEED, seed]), plan.grid
    found = np.zeros((0, 3))
    for _ in range(32 if count else 0):
        places = grid.low + (grid.high - grid.low) * chance.random((2 * count, 3))
        free = plan.ground.segments.shares_of_backs(places) < SOLID
        found = np.concatenate([found, places[free]])
        if len(found) >= count:
            break
    return found[:count]


def direct_of(
    ground: CloudGround,
    places: Positions | Float64[np.ndarray, "lamps 3"],
    *,
    radius: float = 0.0,
    rays: int = 1,
) -> Float32[np.ndarray, "vertices lamps"]:
    """Direct irradiance / π at the vertices of lamps of 1 W/sr, as it is sent on: ``light_fit.bounded``."""
    count = len(places)
    lamps = SphereLamps(
        np.asarray(places, np.float32), np.full(count, radius, np.float32), np.full((count, 3), 4 * np.pi, np.float32)
    )  # fmt: skip
    found = lamp_light(ground.occluders, ground.origins, ground.scene.normals, lamps=lamps, rays=rays)
    return np.ascontiguousarray(bounded(found[:, :, 0], ground.areas))


@dataclass(frozen=True)
class Trials:
    """Lamps as relighting finds them.

    Attributes
    ----------
    weights
        ``(lights, trials)`` of the grid's lights.
    targets
        ``(modes, trials)`` how much of each mode they bring.
    bright
        ``(trials,)``.
    """

    weights: Float64[np.ndarray, "lights trials"]
    targets: Float64[np.ndarray, "modes trials"]
    bright: Float64[np.ndarray, "trials"]

    def of_lights(
        self, brought: Float32[np.ndarray, "lights modes"], modes: slice
    ) -> Float64[np.ndarray, "columns trials"]:
        """Weights of all lights, then of some modes: what the lights do not bring."""
        return np.concatenate([self.weights, self.targets[modes] - brought[:, modes].T @ self.weights])

    def of_groups(
        self, groups: Groups, brought: Float32[np.ndarray, "lights modes"], modes: slice
    ) -> Float64[np.ndarray, "columns trials"]:
        """Weights of groups of lights, then of some modes: what the groups do not bring."""
        out = np.zeros((groups.count, self.weights.shape[1]))
        np.add.at(out, groups.group_of, self.weights)
        left = self.targets[modes] - groups.means(brought[:, modes].astype(np.float64)).T @ out
        return np.concatenate([out, left])

    def bright_in(self, squares: Float64[np.ndarray, "modes"], modes: slice) -> Float64[np.ndarray, "trials"]:
        """How bright lamps are for a zone: ``bright_for`` of them."""
        return bright_for(self.bright, self.targets.T, squares, modes)


def bright_for(
    bright: Float64[np.ndarray, "lamps"],
    brought: np.ndarray,
    squares: Float64[np.ndarray, "modes"],
    modes: slice,
) -> Float64[np.ndarray, "lamps"]:
    """What lamps' errors in a zone are counted by: the mean, geometric, of all their light and of that in its regions.

    By all of it alone, what is dark would have no components, and be lit by what is left over of lamps elsewhere.
    """
    all_light = np.maximum(bright, _DIM * _usual(bright))
    there = np.sqrt(np.square(brought[:, modes].astype(np.float64)) @ squares[modes])
    return np.sqrt(all_light * np.maximum(there, _DARK * all_light))


def tried(
    plan: CloudPlan,
    places: Float64[np.ndarray, "lamps 3"],
    *,
    brought: Float32[np.ndarray, "lights modes"],
    sources: Sources,
    squares: Float64[np.ndarray, "modes"],
) -> Trials:
    """What lights and modes stand for lamps at these places: ``brought`` of the modes by lights, the modes' squares."""
    at, weights, targets = plan.grid.positions, [], []
    for first in range(0, len(places), _AT_ONCE):
        own = places[first : first + _AT_ONCE]
        found = sources.brought(direct_of(plan.ground, own))
        targets.append(found)
        for place, target in zip(own, found, strict=True):  # some hundreds, whatever the cloud
            near, far = nearest(at, place, FITTED + 1)
            shape = kernel(far, 1.001 * far[-1] + 1e-9)
            free = plan.ground.segments.are_free(np.broadcast_to(place, (len(near), 3)), at[near])
            near, far, shape = near[free], far[free], shape[free]
            w = fitted(target, brought[near], prior(far, shape), np.sqrt(shape))
            weights.append(np.bincount(near, w, len(at)).astype(np.float64))
    every = np.concatenate(targets)
    return Trials(np.stack(weights, axis=1), every.T.copy(), np.sqrt(np.square(every) @ squares))


@dataclass(frozen=True)
class Metric:
    """How much lamps ask of lights and modes together, so that components err where it matters least.

    The mean over lamps of w wᵀ, w the lamp's weights over how bright it is: what is left over of rows times its root
    is, on the mean, a lamp's relative error. The lights themselves are lamps too.
    """

    sizes: Float64[np.ndarray, "columns"]
    root: Float64[np.ndarray, "columns columns"]
    inverse: Float64[np.ndarray, "columns columns"]

    @classmethod
    def of(
        cls,
        weights: Float64[np.ndarray, "columns trials"],
        lights: Float64[np.ndarray, "lights"],
        groups: Groups,
    ) -> Metric:
        """``weights`` over how bright each lamp is, and how bright each light of the grid is."""
        S = weights @ weights.T / weights.shape[1]
        every = np.arange(groups.count)
        S[every, every] += np.bincount(groups.group_of, lights**-2.0 / len(lights), groups.count)
        sizes = np.sqrt(np.diag(S))
        for kind in (slice(0, groups.count), slice(groups.count, None)):
            sizes[kind] = np.maximum(sizes[kind], _LEAST * sizes[kind].max(initial=1e-30))
        S = S / sizes[:, None] / sizes
        S[np.diag_indices_from(S)] += _LEAST
        values, vectors = np.linalg.eigh(S)
        values = np.maximum(values, _LEAST)
        return cls(sizes, (vectors * np.sqrt(values)) @ vectors.T, (vectors / np.sqrt(values)) @ vectors.T)

    def weighed(self, rows: np.ndarray) -> np.ndarray:
        """Rows (…, columns) as lamps see them."""
        return ((rows * self.sizes) @ self.root).astype(np.float32)

    def unweighed(self, rows: np.ndarray) -> np.ndarray:
        """The inverse."""
        return ((rows @ self.inverse) / self.sizes).astype(np.float32)


def _usual(bright: Float64[np.ndarray, "lamps"]) -> float:
    """The median of lamps that bring any light."""
    lit = bright[bright > 0]
    return float(np.median(lit)) if len(lit) else 1.0

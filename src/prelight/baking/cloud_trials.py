"""Lamps here and there in a cloud, tried while it is baked.

They tell how much lights and modes have to say, so that components err where it matters least; on some of them,
solved in full, errors are measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Int32, Positions
from ..encoding.light_fit import FITTED, bounded, fitted, kernel, nearest, prior
from ..rays.segments import SOLID
from ..transport.lamps import SphereLamps, lamp_light
from .cloud_modes import Sources
from .cloud_plan import CloudGround, CloudPlan

TRIALS = 384
_DIM = 0.05  # of a usual lamp's light: lamps that bring less count less
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
    """Weights (lights + modes, lamps) of lamps as relighting finds them, and how bright each lamp is (lamps,)."""

    weights: Float64[np.ndarray, "columns trials"]
    bright: Float64[np.ndarray, "trials"]

    def of_groups(
        self, group_of: Int32[np.ndarray, "lights"], groups: int
    ) -> Float64[np.ndarray, "columns trials"]:
        """Weights of groups of lights, then of modes."""
        lights = len(group_of)
        out = np.zeros((groups + len(self.weights) - lights, self.weights.shape[1]))
        np.add.at(out, group_of, self.weights[:lights])
        out[groups:] = self.weights[lights:]
        return out


def tried(
    plan: CloudPlan,
    places: Float64[np.ndarray, "lamps 3"],
    *,
    brought: Float32[np.ndarray, "lights modes"],
    sources: Sources,
    squares: Float64[np.ndarray, "modes"],
) -> Trials:
    """What lights and modes stand for lamps at these places: ``brought`` of the modes by lights, the modes' squares."""
    at, columns, targets = plan.grid.positions, [], []
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
            column = np.zeros(len(at) + len(target))
            column[near] = w
            column[len(at) :] = target - w @ brought[near].astype(np.float64)
            columns.append(column)
    bright = np.sqrt(np.square(np.concatenate(targets)) @ squares)
    return Trials(np.stack(columns, axis=1), bright)


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
        cls, trials: Trials, lights: Float64[np.ndarray, "lights"], *, group_of: np.ndarray, groups: int
    ) -> Metric:
        """``lights``: how bright each of the grid is."""
        weights = trials.of_groups(group_of, groups)
        weights = weights / np.maximum(trials.bright, _DIM * _usual(trials.bright))
        S = weights @ weights.T / weights.shape[1]
        alone = np.maximum(lights, _DIM * _usual(lights)) ** -2.0 / len(lights)
        S[np.arange(groups), np.arange(groups)] += np.bincount(group_of, alone, groups)
        sizes = np.sqrt(np.diag(S))
        for kind in (slice(0, groups), slice(groups, None)):
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

"""Lamps here and there in a cloud, tried while it is baked.

They tell how much lights and patches have to say, so that components err where it matters least; on some of them,
solved in full, errors are measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Int32, Positions
from ..encoding.light_fit import FITTED, bounded, fitted, kernel, nearest, patch_flux, prior
from ..rays.segments import SOLID
from ..transport.lamps import SphereLamps, lamp_light
from .cloud_plan import CloudGround, CloudPlan

TRIALS, HELD_OUT = 96, 32
_SEED = 40
_AT_ONCE = 32  # lamps whose direct light is made together


def trial_places(plan: CloudPlan, *, seed: int, count: int) -> Float64[np.ndarray, "count 3"]:
    """Places in the cloud's box that are inside no solid; fewer where there is hardly any room."""
    chance, grid = np.random.default_rng([_SEED, seed]), plan.grid
    found = np.zeros((0, 3))
    for _ in range(32):
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
    """Weights (lights + patches, lamps) of lamps as relighting finds them."""

    weights: Float64[np.ndarray, "columns trials"]

    def of_groups(
        self, group_of: Int32[np.ndarray, "lights"], groups: int
    ) -> Float64[np.ndarray, "columns trials"]:
        """Weights of groups of lights, then of patches."""
        lights = len(group_of)
        out = np.zeros((groups + len(self.weights) - lights, self.weights.shape[1]))
        np.add.at(out, group_of, self.weights[:lights])
        out[groups:] = self.weights[lights:]
        return out


def tried(
    plan: CloudPlan,
    places: Float64[np.ndarray, "lamps 3"],
    *,
    fluxes: Float32[np.ndarray, "lights patches"],
    patch_of: Int32[np.ndarray, "vertices"],
    areas: Float32[np.ndarray, "vertices"],
) -> Trials:
    """What lights and patches stand for lamps at these places."""
    at, columns = plan.grid.positions, []
    for first in range(0, len(places), _AT_ONCE):
        own = places[first : first + _AT_ONCE]
        D = direct_of(plan.ground, own)
        for k, place in enumerate(own):  # some hundreds, whatever the cloud
            target = patch_flux(D[:, k], areas, patch_of, fluxes.shape[1])
            near, far = nearest(at, place, FITTED + 1)
            shape = kernel(far, 1.001 * far[-1] + 1e-9)
            free = plan.ground.segments.are_free(np.broadcast_to(place, (len(near), 3)), at[near])
            near, far, shape = near[free], far[free], shape[free]
            w = fitted(target, fluxes[near], prior(far, shape), np.sqrt(shape))
            column = np.zeros(len(at) + fluxes.shape[1])
            column[near] = w
            column[len(at) :] = target - w @ fluxes[near].astype(np.float64)
            columns.append(column)
    return Trials(np.stack(columns, axis=1))


def usual_weights(trials: Trials, lights: int) -> tuple[float, float]:
    """How much a light that is a neighbour of a lamp, and any patch, usually have to say: RMS over lamps."""
    of_lights, of_patches = trials.weights[:lights], trials.weights[lights:]
    chosen = of_lights[of_lights != 0]
    light = float(np.sqrt(np.square(chosen).mean())) if len(chosen) else 1.0
    return light, max(float(np.sqrt(np.square(of_patches).mean())), 1e-4 * light)

"""The dense cloud: a grid of lights in a box, without those inside solids; a finer one along walls if wanted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float64
from ..errors import InputError
from ..rays.offset import ray_offset
from ..rays.segments import SOLID, PlainSegments
from ..scene.geometry import Scene
from .cloud_settings import MOST_LIGHTS


@dataclass(frozen=True)
class LightGrid:
    """Lights of a cloud.

    Attributes
    ----------
    positions
        ``(lights, 3)`` metres.
    low, high
        The box that they fill.
    step
        ``(3,)`` metres from one to the next; half as much in the shell along walls.
    in_solids
        How many were left out.
    """

    positions: Float64[np.ndarray, "lights 3"]
    low: Float64[np.ndarray, "3"]
    high: Float64[np.ndarray, "3"]
    step: Float64[np.ndarray, "3"]
    in_solids: int

    def __len__(self) -> int:
        return len(self.positions)


def light_grid(
    scene: Scene,
    segments: PlainSegments,
    *,
    lights: int,
    box: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None,
    shell: float = 0.0,
) -> LightGrid:
    """About ``lights`` cubes' middles that fill the box around the scene, or ``box``; free ones stay.

    Within ``shell`` metres of a surface there are cubes half as wide instead. A light is inside a solid if nine of ten
    rays from it that meet something meet its back. Raises InputError if none is free, if the box lies wholly outside
    of the scene's, or if there are more than 8,192.
    """
    used = scene.positions[np.unique(scene.triangles)].astype(np.float64)
    low, high = used.min(axis=0), used.max(axis=0)
    if box is not None:
        own_low, own_high = np.array(box[0], np.float64), np.array(box[1], np.float64)
        if (own_high < low).any() or (own_low > high).any():
            said = " to ".join(", ".join(f"{x:.3g}" for x in corner) for corner in (low, high))
            raise InputError("box", f"wholly outside of the scene, which reaches from {said}")
        low, high = own_low, own_high
    size = np.maximum(high - low, 1e-3 * float((high - low).max()))
    counts = _counts(size, lights)
    step = size / counts
    positions = _middles(low, step, counts)
    if shell > 0:
        if 8 * len(positions) > _MOST_TRIED:
            raise InputError("lights", f"{lights}, expected at most {_MOST_TRIED // 8} with a shell")
        fine = _middles(low, step / 2, 2 * counts)
        inner, outer = (segments.are_near(at, shell) for at in (positions, fine))
        positions = np.concatenate([positions[~inner], fine[outer]])
        if len(positions) > MOST_LIGHTS:
            said = f"{shell:g} m gives {len(positions):,} lights, at most {MOST_LIGHTS:,}; less, or fewer --lights"
            raise InputError("shell", said)
    positions += _ASIDE * ray_offset(scene.positions)
    free = segments.shares_of_backs(positions) < SOLID
    if not free.any():
        raise InputError("lights", f"all {len(positions)} are inside solids; give a --box in the free space")
    return LightGrid(positions[free], low, high, step, int(np.count_nonzero(~free)))


_MOST_TRIED = 1 << 15
_ASIDE = np.array([0.61, 0.37, 0.83])  # offsets of a ray's origin: lest a light lie exactly in a surface


def _middles(low: np.ndarray, step: np.ndarray, counts: np.ndarray) -> Float64[np.ndarray, "lights 3"]:
    axes = [low[k] + (np.arange(counts[k]) + 0.5) * step[k] for k in range(3)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _counts(size: Float64[np.ndarray, "3"], lights: int) -> np.ndarray:
    """Cells along each axis, as near to cubes as so many allow."""
    low, high = 1e-6 * float(size.max()), 2 * float(size.max())
    for _ in range(60):  # the step, by halving
        step = (low * high) ** 0.5
        if np.prod(np.maximum(1, np.round(size / step))) > lights:
            low = step
        else:
            high = step
    return np.maximum(1, np.round(size / high)).astype(int)

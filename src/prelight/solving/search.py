"""The paper's goal-based use: colours, aims, positions and widths of lights from a wanted picture.

For any aims and widths the best colours are a non-negative least-squares problem of a few unknowns; what is left of
the target is then made smaller by Levenberg's and Marquardt's steps through the steering weights. Lights are added one
after another, each where it helps most, then all are moved together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Float64
from ..errors import InputError
from ..lighting.panel import Panel
from .nonnegative import nonnegative
from .picture_target import Layer, Target
from .poses import Freedom, Knobs, Light, coloured, first_guesses, whitened

_STEPS, _BEST_GUESSES = 60, 4
_ENOUGH = 1e-10  # relative gain of a step


@dataclass(frozen=True)
class Solution:
    """Lights, and how far their picture is from the target: RMS within the mask, relative to the target's."""

    lights: tuple[Light, ...]
    error: float
    steps: int

    @property
    def lit(self) -> int:
        """How many of the lights are not black."""
        return sum(
            max(light.radiance if isinstance(light, Panel) else light.intensity) > 0.0
            for light in self.lights
        )


class _Lit:
    """Lights of given shapes in their best colours."""

    def __init__(self, target: Target, knobs: Sequence[Knobs]) -> None:
        self.knobs = list(knobs)
        self.colours, weights = _best_colours(target, [_weights(target, k) for k in self.knobs])
        self.square = target.distance(weights)
        self.residual = _residual(target, weights)

    @property
    def lights(self) -> tuple[Light, ...]:
        """Those, coloured."""
        return tuple(coloured(k.light, c) for k, c in zip(self.knobs, self.colours, strict=True))


def _weights(target: Target, knobs: Knobs) -> Float64[np.ndarray, "components 3"]:
    layer = knobs.layer
    own = layer.mixing @ whitened(knobs.light).coefficients(layer.basis, layer.place)
    return target.stacked(layer.name, own)


def _best_colours(target: Target, weights: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Colours (lights, 3), not negative, and the weights (K, 3) of the components that follow."""
    A = np.stack(weights, axis=-1)  # (K, 3, lights)
    colours = np.empty((len(weights), 3))
    for c in range(3):
        own = A[:, c]
        colours[:, c] = nonnegative(own.T @ target.gram[c] @ own, own.T @ target.toward[c])
    return colours, np.einsum("kcl,lc->kc", A, colours)


def _residual(target: Target, weights: np.ndarray) -> np.ndarray:
    root, projected = target.roots
    return (np.einsum("cjk,kc->cj", root, weights) - projected).ravel()


def _descended(target: Target, lit: _Lit) -> tuple[_Lit, int]:
    """Levenberg and Marquardt's steps, all lights together."""
    counts = [k.number for k in lit.knobs]
    if not sum(counts):
        return lit, 0
    damping, taken = 1e-2, 0
    for _ in range(_STEPS):
        J = _slopes(target, lit, counts)
        normal, downhill = J.T @ J, -J.T @ lit.residual
        better = None
        for _ in range(8):
            damped = normal + damping * np.diag(np.maximum(np.diag(normal), 1e-12 * normal.trace() + 1e-300))
            step = np.linalg.solve(damped, downhill)
            trial = _Lit(target, _stepped(lit.knobs, step, counts))
            if trial.square < lit.square:
                better = trial
                break
            damping *= 4.0
        if better is None:
            break
        gain, lit, damping, taken = lit.square - better.square, better, max(0.25 * damping, 1e-9), taken + 1
        if gain <= _ENOUGH * max(lit.square, 1e-9):
            break
    return lit, taken


def _stepped(knobs: Sequence[Knobs], step: np.ndarray, counts: Sequence[int]) -> list[Knobs]:
    parts = np.split(step, np.cumsum(counts)[:-1])
    return [k.turned(part) if len(part) else k for k, part in zip(knobs, parts, strict=True)]


def _slopes(target: Target, lit: _Lit, counts: Sequence[int]) -> np.ndarray:
    """How the residual changes with every number, colours following: by differences."""
    widths = np.concatenate([k.steps for k in lit.knobs])
    columns = []
    for n, width in enumerate(widths):
        step = np.zeros(len(widths))
        step[n] = width
        ahead = _Lit(target, _stepped(lit.knobs, step, counts)).residual
        behind = _Lit(target, _stepped(lit.knobs, -step, counts)).residual
        columns.append((ahead - behind) / (2.0 * width))
    return np.stack(columns, axis=-1)


def solve(
    layers: Sequence[Layer],
    picture: np.ndarray,
    *,
    mask: np.ndarray | None = None,
    lights: Sequence[Light] | None = None,
    freedom: Freedom | None = None,
) -> Solution:
    """Lights whose picture is as near to a wanted one as they come.

    Parameters
    ----------
    layers
        What the bake has.
    picture, mask
        (pixels, 3) linear, and (pixels,) from 0, where anything will do, to 1.
    lights
        Which lights to look for, in shapes and layers; one for each layer if not said. Their colours are found anew.
    freedom
        What may change besides their colours: aim and width, unless said otherwise. A kept aim is where a light begins
        and stays.

    Raises
    ------
    InputError
        For a picture, mask or lights that do not fit the bake.
    """
    if not layers:
        raise InputError("layers", "none given; this bake has no steerable layer")
    free = freedom or Freedom()
    target = Target.of(layers, picture, mask=mask)
    if not target.square.sum() > 0.0:
        raise InputError("target", "is black within the mask; switch the lights off")
    wanted: list[tuple[Layer, Light | None]] = []
    for layer in layers if lights is None else ():
        wanted.append((layer, None))
    for light in lights or ():
        wanted.append((_layer_of(target, light), light))
    if not wanted:
        raise InputError("lights", "none given to look for")
    chosen: list[Knobs] = []
    best, steps = None, 0
    for layer, light in wanted:
        guesses = [Knobs(guess, layer, free) for guess in first_guesses(layer, light, free)]
        ranked = _ranked(target, chosen, guesses)
        found = [_descended(target, _Lit(target, [*chosen, guess])) for guess in ranked[:_BEST_GUESSES]]
        best, own_steps = min(found, key=lambda pair: pair[0].square)
        chosen, steps = best.knobs, steps + own_steps
    assert best is not None
    return Solution(best.lights, float(np.sqrt(best.square)), steps)


def _ranked(target: Target, chosen: Sequence[Knobs], guesses: Sequence[Knobs]) -> list[Knobs]:
    """Guesses by how near they come beside the lights that are there, the best first."""
    there = [_weights(target, k) for k in chosen]
    distances = []
    for guess in guesses:
        _, weights = _best_colours(target, [*there, _weights(target, guess)])
        distances.append(target.distance(weights))
    return [guesses[n] for n in np.argsort(distances, kind="stable")]


def _layer_of(target: Target, light: Light) -> Layer:
    if light.layer is None and len(target.layers) == 1:
        return next(iter(target.layers.values()))
    if light.layer not in target.layers:
        raise InputError(
            "layer", f"{light.layer!r} is not in this bake; it has {', '.join(target.layers)[:120]}"
        )
    return target.layers[light.layer]

"""What follows the first bounces of any light, as few modes: M ≈ U·W, M all bounces of light that has bounced before.

Modes are the principal ones of what many lights bring, anywhere in the scene; how much of each light at a vertex brings
is then solved backwards, so that it holds for lights that were not among them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np

from ..arrays import Float32, Float64
from ..encoding.range_kernels import answers, eigenvectors, gram, turned
from ..transport.bounces import bounced
from ..transport.gathering import Gathering
from .thinned_gathering import ThinnedGathering, ThinnedSpreading

COLUMNS = 31  # solved together, with one beside them
MOST_MODES = 124
_TOLERANCE = 1e-3
_STAGE = 38
_SMALLEST = 1e-9  # of the largest eigenvalue

Share = Callable[[float], None]


@dataclass(frozen=True)
class LaterBounces:
    """Indirect light (V, 3) ≈ Σ modes · (sources · light), light (V, 3) irradiance / π that has bounced."""

    modes: Float32[np.ndarray, "vertices modes"]
    sources: Float32[np.ndarray, "3 vertices modes"]
    remaining: float  # bound on what solving left out, a share

    def of(
        self, light: Float32[np.ndarray, "vertices columns 3"]
    ) -> Float32[np.ndarray, "vertices columns 3"]:
        """All bounces of this light."""
        out = np.empty_like(light)
        for c in range(3):
            brought = np.zeros((self.modes.shape[1], light.shape[1]))
            answers(np.ascontiguousarray(self.sources[c].T), np.ascontiguousarray(light[:, :, c]), brought)
            out[:, :, c] = turned(self.modes, brought)
        return out


def later_bounces(
    thin: ThinnedGathering,
    D: Float32[np.ndarray, "vertices lights"],
    areas: Float32[np.ndarray, "vertices"],
    *,
    operator_bounces: int,
    modes: int = MOST_MODES,
    report: Share,
) -> LaterBounces:
    """Modes from the direct light of many lights, the operator having bounced it so many times."""
    seen, remaining = _seen(thin, D, operator_bounces=operator_bounces, report=lambda s: report(0.4 * s))
    weights = np.sqrt(areas)[:, None]
    values, vectors = eigenvectors(gram(seen * weights))
    count = min(modes, int((values > _SMALLEST * max(float(values[0]), 1e-30)).sum()))
    if not count:  # no light bounces twice
        return LaterBounces(np.zeros((len(D), 1), np.float32), np.zeros((3, len(D), 1), np.float32), 0.0)
    U = turned(seen, vectors[:, :count] / np.sqrt(values[:count]))
    backwards = cast(
        Gathering, ThinnedSpreading(thin, areas)
    )  # of one, solving needs no more than ``bounce``
    W = np.empty((3, *U.shape), np.float32)
    for start in range(0, U.shape[1], COLUMNS):
        columns = slice(start, min(start + COLUMNS, U.shape[1]))
        X = np.repeat(U[:, columns, None], 3, axis=2)  # area · U, of which solving wants X / area
        found = bounced(backwards, X, tolerance=_TOLERANCE)
        W[:, :, columns] = np.moveaxis(found.indirect * areas[:, None, None], 2, 0)
        remaining = max(remaining, found.remaining)
        report(0.4 + 0.6 * columns.stop / U.shape[1])
    return LaterBounces(U, W, remaining)


def _seen(
    thin: ThinnedGathering, D: np.ndarray, *, operator_bounces: int, report: Share
) -> tuple[Float32[np.ndarray, "vertices lights"], float]:
    """What each light brings after these bounces, its colours mixed by chance; all lights count alike."""
    rng = np.random.default_rng(np.random.SeedSequence([0, _STAGE]))
    mixed: Float64[np.ndarray, "lights 3"] = rng.standard_normal((D.shape[1], 3))
    seen, remaining = np.empty_like(D), 0.0
    for start in range(0, D.shape[1], COLUMNS):
        columns = slice(start, min(start + COLUMNS, D.shape[1]))
        E = np.repeat(D[:, columns, None], 3, axis=2)
        for _ in range(operator_bounces):
            E = thin.bounce(E)
        strength = np.sqrt(np.square(E, dtype=np.float64).mean(axis=(0, 2)))
        E /= np.where(strength > np.finfo(np.float32).tiny, strength, 1)[None, :, None].astype(np.float32)
        found = bounced(cast(Gathering, thin), E, tolerance=_TOLERANCE)
        seen[:, columns] = np.einsum("vkc,kc->vk", found.indirect, mixed[columns].astype(np.float32))
        remaining = max(remaining, found.remaining)
        report(columns.stop / D.shape[1])
    return seen, remaining

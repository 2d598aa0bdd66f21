"""Lights of a cloud that light a zone alike become one (Kristensen, Akenine-Möller and Jensen 2005, section 4.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Int32
from .light_clustering_kernels import largest_differences, merge_below_one

_FAR = np.float32(2.0)  # of pairs that must not merge: 1 or more

Answers = Float32[np.ndarray, "lights receivers numbers"]


@dataclass(frozen=True)
class Weights:
    """w₁ and w₂ of equation 9: metres and irradiance / π that count as 1 are their reciprocals."""

    w1: float
    w2: float


def suggested_weights(diagonal: float, brightest: float) -> Weights:
    """Weights for a scene so large (metres), whose brightest answer to a light is ``brightest``.

    Lights farther apart than a quarter of the scene never merge, nor do those that differ anywhere by a tenth
    of the brightest answer.
    """
    return Weights(4.0 / max(diagonal, 1e-9), 10.0 / max(brightest, 1e-30))


@dataclass(frozen=True)
class Groups:
    """``group_of`` (lights,): the number of each light's group, in the order of their first lights."""

    group_of: Int32[np.ndarray, "lights"]
    count: int

    def means(self, values: np.ndarray) -> np.ndarray:
        """Arithmetic means over the lights (first axis) of each group."""
        sums = np.zeros((self.count, *values.shape[1:]), values.dtype)
        np.add.at(sums, self.group_of, values)
        sizes = np.bincount(self.group_of, minlength=self.count).astype(values.dtype)
        return sums / sizes.reshape(-1, *[1] * (values.ndim - 1))


@dataclass(frozen=True)
class Pairs:
    """Pairs of lights that may merge: (pairs, 2) numbers, first below second, and the first term of equation 9."""

    lights: int
    which: Int32[np.ndarray, "pairs 2"]
    near: Float32[np.ndarray, "pairs"]

    def chosen(self, keep: np.ndarray) -> Pairs:
        """Some of them, by index or bool: those that see each other, say."""
        return Pairs(self.lights, self.which[keep], self.near[keep])


def near_pairs(
    positions: Float64[np.ndarray, "lights 3"],
    *,
    w1: float,
    aims: Float64[np.ndarray, "lights 3"] | None = None,
) -> Pairs:
    """Pairs whose distance times w₁ is below 1.

    ``aims`` are unit directions of directional lights: the angle between two, in radians, is added.
    """
    found, terms, count = [], [], len(positions)
    step = max(1, (1 << 22) // max(count, 1))
    for start in range(0, count, step):
        rows = slice(start, min(start + step, count))
        square = np.zeros((rows.stop - start, count))
        for k in range(3):
            square += (positions[rows, k, None] - positions[None, :, k]) ** 2
        near = w1 * np.sqrt(square)
        if aims is not None:
            near += np.arccos(np.clip(aims[rows] @ aims.T, -1, 1))
        later = np.arange(count)[None] > np.arange(start, rows.stop)[:, None]
        j, k = np.nonzero((near < 1) & later)
        found.append(np.stack([j + start, k], axis=1).astype(np.int32))
        terms.append(near[j, k].astype(np.float32))
    which = np.concatenate(found) if found else np.zeros((0, 2), np.int32)
    return Pairs(count, which, np.concatenate(terms) if terms else np.zeros(0, np.float32))


def pair_distances(pairs: Pairs, answers: Answers, *, w2: float) -> Float32[np.ndarray, "lights lights"]:
    """Δ of equation 9 for every pair given; 2 for all others.

    ``answers`` are what receivers answer to each light: one number a colour, or SH coefficients.
    """
    out = np.full((pairs.lights, pairs.lights), _FAR, np.float32)
    differences = np.empty(len(pairs.which), np.float32)
    largest_differences(np.ascontiguousarray(answers, np.float32), pairs.which, differences)
    first, second = pairs.which.T
    out[first, second] = out[second, first] = pairs.near + np.float32(w2) * differences
    np.fill_diagonal(out, 0)
    return out


def kept_apart(
    distances: Float32[np.ndarray, "lights lights"], answers: Answers, allowed: Float64[np.ndarray, "lights"]
) -> Float32[np.ndarray, "lights lights"]:
    """The same, but 2 for pairs whose answers differ by more, root of the squares, than is allowed for either.

    Equation 9 bounds the largest difference; of a light that brings little, that may be most of what it brings.
    """
    rows = answers.reshape(len(answers), -1)
    products = (rows @ rows.T).astype(np.float64)
    squares = np.diag(products)
    apart = squares[:, None] + squares[None] - 2 * products
    out = np.where(apart > np.square(np.minimum(allowed[:, None], allowed[None])), _FAR, distances)
    np.fill_diagonal(out, 0)
    return out.astype(np.float32)


def merged(distances: Float32[np.ndarray, "lights lights"]) -> Groups:
    """Bottom-up groups, the most alike first, every pair of two lights in a group below 1."""
    first = np.empty(len(distances), np.int32)
    merge_below_one(np.array(distances, np.float32, order="C"), first)
    firsts, group_of = np.unique(first, return_inverse=True)
    return Groups(group_of.astype(np.int32), len(firsts))

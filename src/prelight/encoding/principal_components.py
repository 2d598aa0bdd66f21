"""Fewer images for the same pictures: principal components of the basis images, through MᵀM.

M has a column for every basis image and a row for every pixel and channel; it is never formed. MᵀM, as small as the
basis, is summed over strips of pixels in float64; with MᵀM = V·S²·Vᵀ the component images are M·V and the weights of a
light are Vᵀ·w. Where tracing has recorded span functions instead of basis lights, MᵀM = A·(span MᵀM)·Aᵀ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..arrays import Float32, Float64
from ..bases.sampled_set import SampledSet
from ..errors import InputError
from .byte_planes import BytePlanes, encoded, far_brighter, one_plane_errors, two_planes_needed

PAPER_SHARE = 0.9  # of the sum of all singular values
LOSS_DB = 0.5  # what bytes may cost
_STRIP = 32_000_000  # numbers of a strip in float64


class Images(Protocol):
    """Images (S, pixels, 3) that can be read in strips [:, first:last], such as an array or a memory map."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(S, pixels, 3)."""
        ...

    def __getitem__(self, part: tuple[slice, slice]) -> np.ndarray:
        """A strip."""
        ...


@dataclass(frozen=True)
class Keep:
    """How many components to keep: the first rule of these that is given.

    ``count``; or ``error``, the RMS error of the basis pictures relative to their RMS; or ``share`` of the sum of the
    singular values, the paper's rule (0.9).
    """

    count: int | None = None
    error: float | None = None
    share: float = PAPER_SHARE

    def number(self, singular_values: np.ndarray) -> int:
        """How many of these singular values, largest first, at least one. Raises InputError for a senseless rule."""
        s = np.asarray(singular_values, np.float64)
        if self.count is not None:
            if not 1 <= self.count <= len(s):
                raise InputError(
                    "components", f"{self.count}, expected 1 to {len(s)}, the number of basis lights"
                )
            return int(self.count)
        if self.error is not None:
            if not 0.0 <= self.error < 1.0:
                raise InputError("error", f"{self.error:g}, expected at least 0 and below 1")
            left = remaining_errors(s)
            return max(int(np.argmax(left <= self.error)), 1)  # the last is 0
        if not 0.0 < self.share <= 1.0:
            raise InputError("share", f"{self.share:g}, expected above 0 and at most 1")
        sums = np.cumsum(s)
        return min(int(np.searchsorted(sums, self.share * sums[-1] * (1.0 - 1e-12))) + 1, len(s))


def remaining_errors(singular_values: np.ndarray) -> Float64[np.ndarray, "numbers"]:
    """Relative RMS error of the basis pictures for 0, 1, … all components."""
    square = np.square(np.asarray(singular_values, np.float64))
    left = np.append(np.cumsum(square[::-1])[::-1], 0.0)
    return np.sqrt(left / max(left[0], 1e-300))


def gram(images: Images) -> Float64[np.ndarray, "images images"]:
    """MᵀM (S, S) of images (S, pixels, 3), strip by strip.

    Raises InputError where a value is not finite.
    """
    S, pixels = images.shape[:2]
    strip = max(_STRIP // (3 * S), 1)
    found = np.zeros((S, S))
    for first in range(0, pixels, strip):
        part = np.asarray(images[:, first : first + strip], np.float64).reshape(S, -1)
        found += part @ part.T
    if not np.isfinite(found).all():
        raise InputError("images", "a basis image has a value that is not finite; render it again")
    return found


@dataclass(frozen=True)
class Components:
    """What to keep of a set of basis images, and how a light's coefficients become weights of it.

    ``extract`` (K, S): component image k = Σ_j extract[k, j]·span image j. ``mixing`` (K, S): weights of the components
    for a light of span coefficients c are mixing @ c. ``singular_values`` (M,), largest first. ``lights`` is M.
    """

    extract: Float64[np.ndarray, "components functions"]
    mixing: Float64[np.ndarray, "components functions"]
    singular_values: Float64[np.ndarray, "lights"]

    @property
    def kept(self) -> int:
        """K."""
        return len(self.mixing)

    @property
    def error(self) -> float:
        """RMS error of the basis pictures, relative to their RMS."""
        return float(remaining_errors(self.singular_values)[self.kept])

    def images(self, span: Images) -> Float32[np.ndarray, "components pixels 3"]:
        """The component images of span images (S, pixels, 3)."""
        S, pixels = span.shape[:2]
        found = np.empty((self.kept, pixels, 3), np.float32)
        strip = max(_STRIP // (3 * S), 1)
        for first in range(0, pixels, strip):
            part = np.asarray(span[:, first : first + strip], np.float64).reshape(S, -1)
            found[:, first : first + strip] = (self.extract @ part).reshape(self.kept, -1, 3)
        return found


def principal_components(span_gram: np.ndarray, basis: SampledSet, *, keep: Keep | None = None) -> Components:
    """Components of the pictures under a basis's lights, from MᵀM (S, S) of those under its span functions.

    Raises InputError where MᵀM does not fit the basis, all of it is dark, or the rule makes no sense.
    """
    G = np.asarray(span_gram, np.float64)
    if G.shape != (basis.functions, basis.functions):
        raise InputError("images", f"MᵀM is {G.shape}, expected {basis.functions} basis images a side")
    A = basis.to_lights
    square, V = np.linalg.eigh(A @ G @ A.T)
    singular = np.sqrt(np.maximum(square[::-1], 0.0))
    if not singular[0] > 0.0:
        raise InputError("images", "all basis images are black; does the light see the scene?")
    V = V[:, ::-1][:, : (keep or Keep()).number(singular)]
    return Components(V.T @ A, V.T @ basis.weights(np.eye(basis.functions)), singular)


def no_components(basis: SampledSet) -> Components:
    """One black image, where there is no light: it takes no light's weight."""
    nothing = np.zeros((1, basis.functions))
    return Components(nothing, nothing, np.zeros(basis.lights))


def basis_lights(basis: SampledSet) -> Components:
    """The basis images themselves as components: nothing is left out."""
    weights = basis.weights(np.eye(basis.functions))
    return Components(basis.to_lights, weights, np.ones(basis.lights))


def to_bytes(
    components: Components, images: Float32[np.ndarray, "components pixels 3"], *, loss_db: float = LOSS_DB
) -> BytePlanes:
    """Component images as bytes, which cost at most ``loss_db`` of the signal-to-noise ratio of the basis pictures.

    Over the basis lights every weight has mean square 1/M, so the errors of bytes add up to Σ_k e_k/M beside the
    Σ_dropped s²/(M·values) of the components left out. Where those errors are too large, or what is left out is below
    −60 dB of the pictures themselves, the worst images get a second plane.
    """
    square = np.square(components.singular_values)
    values = images.shape[1] * 3
    left_out = square[components.kept :].sum()
    allowed = (10.0 ** (loss_db / 10.0) - 1.0) * max(left_out, 1e-6 * square.sum()) / values
    bright = far_brighter(images)
    errors = one_plane_errors(images, bright=bright)
    return encoded(images, twice=two_planes_needed(errors, allowed), bright=bright)

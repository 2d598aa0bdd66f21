"""What every steerable basis can do: span functions on one side, sampled basis lights on the other."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..arrays import Float64
from ..errors import InputError


class SampledSet:
    """A basis whose lights L_i = Σ_j A_ij·(span function j); subclasses define ``to_lights``."""

    @property
    def to_lights(self) -> Float64[np.ndarray, "lights functions"]:
        """A (M, S): coefficients of the basis lights; basis images are A @ span images."""
        raise AttributeError("to_lights")

    @cached_property
    def _inverse(self) -> Float64[np.ndarray, "functions lights"]:
        """pinv(A), by the singular value decomposition; the weights use its transpose."""
        return np.linalg.pinv(self.to_lights, rcond=1e-14)

    @property
    def functions(self) -> int:
        """S, the number of span functions."""
        return self.to_lights.shape[1]

    @property
    def lights(self) -> int:
        """M, the number of basis lights."""
        return self.to_lights.shape[0]

    def checked(self, coefficients: np.ndarray) -> Float64[np.ndarray, "functions ..."]:
        """Coefficients as float64; raises InputError unless there are S of them."""
        c = np.asarray(coefficients, np.float64)
        if c.ndim < 1 or len(c) != self.functions:
            raise InputError("coefficients", f"shape {c.shape}, expected {self.functions} of them")
        return c

    def weights(self, coefficients: np.ndarray) -> Float64[np.ndarray, "lights ..."]:
        """w (M, …) of the basis lights for a light of coefficients (S, …): Aᵀw = c."""
        return self._inverse.T @ self.checked(coefficients)

    def basis_images(self, span: np.ndarray) -> np.ndarray:
        """Images (M, …) under the basis lights from images (S, …) under the span functions."""
        return np.tensordot(self.to_lights.astype(span.dtype), span, axes=1)

    def span_images(self, lights: np.ndarray) -> np.ndarray:
        """The other way, for basis images (M, …) that another renderer has made."""
        return np.tensordot(self._inverse.astype(lights.dtype), lights, axes=1)

"""A steerable layer as the run time holds it: components of one light's basis images under one camera's pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64
from ..bases.exponentials import ExponentialBasis
from ..bases.panels import PanelBasis
from ..bases.products import ProductBasis
from ..bases.steering import SpotBasis
from ..encoding.byte_planes import BytePlanes
from ..encoding.principal_components import (
    Components,
    Images,
    Keep,
    basis_lights,
    gram,
    principal_components,
    to_bytes,
)
from ..errors import InputError
from ..lighting.places import Place

Basis = SpotBasis | PanelBasis | ExponentialBasis | ProductBasis


@dataclass(frozen=True, eq=False)
class SteerableLayer:
    """What a light's pictures are made from.

    ``planes``: the components as bytes; ``mixing`` (K, S): their weights for a light of span coefficients c are
    mixing @ c. ``size`` is (width, height) of the pixels, ``place`` where the light is.

    Raises InputError where these do not fit together.
    """

    name: str
    basis: Basis
    place: Place
    size: tuple[int, int]
    planes: BytePlanes
    mixing: Float64[np.ndarray, "components functions"]

    def __post_init__(self) -> None:
        width, height = self.size
        components = len(self.mixing)
        fits = (
            self.mixing.ndim == 2
            and self.mixing.shape[1] == self.basis.functions
            and self.planes.pixels == width * height
            and self.planes.planes > 0
            and int(self.planes.image_of.max()) < components
        )
        if not fits:
            raise InputError(self.name, "its components, pixels and basis do not fit together")

    @classmethod
    def of_images(
        cls,
        name: str,
        span: Images,
        *,
        basis: Basis,
        place: Place,
        size: tuple[int, int],
        keep: Keep | str | None = None,
    ) -> SteerableLayer:
        """From span images (S, pixels, 3): principal components by a rule, or all basis lights with ``"all"``.

        Raises InputError for images that do not fit the basis, or are not finite or all dark.
        """
        if keep == "all":
            components: Components = basis_lights(basis)
        else:
            rule = keep if isinstance(keep, Keep) else None
            components = principal_components(gram(span), basis, keep=rule)
        planes = to_bytes(components, components.images(span))
        return cls(name, basis, place, size, planes, components.mixing)

    @property
    def components(self) -> int:
        """K."""
        return len(self.mixing)

    def weights(self, coefficients: np.ndarray) -> Float32[np.ndarray, "channels components"]:
        """Weights (3, K) of the components for a light of span coefficients (S, 3)."""
        return np.ascontiguousarray((self.mixing @ coefficients).T, np.float32)

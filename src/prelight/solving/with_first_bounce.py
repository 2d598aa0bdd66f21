"""Layers that keep their first bounce apart, as the search for lights wants them: pictures that are sums again.

Direct light is no sum of components, but it is one of direct pictures under the functions of a basis, fine enough for
all but the narrowest lights. They are made from the first bounce as they are needed, strip by strip.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Float32, Float64
from ..bases.panels import PanelBasis
from ..bases.steering import SpotBasis
from ..lighting.distributions import Distribution, Polynomial, Power
from ..lighting.places import Place
from ..lighting.spot import Spot
from ..relighting.deep_buffer import DeepBuffer
from ..relighting.steerable_layer import Basis, SteerableLayer
from .poses import Light

_DEGREE, _HARMONICS = 10, 6  # a beam of 30° and a panel a quarter wide to a few per cent


@dataclass(frozen=True, eq=False)
class _Planes:
    """Components of later bounces, then direct pictures."""

    layer: SteerableLayer
    deep: DeepBuffer
    basis: Basis

    @property
    def pixels(self) -> int:
        return self.layer.planes.pixels

    def decoded(self, images: int, part: slice = slice(None)) -> Float32[np.ndarray, "images pixels 3"]:
        """All of them, (images, pixels, 3); of a part of the pixels that begins with a block."""
        later = self.layer.planes.decoded(self.layer.components, part)
        return np.concatenate([later, self.deep.span_images(self.basis, part)])


@dataclass(frozen=True, eq=False)
class WholeLayer:
    """A layer with its first bounce, in a basis of its own; what it is made of is as a `SteerableLayer` has it."""

    name: str
    basis: Basis
    place: Place
    size: tuple[int, int]
    planes: _Planes
    mixing: Float64[np.ndarray, "components functions"]

    @property
    def components(self) -> int:
        return len(self.mixing)

    @classmethod
    def of(cls, layer: SteerableLayer, deep: DeepBuffer) -> WholeLayer:
        """From both parts."""
        basis, coarse = _finer(layer.basis)
        later = np.zeros((layer.components, basis.functions))
        later[:, coarse] = layer.mixing
        mixing = np.concatenate([later, np.eye(basis.functions)])
        return cls(layer.name, basis, layer.place, layer.size, _Planes(layer, deep, basis), mixing)


def whole_layers(
    layers: Sequence[SteerableLayer], deep: Mapping[str, DeepBuffer]
) -> list[SteerableLayer | WholeLayer]:
    """Each layer, with its first bounce where that is apart."""
    return [WholeLayer.of(layer, deep[layer.name]) if layer.name in deep else layer for layer in layers]


def in_own_shapes(lights: Sequence[Light], layers: Sequence[SteerableLayer]) -> list[Light]:
    """The same lights, with the shapes named that they have because they are their layer's own."""
    named = {layer.name: layer.basis for layer in layers}
    found = []
    for light in lights:
        basis = named.get(light.layer or next(iter(named)))
        if isinstance(light, Spot) and light.distribution is None and isinstance(basis, SpotBasis):
            found.append(replace(light, distribution=_own(basis)))
        else:
            found.append(light)
    return found


def _own(basis: SpotBasis) -> Distribution:
    if basis.parity == "all":
        return Power(basis.degree)
    return Polynomial((0.0,) * basis.degree + (1.0,))


def _finer(basis: Basis) -> tuple[Basis, np.ndarray]:
    """A basis for direct light, and which of its functions are those of the layer's basis."""
    if isinstance(basis, SpotBasis):
        return SpotBasis(max(basis.degree, _DEGREE)), basis.kept
    if isinstance(basis, PanelBasis):
        fine = tuple(max(n, _HARMONICS) for n in basis.harmonics)
        index = np.arange(np.prod([2 * n + 1 for n in fine])).reshape([2 * n + 1 for n in fine])
        return PanelBasis(fine), index[tuple(slice(2 * n + 1) for n in basis.harmonics)].ravel()
    return basis, np.arange(basis.functions)

"""A wanted picture as a few small matrices, so that looking for lights never touches a pixel again.

With C the components of all layers (pixels × K, channel by channel), a picture is C·w and its squared distance from the
target t, weighted with a mask, is wᵀ(CᵀmC)w − 2·wᵀ(Cᵀmt) + tᵀmt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from ..arrays import Float64
from ..encoding.byte_planes import BLOCK
from ..errors import InputError
from ..lighting.places import Place
from ..relighting.steerable_layer import Basis

_STRIP = 8_000_000  # numbers of a strip


class Planes(Protocol):
    """Images whose sums are pictures."""

    @property
    def pixels(self) -> int: ...

    def decoded(self, images: int, part: slice = ...) -> np.ndarray:
        """Those (images, pixels, 3), of a part of the pixels that begins with a block."""
        ...


class Layer(Protocol):
    """What is asked of a layer when lights are looked for in it."""

    @property
    def name(self) -> str: ...
    @property
    def basis(self) -> Basis: ...
    @property
    def place(self) -> Place: ...
    @property
    def size(self) -> tuple[int, int]: ...
    @property
    def planes(self) -> Planes: ...
    @property
    def mixing(self) -> np.ndarray: ...
    @property
    def components(self) -> int: ...


@dataclass(frozen=True, eq=False)
class Target:
    """CᵀmC (3, K, K), Cᵀmt (3, K) and tᵀmt (3,), summed over pixels; K counts the components of all layers.

    ``begins`` says at which of them each layer's begin. ``layers`` by name, in that order.
    """

    layers: dict[str, Layer]
    begins: dict[str, int]
    gram: Float64[np.ndarray, "3 components components"]
    toward: Float64[np.ndarray, "3 components"]
    square: Float64[np.ndarray, "3"]

    @classmethod
    def of(cls, layers: Sequence[Layer], picture: np.ndarray, *, mask: np.ndarray | None = None) -> Target:
        """From a picture (pixels, 3), linear, and a mask (pixels,), 0 where anything will do and 1 where it counts.

        Raises InputError for shapes that do not fit the layers, values not finite, a mask that is all 0.
        """
        named = {layer.name: layer for layer in layers}
        pixels = layers[0].planes.pixels
        t = np.asarray(picture, np.float64)
        m = np.ones(pixels) if mask is None else np.asarray(mask, np.float64)
        if t.shape != (pixels, 3) or any(layer.planes.pixels != pixels for layer in layers):
            width, height = layers[0].size
            raise InputError(
                "target", f"{len(t):,} pixels, expected a picture of {width}×{height}, as the bake's"
            )
        if m.shape != (pixels,):
            raise InputError("mask", f"{m.size:,} pixels, the target has {pixels:,}")
        if not np.isfinite(t).all() or not np.isfinite(m).all() or m.min() < 0.0:
            raise InputError("target", "it or its mask has values that are not finite, or a mask below 0")
        if not m.max() > 0.0:
            raise InputError("mask", "is black everywhere; paint white what the target is to decide")
        begins, total = {}, 0
        for name, layer in named.items():
            begins[name], total = total, total + layer.components
        gram, toward = np.zeros((3, total, total)), np.zeros((3, total))
        strip = max(_STRIP // (3 * total * BLOCK), 1) * BLOCK
        for first in range(0, pixels, strip):
            part = slice(first, min(first + strip, pixels))
            C = np.concatenate(
                [layer.planes.decoded(layer.components, part) for layer in named.values()]
            )  # (K, n, 3)
            for c in range(3):
                own = C[:, :, c].astype(np.float64)
                weighted = own * m[part]
                gram[c] += weighted @ own.T
                toward[c] += weighted @ t[part, c]
        return cls(named, begins, gram, toward, (m[:, None] * t * t).sum(axis=0))

    @cached_property
    def roots(self) -> tuple[np.ndarray, np.ndarray]:
        """R (3, K, K) with RᵀR = CᵀmC, and R⁻ᵀ·Cᵀmt (3, K): |R·w − R⁻ᵀ·Cᵀmt|² is the distance but for a constant."""
        values, vectors = np.linalg.eigh(self.gram)
        root = np.sqrt(np.maximum(values, 0.0))
        least = 1e-7 * root.max(axis=-1, keepdims=True)
        inverse = np.where(root > least, 1.0 / np.maximum(root, 1e-300), 0.0)
        projected = np.einsum("ckj,ck->cj", vectors, self.toward) * inverse
        return root[..., None] * vectors.transpose(0, 2, 1), projected

    def stacked(self, name: str, weights: np.ndarray) -> Float64[np.ndarray, "components 3"]:
        """Weights (K of the layer, 1 or 3) of one layer among all components, for each channel."""
        found = np.zeros((self.toward.shape[1], 3))
        begin = self.begins[name]
        found[begin : begin + self.layers[name].components] = weights
        return found

    def distance(self, weights: np.ndarray) -> float:
        """Squared distance of the picture with these weights (K, 3) from the target, relative to the target's own."""
        left = self.square.sum()
        for c in range(3):
            w = weights[:, c]
            left += w @ self.gram[c] @ w - 2.0 * w @ self.toward[c]
        return max(float(left / max(self.square.sum(), 1e-300)), 0.0)

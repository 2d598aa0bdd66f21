"""Reading the bounced part of an environment layer, every number checked that a kernel follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Int32
from ..errors import DamagedBakeError
from ..storage.bake import Bake
from .caustics import Caustics, read_caustics
from .first_bounce import FirstBounce, read_first_bounce
from .layer import EnvironmentLayer, first_broken_tree

_LARGEST = 1e12


@dataclass(frozen=True)
class BouncedLayer:
    """T of bounced light ≈ Σ modes · scales · weights; what its arrays mean is in docs/bake-format.md."""

    cells: Int32[np.ndarray, "cells 5"]
    modes: np.ndarray  # (groups, modes, 32) int8
    scales: Float32[np.ndarray, "modes"]
    weights: Float32[np.ndarray, "colours modes cells"]
    sources: np.ndarray | None  # (colours, vertices, modes) int8
    source_scales: Float32[np.ndarray, "colours modes"] | None
    first: FirstBounce | None = None
    most: int | None = None  # bounces; all, if not said
    caustics: Caustics | None = None
    metal: Caustics | None = None  # what rough metal sends of the light of each cell

    @property
    def bytes(self) -> int:
        """Of what a relight reads."""
        sent_on = sum(part.bytes for part in (self.caustics, self.metal) if part is not None)
        return self.modes.nbytes + self.weights.nbytes + sent_on


def read_bounced(bake: Bake, layer: EnvironmentLayer) -> BouncedLayer | None:
    """None where a layer has direct light only. Raises DamagedBakeError; shapes are checked with the manifest."""
    most = bake.layers[layer.name].parameters.get("bounces", 0)
    if most == 0:
        return None
    at = f"layers/{layer.name}/bounced"

    def array(name: str) -> np.ndarray:
        values = bake.array(f"{at}/{name}")
        if values.dtype == np.float32 and not (np.abs(values) <= _LARGEST).all():
            raise DamagedBakeError(bake.path, f"{at}/{name} has values that are no numbers, or too large")
        return values

    cells = array("cells")
    if first_broken_tree(np.array(cells), np.array([0, len(cells)]), layer.resolution) >= 0:
        raise DamagedBakeError(
            bake.path, f"the cells of {at} are no quadtree of 6·{layer.resolution}² texels"
        )
    has_sources = f"{at}/sources" in bake.manifest.arrays
    if has_sources and (layer.channels_of_group != 1).any():
        raise DamagedBakeError(bake.path, f"{at}/sources is for layers of Lambertian vertices")
    return BouncedLayer(
        cells=cells,
        modes=array("modes"),
        scales=array("scales"),
        weights=array("weights"),
        sources=array("sources") if has_sources else None,
        source_scales=array("source_scales") if has_sources else None,
        first=read_first_bounce(bake, f"{at}/first"),
        most=most if type(most) is int else None,
        caustics=read_caustics(bake, f"{at}/caustics", cells=len(cells)),
        metal=read_caustics(bake, f"{at}/metal", cells=len(cells)),
    )

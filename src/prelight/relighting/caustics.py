"""Caustics of a layer under the light of its cells: read from a bake, every number checked that a kernel follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Int64, Radiance
from ..errors import DamagedBakeError
from ..storage.bake import Bake
from .caustic_kernels import shine

_LARGEST = 1e9


@dataclass(frozen=True)
class Caustics:
    """Irradiance / π at vertices of unit light from each cell; docs/bake-format.md has the arrays."""

    starts: Int64[np.ndarray, "vertices_and_one"]
    cells: np.ndarray  # (entries,) uint16
    codes: np.ndarray  # (colours, entries) uint8
    scales: Float32[np.ndarray, "vertices"]

    @property
    def bytes(self) -> int:
        """Of what a change of light reads."""
        return self.cells.nbytes + self.codes.nbytes + self.scales.nbytes

    def of(self, light: np.ndarray) -> Radiance:
        """(vertices, 3) of light (cells, 3)."""
        out = np.empty((len(self.scales), 3), np.float32)
        shine(self.starts, self.cells, self.codes, self.scales, np.ascontiguousarray(light, np.float32), out)
        return out


def read_caustics(bake: Bake, at: str, *, cells: int) -> Caustics | None:
    """None where a layer has none. Raises DamagedBakeError; shapes are checked with the manifest."""
    if f"{at}/counts" not in bake.manifest.arrays:
        return None
    counts, of_entry, codes, scales = (
        bake.array(f"{at}/{name}") for name in ("counts", "cells", "codes", "scales")
    )
    starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    if max(1, int(starts[-1])) != len(of_entry):
        raise DamagedBakeError(bake.path, f"{at}/counts are not those of its {len(of_entry):,} cells")
    if of_entry.max(initial=0) >= cells:
        raise DamagedBakeError(bake.path, f"{at}/cells names one beyond the {cells:,} that there are")
    if not ((scales >= 0) & (scales <= _LARGEST)).all():
        raise DamagedBakeError(bake.path, f"{at}/scales has values outside 0 to {_LARGEST:g}")
    return Caustics(starts, of_entry, codes, scales)

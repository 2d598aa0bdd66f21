"""Traced lights where pixels see the scene: the ``PointLit`` of environment layers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import CubeMap, Int32, Normals, Positions, Radiance
from ..lighting.disc import Disc
from ..lighting.environment import Environment
from .exitant import CellLight, Lights, on_cells
from .live_gloss import Falling
from .strong_lights import StrongLights
from .traced import TracedLights

MOST_FINE = 32  # lights that each pixel sends rays to


@dataclass(frozen=True)
class FineSuns:
    """The traced lights of a layer of vertices that are seen from anywhere."""

    tracer: TracedLights
    lights: StrongLights

    @property
    def lamp_light(self) -> Radiance:
        """(V, 3) irradiance / π that they bring to vertices themselves, without bounces."""
        return self.tracer.radiance(self.lights).astype(np.float32)

    def falling(
        self, irradiance: Radiance, cube: Callable[[], CubeMap], *, discs: Sequence[Disc] = ()
    ) -> Falling:
        """Them and a sky with discs, for gloss to mirror."""
        tracer, lights = self.tracer, self.lights

        def of_rows(rows: Int32[np.ndarray, "rows"]) -> Lights | None:
            return tracer.reaching(lights, rows) if len(lights) else None

        def at(points: Positions, normals: Normals) -> Lights:
            return tracer.reaching_at(lights, points, normals)

        def sky() -> CellLight:
            there = cube()
            if not discs:
                return on_cells(there)
            return on_cells(there) + on_cells(
                Environment.dark().with_discs(tuple(discs)).cube(there.shape[1])
            )

        return Falling(irradiance, sky, of_rows, at)

    def lamp_light_at(self, points: Positions, normals: Normals, *, shadow_rays: int = 1) -> Radiance:
        """The same at points (n, 3) of surfaces with unit normals, by rays to each light."""
        del shadow_rays  # as many as there are parts of texels
        return self.tracer.irradiance_at(self.lights, points, normals)

"""Errors against exact integration: eight maps, falling ε, the sun, and a whole picture (figure 9)."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from scenes import baked, maps, relative, scan

import prelight as pl
from prelight.checking.plots_of_errors import error_plot
from prelight.relighting.environment import EnvironmentLayer, EnvironmentRelighter
from prelight.transport.exact import integrate_exactly

R = 256
EPSILONS = (5e-5, 1e-4, 2.5e-4)
RECEIVERS = 1000


def _exact(found: pl.Bake, chosen: np.ndarray, cubes: list[np.ndarray]) -> list[np.ndarray]:
    receivers = found.receivers
    together = integrate_exactly(
        receivers.positions,
        found.triangles,
        receivers.normals,
        receivers=chosen,
        cube=np.concatenate(cubes, axis=-1),
    )
    return [together[:, 3 * k : 3 * k + 3] * receivers.albedo[chosen] for k in range(len(cubes))]

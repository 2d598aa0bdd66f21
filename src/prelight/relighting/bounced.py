"""Bounced light of a layer under the light that falls on it now: few modes, so that it is always made in full."""

from __future__ import annotations

import numpy as np

from ..arrays import Float32, Float64, Int32, Int64, Radiance
from ..encoding.sparse_tiles import GROUP
from .bounced_kernels import blocks_of, bounce, project
from .bounced_layer import BouncedLayer
from .layer import EnvironmentLayer
from .pace import Pace
from .strong_lights import StrongLights

_BY_ITSELF = 3  # bounces of traced lights followed one by one; then light is smooth enough for modes
_LITTLE, _NOTHING = (
    0.05,
    1e-4,
)  # of the light that falls: what bounces of it may be left to modes, may be forgotten

Light = Float64[np.ndarray, "cells 3"]
Coefficients = Float64[np.ndarray, "modes 3"]


class BouncedLight:
    """What bounces in a layer.

    Parameters
    ----------
    nodes
        Of each cell, in the tree whose light is asked for.
    """

    def __init__(
        self, part: BouncedLayer, layer: EnvironmentLayer, nodes: Int64[np.ndarray, "cells"], count: int
    ) -> None:
        self.part, self._layer, self._nodes = part, layer, nodes
        self.cell_of_node = np.full(count, -1)
        self.cell_of_node[nodes] = np.arange(len(nodes))
        self._every = np.arange(part.modes.shape[1], dtype=np.int32)
        self._light = np.zeros((len(nodes), 3))
        self._sums = np.zeros((layer.groups, 3 * GROUP), np.float32)
        self._pace = Pace(bounce)
        self._strong: tuple[StrongLights, Radiance] | None = None

    def follow(self, light: Light) -> bool:
        """Bounce this light of the cells; False if it is what it was."""
        if (light == self._light).all():
            return False
        self._light = light
        self._multiply(self._of_cells(light), self._sums)
        return True

    @property
    def sums(self) -> Float32[np.ndarray, "groups 96"]:
        """Three channels of 32 receivers, in storage order."""
        return self._sums

    def light_of(self, tree_light: Float64[np.ndarray, "nodes 3"], falling) -> Light:
        """Light of the cells: that of the cube, and of what falls on top (nodes and weights, colour)."""
        light = tree_light[self._nodes]
        for (nodes, weights), colour in falling:
            cells = self.cell_of_node[nodes]
            light[cells[cells >= 0]] += weights[cells >= 0] * colour
        return light

    def of_strong(self, lights: StrongLights, direct: Float64[np.ndarray, "rows 3"]) -> Radiance:
        """(rows, 3) what traced lights bring by bouncing, whose direct irradiance / π is ``direct``; kept."""
        if self._strong is None or self._strong[0] is not lights:
            self._strong = lights, self._bounced(lights, direct)
        return self._strong[1]

    def _bounced(self, lights: StrongLights, direct: Float64[np.ndarray, "rows 3"]) -> Radiance:
        """Some bounces by their operator, where it is kept, and by the modes what follows; all by the modes, if not."""
        part = self.part
        if part.sources is None:
            light = np.zeros((len(self._nodes), 3))
            np.add.at(light, self._cells_of(lights), lights.energy)
            return self._of_modes(self._of_cells(light))
        if part.first is None:
            return self._of_modes(self._projected(direct))
        total, light, fallen = np.zeros((len(direct), 3), np.float32), direct, float(direct.sum())
        for _ in range(_BY_ITSELF if part.most is None else part.most):
            light = part.first.bounce(light)
            total += light
            if float(light.sum(dtype=np.float64)) <= (_LITTLE if part.most is None else _NOTHING) * fallen:
                break
        return total if part.most is not None else total + self._of_modes(self._projected(light))

    def _of_modes(self, coefficients: Coefficients) -> Radiance:
        sums = np.empty_like(self._sums)
        self._multiply(coefficients, sums)
        return self._in_rows(sums)

    def _of_cells(self, light: Light) -> Coefficients:
        weights = self.part.weights
        wide = np.broadcast_to(weights, (3, *weights.shape[1:]))
        light = light.astype(np.float32)  # not by a library that would wait for threads
        return np.stack([np.einsum("kj,j->k", wide[c], light[:, c]) for c in range(3)], axis=1)

    def _projected(self, direct: np.ndarray) -> Coefficients:
        sources, scales = self.part.sources, self.part.source_scales
        assert sources is not None
        found = np.empty((blocks_of(len(direct)), 3, sources.shape[2]), np.float32)
        project(sources, np.ascontiguousarray(direct, np.float32), found)
        return (found.sum(axis=0, dtype=np.float64) * scales).T

    def _multiply(self, coefficients: Coefficients, out: np.ndarray) -> None:
        weights = (coefficients * self.part.scales[:, None]).astype(np.float32)
        self._pace(self.part.modes.nbytes, self.part.modes, self._every, np.ascontiguousarray(weights), out)

    def _in_rows(self, sums: np.ndarray) -> Radiance:
        order = self._layer.order
        stored = sums.reshape(-1, 3, GROUP).transpose(0, 2, 1).reshape(-1, 3)
        rows = np.empty((self._layer.rows, 3), np.float32)
        rows[order[order >= 0]] = stored[order >= 0]
        return rows

    def _cells_of(self, lights: StrongLights) -> Int32[np.ndarray, "lights"]:
        """The cell of each light's middle."""
        face, row, column, height, width = lights.rectangles.T
        row, column = row + height // 2, column + width // 2
        cells = self.part.cells
        inside = np.ones((len(lights), len(cells)), bool)
        for at, first, size in ((row, 1, 3), (column, 2, 4)):
            inside &= (at[:, None] >= cells[:, first]) & (at[:, None] < cells[:, first] + cells[:, size])
        inside &= face[:, None] == cells[:, 0]
        return inside.argmax(axis=1)

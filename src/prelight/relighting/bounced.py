"""Bounced light of a layer under the light that falls on it now: few modes, so that it is always made in full."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Float32, Float64, Int32, Int64, Radiance
from ..encoding.sparse_tiles import GROUP
from .bounced_kernels import bounce
from .bounced_layer import BouncedLayer
from .direct_to_indirect import DirectToIndirect, in_rows
from .layer import EnvironmentLayer
from .pace import Pace
from .strong_lights import StrongLights

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
        self._direct: DirectToIndirect | None = None
        if part.sources is not None:
            self._direct = DirectToIndirect(
                part.modes, part.scales, part.sources, part.source_scales, part.first,
                order=layer.order, rows=layer.rows, most=part.most,
            )  # fmt: skip

    def follow(self, light: Light) -> bool:
        """Bounce this light of the cells; False if it is what it was."""
        if (light == self._light).all():
            return False
        self._light = light
        self._multiply(self._of_cells(light), self._sums)
        for sent_on in (self.part.caustics, self.part.metal):
            if sent_on is not None:
                self._add_stored(sent_on.of(light))
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

    def of_strong(
        self,
        lights: StrongLights,
        direct: Float64[np.ndarray, "rows 3"],
        caustics: Callable[[StrongLights], Radiance | None] = lambda _: None,
    ) -> Radiance:
        """(rows, 3) what traced lights bring by bouncing, whose direct irradiance / π is ``direct``; kept.

        ``caustics`` finds what glass and mirrors send of them, (rows, 3) like ``direct``; by their cells, if it gives
        None.
        """
        if self._strong is None or self._strong[0] is not lights:
            self._strong = lights, self._bounced(lights, direct, caustics)
        return self._strong[1]

    def _bounced(
        self, lights: StrongLights, direct: np.ndarray, caustics: Callable[[StrongLights], Radiance | None]
    ) -> Radiance:
        """From direct light where what light at a vertex brings is kept; from the cells of the lights if not."""
        light = np.zeros((len(self._nodes), 3))
        np.add.at(light, self._cells_of(lights), lights.energy)
        found: Radiance | None = None
        if self.part.caustics is not None:
            found = caustics(lights) if self._direct is not None else None
            found = self.part.caustics.of(light) if found is None else found
        if self.part.metal is not None:
            of_metal = self.part.metal.of(light)
            found = of_metal if found is None else found + of_metal
        if self._direct is not None:
            return (
                self._direct.bounced(direct)
                if found is None
                else found + self._direct.bounced(direct + found)
            )
        sums = np.empty_like(self._sums)
        self._multiply(self._of_cells(light), sums)
        rows = in_rows(sums, self._layer.order, rows=self._layer.rows)
        return rows if found is None else rows + found

    def _of_cells(self, light: Light) -> Coefficients:
        weights = self.part.weights
        wide = np.broadcast_to(weights, (3, *weights.shape[1:]))
        light = light.astype(np.float32)  # not by a library that would wait for threads
        return np.stack([np.einsum("kj,j->k", wide[c], light[:, c]) for c in range(3)], axis=1)

    def _add_stored(self, rows: Radiance) -> None:
        """Add what rows have to their places in the sums."""
        order = self._layer.order.reshape(-1, GROUP)
        values = np.where(order[..., None] >= 0, rows[order], 0)
        self._sums += values.transpose(0, 2, 1).reshape(len(self._sums), 3 * GROUP)

    def _multiply(self, coefficients: Coefficients, out: np.ndarray) -> None:
        weights = (coefficients * self.part.scales[:, None]).astype(np.float32)
        self._pace(self.part.modes.nbytes, self.part.modes, self._every, np.ascontiguousarray(weights), out)

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

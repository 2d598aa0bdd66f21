"""Soft disc lights on top of the cube: what each brings at strength one is kept, and added in its colour.

So brightening a disc reads no transfer, and moving it only that of the clusters where more or less of it falls
than before (Eq. 15 with one change of light for three colours).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Float64, Int64
from ..encoding.sparse_tiles import GROUP
from ..lighting.regions import Cap
from .layer import EnvironmentLayer
from .light_tree import LightTree, Weights
from .pace import Pace
from .tile_kernels import EVERY, relight_discs

Colour = Float64[np.ndarray, "3"]
_NOWHERE: Weights = (np.zeros(0, np.int64), np.zeros((0, 3)))
_BLACK: Colour = np.zeros(3)


@dataclass
class _Lit:
    """A disc that is alight: its row of ``units``, its colour, and how much of it falls where."""

    place: int
    colour: Colour = field(default_factory=lambda: _BLACK)
    weights: Weights = _NOWHERE
    solid_angle: float = 0.0
    clusters: int = 0


@dataclass(frozen=True)
class _Change:
    """What happens to a disc in one update."""

    place: int
    brighter: Colour
    colour: Colour
    weights: Weights = _NOWHERE  # changes of them, or if ``afresh`` all of them
    afresh: bool = False
    clusters: int = 0


class DiscLights:
    """The discs that shine on a layer; they add to sums (groups, 96) given with the shares of threads."""

    def __init__(self, layer: EnvironmentLayer, tree: LightTree) -> None:
        self._layer, self._tree = layer, tree
        self._lit: dict[Cap, _Lit] = {}
        self._units = np.zeros((0, int(layer.channels_of_group.sum()) * GROUP))
        self._alight = np.zeros((0, layer.groups), bool)
        self._free: list[int] = []
        self._pace = Pace(relight_discs)

    @property
    def total(self) -> float:
        """Of all their light, over all channels."""
        return sum(lit.solid_angle * float(lit.colour.sum()) for lit in self._lit.values())

    def change(
        self, wanted: Mapping[Cap, Colour], sums: np.ndarray, shares: Int64[np.ndarray, "threads+1"]
    ) -> tuple[int, int]:
        """Let these discs and no others shine: clusters whose light changes, and bytes of tiles read."""
        gone = [region for region in self._lit if region not in wanted]
        changes = []
        for region, colour in wanted.items():
            lit = self._lit.get(region)
            if lit is None:
                lit = self._lit.pop(gone.pop(0)) if gone else self._new()
                changes.append(self._move(lit, region, colour))
                self._lit[region] = lit
            elif (colour != lit.colour).any():
                changes.append(_Change(lit.place, colour - lit.colour, colour, clusters=lit.clusters))
            lit.colour = colour
        for region in gone:
            lit = self._lit.pop(region)
            self._free.append(lit.place)
            changes.append(_Change(lit.place, -lit.colour, _BLACK, clusters=lit.clusters))
        return sum(c.clusters for c in changes), self._apply(changes, sums, shares) if changes else 0

    def add(self, sums: np.ndarray, shares: Int64[np.ndarray, "threads+1"]) -> None:
        """Add all of them to sums that have none."""
        if self._lit:
            self._apply([_Change(d.place, d.colour, d.colour) for d in self._lit.values()], sums, shares)

    def _move(self, lit: _Lit, region: Cap, colour: Colour) -> _Change:
        weights = self._tree.weights_of(region)
        change = self._tree.difference(weights, lit.weights)
        afresh = len(change[0]) >= len(weights[0])
        brighter, changed = colour - lit.colour, weights if afresh else change
        moved = self._tree.clusters_of(change[0])
        lit.weights, lit.solid_angle = weights, region.solid_angle
        lit.clusters = self._tree.clusters_of(weights[0])
        return _Change(lit.place, brighter, colour, changed, afresh, moved)

    def _apply(self, changes: list[_Change], sums: np.ndarray, shares: np.ndarray) -> int:
        *where, weights = self._tree.gather(*(change.weights for change in changes))
        colours = np.array([(change.brighter, change.colour) for change in changes])
        places = np.array([change.place for change in changes])
        discs = places, colours, np.array([change.afresh for change in changes]), EVERY
        read = self._layer.bytes_in(where[1], where[2])
        size = read + sums.nbytes + len(changes) * self._units.shape[1] * self._units.itemsize
        self._pace(
            size, self._layer.tiles, tuple(where), weights, discs, self._units, self._alight, sums, shares
        )
        return read

    def _new(self) -> _Lit:
        if not self._free:
            rows = len(self._units)
            self._units = np.concatenate([self._units, np.zeros((1, self._units.shape[1]))])
            self._alight = np.concatenate([self._alight, np.zeros((1, self._layer.groups), bool)])
            return _Lit(rows)
        place = self._free.pop()
        self._units[place], self._alight[place] = 0.0, False
        return _Lit(place)

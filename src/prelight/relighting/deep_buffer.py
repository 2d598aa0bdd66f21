"""A spot's first bounce from what each sub-pixel sees of it: exact for every shape, however narrow.

The bounces after it come from the steerable layer, smooth enough for a low degree (Teo, Simoncelli and Heeger 1997,
section 7, the first hybrid).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Int64, UInt16
from ..encoding.octahedral import decoded_directions
from ..errors import InputError
from ..lighting.distributions import Power, frame
from ..lighting.panel import Panel
from ..lighting.places import Place
from ..lighting.spot import Spot
from .steerable import SteerableRelighter

_STRIP = 1 << 20  # entries at a time


@dataclass(frozen=True)
class DeepBuffer:
    """What a lamp brings to pixels directly, by the direction in which it leaves.

    ``starts`` (pixels + 1,) where each pixel's entries begin; ``colours`` (entries, 3) radiance for 1 W/sr;
    ``directions`` (entries, 2) octahedral. ``degree`` of the layer's own shape.

    Raises InputError where these do not fit.
    """

    starts: Int64[np.ndarray, "pixels+1"]
    colours: Float32[np.ndarray, "entries 3"]
    directions: UInt16[np.ndarray, "entries 2"]
    degree: int

    def __post_init__(self) -> None:
        rises = len(self.starts) > 1 and self.starts[0] == 0 and (np.diff(self.starts) >= 0).all()
        entries = (len(self.colours), 3), (len(self.colours), 2)
        if not rises or self.starts[-1] != len(self.colours):
            raise InputError("deep buffer", "its pixels do not fit its entries")
        if (self.colours.shape, self.directions.shape) != entries:
            raise InputError("deep buffer", "its colours and directions do not fit")

    def radiance(self, spot: Spot, place: Place) -> Float32[np.ndarray, "pixels 3"]:
        """Of pixels, row by row, under this spot alone."""
        turn = frame(spot.aim(place), spot.roll_deg)
        shape = spot.distribution or Power(self.degree)
        pixels = len(self.starts) - 1
        found = np.zeros((pixels, 3), np.float32)
        first = 0
        while first < pixels:
            limit = self.starts[first] + _STRIP
            last = max(first + 1, int(np.searchsorted(self.starts, limit, side="right")) - 1)
            here = slice(int(self.starts[first]), int(self.starts[last]))
            light = self.colours[here] * shape.along(decoded_directions(self.directions[here]) @ turn)
            sums = np.concatenate([np.zeros((1, 3)), np.cumsum(light, axis=0, dtype=np.float64)])
            begin = self.starts[first : last + 1] - here.start
            found[first:last] = (sums[begin[1:]] - sums[begin[:-1]]) * spot.intensity
            first = last
        return found


def first_bounces(
    live: SteerableRelighter, deep: Mapping[str, DeepBuffer], lights: Sequence[Spot | Panel]
) -> Float32[np.ndarray, "pixels 3"]:
    """What all lights bring directly, of layers that keep that apart; to be added to ``live.radiance``."""
    found = np.zeros((live.size[0] * live.size[1], 3), np.float32)
    for light in lights:
        layer = live.layer_of(light)
        if layer.name in deep and isinstance(light, Spot):
            found += deep[layer.name].radiance(light, layer.place)
    return found

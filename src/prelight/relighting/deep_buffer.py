"""A lamp's first bounce from what each sub-pixel sees of it: exact for every shape, however narrow.

The bounces after it come from the steerable layer, smooth enough for a low degree (Teo, Simoncelli and Heeger 1997,
section 7, the first hybrid). Or the layer holds all light, and only what is too narrow for it is brought from here: the
second hybrid.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Int64, UInt16
from ..bases.panels import PanelBasis, axis_functions
from ..bases.products import ProductBasis
from ..bases.steering import SpotBasis
from ..encoding.octahedral import decoded_directions, decoded_places
from ..errors import InputError
from ..lighting.distributions import Power, frame
from ..lighting.panel import Panel, Shape, axis_shape
from ..lighting.places import Place
from ..lighting.spot import Spot
from .steerable import SteerableRelighter
from .steerable_layer import Basis

_STRIP = 1 << 20  # entries at a time
_NODES = 32  # in a part of a panel
_NUMBERS = 1 << 24  # of functions at entries at a time


@dataclass(frozen=True, eq=False)
class DeepBuffer:
    """What a lamp brings to pixels directly, by how it leaves.

    ``starts`` (pixels + 1,) where each pixel's entries begin; ``colours`` (entries, 3) radiance where the lamp's
    emission is 1; ``directions`` (entries, 2) octahedral; ``places`` (entries, 2) on a panel (`encoded_places`), none
    of a spot. ``degree`` of the layer's own shape; None where a panel's light leaves alike in all directions.

    Places that were aimed at lie each in its own square, one of ``parts``² of the panel: what a square sends out is
    averaged over it, so that a narrow light does not depend on how many places happen to be in it. Only the edges of
    shadows are blurred by that.

    Raises InputError where these do not fit.
    """

    starts: Int64[np.ndarray, "pixels+1"]
    colours: Float32[np.ndarray, "entries 3"]
    directions: UInt16[np.ndarray, "entries 2"]
    degree: int | None
    places: UInt16[np.ndarray, "entries 2"] | None = None
    parts: int = 1

    def __post_init__(self) -> None:
        rises = len(self.starts) > 1 and self.starts[0] == 0 and (np.diff(self.starts) >= 0).all()
        entries = (len(self.colours), 3), (len(self.colours), 2)
        if not rises or self.starts[-1] != len(self.colours):
            raise InputError("deep buffer", "its pixels do not fit its entries")
        if (self.colours.shape, self.directions.shape) != entries:
            raise InputError("deep buffer", "its colours and directions do not fit")
        if self.places is not None and self.places.shape != entries[1]:
            raise InputError("deep buffer", "its places do not fit")
        if not 1 <= self.parts <= 256:
            raise InputError("deep buffer", "its parts do not fit")

    @property
    def pixels(self) -> int:
        return len(self.starts) - 1

    def radiance(self, light: Spot | Panel, place: Place) -> Float32[np.ndarray, "pixels 3"]:
        """Of pixels, row by row, under this light alone.

        Raises InputError for a spot where a panel is, and the other way round.
        """
        if isinstance(light, Panel) != (self.places is not None):
            kind = "panel" if self.places is not None else "spot"
            raise InputError("light", f"its layer is that of a {kind}; expected [[{kind}]] for it")
        found = np.zeros((self.pixels, 3), np.float32)
        for pixels, here in self._strips(_STRIP):
            light_here = self.colours[here] * self._emitted(light, place, here)
            found[pixels] = self._summed(light_here, pixels)
        return found

    def span_images(
        self, basis: Basis, part: slice = slice(None)
    ) -> Float32[np.ndarray, "functions pixels 3"]:
        """Direct light under every function of a basis, of some pixels: how a narrow light looks to that basis."""
        first, stop, _ = part.indices(self.pixels)
        found = np.zeros((basis.functions, stop - first, 3), np.float32)
        for pixels, here in self._strips(max(_NUMBERS // basis.functions, 1), first, stop):
            values = self._functions(basis, here)
            own = slice(pixels.start - first, pixels.stop - first)
            for c in range(3):
                found[:, own, c] = self._summed(values * self.colours[here, c : c + 1], pixels).T
        return found

    def _strips(self, entries: int, first: int = 0, stop: int | None = None) -> list[tuple[slice, slice]]:
        """Pixels and their entries, about so many entries at a time."""
        last, found = self.pixels if stop is None else stop, []
        while first < last:
            limit = self.starts[first] + entries
            following = int(np.searchsorted(self.starts, limit, side="right")) - 1
            following = min(max(first + 1, following), last)
            found.append(
                (slice(first, following), slice(int(self.starts[first]), int(self.starts[following])))
            )
            first = following
        return found

    def _summed(self, values: np.ndarray, pixels: slice) -> Float64[np.ndarray, "pixels ..."]:
        """Sums over each pixel's entries of values (entries of these pixels, n)."""
        begin = self.starts[pixels.start : pixels.stop + 1] - self.starts[pixels.start]
        sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0, dtype=np.float64)])
        return sums[begin[1:]] - sums[begin[:-1]]

    def _on_axis(self, function: Callable[[np.ndarray], np.ndarray], axis: int, here: slice) -> np.ndarray:
        """A function of one coordinate at each entry, averaged over an entry's own part of the panel if it has one."""
        assert self.places is not None
        x, aimed = decoded_places(self.places[here])
        found = function(x[:, axis])
        nodes = (np.arange(self.parts * _NODES) + 0.5) / (self.parts * _NODES)
        values = function(nodes)
        means = values.reshape(self.parts, _NODES, *values.shape[1:]).mean(axis=1)
        part = np.minimum((x[aimed, axis] * self.parts).astype(np.int64), self.parts - 1)
        found[aimed] = means[part]
        return found

    def _emitted(self, light: Spot | Panel, place: Place, here: slice) -> np.ndarray:
        """Colour of what leaves the lamp at each entry, (entries, 3), in the light's true shape."""
        directions = decoded_directions(self.directions[here])
        if isinstance(light, Spot):
            return self._beamed(light, place, directions) * np.array(light.intensity)
        found = np.ones((here.stop - here.start, 1)) * np.array(light.radiance)
        for axis, (at, width) in enumerate(zip(light.position, light.width, strict=True)):
            shape = functools.partial(_shape_around, light.shape, width, at)
            found *= self._on_axis(shape, axis, here)[:, None]
        if light.beam is not None:
            found = found * self._beamed(light.beam, place, directions) * np.array(light.beam.intensity)
        elif self.degree is not None:
            ahead = Spot((1.0, 1.0, 1.0), direction=light.ahead(place))
            found = found * self._beamed(ahead, place, directions)
        return found

    def _beamed(self, spot: Spot, place: Place, directions: np.ndarray) -> np.ndarray:
        shape = spot.distribution or Power(self.degree or 0)
        return shape.along(directions @ frame(spot.aim(place), spot.roll_deg))

    def _functions(self, basis: Basis, here: slice) -> np.ndarray:
        """Values (entries, S) of a basis."""
        directions = decoded_directions(self.directions[here])
        if isinstance(basis, SpotBasis):
            return basis.evaluate(directions)
        panel = basis.panel if isinstance(basis, ProductBasis) else basis
        found = basis.spot.evaluate(directions) if isinstance(basis, ProductBasis) else None
        if isinstance(panel, PanelBasis):
            per_axis = [functools.partial(axis_functions, n) for n in panel.harmonics]
        else:
            per_axis = [axis.evaluate for axis in panel.axes]
        for axis in (1, 0):  # the last runs fastest
            own = self._on_axis(per_axis[axis], axis, here)
            if found is not None:
                own = (own[:, :, None] * found[:, None, :]).reshape(len(own), -1)
            found = own
        assert found is not None
        return found


def _shape_around(shape: Shape, width: float, at: float, x: np.ndarray) -> np.ndarray:
    return axis_shape(shape, width, x - at)


def first_bounces(
    live: SteerableRelighter, deep: Mapping[str, DeepBuffer], lights: Sequence[Spot | Panel]
) -> Float32[np.ndarray, "pixels 3"]:
    """What all lights bring directly, of layers that keep that apart; to be added to ``live.radiance``."""
    found = np.zeros((live.size[0] * live.size[1], 3), np.float32)
    for light in lights:
        layer = live.layer_of(light)
        if layer.name in deep:
            found += deep[layer.name].radiance(light, layer.place)
    return found


class NarrowParts:
    """What lights are beyond what their layers hold, brought directly (the paper's second hybrid).

    A light is the approximation of it that its layer holds, with every bounce, and a rest, which is narrow. Of the rest
    only the first bounce is added: light − approximation, sub-pixel by sub-pixel.

    Parameters
    ----------
    live
        Lights and layers.
    deep
        First bounces of layers that hold all light; others have no narrow part.
    """

    def __init__(self, live: SteerableRelighter, deep: Mapping[str, DeepBuffer]) -> None:
        self._live, self._deep = live, dict(deep)
        self._span = {name: deep[name].span_images(live.layers[name].basis) for name in deep}

    def radiance(self, lights: Sequence[Spot | Panel]) -> Float32[np.ndarray, "pixels 3"]:
        """To be added to ``live.radiance``; below 0 where the approximation is too bright."""
        found = first_bounces(self._live, self._deep, lights)
        for light in lights:
            layer = self._live.layer_of(light)
            if layer.name in self._span:
                held = light.coefficients(layer.basis, layer.place).astype(np.float32)
                found -= np.einsum("sc,spc->pc", held, self._span[layer.name], optimize=True)
        return found

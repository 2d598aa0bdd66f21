"""What a rig brings to a bake, taken apart by linearity so that each change costs no more than it must.

B = gain · T·(map as turned) + T·(discs); paint covers the map as scaled and tinted, whose gain is then
in it already. Without paint a change of scale or tint changes the gain, with which radiance is
packed, and nothing else; a change of a disc is a local change; only another map or turn is a full product.
While something is dragged a map is turned coarsely and no shadow is traced; at rest the light is the exact one,
which depends on the state alone: every sum is made anew, in one order.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numba
import numpy as np

from ..arrays import Float32, Radiance
from ..lighting.disc import Disc
from ..lighting.environment import Environment
from ..lighting.quantities import Triple
from ..relighting.pace import Pace
from ..relighting.relighter import Relighter
from ..relighting.strong_lights import NO_LIGHTS, StrongLights, strong_discs
from ..storage.bake import Bake
from .environments import Environments, small, turned
from .frames import HEADER_BYTES
from .protocol import MOST_DISCS, State
from .protocol_values import LayerPace, PaintStroke
from .rgb9e5_kernels import pack
from .rig_state import WHITE, lit_discs, painted, sky_id

_COARSE_RESOLUTION = 48  # R of a map while it is turned
_TRACED_AT_ONCE = 4  # strong lights between two looks at whether the light is still wanted


class Packer:
    """Light into radiance frames: sky · gain + discs, (rows, 3) each; the header is left empty."""

    def __init__(self) -> None:
        self._pack = Pace(pack)

    def __call__(self, sky: Radiance, gain: Float32[np.ndarray, "3"], discs: Radiance) -> bytearray:
        data = bytearray(HEADER_BYTES + 4 * len(sky))
        words = np.frombuffer(data, np.uint32, offset=HEADER_BYTES)
        self._pack(28 * len(sky), sky, gain, discs, words, numba.get_num_threads())
        return data


@dataclass(frozen=True)
class Lit:
    """A part of the light that is there: what it is of, what it brings (rows, 3), and whether exactly."""

    key: object
    irradiance: Radiance
    exact: bool
    strong: StrongLights = NO_LIGHTS  # those that are traced


class _MapKey(NamedTuple):
    """A map as turned; painted, also as scaled and tinted."""

    name: str
    rotation_deg: float
    scale: float = 1.0
    tint: Triple = WHITE
    paint: tuple[PaintStroke, ...] = ()

    def of(self, turned_map: Environment) -> Environment:
        if not self.paint:
            return turned_map
        return painted(turned_map.scaled(self.scale).tinted(self.tint), self.paint)


def _map_key(state: State) -> _MapKey:
    key = _MapKey(sky_id(state), state.rotation_deg)
    return key._replace(scale=state.scale, tint=state.tint, paint=state.paint) if state.paint else key


def _gain(state: State) -> Float32[np.ndarray, "3"]:
    """What the light of the map is multiplied with."""
    return np.ones(3, np.float32) if state.paint else (state.scale * np.array(state.tint)).astype(np.float32)


class Light:
    """The radiance of a bake's rows under a rig. Owned by one thread.

    Radiance is irradiance / π of Lambertian rows, without colour, and radiance of all others.

    Raises
    ------
    InputError, DamagedBakeError
        As ``Relighter``.
    """

    def __init__(self, bake: Bake, environments: Environments) -> None:
        self._environments = environments
        self._sky = Relighter(bake, trace_strong=False)
        self._dark = self._sky.environment
        rows = len(self._sky.clustered_irradiance)
        self._no_light = np.zeros((rows, 3), np.float32)
        self._map: Lit | None = None
        self._small: tuple[str, Environment] | None = None
        self._discs = Lit((), self._no_light, True)
        self._name = self._sky.layer_name
        self._mirrored: tuple[tuple[object], tuple[object, object]] = (None,), (None, None)
        self._packer = Packer()
        self._layers: tuple[LayerPace, ...] = ()

    @cached_property
    def _front(self) -> Relighter:
        """For the discs, in front of darkness. The first picture does not wait for it."""
        return Relighter(self._sky.bake, trace_strong=False)

    @property
    def rows(self) -> int:
        return len(self._no_light)

    @property
    def layers(self) -> tuple[LayerPace, ...]:
        """What the layer did at the last ``relight``."""
        return self._layers

    def relight(self, state: State, *, exact: bool, check: Callable[[], None]) -> tuple[bool, str, int]:
        """Make the light that of a state: whether it is exact now, how it was made, how many lights are traced.

        ``check`` is called now and then, and may raise to give up; what is there stays. Without ``exact`` what is
        there of an exact light is kept, where it is of this state.
        """
        began, how = time.perf_counter(), "gain"
        key = _map_key(state)
        known = self._map is not None and self._map.key == key
        if not known or (exact and not (self._map and self._map.exact)):
            self._map = self._exact_map(key, check=check) if exact else self._coarse_map(key)
            how = self._sky.last.kind
        discs = lit_discs(state)
        if self._discs.key != discs or (exact and not self._discs.exact):
            self._discs = self._exact_discs(discs, check=check) if exact else self._coarse_discs(discs)
            how = "full" if how == "full" else "local"
        assert self._map is not None
        took = round((time.perf_counter() - began) * 1e3, 2)
        self._layers = (LayerPace(self._name, "environment", how, took),)
        return self._map.exact and self._discs.exact, how, len(self._map.strong) + len(self._discs.strong)

    def frame(self, state: State, *, beside: Radiance | None = None) -> bytearray:
        """The light that is there, times the state's gain, as a radiance frame; its header is left empty.

        ``beside`` (rows, 3) is added: what other layers bring.
        """
        gain = _gain(state)
        assert self._map is not None
        discs = self._discs.irradiance
        return self._packer(self._map.irradiance, gain, discs if beside is None else discs + beside)

    @property
    def has_gloss(self) -> bool:
        """Whether some rows shine toward the eye."""
        return self._sky.has_gloss

    def glossy(self, state: State, eye: Triple, *, beside: Radiance | None = None) -> Radiance | None:
        """(rows, 3) what the light that is there adds toward a point; None without glossy rows. ``beside`` as above."""
        if not self.has_gloss:
            return None
        assert self._map is not None
        gain = _gain(state)
        for light, mirrored, known in (
            (self._sky, (self._map,), self._mirrored[0]),
            (self._front, (self._discs, beside), self._mirrored[1]),
        ):
            if any(a is not b for a, b in zip(mirrored, known, strict=True)):
                light.dull()
        self._mirrored = (self._map,), (self._discs, beside)
        falls = self._discs.irradiance if beside is None else self._discs.irradiance + beside
        sky = self._sky.glossy(eye, self._map.irradiance, strong=self._map.strong)
        front = self._front.glossy(eye, falls, strong=self._discs.strong)
        assert sky is not None
        assert front is not None
        return sky * gain + front

    def warm(self, state: State) -> None:
        """Do once what the first drag would wait for. What is lit stays as it is."""
        self._small_map(sky_id(state))
        glimmer = Disc((0.0, 1.0, 0.0), 20.0, (1.0, 1.0, 1.0))
        known = self._front.environment
        for discs in ((*known.discs, glimmer), known.discs):
            self._front.environment = self._dark.with_discs(discs[-MOST_DISCS:])

    # ---- The map -----------------------------------------------------------------------------------------

    def _coarse_map(self, key: _MapKey) -> Lit:
        """The map at low resolution, no lights traced."""
        whole = key.of(turned(self._small_map(key.name), key.rotation_deg))
        cube = whole.cube(min(_COARSE_RESOLUTION, self._sky.resolution))
        self._sky.light(Environment.from_cube(cube), trace_strong=False)
        return Lit(key, self._sky.clustered_irradiance, exact=False)

    def _small_map(self, name: str) -> Environment:
        if self._small is None or self._small[0] != name:
            self._small = name, small(self._environments.open(name, roughly=True))
        return self._small[1]

    def _exact_map(self, key: _MapKey, *, check: Callable[[], None]) -> Lit:
        environment = key.of(self._environments.open(key.name).rotated(key.rotation_deg))
        check()
        self._sky.light(environment, trace_strong=True)
        check()
        if self._sky.last.kind != "full":  # increments remember what they came from
            self._sky.refresh()
        strong = self._sky.strong_lights
        irradiance = self._sky.clustered_irradiance
        self._add_traced(irradiance, strong, check=check)
        return Lit(key, irradiance, exact=True, strong=strong)

    # ---- The discs ---------------------------------------------------------------------------------------

    def _coarse_discs(self, discs: tuple[Disc, ...]) -> Lit:
        self._front.environment = self._dark.with_discs(discs)
        return Lit(discs, self._front.clustered_irradiance if discs else self._no_light, exact=not discs)

    def _exact_discs(self, discs: tuple[Disc, ...], *, check: Callable[[], None]) -> Lit:
        """Small strong discs by rays, the others from nothing, so that no increment is left of what was before."""
        total = sum((disc.total for disc in discs), np.zeros(3))
        strong, others = strong_discs(discs, total, self._front.resolution)
        if not self._can_trace:
            strong, others = strong.chosen([]), list(discs)
        self._front.environment = self._dark.with_discs(())
        self._front.environment = self._dark.with_discs(others)
        irradiance = self._front.clustered_irradiance if others else self._no_light.copy()
        self._add_traced(irradiance, strong, check=check)
        return Lit(discs, irradiance, exact=True, strong=strong)

    @property
    def _can_trace(self) -> bool:
        """The rows that a fixed eye sees need the renderer for it."""
        return self._front.can_trace

    def _add_traced(
        self, irradiance: Float32[np.ndarray, "rows 3"], lights: StrongLights, *, check: Callable[[], None]
    ) -> None:
        for first in range(0, len(lights), _TRACED_AT_ONCE):
            check()
            some = lights.chosen(range(first, min(first + _TRACED_AT_ONCE, len(lights))))
            irradiance += self._sky.traced_radiance(some, irradiance=True)

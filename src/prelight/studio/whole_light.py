"""The light of a bake with layers of several kinds: what each brings is added.

The environment goes the quick way (``light``) where a layer of that kind takes it; what other layers take of the rig
(lamps, a sky without such a layer) they are given as a rig, and only when it has changed.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

import numpy as np

from ..arrays import Radiance
from ..errors import InputError
from ..lighting.environment import Environment
from ..lighting.rig import Rig
from ..relighting.lit_bake import LitBake
from ..storage.bake import Bake
from .environments import Environments, small
from .kinds import PORTALS, quick_layers, takes_of, vertex_kinds
from .light import Light, Packer
from .placed import placed_track_of, set_glass
from .protocol import LayerPace, State
from .rig_state import lit_discs, sky_id

_DARK = Environment.dark()


class Lighting(Protocol):
    """What a session lights: the rows of a bake. Owned by one thread."""

    @property
    def rows(self) -> int: ...

    @property
    def layers(self) -> tuple[LayerPace, ...]:
        """What each layer did at the last ``relight``."""
        ...

    def relight(self, state: State, *, exact: bool, check: Callable[[], None]) -> tuple[bool, str, int]: ...

    def frame(self, state: State) -> bytearray: ...

    def warm(self, state: State) -> None: ...


def lighting_of(bake: Bake, environments: Environments) -> Lighting:
    """The quick one for a bake that has an environment layer alone. Raises InputError, DamagedBakeError."""
    kinds = vertex_kinds(bake)
    return Light(bake, environments) if kinds == {"environment"} else WholeLight(bake, environments)


class WholeLight:
    """A ``Lighting`` over every layer of vertices. Raises as ``LitBake``."""

    def __init__(self, bake: Bake, environments: Environments) -> None:
        self._environments = environments
        quick = quick_layers(bake)
        self._quick = Light(bake, environments) if quick else None
        if any(bake.layers[name].camera is not None for name in quick):
            what = f"its layer {quick[0]!r} is for one eye, and adds to no other"
            raise InputError(bake.path, what + "; open a bake with that layer alone")
        steerable = tuple(name for name, record in bake.layers.items() if record.kind == "steerable")
        self._lit = LitBake(bake, without=(*quick, *steerable))
        self._takes_lamps = "lamps" in takes_of(bake)
        self._takes_glass = PORTALS in vertex_kinds(bake)
        self._no_light = np.zeros((len(bake.receivers), 3), np.float32)
        self._key: object = None
        self._brought: Radiance = self._no_light
        self._sky: tuple[object, Environment] | None = None
        self._packer = Packer()
        self._layers: tuple[LayerPace, ...] = ()

    @property
    def rows(self) -> int:
        return len(self._no_light)

    @property
    def layers(self) -> tuple[LayerPace, ...]:
        return self._layers

    def relight(self, state: State, *, exact: bool, check: Callable[[], None]) -> tuple[bool, str, int]:
        """Make the light that of a state: whether it is exact now, how it was made, how many lights are traced.

        Raises InputError for what a layer cannot carry, and what ``check`` raises.
        """
        is_exact, how, strong, told = True, "none", 0, ()
        if self._quick is not None:
            is_exact, how, strong = self._quick.relight(state, exact=exact, check=check)
            told = self._quick.layers
        check()
        lamps = state.lamps if self._takes_lamps else ()
        sky = None if self._quick is not None else self._sky_key(state, exact=exact)
        glass = state.glass if self._takes_glass else ()
        if (lamps, sky, glass) != self._key:
            began = time.perf_counter()
            tracks = tuple(placed_track_of(lamp) for lamp in lamps if lamp.on and lamp.dim > 0)
            environment = _DARK if sky is None else self._sky_of(state, sky)
            self._lit.light(Rig(environment, lamps=tracks, portals=tuple(map(set_glass, glass))))
            self._brought, self._key = self._lit.irradiance, (lamps, sky, glass)
            how = self._lit.layers[0].last.kind if how in ("none", "gain") else how
            took = (time.perf_counter() - began) * 1e3
            told += tuple(
                LayerPace(
                    layer.name, _kind(self._lit, layer.name), layer.last.kind, _ms(layer.last.milliseconds)
                )
                for layer in self._lit.layers
            )
            told += (LayerPace("sum", "", "all layers", _ms(took)),) if len(self._lit.layers) > 1 else ()
        self._layers = told
        return is_exact and (sky is None or sky[-1]), how, strong

    def frame(self, state: State) -> bytearray:
        """The light that is there as a radiance frame; its header is left empty."""
        if self._quick is not None:
            return self._quick.frame(state, beside=self._brought)
        return self._packer(self._no_light, np.ones(3, np.float32), self._brought)

    def warm(self, state: State) -> None:
        """Do once what the first drag would wait for."""
        if self._quick is not None:
            self._quick.warm(state)

    def _sky_key(self, state: State, *, exact: bool) -> tuple:
        """Of the environment as a rig has it; the last says whether it is the exact one."""
        name = sky_id(state)
        known = (name, state.rotation_deg, state.scale, state.tint, lit_discs(state))
        is_lit = isinstance(self._key, tuple) and self._key[1] == (*known, True)
        return (*known, exact or is_lit)

    def _sky_of(self, state: State, key: tuple) -> Environment:
        if self._sky is None or self._sky[0] != key:
            whole = self._environments.open(sky_id(state))
            base = whole if key[-1] else small(whole)
            turned = base.rotated(state.rotation_deg).scaled(state.scale).tinted(state.tint)
            self._sky = key, turned.with_discs([*turned.discs, *lit_discs(state)])
        return self._sky[1]


def _kind(lit: LitBake, name: str) -> str:
    return lit.bake.layers[name].kind


def _ms(value: float) -> float:
    return round(value, 2)

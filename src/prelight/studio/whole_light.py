"""The light of a bake with layers of several kinds: what each brings is added.

The environment goes the quick way (``light``) where a layer of that kind takes it; what other layers take of the rig
(lamps, a sky without such a layer) they are given as a rig, and only when it has changed.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ..arrays import Radiance, UInt32
from ..errors import InputError
from ..lighting.environment import Environment
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from ..relighting.lit_bake import LitBake
from ..relighting.placed_direct import SHADOW_RAYS
from ..relighting.stored_steerable import steerable_names
from ..relighting.transfer import TransferRelighter
from ..storage.bake import Bake
from .environments import Environments, map_directions, small, words_of_map
from .frames import HEADER_BYTES, WORLD_HEIGHT, WORLD_WIDTH
from .kinds import PORTALS, glossy, quick_layers, takes_of, vertex_kinds
from .light import Light, Packer
from .placed import layered_tracks, placed_track_of, set_glass
from .protocol import State
from .protocol_values import LampLight, LayerPace
from .rig_state import lit_discs, sky_id

_FEW_SHADOW_RAYS = 2  # while a lamp is dragged
_DARK = Environment.dark()
_EVEN = np.ones(3, np.float32)
_FADE = 0.1  # seconds, of a cloud's lights that a moving lamp loses sight of
_MAP_DIRECTIONS = map_directions(WORLD_HEIGHT, WORLD_WIDTH)


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

    def view(self, state: State, eye: Triple) -> View: ...


@dataclass(frozen=True)
class View:
    """What depends on the eye: what vertices (V, 4) add toward it, in half floats, the fourth unused; and a map."""

    shine: np.ndarray | None
    world: UInt32[np.ndarray, "texels"] | None


_NOTHING = View(None, None)
_LARGEST_HALF = 6e4


def halves(radiance: Radiance) -> np.ndarray:
    """(V, 4) half floats of three numbers."""
    out = np.zeros((len(radiance), 4), np.float16)
    out[:, :3] = np.clip(radiance, -_LARGEST_HALF, _LARGEST_HALF)
    return out


def lighting_of(bake: Bake, environments: Environments) -> Lighting:
    """The quick one for a bake that has an environment layer alone. Raises InputError, DamagedBakeError."""
    kinds = vertex_kinds(bake)
    alone = kinds == {"environment"} and not steerable_names(bake)
    return SkyLight(bake, environments) if alone else WholeLight(bake, environments)


class SkyLight(Light):
    """A ``Lighting`` of an environment layer alone."""

    def view(self, state: State, eye: Triple) -> View:
        """What its glossy rows add toward a point."""
        shine = self.glossy(state, eye)
        return _NOTHING if shine is None else View(halves(shine), None)


class WholeLight:
    """A ``Lighting`` over every layer of vertices. Raises as ``LitBake``."""

    def __init__(self, bake: Bake, environments: Environments) -> None:
        self._environments = environments
        quick = quick_layers(bake)
        self._quick = Light(bake, environments) if quick else None
        if any(bake.layers[name].camera is not None for name in quick):
            what = f"its layer {quick[0]!r} is for one eye, and adds to no other"
            raise InputError(bake.path, what + "; open a bake with that layer alone")
        self._lit = LitBake(bake, without=quick, fade=_FADE)
        takes = takes_of(bake)
        self._takes_lamps, self._takes_sky = "lamps" in takes, "environment" in takes
        self._takes_glass = PORTALS in vertex_kinds(bake)
        self._has_gloss = glossy(bake)
        pixels = 0 if self._lit.steered is None else self._lit.steered.size[0] * self._lit.steered.size[1]
        self._no_light = np.zeros((len(bake.receivers), 3), np.float32)
        self._no_pixels = np.zeros((pixels, 3), np.float32)
        self._key: object = None
        self._brought: Radiance = self._no_light
        self._sky: tuple[object, Environment] | None = None
        self._packer = Packer()
        self._layers: tuple[LayerPace, ...] = ()

    @property
    def rows(self) -> int:
        return len(self._no_light) + len(self._no_pixels)

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
        lamps = tuple(lamp for lamp in state.lamps if lamp.layer is None) if self._takes_lamps else ()
        steered = tuple(lamp for lamp in state.lamps if lamp.layer is not None)
        sky = self._sky_key(state, exact=exact) if self._takes_sky and self._quick is None else None
        glass = state.glass if self._takes_glass else ()
        world = (state.world, state.seconds) if self._takes_glass and state.world is not None else None
        fine = self._fine(lamps, exact=exact)
        if self._lit.is_settling or (lamps, sky, glass, world, steered, fine) != self._key:
            began = time.perf_counter()
            tracks = tuple(placed_track_of(lamp) for lamp in lamps if lamp.on and lamp.dim > 0)
            environment = _DARK if sky is None else self._sky_of(state, sky)
            rig = Rig(environment, layered_tracks(steered), tracks, portals=tuple(map(set_glass, glass)))
            if world is not None:
                rig = replace(rig, outside=self._environments.worlds.open(world[0]), seconds=world[1])
            for layer in self._lit.layers:
                if isinstance(layer, TransferRelighter):
                    layer.shadow_rays, layer.coarse = SHADOW_RAYS if fine else _FEW_SHADOW_RAYS, not fine
            self._lit.light(rig)
            self._brought, self._key = self._lit.irradiance, (lamps, sky, glass, world, steered, fine)
            if how in ("none", "gain"):
                how = self._lit.layers[0].last.kind if self._lit.layers else "steered"
            took = (time.perf_counter() - began) * 1e3
            told += tuple(
                LayerPace(
                    layer.name, _kind(self._lit, layer.name), layer.last.kind, _ms(layer.last.milliseconds)
                )
                for layer in self._lit.layers
            )
            told += (LayerPace("sum", "", "all layers", _ms(took)),) if len(self._lit.layers) > 1 else ()
        self._layers = told
        is_exact = is_exact and fine and not self._lit.is_settling and (sky is None or sky[-1])
        return is_exact, how, strong

    def frame(self, state: State) -> bytearray:
        """The light that is there as a radiance frame; its header is left empty."""
        if self._quick is not None:
            rows = self._quick.frame(state, beside=self._brought)
        else:
            rows = self._packer(self._no_light, _EVEN, self._brought)
        if self._lit.steered is None:
            return rows
        seen = np.maximum(self._lit.steered.radiance, 0)
        return rows + self._packer(self._no_pixels, _EVEN, seen)[HEADER_BYTES:]

    def warm(self, state: State) -> None:
        """Do once what the first drag would wait for."""
        if self._quick is not None:
            self._quick.warm(state)

    def view(self, state: State, eye: Triple) -> View:
        """What the light that is there adds toward a point, and what is outside as it is seen from there."""
        shine = self._quick.glossy(state, eye, beside=self._brought) if self._quick is not None else None
        more = self._lit.glossy(eye) if self._has_gloss else None
        if shine is not None and more is not None:
            shine = shine + more
        shine = more if shine is None else shine
        seen = None
        if self._takes_glass and state.world is not None:
            seen = words_of_map(self._lit.behind(eye)(_MAP_DIRECTIONS))
        return View(None if shine is None else halves(shine), seen)

    def _fine(self, lamps: tuple[LampLight, ...], *, exact: bool) -> bool:
        """Whether lamps have all their shadow rays: at rest, and where they did not move."""
        is_lit = isinstance(self._key, tuple) and self._key[0] == lamps and self._key[-1]
        return exact or is_lit or not any(lamp.on and lamp.dim > 0 for lamp in lamps)

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

"""The light of a bake with layers of several kinds: what each brings is added.

The environment goes the quick way (``light``) where a layer of that kind takes it; what other layers take of the rig
(lamps, a sky without such a layer) they are given as a rig, and only when it has changed.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..arrays import Radiance
from ..lighting.environment import Environment
from ..lighting.quantities import Triple
from ..lighting.resampling import remember_turns
from ..lighting.rig import Rig
from ..relighting.lit_bake import LitBake
from ..storage.bake import Bake
from .environments import Environments, map_directions, small, turned, words_of_map
from .frames import HEADER_BYTES, WORLD_HEIGHT, WORLD_WIDTH
from .kinds import PORTALS, glossy, quick_layers, takes_of, vertex_kinds
from .light import Light, Packer
from .lit_rows import View, halves
from .placed import layered_tracks, placed_track_of, set_glass
from .protocol import State
from .protocol_values import LayerPace
from .rig_state import lit_discs, painted, sky_id

_DARK = Environment.dark()
_EVEN = np.ones(3, np.float32)
_FADE = 0.1  # seconds, of a cloud's lights that a moving lamp loses sight of
_MAP_DIRECTIONS = map_directions(WORLD_HEIGHT, WORLD_WIDTH)


class WholeLight:
    """A ``Lighting`` over every layer of vertices. Raises as ``LitBake``."""

    def __init__(self, bake: Bake, environments: Environments) -> None:
        self._environments = environments
        quick = quick_layers(bake)
        self._quick = Light(bake, environments) if quick else None
        self._lit = LitBake(bake, without=quick, fade=_FADE)
        takes = takes_of(bake)
        self._takes_lamps, self._takes_sky = "lamps" in takes, "environment" in takes
        self._takes_glass = PORTALS in vertex_kinds(bake)
        self._has_gloss = glossy(bake)
        pixels = self._lit.size[0] * self._lit.size[1] if self._lit.has_pixels else 0
        self._no_light = np.zeros((len(bake.receivers), 3), np.float32)
        self._no_pixels = np.zeros((pixels, 3), np.float32)
        self._key: object = None
        self._is_warm = False  # before, coarse would take longer than exact
        self._brought: Radiance = self._no_light
        self._sky: tuple[object, Environment] | None = None
        self._coarse_map: tuple[Environment, Environment] | None = None
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
        key = (lamps, sky, glass, world, steered)
        if self._lit.is_settling or key != self._key or (exact and self._lit.is_coarse):
            began = time.perf_counter()
            tracks = tuple(placed_track_of(lamp) for lamp in lamps if lamp.on and lamp.dim > 0)
            environment = _DARK if sky is None else self._sky_of(state, sky)
            rig = Rig(environment, layered_tracks(steered), tracks, portals=tuple(map(set_glass, glass)))
            if world is not None:
                rig = replace(rig, outside=self._environments.worlds.open(world[0]), seconds=world[1])
            self._key = None  # should it be given up
            self._lit.light(rig, coarse=self._is_warm and not exact, check=check)
            self._brought, self._key = self._lit.irradiance, key
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
        settled = not self._lit.is_coarse and not self._lit.is_settling
        is_exact = is_exact and settled and (sky is None or sky[-1])
        return is_exact, how, strong

    def frame(self, state: State) -> bytearray:
        """The light that is there as a radiance frame; its header is left empty."""
        if self._quick is not None:
            rows = self._quick.frame(state, beside=self._brought)
        else:
            rows = self._packer(self._no_light, _EVEN, self._brought)
        if not self._lit.has_pixels:
            return rows
        return rows + self._packer(self._no_pixels, _EVEN, self._lit.pixel_radiance)[HEADER_BYTES:]

    def warm(self, state: State) -> None:
        """Do once what the first drag would wait for."""
        self._lit.warm()
        self._is_warm = True
        if self._quick is not None:
            self._quick.warm(state)
        if self._takes_sky and self._quick is None:
            coarse = self._small(self._environments.open(sky_id(state)))
            for layer in self._lit.layers:
                if (side := getattr(layer, "quick_side", None)) is not None:
                    remember_turns(*coarse.pixels.shape[:2], side)

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

    def _sky_key(self, state: State, *, exact: bool) -> tuple:
        """Of the environment as a rig has it; the last says whether it is the exact one."""
        name = sky_id(state)
        known = (name, state.rotation_deg, state.scale, state.tint, state.paint, lit_discs(state))
        is_lit = self._sky is not None and self._sky[0] == (*known, True)
        return (*known, exact or is_lit)

    def _small(self, whole: Environment) -> Environment:
        if self._coarse_map is None or self._coarse_map[0] is not whole:
            self._coarse_map = whole, small(whole)
        return self._coarse_map[1]

    def _sky_of(self, state: State, key: tuple) -> Environment:
        if self._sky is None or self._sky[0] != key:
            whole = self._environments.open(sky_id(state), roughly=not key[-1])
            degrees = state.rotation_deg
            base = whole.rotated(degrees) if key[-1] else turned(self._small(whole), degrees)
            base = painted(base.scaled(state.scale).tinted(state.tint), state.paint)
            self._sky = key, base.with_discs([*base.discs, *lit_discs(state)])
        return self._sky[1]


def _kind(lit: LitBake, name: str) -> str:
    return lit.bake.layers[name].kind


def _ms(value: float) -> float:
    return round(value, 2)

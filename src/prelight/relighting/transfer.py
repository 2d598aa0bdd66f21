"""Relighting a transfer layer: any light, anywhere, now.

Each light by itself: its direct light at the vertices (closed forms, and rays for what is in the way), what bounces of
it, both for colour 1. A light that moves is made anew; one that changes its colour is multiplied; what stays, stays.
"""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Float32, Normals, Positions, Radiance, Triangles
from ..drawing.view import View
from ..lighting.environment import Environment
from ..lighting.placed_lights import Lamp, PlacedLight, PlacedPanel
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from ..storage.bake import Bake
from .direct_to_indirect import AtStandIns
from .environment import Update
from .pixel_light import PointLit
from .placed_caustics import PlacedCaustics
from .placed_direct import SHADOW_RAYS, PlacedDirect, white
from .placed_gloss import PlacedGloss
from .sky_direct import QUICK_SIDE, SkyDirect
from .stand_ins import Detail, StandIns
from .stored_transfer import open_transfer

_REMEMBERED = 8  # lights that were lit, and may come back
_FEW_RAYS = 2  # from each vertex to a light that is dragged


@dataclass(frozen=True)
class _Brought:
    """What one light of colour 1 brings to the vertices, (V, 3) each, irradiance / π."""

    direct: Radiance
    bounced: Radiance
    sent_on: Radiance | None  # by glass and mirrors
    inside: bool  # a solid
    rays: float = math.inf  # to it, from each vertex
    coarse: bool = False  # found while a hand drags

    @property
    def indirect(self) -> Radiance:
        return self.bounced if self.sent_on is None else self.sent_on + self.bounced


class TransferRelighter:
    """A ``LiveLayer`` of lights with a place in the scene, and of an environment where nothing else takes it.

    Parameters
    ----------
    bake
        A ``Bake`` or the path of one.
    name
        Of its transfer layer; the first if not given.
    shadow_rays
        From each vertex to each light that is not a point; 16 for what moves, more for a still picture.

    Raises
    ------
    InputError, DamagedBakeError
        There is no bake, it has no such layer, or it is damaged.
    MissingExtraError
        The renderer is not installed, which traces the shadows.
    """

    quick_side = QUICK_SIDE  # of a sky's cube map, while a hand drags

    def __init__(
        self, bake: Bake | str | Path, name: str | None = None, *, shadow_rays: int = SHADOW_RAYS
    ) -> None:
        self.bake = bake if isinstance(bake, Bake) else Bake.open(bake)
        layer = open_transfer(self.bake, name)
        self.name, self._indirect = layer.name, layer.indirect
        self._placed = PlacedDirect(self.bake, layer.origins, shadow_rays=shadow_rays)
        self._sky = SkyDirect(self.bake, layer.origins, self._placed)
        self._gloss = PlacedGloss.of(self.bake, layer.name, self._placed)
        self._caustics = PlacedCaustics(self.bake) if layer.caustics else None
        self._known: OrderedDict[PlacedLight, _Brought] = OrderedDict()
        self._lit: list[tuple[PlacedLight, PlacedLight]] = []  # each light, and itself of colour 1
        self._environment: tuple[Environment, _Brought] | None = None
        self._is_behind = False  # lights were made, and the answer given up before it was told
        self._few: tuple[StandIns, AtStandIns] | None = None
        self._few_rays = self._placed.with_rays(_FEW_RAYS)
        self._detail: tuple[_Brought, Detail] | None = None
        self.last = Update("none", 0.0, 0, 0)

    @property
    def shadow_rays(self) -> int:
        """From each vertex to each light that is not a point. Lights that were made with more stay as they are."""
        return self._placed.shadow_rays

    @shadow_rays.setter
    def shadow_rays(self, rays: int) -> None:
        self._placed.shadow_rays = rays

    def light(
        self, rig: Rig, *, coarse: StandIns | None = None, check: Callable[[], None] = lambda: None
    ) -> bool:
        """Take the rig's lamps, as they are at its beginning, and its environment; True if something changed.

        ``coarse``: what is new has two shadow rays, and what bounces of it more than once comes by modes, all of it at
        stand-ins; of the sky direct light too.
        """
        return self.shine(rig.lamps_at(0.0), rig.environment, coarse=coarse, check=check)

    def shine(
        self,
        lights: Iterable[PlacedLight],
        environment: Environment | None = None,
        *,
        coarse: StandIns | None = None,
        check: Callable[[], None] = lambda: None,
    ) -> bool:
        """Be lit by these lights and nothing else; True if that is a change. Lights of colour 0 take no time."""
        began = time.perf_counter()
        lit = [(light, white(light)) for light in lights if max(light.colour) > 0]
        missing = dict.fromkeys(key for _, key in lit if not self._has(key, coarse))
        was_behind, self._is_behind = self._is_behind, self._is_behind or bool(missing)
        for key in missing:
            check()
            self._known[key] = self._found(key, check) if coarse is None else self._roughly(key, coarse)
        check()
        sky = self._sky_of(environment, coarse, check)
        new = len(missing) + (sky is not self._environment and sky is not None)
        changed = was_behind or bool(missing) or lit != self._lit or sky is not self._environment
        self._lit, self._environment, self._is_behind = lit, sky, False
        if changed and self._gloss is not None:
            self._gloss.forget()
        self._forget()
        kind = "none" if not changed else "full" if new == len(lit) + (sky is not None) else "local"
        took = (time.perf_counter() - began) * 1e3
        self.last = Update(kind, took, new * self._indirect.bytes, new)
        return changed

    @property
    def is_coarse(self) -> bool:
        """Whether some of its lights were made while a hand dragged."""
        sky = self._environment is not None and self._environment[1].coarse
        return sky or any(self._known[key].coarse for _, key in self._lit)

    def warm(self, places: StandIns) -> None:
        """Make ready what the first drag would wait for."""
        if self._few is None or self._few[0] is not places:
            self._few = places, AtStandIns(self._indirect, places)

    def _has(self, key: PlacedLight, coarse: StandIns | None) -> bool:
        """Whether there is no need to make a light."""
        known = self._known.get(key)
        return known is not None and (
            coarse is not None or (not known.coarse and known.rays >= self._placed.shadow_rays)
        )

    def _found(self, key: PlacedLight, check: Callable[[], None]) -> _Brought:
        """A light, exactly."""
        inside = self._placed.is_inside(key)
        sent_on = None if inside else self._sent_on(key, self._placed)
        direct = self._placed.of(key)
        check()
        bounced = self._indirect.bounced(direct if sent_on is None else direct + sent_on, check=check)
        is_exact = isinstance(key, Lamp) and key.radius == 0 and sent_on is None
        rays = math.inf if is_exact else self._placed.shadow_rays
        return _Brought(direct, bounced, sent_on, inside, rays)

    def _roughly(self, key: PlacedLight, places: StandIns) -> _Brought:
        """A light while it is dragged; the detail between stand-ins is that of an exact one, so the first is exact."""
        before = [(known.position, found) for known, found in self._known.items()
                  if type(known) is type(key) and not found.coarse]  # fmt: skip
        if not before:
            return self._found(key, lambda: None)
        near = min(before, key=lambda one: math.dist(one[0], key.position))[1]
        inside = self._placed.is_inside(key)
        sent_on = None if inside else self._sent_on(key, self._few_rays)
        direct = self._few_rays.of(key)
        bounced = self._spread(direct if sent_on is None else direct + sent_on, places, near)
        return _Brought(direct, bounced, sent_on, inside, coarse=True)

    def _spread(self, light: Radiance, places: StandIns, before: _Brought | None) -> Radiance:
        """(V, 3) what bounces of light, from the stand-ins."""
        self.warm(places)
        assert self._few is not None  # made by warm
        if before is not None and (self._detail is None or self._detail[0] is not before):
            self._detail = before, places.detail(before.bounced)  # caustics go where the light goes
        detail = None if before is None or self._detail is None else self._detail[1]
        return places.spread(self._few[1].bounced(light), detail)

    def _sky_of(
        self, environment: Environment | None, coarse: StandIns | None, check: Callable[[], None]
    ) -> tuple[Environment, _Brought] | None:
        if environment is None or not max(environment.total) > 0:
            return None
        known = self._environment
        if known is not None and known[0] is environment and (coarse is not None or not known[1].coarse):
            return known
        if coarse is not None:
            direct = coarse.spread(self._sky.roughly(environment, coarse.rows))
            return environment, _Brought(direct, self._spread(direct, coarse, None), None, False, coarse=True)
        direct = self._sky.of(environment, check=check)
        return environment, _Brought(direct, self._indirect.bounced(direct, check=check), None, False)

    def _sent_on(self, light: PlacedLight, placed: PlacedDirect) -> Radiance | None:
        """What glass and mirrors make of it."""
        if self._caustics is None or not self._caustics.is_there:
            return None
        return self._caustics.of(light, shadow_rays=placed.shadow_rays)

    def _forget(self) -> None:
        """Keep what is lit, and a few exact ones that were: a light that is dragged comes by no place twice."""
        lit = {key for _, key in self._lit}
        for key in [key for key, known in self._known.items() if known.coarse and key not in lit]:
            del self._known[key]
        for key in lit:
            self._known.move_to_end(key)
        while len(self._known) > len(lit) + _REMEMBERED:
            self._known.popitem(last=False)

    @property
    def irradiance(self) -> Radiance:
        """(V, 3) irradiance / π before albedo, every bounce; a copy. Exactly zero where all lights are off."""
        return self._sum("direct", "indirect")

    @property
    def direct(self) -> Radiance:
        """Of ``irradiance``, what comes from the lights themselves."""
        return self._sum("direct")

    @property
    def indirect(self) -> Radiance:
        """Of ``irradiance``, what has bounced, or what glass and mirrors sent."""
        return self._sum("indirect")

    @property
    def lamp_light(self) -> Radiance:
        """Of ``direct``, what comes from lights with a place in the scene."""
        return self._sum("direct", sky=False)

    def lamp_light_at(self, points: Positions, normals: Normals, *, shadow_rays: int) -> Radiance:
        """``lamp_light`` at other points (n, 3) of surfaces, with unit normals: irradiance / π."""
        there, out = self._placed.elsewhere(points, normals, shadow_rays=shadow_rays), np.zeros_like(points)
        for light, key in self._lit:
            out += there.of(key) * np.array(light.colour, np.float32)
        return out

    def _sum(self, *parts: str, sky: bool = True) -> Radiance:
        out = np.zeros((len(self.bake.receivers), 3), np.float32)
        for light, key in self._lit:
            factors = np.array(light.colour, np.float32)
            for part in parts:
                out += getattr(self._known[key], part) * factors
        if self._environment is not None and sky:
            for part in parts:
                out += getattr(self._environment[1], part)
        return out

    @property
    def notes(self) -> list[str]:
        """What somebody who lights with these lights should know: those that are inside a solid."""
        return [_told_inside(light) for light, key in self._lit if self._known[key].inside]

    def glossy(self, eye: Triple) -> Radiance | None:
        """(V, 3) what glossy vertices add toward a point; None where the layer was baked without."""
        return None if self._gloss is None else self._gloss.toward(eye, self.irradiance, *self._shown)

    def drawn_gloss(
        self, view: View, triangles: Triangles, *, eye: Triple, fine: bool
    ) -> Float32[np.ndarray, "height width 3"] | None:
        """The same as ``view`` sees it of ``triangles``, pixel by pixel."""
        if self._gloss is None:
            return None
        return self._gloss.drawn(view, triangles, self.irradiance, *self._shown, eye=eye, fine=fine)

    @property
    def glossy_milliseconds(self) -> float:
        """What the gloss of the last change of light took, once it was looked at; 0 where there is none."""
        return 0.0 if self._gloss is None else self._gloss.milliseconds

    @property
    def _shown(self) -> tuple[list[tuple[PlacedLight, Triple]], Environment | None]:
        """Lights of colour 1 with their colours, and the sky."""
        sky = None if self._environment is None else self._environment[0]
        return [(key, light.colour) for light, key in self._lit], sky

    @property
    def point_lit(self) -> PointLit | None:
        """Its lamps, at any point."""
        return self if self._lit else None


def _told_inside(light: PlacedLight) -> str:
    kind = "panel" if isinstance(light, PlacedPanel) else "lamp"
    named = f"{kind} {light.name!r:.60}" if light.name else f"a {kind}"
    x, y, z = light.position
    return f"{named} at ({x:g}, {y:g}, {z:g}) is inside a solid, which keeps its light; move it out"

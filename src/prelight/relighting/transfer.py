"""Relighting a transfer layer: any light, anywhere, now.

Each light by itself: its direct light at the vertices (closed forms, and rays for what is in the way), what bounces of
it, both for colour 1. A light that moves is made anew; one that changes its colour is multiplied; what stays, stays.
"""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..arrays import Float32, Normals, Positions, Radiance, Triangles
from ..drawing.view import View
from ..lighting.environment import Environment
from ..lighting.placed_lights import Lamp, PlacedLight, PlacedPanel
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from ..storage.bake import Bake
from .environment import Update
from .pixel_light import PointLit
from .placed_caustics import PlacedCaustics
from .placed_direct import SHADOW_RAYS, PlacedDirect, white
from .placed_gloss import PlacedGloss
from .sky_direct import SkyDirect
from .stored_transfer import open_transfer

_REMEMBERED = 8  # lights that were lit, and may come back


@dataclass(frozen=True)
class _Brought:
    """What one light of colour 1 brings to the vertices, (V, 3) each, irradiance / π."""

    direct: Radiance
    indirect: Radiance
    inside: bool  # a solid
    rays: float = math.inf  # to it, from each vertex
    coarse: bool = False


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

    Attributes
    ----------
    coarse
        Leave what bounces more than once to the modes, in half of the time: for a light while it moves. Lights that
        were made so are made anew when this is False again.

    Raises
    ------
    InputError, DamagedBakeError
        There is no bake, it has no such layer, or it is damaged.
    MissingExtraError
        The renderer is not installed, which traces the shadows.
    """

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
        self.last = Update("none", 0.0, 0, 0)
        self.coarse = False

    @property
    def shadow_rays(self) -> int:
        """From each vertex to each light that is not a point. Lights that were made with more stay as they are."""
        return self._placed.shadow_rays

    @shadow_rays.setter
    def shadow_rays(self, rays: int) -> None:
        self._placed.shadow_rays = rays

    def light(self, rig: Rig) -> bool:
        """Take the rig's lamps, as they are at its beginning, and its environment; True if something changed."""
        return self.shine(rig.lamps_at(0.0), rig.environment)

    def shine(self, lights: Iterable[PlacedLight], environment: Environment | None = None) -> bool:
        """Be lit by these lights and nothing else; True if that is a change. Lights of colour 0 take no time."""
        began = time.perf_counter()
        lit = [(light, white(light)) for light in lights if max(light.colour) > 0]
        rays = self._placed.shadow_rays
        missing = dict.fromkeys(
            key for _, key in lit if key not in self._known or not self._is_enough(self._known[key], rays)
        )
        for key in missing:
            inside = self._placed.is_inside(key)
            sent_on = None if inside else self._sent_on(key)
            found = self._brought(self._placed.of(key), sent_on, inside=inside)
            is_exact = isinstance(key, Lamp) and key.radius == 0 and sent_on is None
            self._known[key] = found if is_exact else replace(found, rays=rays)
        sky = self._sky_of(environment)
        new = len(missing) + (sky is not self._environment and sky is not None)
        changed = bool(missing) or lit != self._lit or sky is not self._environment
        self._lit, self._environment = lit, sky
        if changed and self._gloss is not None:
            self._gloss.forget()
        self._forget()
        kind = "none" if not changed else "full" if new == len(lit) + (sky is not None) else "local"
        took = (time.perf_counter() - began) * 1e3
        self.last = Update(kind, took, new * self._indirect.bytes, new)
        return changed

    def _sky_of(self, environment: Environment | None) -> tuple[Environment, _Brought] | None:
        if environment is None or not max(environment.total) > 0:
            return None
        known = self._environment
        if known is not None and known[0] is environment and self._is_enough(known[1]):
            return known
        return environment, self._brought(self._sky.of(environment))

    def _sent_on(self, light: PlacedLight) -> Radiance | None:
        """What glass and mirrors make of it."""
        if self._caustics is None or not self._caustics.is_there:
            return None
        return self._caustics.of(light, shadow_rays=self._placed.shadow_rays)

    def _is_enough(self, known: _Brought, rays: float = 0.0) -> bool:
        return known.rays >= rays and (self.coarse or not known.coarse)

    def _brought(
        self, direct: Radiance, sent_on: Radiance | None = None, *, inside: bool = False
    ) -> _Brought:
        if sent_on is None:
            bounced = self._indirect.bounced(direct, coarse=self.coarse)
        else:
            bounced = sent_on + self._indirect.bounced(direct + sent_on, coarse=self.coarse)
        return _Brought(direct, bounced, inside, coarse=self.coarse)

    def _forget(self) -> None:
        """Keep what is lit, and a few that were."""
        for _, key in self._lit:
            self._known.move_to_end(key)
        most = len({key for _, key in self._lit}) + _REMEMBERED
        while len(self._known) > most:
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

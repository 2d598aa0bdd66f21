"""Suns through portals, exactly: shadow rays from the receivers at run time in place of a few cells of a cube map.

A sun is a hundredth of a cell wide; the cell would blur its patch by degrees. A receiver sees points spread over the
disc, each through one pane of the room or not at all; few receivers do, and only they send rays into the scene. What a
sun of strength one brings through each pane is kept, so glass changes without a ray.

What bounces is all that falls, between vertices too: points spread over the surfaces tell it (``SurfacePoints``).
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Float32, Float64, Int32, Normals, Positions, Radiance, Triangles
from ..lighting.disc import Disc
from .portal_openings import Openings
from .portal_sun_rays import Seen, SunRays, SurfacePoints, axes_around

if TYPE_CHECKING:
    from .portal_sun_caustics import PortalSunCaustics

POINTS, MOST_POINTS = 32, 128  # over a disc: up to a degree, and of a larger one
_SELDOM = 4  # one of so many of these points, while a hand drags
_WIDE_DEG = 1.0
_KEPT = 16  # units that are remembered, up to three of a sun


@dataclass(frozen=True)
class Unit:
    """What a disc of total one, ∫ L dω, brings: irradiance / π of some receivers, each through one pane."""

    receiver: Int32[np.ndarray, "n"]
    pane: Int32[np.ndarray, "n"]
    weight: Float32[np.ndarray, "n"]

    def onto(self, total: Radiance, colours: Float64[np.ndarray, "panes 3"]) -> None:
        """Add it to (V, 3), through panes that let so much of the sun through."""
        light = self.weight[:, None] * colours[self.pane].astype(np.float32)
        np.add.at(total, self.receiver, light)


class PortalSuns:
    """Rays to suns from the receivers of a room.

    Parameters
    ----------
    openings
        Of the bake.
    triangles, normals
        The scene's, ``(F, 3)`` and ``(V, 3)``; receivers of normal zero get no light.
    positions
        ``(V, 3)``, of the triangles' corners.
    sent_on
        What glass and mirrors in the room send on of suns, if they do.
    """

    def __init__(
        self,
        openings: Openings,
        *,
        positions: Positions,
        triangles: Triangles,
        normals: Normals,
        sent_on: PortalSunCaustics | None = None,
    ) -> None:
        self._sent_on = sent_on
        self._openings, self._positions, self._triangles = openings, positions, triangles
        self._normals = np.ascontiguousarray(normals, np.float32)
        self._known: OrderedDict[tuple, Unit] = OrderedDict()

    @property
    def sends_on(self) -> bool:
        """Whether units have what glass and mirrors in the room send on."""
        return self._sent_on is not None and self._sent_on.is_there

    def unit(self, disc: Disc, *, spread: bool = False, roughly: bool = False) -> Unit:
        """Of a disc, whatever its radiance; ``spread``: of all that falls around vertices, for what bounces.

        ``roughly``: by few rays to the disc, and only what falls on vertices bounces.
        """
        if roughly:
            return self._once(disc, "rough", self._rough)
        units = [self._once(disc, "spread", self._spread) if spread else self.sharp(disc)]
        if not spread and len(self._outside):
            units.append(self._once(disc, "beyond", self._beyond))
        if self._sent_on is not None and self.sends_on:
            units.append(self._once(disc, "sent on", self._caustic))
        parts = ("receiver", "pane", "weight")
        return Unit(*(np.concatenate([getattr(unit, part) for unit in units]) for part in parts))

    def knows(self, disc: Disc) -> bool:
        """Whether a disc has been found exactly, at vertices and around them, and is remembered."""
        return all((*_key(disc), kind) in self._known for kind in ("sharp", "spread"))

    def sharp(self, disc: Disc) -> Unit:
        """Of a disc at receivers through panes, without what glass and mirrors in the room send on."""
        return self._once(disc, "sharp", self._sharp)

    def at(self, disc: Disc, points: Positions, normals: Normals, *, most: int) -> Unit:
        """The same at any points (n, 3) of surfaces, by at most so many rays from each; not remembered."""
        towards = disc_points(disc)
        some = towards[:: max(1, -(-len(towards) // max(most, 1)))]
        return _unit(self._rays.seen(points, normals, some))

    def _once(self, disc: Disc, kind: str, found: Callable[[Disc], Unit]) -> Unit:
        key = (*_key(disc), kind)
        if key not in self._known:
            self._known[key] = found(disc)
        self._known.move_to_end(key)
        while len(self._known) > _KEPT:
            self._known.popitem(last=False)
        return self._known[key]

    def _sharp(self, disc: Disc) -> Unit:
        return _unit(self._rays.seen(self._openings.origins, self._normals, disc_points(disc)))

    def _rough(self, disc: Disc) -> Unit:
        some = disc_points(disc)[::_SELDOM]
        return _unit(self._rays.seen(self._openings.origins, self._normals, some))

    def _spread(self, disc: Disc) -> Unit:
        places, middle = self._surface, axes_around(np.array(disc.direction))[2:]
        own = places.of_triangles(self._rays.may_be_seen(middle[0]), middle[0])
        seen = self._rays.seen(places.origins[own], places.normals[own], middle)
        seen = seen._replace(point=own[seen.point])
        if self._openings.beyond is not None:
            beyond = self._openings.beyond[places.corners].max(axis=1)
            own = np.flatnonzero(beyond >= 0)
            past = self._rays.seen(places.origins[own], places.normals[own], middle, beyond=beyond[own])
            past = past._replace(point=own[past.point])
            seen = Seen(*(np.concatenate(both) for both in zip(seen, past, strict=True)))
        return _unit(places.at_vertices(seen, self._rays.panes))

    def _beyond(self, disc: Disc) -> Unit:
        """Of receivers outside of the glass, what comes to them past it."""
        own, found = self._outside, self._openings
        assert found.beyond is not None  # or none is outside
        towards, beyond = disc_points(disc), found.beyond[own]
        past = self._rays.seen(found.origins[own], self._normals[own], towards, beyond=beyond)
        return _unit(past._replace(point=own[past.point]))

    @cached_property
    def _outside(self) -> Int32[np.ndarray, "some"]:
        beyond = self._openings.beyond
        return np.zeros(0, np.int32) if beyond is None else np.flatnonzero(beyond >= 0).astype(np.int32)

    def _caustic(self, disc: Disc) -> Unit:
        assert self._sent_on is not None  # asked by the caller
        return Unit(*self._sent_on.brought(disc))

    @cached_property
    def _opaque(self) -> Triangles:
        opaque = np.ones(len(self._triangles), bool)
        opaque[self._openings.glass] = False
        return self._triangles[opaque]

    @cached_property
    def _rays(self) -> SunRays:
        corners, pane_of = self._openings.corners, self._openings.pane_of
        return SunRays(corners, pane_of, positions=self._positions, triangles=self._opaque)

    @cached_property
    def _surface(self) -> SurfacePoints:
        return SurfacePoints(self._positions, self._opaque, self._normals)


def _key(disc: Disc) -> tuple:
    return disc.direction, disc.radius_deg, disc.softness


def _unit(seen: Seen) -> Unit:
    return Unit(seen.point.astype(np.int32), seen.pane.astype(np.int32), seen.weight.astype(np.float32))


def disc_points(disc: Disc) -> Float64[np.ndarray, "k 3"]:
    """Unit directions spread over a disc as its light is: each stands for as much of it as any other."""
    count = POINTS if disc.radius_deg <= _WIDE_DEG else MOST_POINTS
    inner, outer = disc.region.depths
    depth = np.linspace(0.0, outer, 4097)
    y = np.clip((depth - inner) / max(outer - inner, 1e-300), 0.0, 1.0)
    share = np.where(depth <= inner, 1.0, 1.0 - y * y * (3.0 - 2.0 * y))
    held = np.concatenate([[0.0], np.cumsum(0.5 * (share[1:] + share[:-1]))])
    # 1 − cos of the angle to the middle
    w = np.interp((np.arange(count) + 0.5) / count, held / held[-1], depth)
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    axes = axes_around(np.array(disc.direction))
    r = np.sqrt(w * (2.0 - w))
    return np.stack([r * np.cos(turn), r * np.sin(turn), 1.0 - w], axis=1) @ axes

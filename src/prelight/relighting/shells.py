"""Shells: the environment as it is seen from a point of a room's windows, the world outside in front of it.

A shell is a cube map in the room's axes (``bases.cube_map``), the mean radiance of each texel: the rig's environment,
and before it what stands outside, as it is at the rig's moment. Where nothing does, it is the environment's own cube.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from ..arrays import CubeMap, Directions, Float32, Float64, Positions, Radiance, Triangles
from ..bases import cube_map
from ..errors import InputError
from ..lighting.disc import Disc, add_discs
from ..lighting.environment import Environment
from ..lighting.outside import Placement
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from ..rays.bodies import NO_LIGHT, Bodies, Body
from .exterior import Exterior, is_sun, sphere, stamps

_SUN_RAYS = 32  # over a disc, to find how much of it is free
_WATCHED = 65  # moments at which the paths are looked at for something inside the room
_ENCLOSED = 0.7  # share of the directions in which a point inside a room meets the room
_AROUND, _MOST_POINTS = 64, 4096


class Shells:
    """Shells of one room under a rig that changes.

    Parameters
    ----------
    positions, triangles
        The room's, ``(V, 3)`` metres and ``(F, 3)``: only to refuse a world that reaches inside it.
    """

    def __init__(self, positions: Positions, triangles: Triangles) -> None:
        self._positions, self._triangles = positions, triangles
        self._environment = Environment.dark()
        self._exterior: Exterior | None = None
        self._stamps: object = None
        self._room = Placement((0.0, 0.0, 0.0), 0.0)
        self._turned: dict[tuple[int, bool], CubeMap] = {}
        self._seen_from_room = self._environment

    @property
    def same_everywhere(self) -> bool:
        """Whether all shells are the same: nothing stands outside."""
        return self._exterior is None

    @property
    def environment(self) -> Environment:
        """What is infinitely far, in the room's axes."""
        return self._seen_from_room

    @property
    def triangles(self) -> int:
        """Of the world outside."""
        return 0 if self._exterior is None else self._exterior.triangles

    def light(self, rig: Rig) -> bool:
        """Take what is outside of ``rig`` at its moment; True if a shell may have changed. Raises InputError."""
        outside, seconds = rig.outside, rig.seconds
        changed = rig.environment is not self._environment
        room = Placement((0.0, 0.0, 0.0), 0.0)
        if outside is None:
            changed |= self._exterior is not None
            self._exterior, self._stamps = None, None
        else:
            wanted = (stamps(outside), outside)
            if self._exterior is None or self._stamps != wanted:
                exterior = Exterior(outside)
                self._check(exterior)
                self._exterior, self._stamps, changed = exterior, wanted, True
            room = outside.room.at(seconds)
            changed |= self._exterior.seconds != seconds and outside.duration > 0
            self._exterior.move(seconds)
            self._exterior.illuminate(rig.environment)
        if rig.environment is not self._environment or room.heading_deg != self._room.heading_deg:
            self._turned = {}
            self._seen_from_room = (
                rig.environment.rotated(room.heading_deg) if room.heading_deg else rig.environment
            )
        changed |= room != self._room
        self._environment, self._room = rig.environment, room
        return changed

    def shell_of(
        self, centre: Triple, resolution: int, *, discs: bool = True, roughly: bool = False
    ) -> CubeMap:
        """What is seen from a point of the room, (6, n, n, 3) in its axes. Not to be written to.

        ``discs``: the environment's small discs, such as the sun, too; as far as nothing outside hides them.
        ``roughly``: with one ray to a texel.
        """
        if self._exterior is None:
            return self._far(resolution, discs=discs)
        samples = 1 if roughly else self._exterior.outside.samples
        seen = self._look(centre, _sample_directions(resolution, samples))
        seen = seen.reshape(6 * resolution * resolution, samples * samples, 4).mean(axis=1)
        seen = seen.reshape(6, resolution, resolution, 4)
        shell = self._far(resolution, discs=False) * (1.0 - seen[..., 3:]) + seen[..., :3]
        if discs:
            add_discs(shell, self.discs_of(centre))
        return shell

    def shells_of(
        self,
        centres: Float32[np.ndarray, "portals 3"],
        resolution: int,
        *,
        discs: bool = True,
        roughly: bool = False,
    ) -> Float32[np.ndarray, "portals 6 row column 3"]:
        """``shell_of`` for several points."""
        out = np.empty((len(centres), 6, resolution, resolution, 3), np.float32)
        for shell, (x, y, z) in zip(out, np.asarray(centres, np.float64).tolist(), strict=True):
            shell[:] = self.shell_of((x, y, z), resolution, discs=discs, roughly=roughly)
        return out

    def discs_of(self, centre: Triple) -> tuple[Disc, ...]:
        """The environment's small discs as seen from a point of the room, dimmed by how much of them is hidden."""
        suns = tuple(disc for disc in self._seen_from_room.discs if is_sun(disc))
        if self._exterior is None or not suns:
            return suns
        towards = np.concatenate([_over_disc(disc) for disc in suns])
        free = 1.0 - self._look(centre, towards)[:, 3].reshape(len(suns), _SUN_RAYS).mean(axis=1)
        return tuple(
            disc if share == 1.0 else disc.times((share, share, share))
            for disc, share in zip(suns, free.tolist(), strict=True)
            if share > 0.0
        )

    def behind(self, eye: Triple) -> Callable[[Directions], Radiance]:
        """What a camera in the room sees where it sees out, for a picture's background."""
        if self._exterior is None:
            return self._seen_from_room.radiance_along

        def seen(directions: Directions) -> Radiance:
            found = self._look(eye, directions)
            radiance = found[:, :3].copy()
            far = found[:, 3] == 0.0
            if far.any():
                radiance[far] = self._seen_from_room.radiance_along(directions[far])
            return radiance

        return seen

    def _look(self, point: Triple, directions: Directions) -> Float32[np.ndarray, "n 4"]:
        """From a point of the room along its directions, through the world."""
        exterior, turn = self._exterior, self._room.rotation
        assert exterior is not None  # asked by the callers
        origin = turn @ np.array(point, np.float64) + self._room.position
        return exterior.bodies.look(
            origin[None].astype(np.float32), (directions @ turn.T).astype(np.float32), exterior.light
        )

    def _far(self, resolution: int, *, discs: bool) -> CubeMap:
        """The environment's cube, with its small discs or without them."""
        known = self._turned.get((resolution, discs))
        if known is None:
            whole = self._seen_from_room
            large = whole if discs else whole.with_discs([d for d in whole.discs if not is_sun(d)])
            known = self._turned[resolution, discs] = large.cube(resolution)
            known.setflags(write=False)
        return known

    def _check(self, exterior: Exterior) -> None:
        """Raises InputError where something outside is, or comes, inside the room."""
        low, high = self._positions.min(axis=0), self._positions.max(axis=0)
        room: Bodies | None = None
        outside = exterior.outside
        for seconds in np.linspace(0.0, outside.duration, _WATCHED if outside.duration else 1).tolist():
            place = outside.room.at(seconds)
            for one, points in zip(outside.objects, exterior.points(seconds), strict=True):
                here = (points - place.position) @ place.rotation
                near = here[((here > low) & (here < high)).all(axis=1)]
                if not len(near):
                    continue
                room = room or _told_by_normals(self._positions, self._triangles)
                inside = _first_enclosed(room, near[:: -(-len(near) // _MOST_POINTS)])
                if inside is not None:
                    x, y, z = inside.tolist()
                    when = f" at {seconds:.3g} s" if outside.duration else ""
                    reason = f"{one.name} is inside the room{when}, near ({x:.2f}, {y:.2f}, {z:.2f})"
                    raise InputError("outside", f"{reason}; move it, or leave that part of its mesh out")


def _told_by_normals(positions: Positions, triangles: Triangles) -> Bodies:
    """The room, each triangle shining with its own normal, so that a look tells which side of it is met."""
    used = positions[triangles].astype(np.float64)
    normals = np.cross(used[:, 1] - used[:, 0], used[:, 2] - used[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    corners = np.repeat(normals[:, None].astype(np.float32), 3, axis=1)
    dark = np.zeros((len(triangles), 3), np.float32)
    return Bodies([Body(positions, triangles, corners, dark, normals.astype(np.float32), dark)])


def _first_enclosed(room: Bodies, points: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "3"] | None:
    """The first of some points that sees the front of the room's surfaces nearly all around; their backs are walls."""
    fronts = np.zeros(len(points))
    for d in sphere(_AROUND).astype(np.float32):
        found = room.look(points, np.tile(d, (len(points), 1)), NO_LIGHT)
        fronts += (found[:, 3] > 0) & (found[:, :3] @ d < 0)
    inside = np.flatnonzero(fronts > _ENCLOSED * _AROUND)
    return points[inside[0]] if len(inside) else None


@lru_cache(maxsize=4)
def _sample_directions(resolution: int, samples: int) -> Directions:
    """Unit directions of samples × samples points in each texel, texel by texel."""
    places = (2.0 * np.arange(resolution * samples) + 1.0) / (resolution * samples) - 1.0
    v, u = (grid.reshape(resolution, samples, resolution, samples).swapaxes(1, 2).ravel()
            for grid in np.meshgrid(places, places, indexing="ij"))  # fmt: skip
    faces = np.repeat(np.arange(6, dtype=np.int32), len(u))
    found = cube_map.directions(faces, np.tile(u, 6), np.tile(v, 6)).astype(np.float32)
    found.setflags(write=False)
    return found


def _over_disc(disc: Disc) -> Directions:
    """Unit directions spread evenly over a disc."""
    middle = np.array(disc.direction)
    across = np.cross(middle, np.eye(3)[np.abs(middle).argmin()])
    across /= np.linalg.norm(across)
    i = np.arange(_SUN_RAYS) + 0.5
    r = np.radians(disc.radius_deg) * np.sqrt(i / _SUN_RAYS)
    turn = np.pi * (3.0 - np.sqrt(5.0)) * i
    d = middle + (r * np.cos(turn))[:, None] * across
    d += (r * np.sin(turn))[:, None] * np.cross(middle, across)
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)

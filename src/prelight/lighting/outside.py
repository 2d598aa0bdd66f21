"""The world outside of a room, as a rig says it: a scene, objects that move along paths, and where the room stands."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..arrays import Float64
from ..errors import InputError
from .quantities import Triple


class Placement(NamedTuple):
    """Where something stands, and where its own −Z looks: degrees from −Z towards +X."""

    position: Triple
    heading_deg: float

    @property
    def rotation(self) -> Float64[np.ndarray, "3 3"]:
        """From its own axes to the world's: acts on columns."""
        h = math.radians(self.heading_deg)
        c, s = math.cos(h), math.sin(h)
        return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


@dataclass(frozen=True)
class Path:
    """Where something is at certain times, in seconds, rising from 0; before and after them it rests.

    Parameters
    ----------
    times, positions
        As many of each, at least one; metres.
    headings
        Degrees at those times, turned the shorter way between them; None to look along the way.
    curved
        Through the positions in a smooth curve; straight from one to the next if not.
    """

    times: tuple[float, ...]
    positions: tuple[Triple, ...]
    headings: tuple[float, ...] | None = None
    curved: bool = True

    def __post_init__(self) -> None:
        if not self.times or len(self.times) != len(self.positions):
            raise InputError("keys", "expected as many times as positions, at least one")
        if any(later <= earlier for earlier, later in zip(self.times, self.times[1:], strict=False)):
            raise InputError("keys", "expected times that rise, from 0 on: the table itself is at 0")

    @classmethod
    def resting(cls, position: Triple = (0.0, 0.0, 0.0), heading_deg: float = 0.0) -> Path:
        """At one place for ever."""
        return cls((0.0,), (position,), (heading_deg,))

    @property
    def duration(self) -> float:
        """When it comes to rest, seconds."""
        return self.times[-1]

    def at(self, seconds: float) -> Placement:
        """Where it is at a time."""
        t = min(max(seconds, self.times[0]), self.times[-1])
        n = min(max(bisect_right(self.times, t), 1), len(self.times) - 1)
        if len(self.times) == 1:
            return Placement(self.positions[0], self.headings[0] if self.headings else 0.0)
        span = self.times[n] - self.times[n - 1]
        s = (t - self.times[n - 1]) / span
        place, way = self._moved(n, s, span)
        if self.headings is None:
            heading = math.degrees(math.atan2(way[0], -way[2]))
        else:
            one, other = self.headings[n - 1], self.headings[n]
            heading = one + s * ((other - one + 180.0) % 360.0 - 180.0)
        x, y, z = place.tolist()
        return Placement((x, y, z), heading)

    def _moved(self, n: int, s: float, span: float) -> tuple[np.ndarray, np.ndarray]:
        """Place and velocity a share of the way to key n: cubic, with the mean velocity of both sides at each key."""
        a, b = (np.array(self.positions[k]) for k in (n - 1, n))
        if not self.curved:
            return a + s * (b - a), b - a
        p, q = self._velocity(n - 1) * span, self._velocity(n) * span
        place = (2 * s**3 - 3 * s**2 + 1) * a + (s**3 - 2 * s**2 + s) * p
        place += (3 * s**2 - 2 * s**3) * b + (s**3 - s**2) * q
        way = (6 * s**2 - 6 * s) * (a - b) + (3 * s**2 - 4 * s + 1) * p + (3 * s**2 - 2 * s) * q
        return place, way if np.hypot(way[0], way[2]) > 1e-9 else b - a

    def _velocity(self, k: int) -> Float64[np.ndarray, "3"]:
        first, last = max(k - 1, 0), min(k + 1, len(self.times) - 1)
        if any(j != k and self.positions[j] == self.positions[k] for j in (first, last)):
            return np.zeros(3)  # it rests before or after
        moved = np.array(self.positions[last]) - np.array(self.positions[first])
        return moved / (self.times[last] - self.times[first])


@dataclass(frozen=True)
class OutsideObject:
    """A mesh outside, and how it moves. ``source`` is a file, or a built-in scene's name."""

    source: str
    path: Path
    scale: float = 1.0
    turn_deg: float = 0.0  # about +Y, counter-clockwise seen from above, before it is placed
    name: str = "object"


@dataclass(frozen=True)
class Outside:
    """All that is outside, and where in it the room stands. Nothing in it moves unless its path says so."""

    objects: tuple[OutsideObject, ...]
    room: Path = field(default_factory=Path.resting)
    samples: int = 2  # a side of each texel of a shell
    bounce: bool = True  # whether what the sky does not reach is lit by its surroundings

    @property
    def duration(self) -> float:
        """When everything has come to rest, seconds."""
        return max((path.duration for path in (self.room, *(o.path for o in self.objects))), default=0.0)

"""Lights that change in time: between keyframes, directions turn, everything else is mixed."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..errors import InputError
from .distributions import Power
from .panel import Panel
from .placed_lights import Lamp, PlacedPanel
from .quantities import Triple
from .spot import Spot

Light = Spot | Panel | Lamp | PlacedPanel
Ease = Literal["smooth", "linear"]


@dataclass(frozen=True)
class Track:
    """One light at certain times, in seconds, rising from 0; before and after them it rests.

    ``smooth`` slows down at every keyframe. Raises InputError where two lights have nothing between them.
    """

    times: tuple[float, ...]
    lights: tuple[Light, ...]
    ease: Ease = "smooth"

    def __post_init__(self) -> None:
        if not self.lights or len(self.times) != len(self.lights):
            raise InputError("keys", "expected as many times as lights, at least one")
        if any(later <= earlier for earlier, later in zip(self.times, self.times[1:], strict=False)):
            raise InputError("keys", "expected times that rise, from 0 on: the table itself is at 0")
        for one, other in zip(self.lights, self.lights[1:], strict=False):
            between(one, other, 0.5)

    @property
    def duration(self) -> float:
        """When it stops changing, seconds."""
        return self.times[-1]

    def at(self, seconds: float) -> Light:
        """The light at a time."""
        n = bisect_right(self.times, seconds)
        if n == 0 or n == len(self.times):
            return self.lights[max(n - 1, 0)]
        share = (seconds - self.times[n - 1]) / (self.times[n] - self.times[n - 1])
        if self.ease == "smooth":
            share = share * share * (3.0 - 2.0 * share)
        return between(self.lights[n - 1], self.lights[n], share)


def between(one: Light, other: Light, share: float) -> Light:
    """From one light (share 0) to another (1). Raises InputError where there is nothing between them."""
    if isinstance(one, Spot) and isinstance(other, Spot):
        return _between_spots(one, other, share)
    if isinstance(one, Lamp) and isinstance(other, Lamp):
        return replace(
            one,
            position=_mixed(one.position, other.position, share),
            radius=one.radius + share * (other.radius - one.radius),
            beam=_between_spots(one.beam, other.beam, share),
        )
    if isinstance(one, PlacedPanel) and isinstance(other, PlacedPanel):
        return replace(
            one,
            position=_mixed(one.position, other.position, share),
            size=_mixed(one.size, other.size, share),
            beam=_between_spots(one.beam, other.beam, share),
        )
    if isinstance(one, Panel) and isinstance(other, Panel):
        if len(one.position) != len(other.position) or (one.beam is None) != (other.beam is None):
            raise InputError("keys", "have another number of axes, or a direction that others have not")
        beam = None
        if one.beam is not None and other.beam is not None:
            beam = _between_spots(one.beam, other.beam, share)
        return replace(
            one,
            position=_mixed(one.position, other.position, share),
            width=_mixed(one.width, other.width, share),
            radiance=_mixed(one.radiance, other.radiance, share),
            beam=beam,
        )
    raise InputError("keys", "there is nothing between lights of two kinds")


def _between_spots(one: Spot, other: Spot, share: float) -> Spot:
    if (one.direction is None) != (other.direction is None):
        raise InputError("keys", "expected a direction at every time, or a target at every time")
    if one.direction is not None and other.direction is not None:
        aim: dict[str, Triple] = {"direction": _turned(one.direction, other.direction, share)}
    else:
        assert one.target is not None
        assert other.target is not None
        aim = {"target": _mixed(one.target, other.target, share)}
    distribution = one.distribution
    if isinstance(one.distribution, Power) and isinstance(other.distribution, Power):
        least = 1e-3  # a power grows by factors
        low, high = (math.log(max(shape.power, least)) for shape in (one.distribution, other.distribution))
        distribution = Power(math.exp(low + share * (high - low))) if low != high else one.distribution
    elif one.distribution is not other.distribution and one.distribution != other.distribution:
        raise InputError("keys", "only power and width_deg change in time; other shapes stay as they are")
    return replace(
        one,
        intensity=_mixed(one.intensity, other.intensity, share),
        roll_deg=one.roll_deg + share * (other.roll_deg - one.roll_deg),
        distribution=distribution,
        **aim,
    )


def _mixed(one: Sequence[float], other: Sequence[float], share: float):
    return tuple(a + share * (b - a) for a, b in zip(one, other, strict=True))


def _turned(one: Triple, other: Triple, share: float) -> Triple:
    """Along the great circle; by way of some direction across where they are opposite."""
    a, b = np.array(one), np.array(other)
    angle = math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))
    if angle < 1e-9:
        return one
    across = b - (a @ b) * a
    if np.linalg.norm(across) < 1e-9:
        across = np.cross(a, np.eye(3)[int(np.abs(a).argmin())])
    across /= np.linalg.norm(across)
    x, y, z = (math.cos(share * angle) * a + math.sin(share * angle) * across).tolist()
    return x, y, z

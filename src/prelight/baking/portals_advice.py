"""The two conditions of the paper's section 6, worked out for the portals there are, and said as advice."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..scene.portals import Portals
from .portals_settings import PortalsSettings

_DIRECTIONS = 200


@dataclass(frozen=True)
class PortalsAdvice:
    """What may move outside, and how near.

    Attributes
    ----------
    extent
        l of the largest portal, metres.
    angle_deg
        l/(2r) of it at the exterior distance: how far what is seen through its rim is from where its middle sees it; 0
        where everything is far.
    least_distance
        r for which l/(2r) is θ_M, metres.
    returned_distance
        d for which A/(4πd²) is R_Θ, metres; A the area of glass that is seen from where most of it is.
    """

    extent: float
    angle_deg: float
    least_distance: float
    returned_distance: float

    def lines(self, settings: PortalsSettings) -> list[str]:
        """In words."""
        wish = settings.wish
        if math.isinf(wish.exterior_distance):
            first = "one shell serves all portals while everything outside is far away"
        else:
            first = (
                f"at {wish.exterior_distance:g} m the largest portal errs by {self.angle_deg:.1f}° "
                f"(θ_M {wish.theta_deg:g}°)"
            )
        return [
            f"{first}; with θ_M {wish.theta_deg:g}° things may move as near as {self.least_distance:.3g} m to the "
            f"largest portal ({self.extent:.2g} m)",
            f"nearer than {self.returned_distance:.2g} m light that comes back from the room would matter outside "
            f"(R_Θ {settings.returned:g})",
        ]


def advise(portals: Portals, settings: PortalsSettings) -> PortalsAdvice:
    """Of these portals."""
    extent = float(portals.extents.max())
    distance, theta = settings.wish.exterior_distance, math.radians(settings.wish.theta_deg)
    area = _seen_area(portals)
    return PortalsAdvice(
        extent,
        0.0 if math.isinf(distance) else math.degrees(extent / (2 * distance)),
        extent / (2 * theta),
        math.sqrt(area / (4 * math.pi * settings.returned)),
    )


def _seen_area(portals: Portals) -> float:
    """The largest area of all portals together, projected along a direction."""
    a, b, c = np.moveaxis(portals.corners.astype(np.float64), 1, 0)
    across = np.cross(b - a, c - a) / 2
    k = np.arange(_DIRECTIONS) + 0.5
    z, turn = 1 - 2 * k / _DIRECTIONS, k * math.pi * (1 + 5**0.5)
    flat = np.sqrt(1 - z * z)
    d = np.stack([flat * np.cos(turn), flat * np.sin(turn), z])
    # Glass is seen from both sides; of closed panes one side shows.
    return float(np.abs(across @ d).sum(axis=0).max())

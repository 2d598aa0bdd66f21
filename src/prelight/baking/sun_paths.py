"""Where the sun stands through a year, and which nodes of the cube's quadtree that meets.

A cluster may stand for its lights to within the tolerance, and a sun is one light: there the tree is finer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bases.cube_map import directions, mean_directions
from ..bases.quadtree import Nodes
from ..errors import InputError

ANY = "any"
TILT_DEG = 23.44  # of the earth's axis: as far north and south as the sun is overhead
RADIUS_DEG = 0.27  # of the sun
TOLERANCE_SHARE = 0.25  # of the tolerance, where the sun stands; see decision 0015


@dataclass(frozen=True)
class SunPaths:
    """The band of the sky that the sun crosses; north is −Z, east +X.

    Parameters
    ----------
    latitude_deg
        Degrees, north positive; None for any place on earth, or a sky turned by anything: all above the horizon.
    """

    latitude_deg: float | None

    @classmethod
    def read(cls, value: float | str) -> SunPaths:
        """A latitude, −90 to 90, or the word any; raises InputError."""
        if isinstance(value, str) and value.strip().lower() == ANY:
            return cls(None)
        try:
            latitude = float(value)
        except (TypeError, ValueError):
            latitude = float("nan")
        if isinstance(value, bool) or not -90 <= latitude <= 90:
            raise InputError("sun-paths", f"{value!r}, expected a latitude from -90 to 90 degrees, or any")
        return cls(latitude)

    @property
    def said(self) -> float | str:
        """What ``read`` reads."""
        return ANY if self.latitude_deg is None else self.latitude_deg

    def meet(self, nodes: Nodes, resolution: int) -> np.ndarray:
        """Whether each node may have the sun in it (n,): no node that has it is left out."""
        middle = mean_directions(nodes, resolution)
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        reach = np.radians(RADIUS_DEG) + _largest_angles(nodes, resolution, middle)
        above = np.arcsin(np.clip(middle[:, 1], -1, 1)) >= -reach
        if self.latitude_deg is None:
            return above
        latitude = np.radians(self.latitude_deg)
        pole = np.array([0.0, np.sin(latitude), -np.cos(latitude)])
        declination = np.arcsin(np.clip(middle @ pole, -1, 1))
        return above & (np.abs(declination) <= np.radians(TILT_DEG) + reach)


def _largest_angles(nodes: Nodes, resolution: int, middle: np.ndarray) -> np.ndarray:
    """From the middle of each node to its farthest corner."""
    face, row, column, height, width = nodes.T
    cosine = np.ones(len(nodes))
    for down in (row, row + height):
        for across in (column, column + width):
            d = directions(face, 2.0 * across / resolution - 1.0, 2.0 * down / resolution - 1.0)
            cosine = np.minimum(cosine, (d * middle).sum(axis=1))
    return np.arccos(np.clip(cosine, -1, 1))

"""Where a steerable light of a bake is: what was fixed when its basis images were made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..arrays import Float64
from ..errors import InputError
from .quantities import Triple, triple

Kind = Literal["spot", "panel", "box", "sky"]
_EDGES = {"spot": 0, "panel": 2, "box": 3, "sky": 0}


@dataclass(frozen=True)
class Place:
    """A point (a spot), a rectangle (a panel), a box of light, or all around (a sky).

    Parameters
    ----------
    kind
        Which of them.
    origin
        The spot's middle, or the corner of the panel or box where its coordinates are 0; metres.
    edges
        Along which its coordinates run to 1: none, two or three vectors, at right angles. A panel shines to the side
        of first × second.

    Raises
    ------
    InputError
        For another number of edges, edges without length or not at right angles, numbers not finite.
    """

    kind: Kind
    origin: Triple = (0.0, 0.0, 0.0)
    edges: tuple[Triple, ...] = ()

    def __post_init__(self) -> None:
        if self.kind not in _EDGES:
            raise InputError("kind", f"{self.kind!r}, expected one of {', '.join(_EDGES)}")
        object.__setattr__(self, "origin", triple("position", self.origin, what="x, y, z in metres"))
        edges = tuple(triple("edge", edge, what="x, y, z in metres") for edge in self.edges)
        object.__setattr__(self, "edges", edges)
        if len(edges) != _EDGES[self.kind]:
            raise InputError("edges", f"{len(edges)} of them, a {self.kind} has {_EDGES[self.kind]}")
        lengths = self.sizes
        if not (lengths > 0.0).all():
            raise InputError("edges", "one has no length; expected two or three vectors in metres")
        if edges:
            unit = np.array(edges) / lengths[:, None]
            if np.abs(unit @ unit.T - np.eye(len(edges))).max() > 1e-3:
                raise InputError("edges", "not at right angles to each other, as those of a rectangle are")

    @property
    def sizes(self) -> Float64[np.ndarray, "axes"]:
        """Length of each edge, metres."""
        return np.linalg.norm(np.array(self.edges).reshape(-1, 3), axis=1)

    def toward(self, target: Sequence[float]) -> Float64[np.ndarray, "3"]:
        """The unit direction from the middle to a point. Raises InputError where they are the same."""
        middle = np.array(self.origin) + 0.5 * np.array(self.edges).reshape(-1, 3).sum(axis=0)
        way = np.array(triple("target", target, what="x, y, z in metres")) - middle
        farthest = float(np.abs(way).max())
        if farthest < 1e-9:
            raise InputError("target", "is where the light itself is; expected a point it can shine at")
        way /= farthest  # its square does not overflow
        return way / np.linalg.norm(way)

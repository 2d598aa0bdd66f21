"""Receivers: the rows of T, the places where radiance is wanted."""

from __future__ import annotations

from dataclasses import dataclass

from .arrays import Albedo, Normals, Positions


@dataclass(frozen=True)
class Receivers:
    """Diffuse vertices, in the order of the scene's vertices.

    A receiver without a normal (a vertex no triangle uses) has the zero vector and stays dark.
    """

    positions: Positions  # (R, 3) metres
    normals: Normals  # (R, 3) unit length or zero
    albedo: Albedo  # (R, 3) linear Rec.709, in [0, 1]

    def __len__(self) -> int:
        return len(self.positions)

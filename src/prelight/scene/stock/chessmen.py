"""Chessmen of our own, turned on a lathe."""

from __future__ import annotations

import numpy as np

from .parts import Part
from .revolved import Profile

# (radius, y) in metres; the foot of each stands on y = 0.
_FOOT = ((0.0, 0.0), (0.5, 0.0), (0.94, 0.0), (1.0, 0.02), (1.0, 0.22), (0.97, 0.30), (0.80, 0.38), (0.80, 0.48),
         (0.84, 0.54), (0.72, 0.64))  # fmt: skip


def _on_foot(radius: float, *above: tuple[float, float]) -> Profile:
    """A foot of this radius, and what stands on it."""
    return Profile((*((radius * r, radius * y) for r, y in _FOOT), *above))


PAWN = _on_foot(
    0.029,
    (0.0135, 0.028), (0.0098, 0.048), (0.0098, 0.055), (0.0175, 0.057), (0.0175, 0.060), (0.0100, 0.063),
    (0.0100, 0.0645), (0.0185, 0.070), (0.0205, 0.083), (0.0140, 0.0985), (0.0045, 0.1005), (0.0, 0.1005),
)  # fmt: skip
ROOK = _on_foot(
    0.032,
    (0.0190, 0.032), (0.0165, 0.055), (0.0165, 0.078), (0.0235, 0.083), (0.0245, 0.086), (0.0245, 0.109),
    (0.0245, 0.111), (0.0235, 0.112), (0.0180, 0.112), (0.0170, 0.111), (0.0165, 0.102), (0.0120, 0.100), (0.0, 0.100),
)  # fmt: skip
BISHOP = _on_foot(
    0.031,
    (0.0150, 0.034), (0.0105, 0.062), (0.0105, 0.084), (0.0195, 0.087), (0.0195, 0.090), (0.0105, 0.093),
    (0.0105, 0.095), (0.0200, 0.101), (0.0225, 0.116), (0.0140, 0.137), (0.0040, 0.143), (0.0038, 0.145),
    (0.0075, 0.1485), (0.0075, 0.154), (0.0030, 0.157), (0.0, 0.157),
)  # fmt: skip
QUEEN = _on_foot(
    0.036,
    (0.0185, 0.038), (0.0125, 0.072), (0.0125, 0.108), (0.0225, 0.112), (0.0225, 0.116), (0.0130, 0.119),
    (0.0130, 0.122), (0.0180, 0.138), (0.0255, 0.157), (0.0255, 0.1585), (0.0230, 0.1600), (0.0170, 0.1570),
    (0.0080, 0.1610), (0.0060, 0.1640), (0.0095, 0.1680), (0.0095, 0.1750), (0.0040, 0.1790), (0.0, 0.1790),
)  # fmt: skip


def turned(profile: Profile, detail: float, *, fine: float = 1.0) -> Part:
    """A closed body; ``fine`` for those that light is bent by."""
    along, around = max(14, round(46 * detail * fine)), 2 * max(7, round(18 * detail * fine))
    return profile.part(along=along, around=around)


def ball(radius: float, detail: float) -> Part:
    """A sphere on y = 0."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 25)
    out = radius / (1 - (angle[1] - angle[0]) ** 2 / 6)  # the spline runs inside its points by so much
    x, y = out * np.cos(angle), out * np.sin(angle) + radius
    x[[0, -1]] = 0.0
    profile = Profile(tuple(zip(x.tolist(), y.tolist(), strict=True)))
    return profile.part(along=max(20, round(54 * detail)), around=2 * max(12, round(32 * detail)))

"""What the glass of a portal is just now: clear, frosted, tinted, behind a blind, or shut. Nothing is traced for it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from ..errors import InputError
from . import quantities
from .quantities import Triple
from .rough_pane import LARGEST_ROUGH, LEAST_ROUGH, rough_pane

CLEAR, FROSTED, SHUT = "clear", "frosted", "shut"
KINDS = (CLEAR, FROSTED, SHUT)
LARGEST_FROST_DEG = 60.0
USUAL_FROST_DEG = 15.0
EVERY = "*"


@dataclass(frozen=True)
class Glass:
    """The glass of the portals that a name, or a pattern with ``*``, stands for.

    Parameters
    ----------
    name
        Of a portal; ``*`` in it stands for any letters.
    kind
        "clear", "frosted" or "shut" (no light at all).
    tint
        Transmittance in red, green and blue, 0 to 1, in place of the glass's own colour; None keeps that.
    frost_deg
        Of frosted glass: the standard deviation of the angle by which it turns light, degrees, up to 60.
    blind
        Share of the portal that a blind covers, 0 to 1; it dims the portal alike everywhere.
    rough
        Of frosted glass, in place of ``frost_deg``: the GGX roughness of one of its faces, 0.02 to 1, which says by how
        much it turns light and how much it lets through at each angle (``rough_pane``). None lets alike through.

    Raises InputError for values out of range.
    """

    name: str = EVERY
    kind: str = CLEAR
    tint: Triple | None = None
    frost_deg: float = USUAL_FROST_DEG
    blind: float = 0.0
    rough: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError("glass", f"{self.kind!r}, expected {', '.join(KINDS)}")
        if self.tint is not None:
            colour = quantities.colour("tint", self.tint)
            if max(colour) > 1:
                raise InputError("tint", f"{list(colour)}, expected three numbers of 0 to 1")
            object.__setattr__(self, "tint", colour)
        for name, value, most in (
            ("frost_deg", self.frost_deg, LARGEST_FROST_DEG),
            ("blind", self.blind, 1.0),
        ):
            if not (math.isfinite(value) and 0 <= value <= most):
                raise InputError(name, f"{value!r}, expected 0 to {most:g}")
        if self.rough is not None:
            if self.kind != FROSTED:
                raise InputError("rough", f"is of frosted glass, and this is {self.kind}")
            if not (math.isfinite(self.rough) and LEAST_ROUGH <= self.rough <= LARGEST_ROUGH):
                raise InputError("rough", f"{self.rough!r}, expected {LEAST_ROUGH:g} to {LARGEST_ROUGH:g}")

    def is_for(self, portal: str) -> bool:
        """Whether it is the glass of a portal of this name."""
        return self.name == portal or (
            "*" in self.name and fnmatchcase(portal, self.name.replace("[", "[[]"))
        )

    @property
    def frost(self) -> float:
        """The angle that light is turned by, degrees; 0 of what is not frosted."""
        if self.rough is not None:
            return rough_pane(self.rough).turned_deg
        return self.frost_deg if self.kind == FROSTED else 0.0

    def factor(self, own: Triple) -> Triple:
        """What it lets through of each colour, ``own`` being the glass's as it was built."""
        red, green, blue = self.tint if self.tint is not None else own
        open_ = 0.0 if self.kind == SHUT else 1.0 - self.blind
        return red * open_, green * open_, blue * open_


AS_BUILT = Glass()


def glass_of(portals: Sequence[str], glass: Sequence[Glass]) -> list[Glass]:
    """The glass of each portal: the last that is for it, or as it was built.

    Raises InputError for glass that is for no portal.
    """
    for one in glass:
        if not any(one.is_for(name) for name in portals):
            shown = ", ".join(portals[:8]) + (", …" if len(portals) > 8 else "")
            raise InputError("rig", f"[[portal]] {one.name!r} is none of this bake's: {shown}")
    return [next((one for one in reversed(glass) if one.is_for(name)), AS_BUILT) for name in portals]

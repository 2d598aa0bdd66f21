"""What a transfer bake is asked for, checked."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import InputError
from ..storage.exitant_part import MOST_ORDER
from ..storage.transfer_layer import MOST_BOUNCES
from .later_bounces import MOST_MODES

LEAST_MEMORY = 500_000_000
GATHER_RAYS = 1600
MOST_GATHER_RAYS = 1 << 14
TRIALS = 248  # lights that modes are found from
HELD_OUT = 16  # others, that errors are measured on
OPERATOR_BOUNCES = 2
ENTRIES = 300  # of a row
COARSER = 3  # times fewer for light that has bounced before


@dataclass(frozen=True)
class TransferSettings:
    """What to bake.

    Parameters
    ----------
    gather_rays
        Rays from each vertex that find what light has bounced towards it; a square number up to 16,384.
    entries
        Of the thinned operator, in the mean of its rows: 16 to 4096, a third of them for light that has bounced before.
        More are truer and slower.
    operator_bounces
        How many bounces of a light the operator makes, 1 to 3; modes hold what follows.
    modes
        At most so many: 1 to 124.
    glossy_order
        Of the harmonics that glossy vertices send on, 1 to 16; 0 shows all surfaces as diffuse.
    caustics
        Leave what clear glass and mirrors send on to photons when relighting; otherwise they are as if diffuse.
    memory
        Bytes the process may use; default half of this machine's.

    Raises
    ------
    InputError
        For anything else.
    """

    gather_rays: int = GATHER_RAYS
    entries: int = ENTRIES
    operator_bounces: int = OPERATOR_BOUNCES
    modes: int = MOST_MODES
    memory: int | None = None
    glossy_order: int = 0
    caustics: bool = True

    def __post_init__(self) -> None:
        for name, value, least, most in (
            ("gather-rays", self.gather_rays, 1, MOST_GATHER_RAYS),
            ("entries", self.entries, 16, 4096),
            ("operator-bounces", self.operator_bounces, 1, MOST_BOUNCES),
            ("modes", self.modes, 1, MOST_MODES),
            ("glossy-order", self.glossy_order, 0, MOST_ORDER),
        ):
            if not (isinstance(value, int) and not isinstance(value, bool) and least <= value <= most):
                raise InputError(name, f"{value!r}, expected a whole number from {least} to {most}")
        if math.isqrt(self.gather_rays) ** 2 != self.gather_rays:
            what = f"{self.gather_rays}, expected a square number such as 256, 1600 or 4096"
            raise InputError("gather-rays", what)
        if self.memory is not None and self.memory < LEAST_MEMORY:
            what = f"{self.memory / 1e9:.2f} GB, a bake needs at least {LEAST_MEMORY / 1e9} GB"
            raise InputError("memory", what)

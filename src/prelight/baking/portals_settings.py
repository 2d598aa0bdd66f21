"""What a bake of portals is asked for, checked."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..encoding.pulse_or_haar import check_resolution
from ..errors import InputError
from ..scene.portals import PortalWish
from ..storage.exitant_part import MOST_ORDER as MOST_GLOSSY
from .environment_settings import LEAST_MEMORY, MOST_BOUNCES, MOST_GATHER_RAYS, MOST_PHOTONS

MOST_ORDER = 12
PAPER = {
    "rays": 4096, "gather_rays": 4096, "bounces": 9, "order": 4, "cube": 32, "returned": 0.02,
}  # fmt: skip
PAPER_THETA_DEG = 5.0
MOST_RAYS = 1 << 16


@dataclass(frozen=True)
class PortalsSettings:
    """What to bake.

    Parameters
    ----------
    wish
        Which portals.
    cube
        Cells along a face of the cube map that direct light is kept on: 4, 8, 16, 32 or 64.
    rays
        From each receiver, shared among the portals before it.
    order
        Of the spherical harmonics that bounced light is kept in, 0 to 12.
    accuracy
        Choose the order: the least that holds this share of the energy of bounced light (Eqs. 4 and 5 of the paper),
        0 to 1, no higher than ``order``; None takes ``order`` as it is.
    spectrum
        For ``accuracy``: the energy that a sky has in each order from 0 on (``bases.harmonic_cells.spectrum_of``). None
        counts all orders alike, as Eq. 5 does.
    bounces
        How often light may bounce: None for as often as it matters, 0 for direct light only.
    gather_rays
        Rays from each receiver that find what light has bounced towards it; a square number.
    suns
        Keep the one-bounce operator too, thinned: suns, which harmonics of low order do not hold, then bounce from
        where they fall. About 500 bytes a vertex.
    returned
        R_Θ of the paper: the share of the light at a thing outside that may come back from the room.
    photons
        Of all portals together, for what glass and mirrors in the room send on; None for 4 million where a material
        needs them, 0 for none.
    seed
        Of all randomness.
    glossy_order
        Of the harmonics that glossy vertices send on, 1 to 16; 0 shows all surfaces as diffuse.
    memory
        Bytes the process may use; default half of this machine's.
    """

    wish: PortalWish = field(default_factory=PortalWish)
    cube: int = 32
    rays: int = 4096
    order: int = 4
    accuracy: float | None = None
    spectrum: tuple[float, ...] | None = None
    bounces: int | None = None
    gather_rays: int = 1024
    suns: bool = True
    returned: float = 0.02
    photons: int | None = None
    seed: int = 0
    memory: int | None = None
    glossy_order: int = 0

    def __post_init__(self) -> None:
        check_resolution(self.cube)
        for name, value, least, most in (
            ("rays", self.rays, 1, MOST_RAYS), ("order", self.order, 0, MOST_ORDER),
            ("bounces", 0 if self.bounces is None else self.bounces, 0, MOST_BOUNCES),
            ("gather-rays", self.gather_rays, 1, MOST_GATHER_RAYS),
            ("glossy-order", self.glossy_order, 0, MOST_GLOSSY),
            ("photons", 0 if self.photons is None else self.photons, 0, MOST_PHOTONS),
            ("seed", self.seed, 0, (1 << 31) - 1),
        ):  # fmt: skip
            if not (isinstance(value, int) and not isinstance(value, bool) and least <= value <= most):
                raise InputError(name, f"{value!r}, expected a whole number from {least} to {most}")
        if math.isqrt(self.gather_rays) ** 2 != self.gather_rays:
            raise InputError(
                "gather-rays", f"{self.gather_rays}, expected a square number such as 256, 1024 or 4096"
            )
        for name, share in (("accuracy", self.accuracy), ("returned", self.returned)):
            if share is not None and not 0 < share < 1:
                raise InputError(name, f"{share!r}, expected a number above 0 and below 1")
        if self.spectrum is not None:
            energy = np.asarray(self.spectrum, np.float64)
            if (
                energy.shape != (MOST_ORDER + 1,)
                or not (np.isfinite(energy) & (energy >= 0)).all()
                or not energy.any()
            ):
                raise InputError(
                    "spectrum", f"expected the energy of orders 0 to {MOST_ORDER}, not negative nor all 0"
                )
        if self.memory is not None and self.memory < LEAST_MEMORY:
            raise InputError(
                "memory", f"{self.memory / 1e9:.2f} GB, a bake needs at least {LEAST_MEMORY / 1e9} GB"
            )

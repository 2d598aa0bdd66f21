"""What a cloud of lights is asked for, checked."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import InputError
from ..storage.exitant_part import MOST_ORDER
from .environment_settings import LEAST_MEMORY
from .environment_settings import MOST_GATHER_RAYS as MOST_RAYS

MOST_LIGHTS = 8192
MOST_ZONES, MOST_ZONE = 4096, 1 << 20
MOST_MODES = 1024
MOST_PHOTONS = 1 << 22  # of a light
CODES = ("bytes", "float16")
MERGES = ("mean", "harmonic")
INTERPOLATIONS = ("fitted", "kernel")


@dataclass(frozen=True)
class CloudSettings:
    """How a cloud of lights is made.

    Parameters
    ----------
    lights
        About so many in the grid, those inside solids included.
    box
        Where they are: low and high corner, metres; the box around the scene if not given.
    shell
        Lights half as far apart within so many metres of surfaces; 0 for one grid everywhere.
    radius
        Of the grid's lights, metres; 0 for points.
    zone
        Vertices of a zone at most: a box with more is split.
    clusters
        Of PCA, in each zone; one for each 33 vertices if not given.
    coefficients
        Of a vertex and colour, in the mean.
    error
        Keep no more than bring what is left over below this share, RMS; then ``coefficients`` is the most there are.
    w1, w2
        Of equation 9: reciprocals of a distance and of a difference of irradiance / π of a light of 1 W/sr that keep
        lights apart. Suggested from the scene if not given.
    merge
        ``mean``, or ``harmonic`` as the paper has it, where every light of a group brings something.
    modes
        Of bounced light at most, which make up for what no grid light has; 0 for the paper's cloud alone.
    interpolation
        ``fitted`` to what bounces of the light that falls, or the paper's ``kernel``: what relighting does by default.
    codes
        Coordinates in ``bytes`` or ``float16``.
    gather_rays
        From each vertex, a square number up to 16,384.
    photons
        Of each light, for what clear glass and mirrors send on; None for 65,536 where a material needs them.
    glossy_order
        Of the harmonics that glossy vertices send on, 1 to 16 (the paper's is 3); 0 shows all surfaces as diffuse.
    memory
        Bytes the bake may use; half of the machine's if not given.

    Raises
    ------
    InputError
        For anything else.
    """

    lights: int = 384
    box: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    shell: float = 0.0
    radius: float = 0.0
    zone: int = 1024
    clusters: int | None = None
    coefficients: float = 16.0
    error: float | None = None
    w1: float | None = None
    w2: float | None = None
    merge: str = "mean"
    modes: int = 512
    interpolation: str = "fitted"
    codes: str = "bytes"
    gather_rays: int = 1024
    photons: int | None = None
    memory: int | None = None
    glossy_order: int = 0

    def __post_init__(self) -> None:
        for name, value, least, most in (
            ("lights", self.lights, 1, MOST_LIGHTS),
            ("zone", self.zone, 16, MOST_ZONE),
            ("clusters", 1 if self.clusters is None else self.clusters, 1, 1024),
            ("modes", self.modes, 0, MOST_MODES),
            ("gather-rays", self.gather_rays, 1, MOST_RAYS),
            ("glossy-order", self.glossy_order, 0, MOST_ORDER),
            ("photons", 0 if self.photons is None else self.photons, 0, MOST_PHOTONS),
        ):
            if type(value) is not int or not least <= value <= most:
                raise InputError(name, f"{value!r}, expected a whole number from {least} to {most}")
        if math.isqrt(self.gather_rays) ** 2 != self.gather_rays:
            raise InputError(
                "gather-rays", f"{self.gather_rays}, expected a square number such as 256 or 1024"
            )
        for name, value, least, most in (
            ("coefficients", self.coefficients, 0.0, 256.0),
            ("error", 0.0 if self.error is None else self.error, 0.0, 1.0),
            ("radius", self.radius, 0.0, 100.0),
            ("shell", self.shell, 0.0, 100.0),
            ("w1", 1.0 if self.w1 is None else self.w1, 0.0, 1e9),
            ("w2", 1.0 if self.w2 is None else self.w2, 0.0, 1e9),
        ):
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if not is_number or not (math.isfinite(value) and least <= value <= most):
                raise InputError(name, f"{value!r}, expected a number from {least:g} to {most:g}")
        for name, value, choices in (
            ("codes", self.codes, CODES),
            ("merge", self.merge, MERGES),
            ("interpolation", self.interpolation, INTERPOLATIONS),
        ):
            if value not in choices:
                raise InputError(name, f"{value!r}, expected {' or '.join(choices)}")
        if self.interpolation == "fitted" and self.modes == 0:
            raise InputError("interpolation", "fitted by means of modes, of which there are 0; give more")
        if self.box is not None:
            _check_box(self.box)
        if self.memory is not None and self.memory < LEAST_MEMORY:
            raise InputError(
                "memory", f"{self.memory / 1e9:.2f} GB, a bake needs at least {LEAST_MEMORY / 1e9} GB"
            )


def _check_box(box: object) -> None:
    try:
        low, high = ([float(x) for x in corner] for corner in box)  # ty: ignore[not-iterable]
        good = len(low) == len(high) == 3 and all(
            math.isfinite(a) and math.isfinite(b) and abs(a) < 1e6 and abs(b) < 1e6 and a < b
            for a, b in zip(low, high, strict=True)
        )
    except (TypeError, ValueError):
        good = False
    if not good:
        raise InputError("box", f"{str(box)[:80]}, expected its low and its high corner, metres")

"""The colour of what glows at a temperature."""

from __future__ import annotations

import numpy as np

from . import quantities
from .painting import LUMINANCE
from .quantities import Triple

COOLEST, HOTTEST = 1667.0, 25_000.0  # kelvin, between which the locus is known
_TO_REC709 = np.array([
    [3.2404542, -1.5371385, -0.4985314],
    [-0.9692660, 1.8760108, 0.0415560],
    [0.0556434, -0.2040259, 1.0572252],
])  # fmt: skip


def of_kelvin(kelvin: float) -> Triple:
    """Linear Rec.709 of luminance 1 of a black body; what lies outside the colours of Rec.709 is cut off.

    Raises InputError outside 1667 to 25000 kelvin. Source: Kim et al., Design of advanced color temperature control
    system for HDTV applications, 2002 (the Planckian locus as cubics).
    """
    t = 1e3 / quantities.amount("kelvin", kelvin, least=COOLEST, most=HOTTEST)
    if t >= 0.25:
        x = ((-0.2661239 * t - 0.2343589) * t + 0.8776956) * t + 0.179910
    else:
        x = ((-3.0258469 * t + 2.1070379) * t + 0.2226347) * t + 0.240390
    if t >= 1 / 2.222:
        y = ((-1.1063814 * x - 1.34811020) * x + 2.18555832) * x - 0.20219683
    elif t >= 0.25:
        y = ((-0.9549476 * x - 1.37418593) * x + 2.09137015) * x - 0.16748867
    else:
        y = ((3.0817580 * x - 5.87338670) * x + 3.75112997) * x - 0.37001483
    colour = np.maximum(_TO_REC709 @ np.array([x / y, 1.0, (1.0 - x - y) / y]), 0.0)
    red, green, blue = (colour / float(colour @ LUMINANCE)).tolist()
    return red, green, blue

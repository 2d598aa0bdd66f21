"""What light brings after one and more bounces by an operator, followed as the light changes.

The series is never begun anew for a small change: what has bounced is kept with what has still to bounce, to which the
change is added. So a blind that is pulled takes the one or two bounces that its change is worth, and nothing that was
left out is lost: sum = kept + (K + K² + …) · left, always. What is answered is ``kept``: it depends on the light
before by what is left, half a percent of the light that falls at most, and what would have bounced of it.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Radiance
from .first_bounce import FirstBounce

LITTLE = 0.005  # of the light that falls: what may be left to bounce
_MOST = 24  # bounces
_ANEW = 0.25  # of the light: a change of more begins anew


class SunBounces:
    """All bounces of light at vertices; ``most``: at most so many of them, then nothing is kept."""

    def __init__(self, operator: FirstBounce, *, most: int | None = None) -> None:
        self._operator, self._most = operator, most
        self._light: Radiance | None = None  # that was asked about last
        self._kept: Radiance
        self._left: Radiance

    def of(self, light: Radiance) -> Radiance:
        """(V, 3) of light (V, 3), both irradiance / π; not to be written to."""
        fallen, before = float(light.sum(dtype=np.float64)), self._light
        change = None if before is None or self._most is not None else light - before
        if change is None or float(np.abs(change).sum(dtype=np.float64)) > _ANEW * fallen:
            self._kept, self._left = np.zeros_like(light), light
        else:
            self._left = self._left + change
        self._light = light
        for _ in range(min(_MOST, self._most or _MOST)):
            if float(np.abs(self._left).sum(dtype=np.float64)) <= LITTLE * fallen:
                break
            self._left = self._operator.bounce(self._left)
            self._kept = self._kept + self._left
        return self._kept

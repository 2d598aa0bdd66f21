"""A live session's lights of a cloud fade in and out, where a lamp that moves loses sight of some and sees others.

For sessions alone: what they come to rest at depends on the lamps alone, as everywhere.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ..arrays import Float32

_SETTLED = 1e-3  # of a lamp's largest weight

Weights = Float32[np.ndarray, "3 slots"]


class Fading:
    """Weights of lamps, lamp by lamp in their order, that follow those wanted.

    Parameters
    ----------
    seconds
        In which a difference falls to a third.
    clock
        Seconds, from whenever.
    """

    def __init__(self, seconds: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._seconds, self._clock = seconds, clock
        self._shown: list[Weights] = []
        self._before = clock()
        self.is_settling = False

    def toward(self, wanted: list[Weights]) -> list[Weights]:
        """What to show of lamps now. One that is new is there at once, one that is gone is gone."""
        now = self._clock()
        share = np.float32(1 - np.exp(-(now - self._before) / self._seconds))
        self._before, self.is_settling, shown = now, False, []
        for k, target in enumerate(wanted):
            old = self._shown[k] if len(self._shown) == len(wanted) else target
            away = target - old
            is_there = np.abs(away).max(initial=0) <= _SETTLED * np.abs(target).max(initial=0)
            shown.append(target if is_there else old + share * away)
            self.is_settling |= not is_there
        self._shown = shown
        return shown

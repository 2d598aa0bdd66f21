"""What light brings after one and more bounces by an operator, in one go or followed as the light changes.

Followed, the series is not begun anew for a small change: what has bounced is kept with what has still to bounce, to
which the change is added. So a blind that is pulled takes the one or two bounces that its change is worth, and nothing
that was left out is lost: sum = kept + (K + K² + …) · left, always, even where an answer must come sooner than the
series ends. What is answered is ``kept``: it depends on the light before by what is left, half a percent of the light
that falls at most, and what would have bounced of it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Radiance
from .among_few import AmongFew
from .first_bounce import FirstBounce
from .stand_ins import Detail, StandIns

LITTLE = 0.005  # of the light that falls: what may be left to bounce
_MOST = 24  # bounces
_AT_ONCE = 4  # bounces at stand-ins in one update; what is left follows in the next
_ANEW = 0.25  # of the light: a change of more begins anew


class SunBounces:
    """All bounces of light at vertices.

    Parameters
    ----------
    most
        At most so many of them, then nothing is kept.
    places
        Find them at these stand-ins alone: light that is new everywhere is read where it falls, by the operator's rows
        of the stand-ins; what has bounced goes on among them.
    """

    def __init__(
        self, operator: FirstBounce, *, most: int | None = None, places: StandIns | None = None
    ) -> None:
        self._operator = operator if places is None else operator.chosen(places.rows)
        self._among = None if places is None else AmongFew(self._operator, places)
        self.places, self._most = places, most
        self._light: Radiance | None = None  # that was asked about last
        self._kept: Radiance
        self._left: Radiance  # at all vertices, or at the stand-ins: what has bounced and will again
        self._new: (
            Radiance | None
        )  # at all vertices, what has not bounced yet; None where that is in what is left

    def of(
        self, light: Radiance, *, at_once: int = _MOST, check: Callable[[], None] = lambda: None
    ) -> Radiance:
        """What bounces of light (V, 3), both irradiance / π, at (V, 3) or the stand-ins; not to be written to.

        ``at_once``: no more bounces now; ``check`` is called before each, and may raise to give up.
        """
        fallen, before = _sum(light), self._light
        change = None if before is None or self._most is not None else light - before
        if change is None or _sum(np.abs(change)) > _ANEW * fallen:
            rows = len(light) if self.places is None else len(self.places)
            self._kept, self._left = np.zeros((rows, 3), np.float32), np.zeros((rows, 3), np.float32)
            self._new, change = None, light
        self._new = change if self._new is None else self._new + change
        self._light = light
        for _ in range(min(at_once, self._most or _MOST)):
            new = 0.0 if self._new is None else _sum(np.abs(self._new))
            if new + _sum(np.abs(self._left)) * (len(light) / len(self._left)) <= LITTLE * fallen:
                break
            check()
            self._left = self._bounced(self._new, self._left)
            self._new = None
            self._kept = self._kept + self._left
        return self._kept

    def _bounced(self, new: Radiance | None, left: Radiance) -> Radiance:
        if self._among is None:
            return self._operator.bounce(left if new is None else left + new)
        if new is None:
            return self._among.bounce(left)
        arrived = self._operator.bounce(new)
        return arrived + self._among.bounce(left) if left.any() else arrived


def _sum(light: Radiance) -> float:
    return float(light.sum())  # pairwise, so single precision will do


class BouncedSuns:
    """What bounces of suns in a room: exactly, or at stand-ins while a hand drags.

    Whenever it is found exactly, it is found at the stand-ins too: a drag begins with a series that has come to its
    end, and knows what stand-ins cannot tell.
    """

    def __init__(self, operator: FirstBounce, *, most: int | None) -> None:
        self._operator, self._most = operator, most
        self._few: SunBounces | None = None
        self._exact: tuple[Radiance, Radiance] | None = (
            None  # light and what bounced of it, when last found so
        )
        self._detail: Detail | None = None  # of that

    def of(self, light: Radiance, coarse: StandIns | None, check: Callable[[], None]) -> Radiance:
        """(V, 3) of light (V, 3), both irradiance / π. Exactly, it depends on this light alone."""
        if coarse is None:
            self._exact = light, SunBounces(self._operator, most=self._most).of(light, check=check)
            self._follow(check)
            return self._exact[1]
        self.warm(coarse)
        assert self._few is not None  # made by warm
        few = self._few.of(light, at_once=_AT_ONCE)
        return coarse.spread(np.maximum(few, 0), self._detail)

    def warm(self, places: StandIns) -> None:
        """Make ready what a drag would wait for."""
        if self._few is None or self._few.places is not places:
            self._few = SunBounces(self._operator, most=self._most, places=places)
            self._follow(lambda: None)

    def _follow(self, check: Callable[[], None]) -> None:
        if self._few is not None and self._few.places is not None and self._exact is not None:
            light, bounced = self._exact
            self._detail = self._few.places.detail(bounced, np.maximum(self._few.of(light, check=check), 0))

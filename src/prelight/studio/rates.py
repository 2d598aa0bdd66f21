"""How fast a bake goes, from the shares that it tells."""

from __future__ import annotations

import time
from collections import deque

_LATELY = 4.0  # seconds that a rate is taken over


class Rate:
    """The shares told of late, of a layer that was planned to take so many rays and seconds."""

    def __init__(self, rays: float = 0.0, seconds: float = 0.0) -> None:
        self._rays, self._seconds = rays, seconds
        self._told: deque[tuple[float, float]] = deque(maxlen=64)
        self._first: tuple[float, float] | None = None

    def note(self, share: float) -> None:
        """So much of the layer is done now."""
        now = time.monotonic()
        self._first = self._first or (now, share)
        self._told.append((now, share))
        while len(self._told) > 2 and now - self._told[0][0] > _LATELY:
            self._told.popleft()

    @property
    def rays_per_second(self) -> float | None:
        """Of late; None where that is not known yet."""
        if len(self._told) < 2:
            return None
        (began, share), (now, last) = self._told[0], self._told[-1]
        return self._rays * (last - share) / (now - began) if now > began else None

    def left(self, planned: float) -> float:
        """Seconds: what the plan says of the rest, corrected by how this layer has gone so far, 0.2 to 5 times."""
        if self._first is None or not self._told:
            return planned
        (began, first), (now, last) = self._first, self._told[-1]
        done, took = last - first, now - began
        if done < 0.02 or self._seconds <= 0:
            return planned
        return planned * min(max(took / (done * self._seconds), 0.2), 5.0)

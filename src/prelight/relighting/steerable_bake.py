"""A bake of steerable lamps, opened: its lights, and the picture that follows, first bounces kept apart included."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..arrays import Radiance
from ..drawing.picture import Picture
from ..drawing.pixels import pixel_picture
from ..errors import InputError
from ..lighting.panel import Panel
from ..lighting.spot import Spot
from ..storage.bake import Bake
from .deep_buffer import DeepBuffer, NarrowParts, first_bounces
from .steerable import SteerableRelighter, SteerableUpdate
from .stored_steerable import open_deep, open_steerable, steerable_camera, steerable_names


class SteerableBake:
    """Lights of a bake made by ``bake_steerable``; what follows depends on them alone, not on those before.

    Parameters
    ----------
    bake
        The bake, or where it is.
    narrow
        First bounces of layers that hold all light (``viewed.narrow_parts``): then of every light what its layer cannot
        hold, because it is too narrow, is added with its first bounce. None leaves it out, and ``notes`` tell.

    Attributes
    ----------
    camera
        The one eye.
    live
        What sums the components, for pictures that grow.

    Raises
    ------
    InputError
        The bake has no steerable layer.
    OutputError, DamagedBakeError
        It cannot be read, or is not what was written.
    """

    def __init__(self, bake: Bake | str | Path, *, narrow: Mapping[str, DeepBuffer] | None = None) -> None:
        self.bake = bake if isinstance(bake, Bake) else Bake.open(bake)
        if not steerable_names(self.bake):
            kinds = ", ".join(sorted({layer.kind for layer in self.bake.layers.values()})) or "no"
            what = f"has {kinds} layers, expected steerable ones; make them with prelight bake steerable"
            raise InputError(self.bake.path, what)
        self.camera = steerable_camera(self.bake)[1]
        self.live = SteerableRelighter(open_steerable(self.bake))
        self._deep = open_deep(self.bake)
        self._narrow = NarrowParts(self.live, narrow) if narrow else None
        self._first = np.zeros((self.size[0] * self.size[1], 3), np.float32)
        self.first_bounce_milliseconds = 0.0

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the picture."""
        return self.live.size

    @property
    def radiance(self) -> Radiance:
        """Linear radiance (pixels, 3), row by row from the top; a copy. Noise may leave it a little below 0."""
        return self.live.radiance + self._first

    def light(self, lights: Sequence[Spot | Panel]) -> SteerableUpdate:
        """Light the scene with these and nothing else.

        Raises InputError for a light that no layer has, or that does not fit its layer.
        """
        update = self.live.light(lights)
        self.first_bounce_milliseconds = 0.0
        if self._deep or self._narrow:
            began = time.perf_counter()
            if self._narrow:
                self._first = self._narrow.radiance(lights)
            else:
                self._first = first_bounces(self.live, self._deep, lights)
            self.first_bounce_milliseconds = 1e3 * (time.perf_counter() - began)
        return update

    def notes(self, lights: Sequence[Spot | Panel]) -> list[str]:
        """Where what is asked for is only approximated, one line each; none where first bounces are exact.

        For then what shows of a shape is exact, and the bounces after it are smooth.
        """
        notes = self.live.notes(lights)  # raises for lights that do not fit
        return [] if self._deep or self._narrow else notes

    def picture(self) -> Picture:
        """Under the lights as they are."""
        width, height = self.size
        return pixel_picture(np.maximum(self.radiance, 0.0), np.ones((height, width), np.float32))

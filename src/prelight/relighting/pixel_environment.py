"""An environment layer whose receivers are the pixels of one eye, among other layers: it adds to that eye's picture."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Float32, Radiance
from ..lighting.environment import Environment
from ..lighting.rig import Rig
from .environment import Update
from .relighter import Relighter
from .stand_ins import StandIns


class PixelEnvironment:
    """The layer that ``lit`` has opened, under the environment of a rig.

    Attributes
    ----------
    camera, size
        The one eye, and (width, height) of its picture.
    """

    def __init__(self, lit: Relighter, *, size: tuple[int, int]) -> None:
        self._lit, self.size = lit, size
        self.name, self.camera = lit.layer_name, lit.camera()
        self._known: Environment | None = None

    def light(
        self, rig: Rig, *, coarse: StandIns | None = None, check: Callable[[], None] = lambda: None
    ) -> bool:
        """Take the rig's environment; True if it is another. Raises InputError as ``Relighter.environment``."""
        del coarse, check
        if rig.environment is self._known:
            return False
        self._lit.environment = self._known = rig.environment
        return True

    @property
    def last(self) -> Update:
        """How the last change was made, and what it took."""
        return self._lit.last

    @property
    def strong_lights(self) -> int:
        """How many lights are traced by rays."""
        return len(self._lit.strong_lights)

    @property
    def radiance(self) -> Radiance:
        """(pixels, 3) linear, row by row from the top, before black; a copy."""
        return self._lit.radiance

    @property
    def coverage(self) -> Float32[np.ndarray, "height width"]:
        """The part of each pixel's samples that see the scene, 0 to 1."""
        return self._lit.coverage

"""An environment layer of vertices among other layers: its irradiance under the rig's environment.

Of a layer baked for one eye, rows of materials that are not Lambertian are radiance toward that eye: gloss, then.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from ..arrays import Float32, Radiance, Triangles
from ..drawing.view import View
from ..lighting.environment import Environment
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from .environment import Update
from .pixel_light import PointLit
from .relighter import Relighter
from .stand_ins import StandIns


class LiveEnvironment:
    """A ``LiveLayer`` over ``lit``, which has opened a layer of vertices; ``eye`` is its own, or None."""

    is_coarse = False

    def __init__(self, lit: Relighter) -> None:
        self.name, self._lit = lit.layer_name, lit
        self.eye = None if lit.bake.layers[self.name].camera is None else lit.camera()
        self._seen = np.ones(len(lit.bake.receivers), bool)  # rows that are radiance already
        self._seen[lit.lambertian] = False
        self._known: Environment | None = None

    def light(
        self, rig: Rig, *, coarse: StandIns | None = None, check: Callable[[], None] = lambda: None
    ) -> bool:
        del coarse, check  # of its own it needs neither
        if rig.environment is self._known:
            return False
        self._lit.environment = self._known = rig.environment
        self.__dict__.pop("_irradiance", None)
        self.__dict__.pop("_rows", None)
        return True

    @property
    def last(self) -> Update:
        return self._lit.last

    @property
    def irradiance(self) -> Radiance:
        return self._irradiance.copy()

    @cached_property
    def _irradiance(self) -> Radiance:
        return np.where(self._seen[:, None], np.float32(0), self._rows)

    @cached_property
    def _rows(self) -> Radiance:
        return np.ascontiguousarray(self._lit.irradiance)

    @property
    def strong_lights(self) -> int:
        """How many lights are traced by rays."""
        return len(self._lit.strong_lights)

    @property
    def glossy_milliseconds(self) -> float:
        """What the gloss of the last change of light took, once it was looked at; 0 where there is none."""
        return self._lit.glossy_milliseconds

    def glossy(self, eye: Triple) -> Radiance | None:
        if self._seen.any():
            return np.where(self._seen[:, None], self._rows, np.float32(0))
        return self._lit.glossy(eye, self._irradiance)

    def drawn_gloss(
        self, view: View, triangles: Triangles, *, eye: Triple, fine: bool
    ) -> Float32[np.ndarray, "height width 3"] | None:
        if self._seen.any():
            return None
        fine = fine and self._lit.fine_suns is not None
        return self._lit.drawn_gloss(view, triangles, eye=eye, irradiance=self._irradiance, fine=fine)

    @property
    def point_lit(self) -> PointLit | None:
        return self._lit.fine_suns

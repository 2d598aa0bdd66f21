"""An environment layer of vertices among other layers: its irradiance under the rig's environment."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..arrays import Float32, Radiance, Triangles
from ..drawing.view import View
from ..errors import InputError
from ..lighting.environment import Environment
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from ..storage.bake import Bake
from .environment import Update
from .pixel_light import PointLit
from .relighter import Relighter


class LiveEnvironment:
    """A ``LiveLayer`` over ``Relighter``. Raises InputError for a layer that is baked for one eye."""

    def __init__(self, bake: Bake, name: str, *, trace_strong: bool = True) -> None:
        self.name, self._lit = name, Relighter(bake, layer=name, trace_strong=trace_strong)
        if bake.layers[name].camera is not None:
            what = f"its layer {name!r} is for one eye, and adds to no other"
            raise InputError(bake.path, what + "; relight a bake with that layer alone")
        self._known: Environment | None = None

    def light(self, rig: Rig) -> bool:
        if rig.environment is self._known:
            return False
        self._lit.environment = self._known = rig.environment
        self.__dict__.pop("_irradiance", None)
        return True

    @property
    def last(self) -> Update:
        return self._lit.last

    @property
    def irradiance(self) -> Radiance:
        return self._irradiance.copy()

    @cached_property
    def _irradiance(self) -> Radiance:
        return np.ascontiguousarray(self._lit.irradiance)

    def glossy(self, eye: Triple) -> Radiance | None:
        return self._lit.glossy(eye, self._irradiance)

    def drawn_gloss(
        self, view: View, triangles: Triangles, *, eye: Triple, fine: bool
    ) -> Float32[np.ndarray, "height width 3"] | None:
        fine = fine and self._lit.fine_suns is not None
        return self._lit.drawn_gloss(view, triangles, eye=eye, irradiance=self._irradiance, fine=fine)

    @property
    def point_lit(self) -> PointLit | None:
        return self._lit.fine_suns

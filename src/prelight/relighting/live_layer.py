"""What every kind of layer offers whose rows are the scene's vertices: they take their share of a rig and add."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from ..arrays import Float32, Radiance, Triangles
from ..drawing.view import View
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from .environment import Update
from .pixel_light import PointLit
from .stand_ins import StandIns


class LiveLayer(Protocol):
    """One layer under the light that falls on it now. What follows depends on the rig alone."""

    name: str

    @property
    def last(self) -> Update:
        """How the last change was made, and what it took."""
        ...

    def light(
        self, rig: Rig, *, coarse: StandIns | None = None, check: Callable[[], None] = lambda: None
    ) -> bool:
        """Take what of ``rig`` is this layer's; True if its light changed.

        ``coarse``: a hand drags, and what takes long may be found at these stand-ins, or in another quick way; the
        next call without it makes that exact. A layer may ignore it. ``check`` is called where an exact answer can be
        given up, and raises to do so: the next call begins where this one did.

        Raises InputError for what it cannot carry.
        """
        ...

    @property
    def is_coarse(self) -> bool:
        """Whether what is there now is not exact, since a hand drags."""
        ...

    @property
    def irradiance(self) -> Radiance:
        """(V, 3) irradiance / π before albedo, every bounce; a copy. Exactly zero where its light is off."""
        ...

    def glossy(self, eye: Triple) -> Radiance | None:
        """(V, 3) radiance toward a point that glossy surfaces add to what is diffuse; None without such rows."""
        ...

    def drawn_gloss(
        self, view: View, triangles: Triangles, *, eye: Triple, fine: bool
    ) -> Float32[np.ndarray, "height width 3"] | None:
        """The same as a picture to add, pixel by pixel; None where ``glossy`` of vertices is all there is.

        ``view`` sees ``triangles`` of the mesh; ``fine``: single lights' shadows are found for each pixel.
        """
        ...

    @property
    def point_lit(self) -> PointLit | None:
        """Its single lights anywhere, for pictures whose shadows are finer than the mesh; None without such lights."""
        ...

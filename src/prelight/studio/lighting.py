"""What lights a bake: the quick way where it has an environment layer alone, else ``whole_light``."""

from __future__ import annotations

from ..lighting.quantities import Triple
from ..storage.bake import Bake
from .environments import Environments
from .kinds import is_sky_alone
from .light import Light
from .lit_rows import Lighting, View, halves
from .protocol import State


class SkyLight(Light):
    """A ``Lighting`` of an environment layer alone."""

    def view(self, state: State, eye: Triple) -> View:
        """What its glossy rows add toward a point."""
        shine = self.glossy(state, eye)
        return View(None if shine is None else halves(shine), None)


def lighting_of(bake: Bake, environments: Environments) -> Lighting:
    """The quick one for a bake that has an environment layer alone. Raises InputError, DamagedBakeError."""
    if is_sky_alone(bake):
        return SkyLight(bake, environments)
    from .whole_light import WholeLight  # brings the code of all other kinds along

    return WholeLight(bake, environments)

"""Which layers of a bake take what of a rig. It is asked before the compiler is wanted, and brings nothing along."""

from __future__ import annotations

from ..errors import InputError
from ..storage.bake import Bake
from ..storage.manifest import LayerRecord

ENVIRONMENT = "environment"
STEERABLE = "steerable"  # whose lamps stand in the layer
SKIES = ("portals", ENVIRONMENT, "transfer", "cloud")  # who takes the environment, first come first served
LAMPS = ("transfer", "cloud")  # who takes lamps, spots and panels with a place of their own


def found_layer(bake: Bake, name: str | None = None) -> tuple[str, LayerRecord]:
    """An environment layer by name; without it the one named environment, or the first. Raises InputError."""
    environments = [n for n, record in bake.layers.items() if record.kind == ENVIRONMENT]
    if name is None:
        name = ENVIRONMENT if ENVIRONMENT in environments or not environments else environments[0]
    if name not in environments:
        raise InputError(
            bake.path, f"has no environment layer {name!r}; its layers are {', '.join(bake.layers) or 'none'}"
        )
    return name, bake.layers[name]

"""A transfer layer read from a bake: every number checked that a kernel or an address follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Positions
from ..errors import DamagedBakeError, InputError
from ..storage.bake import Bake
from .direct_to_indirect import DirectToIndirect
from .first_bounce import read_first_bounce

KIND = "transfer"
_LARGEST = 1e12


@dataclass(frozen=True)
class TransferLayer:
    """Where the vertices' rays begin, and what becomes of direct light at them; ``caustics``: glass and mirrors, which
    bounce nothing in it, send light on by photons."""

    name: str
    origins: Positions
    indirect: DirectToIndirect
    caustics: bool


def transfer_names(bake: Bake) -> tuple[str, ...]:
    """The transfer layers of a bake, by name."""
    return tuple(name for name, layer in bake.layers.items() if layer.kind == KIND)


def open_transfer(bake: Bake, name: str | None = None) -> TransferLayer:
    """A transfer layer, the first if not named. Raises InputError, DamagedBakeError."""
    names = transfer_names(bake)
    if name is None and names:
        name = names[0]
    if name is None or name not in names:
        there = ", ".join(f"{n} ({layer.kind})" for n, layer in bake.layers.items()) or "none"
        wanted = "a transfer layer" if name is None else f"the transfer layer {name!r:.60}"
        raise InputError(
            bake.path, f"has not {wanted}; its layers are: {there}; prelight bake transfer makes one"
        )
    at = f"layers/{name}"

    def numbers(part: str) -> np.ndarray:
        values = bake.array(f"{at}/{part}")
        if not (np.abs(values) <= _LARGEST).all():
            raise DamagedBakeError(bake.path, f"{at}/{part} has values that are no numbers, or too large")
        return values

    first = read_first_bounce(bake, f"{at}/first")
    indirect = DirectToIndirect(
        modes=bake.array(f"{at}/modes"),
        scales=numbers("scales"),
        sources=bake.array(f"{at}/sources"),
        source_scales=numbers("source_scales"),
        first=first,
        order=None,
        rows=len(bake.receivers),
        by_itself=int(bake.layers[name].parameters["operator_bounces"]),  # ty: ignore[invalid-argument-type]
        later=read_first_bounce(bake, f"{at}/later"),
    )
    return TransferLayer(
        name, numbers("origins"), indirect, bool(bake.layers[name].parameters.get("caustics"))
    )

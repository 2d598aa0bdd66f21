"""What rays to suns need of a bake of portals, every number checked that a kernel follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Int32, Positions
from ..errors import DamagedBakeError
from ..storage.bake import Bake

_LARGEST = 1e12


@dataclass(frozen=True)
class Openings:
    """What rays to a sun need of a bake, in metres.

    ``corners`` (T, 3, 3) of the portals' triangles, the pane of each, ``origins`` (V, 3) where receivers look from,
    which of the scene's triangles are the portals' glass, and ``beyond`` (V,) the pane that receivers outside of the
    glass are seen through, −1 of those inside; None where all are.
    """

    corners: Float32[np.ndarray, "triangles 3 3"]
    pane_of: Int32[np.ndarray, "triangles"]
    origins: Positions
    glass: Int32[np.ndarray, "some"]
    beyond: Int32[np.ndarray, "vertices"] | None = None


def read_openings(bake: Bake, at: str, *, panes: int) -> Openings | None:
    """None where a bake has none. Raises DamagedBakeError; shapes are checked with the manifest."""
    if f"{at}/corners" not in bake.manifest.arrays:
        return None
    corners, pane_of, origins = (bake.array(f"{at}/{part}") for part in ("corners", "pane_of", "origins"))
    glass = np.zeros(0, np.int32)
    if f"{at}/glass_triangles" in bake.manifest.arrays:
        glass = bake.array(f"{at}/glass_triangles")
    for part, values in (("corners", corners), ("origins", origins)):
        if not (np.abs(values) <= _LARGEST).all():
            raise DamagedBakeError(bake.path, f"{at}/{part} has values that are no numbers, or too large")
    for part, values, count in (("pane_of", pane_of, panes), ("glass_triangles", glass, len(bake.triangles))):
        if not ((values >= 0) & (values < count)).all():
            raise DamagedBakeError(bake.path, f"{at}/{part} names what does not exist")
    beyond = bake.array(f"{at}/beyond") if f"{at}/beyond" in bake.manifest.arrays else None
    if beyond is not None and not ((beyond >= -1) & (beyond < panes)).all():
        raise DamagedBakeError(bake.path, f"{at}/beyond names what does not exist")
    return Openings(corners, pane_of, origins, glass, beyond)

"""Make portal_caustics.png: python docs/pictures/portal_caustics.py FOLDER, which keeps the bake: some minutes of work.

A room with a window, two balls of glass and a brass ring on its floor, baked once: a low sun, and an overcast noon.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from caustics import BRASS, GLASS, GREEN_GLASS, ball, ring
from PIL import Image

import prelight as pl
from prelight.baking.portals import bake_portals
from prelight.baking.portals_settings import PortalsSettings
from prelight.lighting.rig import Rig
from prelight.material import Material
from prelight.relighting.lit_bake import LitBake
from prelight.scene.geometry import Scene
from prelight.scene.stock.parts import Part, rectangle, scene_of

PLASTER = Material("plaster", (0.72, 0.7, 0.66))
PANE = Material("window glass", (1.0, 1.0, 1.0), transmission=1.0, specular=1.0)
EYE = pl.Camera(eye=(1.35, 1.5, 1.5), target=(-0.3, 0.1, 0.0), vertical_fov_deg=42)
WEST, EAST, SOUTH, NORTH, HIGH = -1.2, 1.6, -1.3, 1.7, 2.0
SILL, LINTEL, FROM, TO = 0.5, 1.7, -0.9, 0.9
LOW_SUN = pl.Environment.constant((0.2, 0.26, 0.36)).with_discs(
    (pl.Disc(direction=(-0.86, 0.62, 0.05), radius_deg=0.6, radiance=(16000, 13500, 10000)),)
)


def side(corner: tuple, first: tuple, second: tuple, cells: tuple[int, int]) -> Part:
    corner, first, second = (np.array(v, np.float64) for v in (corner, first, second))
    return rectangle(corner, first, second, cells=cells)


def scene() -> Scene:
    wide, deep = EAST - WEST, NORTH - SOUTH
    parts = [
        (side((WEST, 0, SOUTH), (0, 0, deep), (wide, 0, 0), (140, 130)), PLASTER),
        (side((WEST, HIGH, SOUTH), (wide, 0, 0), (0, 0, deep), (24, 24)), PLASTER),
        (side((EAST, 0, SOUTH), (0, 0, deep), (0, HIGH, 0), (24, 18)), PLASTER),
        (side((WEST, 0, SOUTH), (wide, 0, 0), (0, HIGH, 0), (24, 18)), PLASTER),
        (side((WEST, 0, NORTH), (0, HIGH, 0), (wide, 0, 0), (18, 24)), PLASTER),
        (side((WEST, SILL, FROM), (0, LINTEL - SILL, 0), (0, 0, TO - FROM), (2, 2)), PANE),
        (ring(0.35, -0.25), BRASS), (ball(0.2, -0.3, 0.25), GLASS), (ball(0.13, -0.35, -0.35), GREEN_GLASS),
    ]  # fmt: skip
    for low, high, begin, end in (
        (0, SILL, SOUTH, NORTH), (LINTEL, HIGH, SOUTH, NORTH), (SILL, LINTEL, SOUTH, FROM), (SILL, LINTEL, TO, NORTH)
    ):  # fmt: skip
        parts.append((side((WEST, low, begin), (0, high - low, 0), (0, 0, end - begin), (10, 14)), PLASTER))
    return scene_of("caustics through a window", parts, cameras={"in": EYE})


def main() -> None:
    path, panes = Path(sys.argv[1]) / "portal_caustics.prelight", []
    if not path.exists():
        bake_portals(scene(), path, settings=PortalsSettings(rays=2048, gather_rays=400))
    lit = LitBake(path)
    for environment, exposure in ((LOW_SUN, -0.4), (pl.Environment.stock("overcast"), 1.6)):
        lit.light(Rig(environment))
        picture = lit.picture("in", width=800, height=600, background=(0.5, 0.55, 0.6))
        panes.append(picture.display(exposure=exposure))
    Image.fromarray(np.hstack(panes)).save(Path(__file__).with_name("portal_caustics.png"), optimize=True)


if __name__ == "__main__":
    main()

"""Make transfer_caustics.png: python docs/pictures/transfer_caustics.py FOLDER, where the bake is kept; a minute.

The things of caustics.png in a transfer bake: one small lamp, in two places.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from caustics import EYE, scene
from PIL import Image

from prelight.baking.transfer import bake_transfer
from prelight.baking.transfer_settings import TransferSettings
from prelight.lighting.environment import Environment
from prelight.lighting.keyframes import Track
from prelight.lighting.placed_lights import Lamp
from prelight.lighting.rig import Rig
from prelight.relighting.lit_bake import LitBake
from prelight.storage.bake import Bake

PLACES = ((-1.15, 1.1, -0.55), (0.95, 0.75, 0.75))


def main() -> None:
    folder, panes = Path(sys.argv[1]), []
    path = folder / "transfer-caustics.prelight"
    if not path.exists():
        bake_transfer(
            scene(),
            path,
            settings=TransferSettings(gather_rays=256, entries=96, operator_bounces=1, modes=31),
        )
    light = LitBake(Bake.open(path))
    for place in PLACES:
        lamp = Lamp.of_power(place, (42.0, 37.0, 29.0), radius=0.03)
        light.light(Rig(Environment.constant((0.03, 0.035, 0.045)), lamps=(Track((0.0,), (lamp,)),)))
        picture = light.picture(EYE, width=800, height=600, background=(0.02, 0.02, 0.02), fine=True)
        panes.append(picture.display(exposure=-0.2))
    Image.fromarray(np.hstack(panes)).save(Path(__file__).with_name("transfer_caustics.png"), optimize=True)


if __name__ == "__main__":
    main()

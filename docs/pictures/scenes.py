"""Make still-life.png and cornell.png: python docs/pictures/scenes.py STILL_LIFE.prelight CORNELL.prelight

The bakes, a few minutes each:
prelight bake environment stock:still-life --receivers pixels --camera front --size 512x288 --resolution 64 \
    --tolerance 0.03 --zones 24
prelight bake environment stock:cornell --resolution 64 --tolerance 0.01
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import prelight as pl

SHEETS = (
    ("still-life", 0.3, {"studio": 0, "sunset": 0, "noon": 0, "stage": 0}),
    ("cornell", 0.5, {"studio": 55, "sunset": 45, "noon": 45, "stage": 45}),  # turned to shine into the box
)
for bake, (name, exposure, skies) in zip(sys.argv[1:], SHEETS, strict=True):
    light = pl.Relighter(bake)
    size = {} if light.picture_size else {"width": 640, "height": 360}
    panes = []
    for sky, turn in skies.items():
        light.environment = pl.Environment.stock(sky).rotated(turn)
        panes.append(light.picture(**size).display(exposure=exposure))
    sheet = np.vstack([np.hstack(panes[:2]), np.hstack(panes[2:])])
    Image.fromarray(sheet).save(Path(__file__).with_name(f"{name}.png"), optimize=True)

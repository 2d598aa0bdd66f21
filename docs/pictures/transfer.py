"""Make transfer.png: python docs/pictures/transfer.py ROOM.prelight

The bake, a minute or so: prelight bake transfer stock:room
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from prelight.lighting.rig import Rig
from prelight.relighting.lit_bake import LitBake

HERE = Path(__file__).parent

light = LitBake(sys.argv[1])
light.light(Rig.open(str(HERE / "transfer.toml")))
picture = light.picture("front", width=1920, height=1080, fine=True)
shown = Image.fromarray(np.asarray(picture.display(exposure=picture.stops("auto"))))
shown.resize((960, 540), Image.Resampling.LANCZOS).save(HERE / "transfer.png", optimize=True)

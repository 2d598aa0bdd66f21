"""Make first-light.png from a finished demo: python docs/pictures/first_light.py prelight-demo/sculpture.prelight"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import prelight as pl

light = pl.Relighter(sys.argv[1])
panes = []
for sky in ("noon", "sunset", "studio", "stage"):
    light.environment = pl.Environment.stock(sky)
    panes.append(light.picture(width=800, height=450).display(exposure=0.0))
sheet = np.vstack([np.hstack(panes[:2]), np.hstack(panes[2:])])
Image.fromarray(sheet).save(Path(__file__).with_name("first-light.png"), optimize=True)

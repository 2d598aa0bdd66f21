"""Make portals.png: python docs/pictures/portals.py CHAPEL.prelight

The bake, a few minutes: prelight bake portals stock:portals --group window -o CHAPEL.prelight
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from prelight.lighting.daylight import Daylight
from prelight.lighting.glass import Glass
from prelight.lighting.moment import Site, moment_of
from prelight.lighting.rig import Rig
from prelight.relighting.lit_bake import LitBake

HERE = Path(__file__).parent
PLACE = Site(43.7, 15.9)
SIZE = (960, 540)  # drawn at twice the size it is shown at

# A morning; the same with the clear windows frosted; their blinds nearly down; an evening.
STATES = [
    ("2026-03-21T09:00", ()),
    ("2026-03-21T09:00", (Glass("clear glass*", "frosted", frost_deg=25.0),)),
    ("2026-03-21T09:00", (Glass("clear glass*", blind=0.97),)),
    ("2026-06-21T18:40", ()),
]

light = LitBake(sys.argv[1])
panels = []
for when, glass in STATES:
    sky = Daylight(PLACE, moment_of("time", when, place=PLACE), turbidity=2.5).environment()
    light.light(Rig(sky, portals=glass))
    picture = light.picture("front", width=SIZE[0], height=SIZE[1])
    shown = Image.fromarray(np.asarray(picture.display(exposure=picture.stops("auto") - 0.9)))
    panels.append(
        np.asarray(shown.resize((SIZE[0] // 2 * 4 // 3, SIZE[1] // 2 * 4 // 3), Image.Resampling.LANCZOS))
    )
rows = [np.concatenate(panels[k : k + 2], axis=1) for k in (0, 2)]
Image.fromarray(np.concatenate(rows)).save(HERE / "portals.png", optimize=True)

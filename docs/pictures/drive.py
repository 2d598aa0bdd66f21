"""Make drive.png: python docs/pictures/drive.py CAR.prelight

The bake, a minute: prelight bake portals stock:car
"""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

from prelight.lighting.rig import Rig
from prelight.relighting.lit_bake import LitBake

SECONDS = (0.6, 2.4, 4.4, 5.9, 6.7, 9.0)
COLUMNS, WIDTH, HEIGHT, GAP = 3, 420, 236, 4

light = LitBake(sys.argv[1])
rig = Rig.open(str(Path(__file__).with_name("drive.toml")))
frames = []
for seconds in SECONDS:
    light.light(rig.at(seconds))
    frames.append(light.picture("close", width=2 * WIDTH, height=2 * HEIGHT))
stops = sum(frame.stops("auto") for frame in frames) / len(frames) - 1.6
rows = len(SECONDS) // COLUMNS
sheet = Image.new("RGB", (COLUMNS * (WIDTH + GAP) - GAP, rows * (HEIGHT + GAP) - GAP), "white")
for n, frame in enumerate(frames):
    pane = Image.fromarray(frame.display(exposure=stops)).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
    sheet.paste(pane, (n % COLUMNS * (WIDTH + GAP), n // COLUMNS * (HEIGHT + GAP)))
sheet.save(Path(__file__).with_name("drive.png"), optimize=True)

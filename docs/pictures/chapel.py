"""Make chapel.png and chapel-day.png: python docs/pictures/chapel.py CHAPEL.prelight

The bake, some minutes: prelight bake portals stock:portals
"""

from __future__ import annotations

import sys
from dataclasses import replace
from datetime import date
from pathlib import Path

from PIL import Image

from prelight.lighting.daylight import Daylight
from prelight.lighting.environment import Environment
from prelight.lighting.moment import Site, hours_of_day, moment_of
from prelight.lighting.rig import Rig
from prelight.relighting.lit_bake import LitBake

SIBENIK = Site(43.7, 15.9)
ALTAR_IN_THE_EAST = -90.0
FRAMES, COLUMNS, GAP = 12, 4, 4

light = LitBake(sys.argv[1])
noon = moment_of("time", "2026-12-21T11:10", place=SIBENIK)
day = Daylight(SIBENIK, noon, north_deg=ALTAR_IN_THE_EAST)
rig = Rig(Environment.dark())


def picture(daylight: Daylight, width: int, height: int):
    light.light(rig.under(daylight))
    return light.picture("front", width=width, height=height)


large = picture(day, 1280, 720)
stops = large.stops("auto")
Image.fromarray(large.display(exposure=stops - 0.9)).save(
    Path(__file__).with_name("chapel.png"), optimize=True
)
width, height = 320, 180
rows = FRAMES // COLUMNS
sheet = Image.new("RGB", (COLUMNS * (width + GAP) - GAP, rows * (height + GAP) - GAP), "white")
for n, when in enumerate(hours_of_day(date(2026, 12, 21), SIBENIK, steps=FRAMES)):
    one = picture(replace(day, when=when), 2 * width, 2 * height)
    own = stops - 1.0 + 0.5 * (one.stops("auto") - stops)  # as `prelight relight --day` adapts
    pane = Image.fromarray(one.display(exposure=own)).resize((width, height), Image.Resampling.LANCZOS)
    sheet.paste(pane, (n % COLUMNS * (width + GAP), n // COLUMNS * (height + GAP)))
sheet.save(Path(__file__).with_name("chapel-day.png"), optimize=True)

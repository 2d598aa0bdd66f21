"""Fifty lights anywhere in a room: lamps, spots and panels, from a seed."""

from __future__ import annotations

import numpy as np

from prelight.lighting.distributions import Power
from prelight.lighting.placed_lights import Lamp, PlacedLight, PlacedPanel
from prelight.lighting.spot import Spot
from prelight.scene.stock import room as rooms

CLEAR = 0.12  # metres from the room's walls
RADIUS = 0.03
WIDTHS = (20.0, 90.0)  # degrees of spots, from half to half
SIDES = (0.2, 1.2)  # metres of panels


def some(count: int, *, seed: int = 50) -> list[PlacedLight]:
    """Lamps, spots and panels in turn, of colours near white; none is inside of anything (they may be close)."""
    rng = np.random.default_rng(seed)
    low = np.array([-rooms.HALF_WIDTH, 0.0, -rooms.HALF_DEPTH]) + CLEAR
    high = np.array([rooms.HALF_WIDTH, rooms.HEIGHT, rooms.HALF_DEPTH]) - CLEAR
    found: list[PlacedLight] = []
    while len(found) < count:
        place = rng.uniform(low, high)
        colour = tuple(rng.uniform(0.6, 1.4, 3).tolist())
        toward = rng.standard_normal(3)
        kind = len(found) % 3
        width, sides = float(np.exp(rng.uniform(*np.log(WIDTHS)))), rng.uniform(*SIDES, 2)
        if _in_something(place):
            continue
        x, y, z = place.tolist()
        aim = Spot(colour, direction=tuple(toward.tolist()))
        if kind == 0:
            found.append(Lamp((x, y, z), aim, RADIUS))
        elif kind == 1:
            shaped = Spot(colour, direction=aim.direction, distribution=Power.of_width(width))
            found.append(Lamp((x, y, z), shaped, RADIUS))
        else:
            panel = PlacedPanel((x, y, z), tuple(sides.tolist()), aim)
            corners = panel.corners
            if (
                (corners > low).all()
                and (corners < high).all()
                and not any(_in_something(c) for c in corners)
            ):
                found.append(panel)
    return found


def _in_something(place: np.ndarray) -> bool:
    """Near the plinth with its vase, the stool, the shelf or the canvas: by boxes around them."""
    (px, pz), (sx, sz), r = rooms.PLINTH_AT, rooms.STOOL_AT, 0.36
    boxes = (
        ((px - r, 0.0, pz - r), (px + r, 1.75, pz + r)),
        ((sx - r, 0.0, sz - r), (sx + r, 0.45, sz + r)),
        ((-1.6, 1.2, -2.4), (-0.3, 1.6, -2.1)),
    )
    return any(all(a < p < b for a, p, b in zip(low, place, high, strict=True)) for low, high in boxes)

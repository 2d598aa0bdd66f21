"""The stock scenes by name: ``stock:NAME`` wherever a scene is asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from ...errors import InputError
from ..geometry import Scene
from .car import car
from .chapel import chapel
from .chess import chess
from .cornell import cornell
from .maze import maze
from .pierced_box import pierced_box
from .room import room
from .sculpture import sculpture
from .still_life import still_life
from .town import town


class StockScene(NamedTuple):
    """How a stock scene is made, and what it is, in a line."""

    make: Callable[[], Scene]
    title: str


STOCK_SCENES: dict[str, StockScene] = {
    "sculpture": StockScene(
        sculpture, "a terracotta band on a plinth, 29,695 receivers; cameras front, close"
    ),
    "sculpture-small": StockScene(
        partial(sculpture, detail=0.38), "the same in 4,669 receivers, for trials and tests"
    ),
    "cornell": StockScene(
        cornell, "a box with red and green walls, open in front, 19,610 receivers; cameras front, close"
    ),
    "cornell-small": StockScene(partial(cornell, detail=0.44), "the same in 4,665 receivers"),
    "still-life": StockScene(
        still_life,
        "lacquer, glaze, fruit, metal and linen on a table, 29,090 receivers; cameras front, close",
    ),
    "still-life-small": StockScene(partial(still_life, detail=0.38), "the same in 4,676 receivers"),
    "room": StockScene(
        room, "a closed room with one window, for bounced light, 29,758 receivers; cameras front, close"
    ),
    "room-small": StockScene(partial(room, detail=0.34), "the same in 4,548 receivers"),
    "steerable": StockScene(chess, "chessmen, one of glass, a mirror ball, a red wall; cameras front, close"),
    "steerable-small": StockScene(partial(chess, detail=0.39), "the same in fewer triangles"),
    "portals": StockScene(chapel, "a chapel lit through clear and stained glass; cameras front, close"),
    "portals-small": StockScene(partial(chapel, detail=0.34), "the same in fewer triangles"),
    "chapel-open": StockScene(
        partial(chapel, glass=False),
        "the chapel without its panes, for bakes that know no glass; cameras front, close",
    ),
    "chapel-open-small": StockScene(partial(chapel, detail=0.34, glass=False), "the same in fewer triangles"),
    "car": StockScene(car, "a car with its interior, to drive through stock:town; cameras front, close"),
    "car-small": StockScene(partial(car, detail=0.36), "the same in fewer triangles"),
    "town": StockScene(
        town, "a small town of 50,000 triangles, for the [outside] of a rig; cameras front, close"
    ),
    "maze": StockScene(maze, "a maze without a roof, for lamps moved through it; cameras front, close"),
    "maze-small": StockScene(partial(maze, detail=0.3), "the same in fewer triangles"),
    "pierced-box": StockScene(
        partial(pierced_box, detail=1.1),
        "a box with a hole in a wall, for a lamp that goes through it; cameras front, close",
    ),
    "pierced-box-small": StockScene(partial(pierced_box, detail=0.55), "the same in fewer triangles"),
    "cloud": StockScene(maze, "the scene that shows a cloud of lights: the maze"),
    "environment": StockScene(sculpture, "the scene that shows environment light: the sculpture"),
}


def stock_scene(name: str) -> Scene:
    """The stock scene of this name. Raises InputError naming those there are."""
    if name not in STOCK_SCENES:
        known = ", ".join(known for known in STOCK_SCENES if not known.endswith("-small"))
        raise InputError(f"stock:{name}", f"no such stock scene; there are {known}, and most as NAME-small")
    return STOCK_SCENES[name].make()

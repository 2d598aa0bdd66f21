"""The stock scenes by name: ``stock:NAME`` wherever a scene is asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from ...errors import InputError
from ..geometry import Scene
from .sculpture import sculpture


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
    "environment": StockScene(sculpture, "the scene that shows environment light: the sculpture"),
}


def stock_scene(name: str) -> Scene:
    """The stock scene of this name. Raises InputError naming those there are."""
    if name not in STOCK_SCENES:
        raise InputError(f"stock:{name}", f"no such stock scene; there are {', '.join(STOCK_SCENES)}")
    return STOCK_SCENES[name].make()

"""Where lamps of a steerable bake are, from what --spot, --panel, --box and --sky say."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..errors import InputError

if TYPE_CHECKING:
    from ..baking.steerable_settings import BakedLamp

Point = tuple[float, float, float]
_LAMP = re.compile(r"(?:([^=]{1,40})=)?(.+)", re.DOTALL)
_TERM = re.compile(r"([-+]?[0-9.]+(?:e[-+]?[0-9]+)?)?(?:([-+][0-9.]+(?:e[-+]?[0-9]+)?)i)?:([0-9]{1,2})")


def lamps_of(scene: str, asked: Mapping[str, Sequence[str]], **how: Any) -> list[BakedLamp]:
    """Lamps by kind, as the options name them; a stock scene made for it has a spot of its own.

    ``how``: degree, periods (of panels, of boxes), panel_degree, terms, parity and radius, as the options.
    Raises InputError.
    """
    from ..baking.steerable_settings import BakedLamp
    from ..transport.steered_lamps import SteeredBox, SteeredPanel, SteeredSky, SteeredSpot

    asked = dict(asked)
    if not any(asked.values()):
        if not scene.startswith("stock:steerable"):
            what = "no lamp given; say where one is: --spot X,Y,Z or --panel X,Y,Z/X,Y,Z/X,Y,Z"
            raise InputError("--spot", what)
        from ..scene.stock.chess import SPOT_AT

        asked["spot"] = [",".join(map(str, SPOT_AT))]
    degree, parity, (periods, of_box) = how["degree"], how["parity"], how["periods"]
    found = []
    for text in asked["spot"]:
        name, (position,) = _named("--spot", text, "spot", 1)
        found.append(BakedLamp(name, SteeredSpot(position, degree, how["radius"]), parity))
    terms = () if how["terms"] is None else _terms(how["terms"])
    for text in asked["panel"]:
        name, corners = _named("--panel", text, "panel", 3)
        turns = how["panel_degree"]
        lamp = SteeredPanel(*corners, (0, 0) if terms else (periods, periods), turns, terms)
        found.append(BakedLamp(name, lamp, parity if turns is not None else "all"))
    for text in asked["box"]:
        name, corners = _named("--box", text, "box", 4)
        found.append(BakedLamp(name, SteeredBox(*corners, (of_box,) * 3)))
    found += [BakedLamp(name, SteeredSky(degree), parity) for name in asked["sky"]]
    return found


def _named(option: str, text: str, usual: str, count: int) -> tuple[str, list[Point]]:
    """NAME=X,Y,Z/X,Y,Z: the name and so many points."""
    match = _LAMP.fullmatch(text)
    points = []
    for part in (match[2] if match else "").split("/"):
        try:
            x, y, z = (float(number) for number in part.split(","))
        except ValueError:
            continue
        points.append((x, y, z))
    if match is None or len(points) != count or text.count("/") != count - 1:
        wanted = "/".join(["X,Y,Z"] * count)
        raise InputError(option, f"{text!r}, expected {wanted} or NAME={wanted}, metres")
    return match[1] or usual, points


def _terms(text: str) -> tuple[tuple[float, float, int], ...]:
    """RATE:POWER,RATE:POWER, a rate as 3, -4 or -4+3i."""
    found = []
    for part in text.split(","):
        match = _TERM.fullmatch(part.strip())
        try:
            if match is None or (match[1] is None and match[2] is None):
                raise ValueError
            found.append((float(match[1] or 0), float(match[2] or 0), int(match[3])))
        except ValueError:
            what = f"{part[:40]!r}, expected RATE:POWER, such as 0:6 or -4+3i:1"
            raise InputError("--panel-terms", what) from None
    return tuple(found)

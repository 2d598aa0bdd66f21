"""Values that several commands take, and what they may look like."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError

if TYPE_CHECKING:
    from cyclopts import Token

    from ..camera import Camera
    from ..relighting.lit_bake import LitBake
    from ..relighting.relighter import Relighter

_LARGEST_PICTURE = 64 << 20  # pixels: drawn in 3.5 GB
_UNITS = {"": 1, "B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12,
          "K": 10**3, "M": 10**6, "G": 10**9, "KIB": 2**10, "MIB": 2**20, "GIB": 2**30}  # fmt: skip


def whole_number(_type: type, tokens: Sequence[Token]) -> int:
    """An integer as it stands: 1.5 is not 2. For ``cyclopts.Parameter(converter=…)``."""
    text = tokens[0].value
    if not re.fullmatch(r"[+-]?\d{1,18}", text):
        raise ValueError(f'"{text}" is not a whole number.')
    return int(text)


def memory(text: str | None) -> int | None:
    """``4GB``, ``800 MB``, ``2GiB`` or a number of bytes."""
    if text is None:
        return None
    match = re.fullmatch(r"\s*(\d{1,15}(?:\.\d{1,15})?)\s*([A-Za-z]*)\s*", text)
    if not match or match[2].upper() not in _UNITS:
        raise InputError("--memory", f"{text!r}, expected a size such as 4GB or 800MB")
    if not match[2] and float(match[1]) < 1e6:
        raise InputError("--memory", f"{text!r} bytes is very little; did you mean {text.strip()}GB?")
    return int(float(match[1]) * _UNITS[match[2].upper()])


def picture_size(text: str) -> tuple[int, int]:
    """``1280x720``: width and height, 1 to 16384 pixels each, 64 megapixels at most."""
    match = re.fullmatch(r"(\d{1,5})[x×](\d{1,5})", text)
    if not match or not (1 <= int(match[1]) <= 16384 and 1 <= int(match[2]) <= 16384):
        raise InputError(
            "--size", f"{text!r}, expected WIDTHxHEIGHT such as 1280x720, 1 to 16384 pixels each"
        )
    if int(match[1]) * int(match[2]) > _LARGEST_PICTURE:
        raise InputError("--size", f"{text!r}, at most {_LARGEST_PICTURE >> 20} megapixels are drawn")
    return int(match[1]), int(match[2])


def colour(option: str, text: str) -> tuple[float, float, float]:
    """``0.9,0.8,0.7``: linear red, green, blue; one number is grey."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) == 1:
        numbers *= 3
    if len(numbers) != 3:
        raise InputError(option, f"{text!r}, expected one number or three such as 1,0.9,0.8")
    return numbers[0], numbers[1], numbers[2]


def exposure(text: str) -> tuple[bool, float]:
    """``auto``, ``auto+0.5``, ``auto-1`` or stops: whether to meter, and the stops given."""
    match = re.fullmatch(r"(auto)?([+-]?\d{1,4}(?:\.\d{1,6})?)?", text)
    if not text or not match or (match[1] and match[2] and match[2][0] not in "+-"):
        raise InputError(
            "--exposure", f"{text!r}, expected auto, auto+0.5, auto-1 or a number of stops such as -1.5"
        )
    return match[1] is not None, float(match[2] or 0)


def bake_target(scene: str, output: Path | None) -> Path:
    """Where a bake goes: beside the caller, named for its scene, if not said."""
    named = scene.removeprefix("stock:") if scene.startswith("stock:") else Path(scene).stem
    return output or Path(named + ".prelight")


def eye(text: str | None) -> Camera | str | None:
    """A camera of the scene by its name, or one from a file."""
    from ..camera import Camera

    return Camera.open(text) if text is not None and text.lower().endswith(".json") else text


def camera_of(light: Relighter | LitBake, text: str | None) -> Camera:
    """A camera of the bake by name, one in a JSON file, or the bake's first."""
    from ..camera import Camera

    if text is not None and text.endswith(".json"):
        return Camera.open(text)
    return light.camera(text)

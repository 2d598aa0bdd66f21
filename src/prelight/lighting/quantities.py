"""Numbers, colours and directions as people give them: checked, and refused by name."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence

import numpy as np

from ..bases import cube_map
from ..errors import InputError

Triple = tuple[float, float, float]
_BRIGHTEST = 1e20


def amount(name: str, value: object, *, least: float | None = None, most: float | None = None) -> float:
    """A finite number within bounds; raises InputError."""
    try:
        number = float(value)  # ty: ignore[invalid-argument-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if (
        not math.isfinite(number)
        or (least is not None and number < least)
        or (most is not None and number > most)
    ):
        bounds = (
            ""
            if least is None
            else f" of at least {least:g}"
            if most is None
            else f" from {least:g} to {most:g}"
        )
        raise InputError(name, f"{_shown(value)}, expected a finite number{bounds}")
    return number


def triple(name: str, value: object, *, least: float | None = None, what: str) -> Triple:
    """Three finite numbers; ``what`` they are is said in the message. Raises InputError."""
    parts = list(value) if isinstance(value, Sequence | np.ndarray) and not isinstance(value, str) else []
    if len(parts) != 3:
        raise InputError(name, f"{_shown(value)}, expected three numbers: {what}")
    x, y, z = (amount(name, part, least=least) for part in parts)
    return x, y, z


def colour(name: str, value: object) -> Triple:
    """Linear red, green and blue, not negative; raises InputError."""
    return triple(name, value, least=0.0, what="linear red, green, blue")


def strength(name: str, value: object) -> Triple:
    """A colour of what shines by itself: small enough that its pictures are finite; raises InputError."""
    given = colour(name, value)
    if max(given) > _BRIGHTEST:
        raise InputError(name, f"{_shown(value)}, expected at most {_BRIGHTEST:g} each")
    return given


def unit(name: str, value: object) -> Triple:
    """The unit vector along three numbers that are not all zero; raises InputError."""
    x, y, z = triple(name, value, what="x, y, z of a direction")
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0.0:
        raise InputError(name, "(0, 0, 0) points nowhere; expected the direction the light comes from")
    x, y, z = x / largest, y / largest, z / largest  # neither overflows nor vanishes when squared
    length = math.sqrt(x * x + y * y + z * z)
    if abs(length - 1.0) <= 1e-15:
        return x, y, z
    return x / length, y / length, z / length


def pair(name: str, value: object, *, least: float, most: float) -> tuple[float, float]:
    """Two numbers within bounds, the first below the second; raises InputError."""
    parts = list(value) if isinstance(value, Sequence | np.ndarray) and not isinstance(value, str) else []
    if len(parts) != 2:
        raise InputError(name, f"{_shown(value)}, expected two numbers: from, to")
    low, high = (amount(name, part, least=least, most=most) for part in parts)
    if not low < high:
        raise InputError(name, f"from {low:g} to {high:g}; expected the lower one first")
    return low, high


def resolution(value: object) -> int:
    """R of a cube map, 1 to 4096; raises InputError."""
    try:
        side = operator.index(value)  # ty: ignore[invalid-argument-type]
    except TypeError:
        side = 0
    if not 1 <= side <= cube_map.MAX_RESOLUTION:
        expected = f"expected a whole number from 1 to {cube_map.MAX_RESOLUTION}"
        raise InputError("resolution", f"{_shown(value)}, {expected}")
    return side


def turned(direction: Triple, degrees: float) -> Triple:
    """Turned about +Y, counter-clockwise seen from above; quarters exactly."""
    quarter = {0.0: (1.0, 0.0), 90.0: (0.0, 1.0), 180.0: (-1.0, 0.0), 270.0: (0.0, -1.0)}
    c, s = quarter.get(degrees % 360.0) or (math.cos(math.radians(degrees)), math.sin(math.radians(degrees)))
    x, y, z = direction
    return c * x + s * z, y, c * z - s * x


def refused(name: str, value: object, expected: str) -> InputError:
    """The error to raise for a value of another type."""
    return InputError(name, f"{type(value).__name__}, expected {expected}")


def _shown(value: object) -> str:
    """What was given, if it can be said: an integer of 5,000 digits cannot."""
    try:
        return repr(value)[:80]
    except ValueError:
        return "a number too large"

"""Words and numbers in figures, in Pillow's own font."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont, ImageFont

INK = (34, 36, 40)
QUIET = (104, 108, 116)
PAPER = (255, 255, 255)

# What Pillow's font has no glyphs for.
_SPELT = str.maketrans({
    "×": "x", "−": "-", "–": "-", "—": "-", "ε": "epsilon", "τ": "tau", "≤": "<=", "≥": ">=", "²": "2", "µ": "u",
    "…": "...", "√": "sqrt ",
})  # fmt: skip


@lru_cache(maxsize=16)
def font(size: int) -> FreeTypeFont | ImageFont:
    """Pillow's font, ``size`` pixels high."""
    from PIL import ImageFont

    return ImageFont.load_default(size=size)


def spelt(text: str) -> str:
    """The text in letters that the font has."""
    return text.translate(_SPELT)


def write(
    draw: ImageDraw,
    at: tuple[float, float],
    text: str,
    *,
    size: int,
    anchor: str = "la",
    colour: tuple[int, int, int] = INK,
) -> None:
    """Text at a point; ``anchor`` as Pillow's: l, m or r, then a (top), m (middle), s (baseline) or d (bottom)."""
    draw.text(at, spelt(text), font=font(size), fill=colour, anchor=anchor)


def width_of(text: str, *, size: int) -> float:
    return font(size).getlength(spelt(text))


def write_power(
    draw: ImageDraw, at: tuple[float, float], exponent: int, *, size: int, anchor: str = "mm"
) -> None:
    """10 with a raised exponent; plain numbers from 0.1 to 100."""
    if -1 <= exponent <= 2:
        write(draw, at, f"{10.0**exponent:g}", size=size, anchor=anchor, colour=QUIET)
        return
    small = max(8, round(0.72 * size))
    raised = f"{exponent}"
    whole = width_of("10", size=size) + width_of(raised, size=small) + 1
    x = at[0] - {"l": 0.0, "m": whole / 2, "r": whole}[anchor[0]]
    y = at[1] + {"a": size / 2, "m": 0.0, "d": -size / 2, "s": -size / 2}[anchor[1]]
    write(draw, (x, y), "10", size=size, anchor="lm", colour=QUIET)
    above = y - 0.42 * size
    write(draw, (x + width_of("10", size=size) + 1, above), raised, size=small, anchor="lm", colour=QUIET)


def short(value: float) -> str:
    """A number in a legend, three digits."""
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e4:
        return f"{value:.3g}"
    power = math.floor(math.log10(abs(value)))
    return f"{value / 10.0**power:.3g}e{power}"

"""Lines over logarithmic or even axes, for documents: light, plain, legible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Float64, UInt8
from ..errors import InputError
from . import lettering

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw

Points = tuple[Float64[np.ndarray, "n"], Float64[np.ndarray, "n"]]

# Told apart by the colour-blind (after Okabe and Ito 2008), darkened for thin lines on white.
_COLOURS = (
    (0, 96, 160), (200, 84, 0), (0, 128, 96), (176, 80, 136), (56, 56, 60), (190, 138, 0), (58, 148, 200),
    (134, 70, 30),
)  # fmt: skip
_GRID, _FRAME = (228, 230, 234), (150, 154, 160)
_FINER = 3  # drawn so much larger, then reduced: smooth lines


@dataclass(frozen=True)
class Axis:
    """One axis: what it measures, and whether evenly or by powers of ten."""

    label: str
    log: bool = True


def line_plot(
    series: Mapping[str, Points],
    *,
    x: Axis,
    y: Axis,
    title: str = "",
    size: tuple[int, int] = (960, 600),
) -> UInt8[np.ndarray, "height width 3"]:
    """An image of lines with a mark at each point, named at their right.

    Parameters
    ----------
    series
        By name, in the order of the legend: x and y of each point, finite; above 0 where the axis is logarithmic.
    size
        Width and height in pixels, from 320×240.

    Raises InputError for no points, points that no axis can show, or a size too small.
    """
    from PIL import Image, ImageDraw

    width, height = size
    if width < 320 or height < 240:
        raise InputError("size", f"{width}×{height}, expected at least 320×240")
    lines = {name: _checked(name, points, (x, y)) for name, points in series.items()}
    if not lines:
        raise InputError("series", "is empty, expected at least one line")
    letters = max(13, round(height / 34))
    every = [np.concatenate([line[k] for line in lines.values()]) for k in (0, 1)]
    legend = max(lettering.width_of(name, size=letters) for name in lines) + 3.2 * letters
    box = _Box(
        left=5.2 * letters, top=(3.0 if title else 1.4) * letters, right=width - legend - letters,
        bottom=height - 4.4 * letters, ranges=(_range(every[0], x.log), _range(every[1], y.log)), axes=(x, y),
    )  # fmt: skip
    sheet = Image.new("RGB", (width * _FINER, height * _FINER), lettering.PAPER)
    fine = ImageDraw.Draw(sheet)
    box.draw_grid(fine)
    for k, line in enumerate(lines.values()):
        _draw_line(fine, box, line, _COLOURS[k % len(_COLOURS)], letters)
    sheet = sheet.resize((width, height), Image.Resampling.BOX)
    draw = ImageDraw.Draw(sheet)
    box.letter(draw, letters)
    if title:
        lettering.write(draw, (box.left, 0.8 * letters), title, size=round(1.2 * letters))
    _draw_legend(draw, list(lines), (box.right + letters, box.top + 0.6 * letters), letters)
    _turned_label(sheet, y.label, box, letters)
    return np.asarray(sheet)


@dataclass(frozen=True)
class _Box:
    """Where in the image the data are, in pixels, and their ranges."""

    left: float
    top: float
    right: float
    bottom: float
    ranges: tuple[tuple[float, float], tuple[float, float]]
    axes: tuple[Axis, Axis]

    def share(self, k: int, values: np.ndarray) -> np.ndarray:
        """0 to 1 along axis k."""
        low, high = self.ranges[k]
        if self.axes[k].log:
            return (np.log10(values) - np.log10(low)) / (np.log10(high) - np.log10(low))
        return (np.asarray(values) - low) / (high - low)

    def places(self, points: Points) -> np.ndarray:
        """(n, 2) pixels."""
        x = self.left + self.share(0, points[0]) * (self.right - self.left)
        y = self.bottom - self.share(1, points[1]) * (self.bottom - self.top)
        return np.stack([x, y], axis=1)

    def ticks(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Where numbers stand, and where only faint lines do."""
        low, high = self.ranges[k]
        if not self.axes[k].log:
            step = _round_step((high - low) / 6)
            return np.arange(np.ceil(low / step), np.floor(high / step + 1e-9) + 1) * step, np.empty(0)
        first, last = int(np.floor(np.log10(low) + 1e-9)), int(np.ceil(np.log10(high) - 1e-9))
        tens = 10.0 ** np.arange(first, last + 1)
        between = (tens[:, None] * np.arange(2, 10)).ravel()
        inside = lambda v: v[(v >= low * (1 - 1e-9)) & (v <= high * (1 + 1e-9))]  # noqa: E731
        tens, between = inside(tens), inside(between)
        if len(tens) < 2:  # less than a power of ten: numbers at 1, 2 and 5 too
            numbered = np.isin(np.round(between / 10.0 ** np.floor(np.log10(between))), (2, 5))
            return np.sort(np.concatenate([tens, between[numbered]])), between[~numbered]
        return tens, between

    def draw_grid(self, draw: ImageDraw) -> None:
        for k in (0, 1):
            numbered, faint = self.ticks(k)
            for values, thick in ((faint, 1), (numbered, 2)):
                for at in self.share(k, values):
                    if k == 0:
                        x = self.left + at * (self.right - self.left)
                        ends = [(x, self.top), (x, self.bottom)]
                    else:
                        y = self.bottom - at * (self.bottom - self.top)
                        ends = [(self.left, y), (self.right, y)]
                    draw.line([_scaled(*end) for end in ends], fill=_GRID, width=thick)
        frame = [(self.left, self.top), (self.left, self.bottom), (self.right, self.bottom)]
        draw.line([_scaled(*corner) for corner in frame], fill=_FRAME, width=_FINER)

    def letter(self, draw: ImageDraw, letters: int) -> None:
        for k in (0, 1):
            numbered, _ = self.ticks(k)
            for value, at in zip(numbered, self.share(k, numbered), strict=True):
                if k == 0:
                    place = self.left + at * (self.right - self.left), self.bottom + 0.9 * letters
                else:
                    place = self.left - 0.5 * letters, self.bottom - at * (self.bottom - self.top)
                self._number(draw, place, value, k, letters)
        middle = (self.left + self.right) / 2
        lettering.write(
            draw, (middle, self.bottom + 2.3 * letters), self.axes[0].label, size=letters, anchor="ma"
        )

    def _number(
        self, draw: ImageDraw, place: tuple[float, float], value: float, k: int, letters: int
    ) -> None:
        anchor = "mm" if k == 0 else "rm"
        exponent = np.log10(value) if value > 0 else np.nan
        if self.axes[k].log and abs(exponent - round(exponent)) < 1e-6:
            lettering.write_power(draw, place, round(exponent), size=letters, anchor=anchor)
        else:
            text = lettering.short(float(value))
            lettering.write(draw, place, text, size=letters, anchor=anchor, colour=lettering.QUIET)


def _checked(name: str, points: Points, axes: tuple[Axis, Axis]) -> Points:
    x, y = (np.asarray(values, np.float64).ravel() for values in points)
    if len(x) != len(y) or not len(x):
        raise InputError("series", f"{name!r} has {len(x)} x and {len(y)} y, expected as many, at least one")
    for values, axis in zip((x, y), axes, strict=True):
        if not np.isfinite(values).all() or (axis.log and (values <= 0).any()):
            raise InputError("series", f"{name!r} has values that the axis {axis.label!r} cannot show")
    order = np.argsort(x, kind="stable")
    return x[order], y[order]


def _range(values: np.ndarray, log: bool) -> tuple[float, float]:
    """A little more than the values'; evenly spaced axes from 0 where that is near."""
    low, high = float(values.min()), float(values.max())
    if log:
        room = max((high / low) ** 0.06, 1.15)
        return low / room, high * room
    if 0 < low < 0.4 * high:
        low = 0.0
    room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    return (low - room if low else 0.0), high + room


def _round_step(step: float) -> float:
    power = 10.0 ** np.floor(np.log10(step))
    return float(power * next(m for m in (1, 2, 5, 10) if m * power >= step * (1 - 1e-9)))


def _scaled(x: float, y: float) -> tuple[float, float]:
    return _FINER * x, _FINER * y


def _draw_line(
    draw: ImageDraw, box: _Box, points: Points, colour: tuple[int, int, int], letters: int
) -> None:
    places = [_scaled(*place) for place in box.places(points)]
    draw.line(places, fill=colour, width=round(0.15 * letters * _FINER), joint="curve")
    for x, y in places:
        r = 0.30 * letters * _FINER
        draw.ellipse((x - r, y - r, x + r, y + r), fill=colour, outline=lettering.PAPER, width=_FINER)


def _draw_legend(draw: ImageDraw, names: list[str], at: tuple[float, float], letters: int) -> None:
    for k, name in enumerate(names):
        x, y = at[0], at[1] + 1.55 * k * letters
        colour = _COLOURS[k % len(_COLOURS)]
        draw.line([(x, y), (x + 1.4 * letters, y)], fill=colour, width=3)
        r = 0.26 * letters
        draw.ellipse((x + 0.7 * letters - r, y - r, x + 0.7 * letters + r, y + r), fill=colour)
        lettering.write(draw, (x + 1.9 * letters, y), name, size=letters, anchor="lm")


def _turned_label(sheet, text: str, box: _Box, letters: int) -> None:
    """The name of the vertical axis, read from below."""
    from PIL import Image, ImageDraw

    wide = int(lettering.width_of(text, size=letters)) + 4
    label = Image.new("RGB", (wide, round(1.5 * letters)), lettering.PAPER)
    lettering.write(ImageDraw.Draw(label), (wide / 2, 0.75 * letters), text, size=letters, anchor="mm")
    label = label.rotate(90, expand=True)
    sheet.paste(label, (round(0.4 * letters), round((box.top + box.bottom - label.height) / 2)))

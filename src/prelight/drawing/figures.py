"""Pictures beside each other for a reader: panels with captions, differences that can be seen.

Everything here is sRGB bytes (H, W, 3) on white.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import Picture as Pixels
from ..arrays import UInt8
from ..errors import InputError
from ..files import refuse_existing
from . import lettering

Shown = UInt8[np.ndarray, "height width 3"]

# Of no difference to full scale: dark to light in even steps of lightness, told apart by the colour-blind too.
_SCALE = np.array(
    [(8, 8, 14), (46, 18, 84), (112, 26, 110), (181, 48, 86), (232, 96, 44), (250, 172, 36), (252, 252, 208)],
    np.float64,
)


def difference_picture(
    a: Pixels, b: Pixels, *, factor: float, white: float = 1.0, legend: bool = True
) -> Shown:
    """|a − b| of two linear pictures, emphasised, from black over red to pale yellow.

    Parameters
    ----------
    a, b
        (H, W, 3) linear radiance; of each pixel the channel counts that differs most.
    factor
        How much the difference is emphasised: it reaches the end of the scale at ``white / factor``.
    white
        The radiance that a picture shows as white, 2^−exposure.
    legend
        A bar below with the scale and the factor.

    Raises InputError for pictures of different size, or a factor or white that is not above 0.
    """
    a, b = np.asarray(a, np.float32), np.asarray(b, np.float32)
    if a.shape != b.shape or a.ndim != 3 or a.shape[2] != 3:
        raise InputError("pictures", f"of shapes {a.shape} and {b.shape}, expected twice (height, width, 3)")
    for name, value in (("factor", factor), ("white", white)):
        if not (np.isfinite(value) and value > 0):
            raise InputError(name, f"{value!r}, expected a finite number above 0")
    with np.errstate(invalid="ignore", over="ignore"):
        level = np.abs(a - b).max(axis=2) * (factor / white)
    picture = _scaled(np.nan_to_num(np.clip(level, 0, 1), nan=1.0))
    if not legend:
        return picture
    bar = _legend(picture.shape[1], factor=factor, white=white)
    return np.concatenate([picture, bar])


def readable_factor(white: float, a: Pixels, b: Pixels, *, most: float = 1000.0) -> float:
    """1, 2 or 5 times a power of ten, up to ``most``: all but a five-hundredth of |a − b| stay on the scale."""
    difference = np.abs(np.asarray(a, np.float64) - b).max(axis=2)
    seen = difference[difference > 0]
    if not seen.size:
        return 1.0
    exact = float(np.clip(white / np.percentile(seen, 99.8), 1.0, most))
    decade = 10.0 ** np.floor(np.log10(exact))
    return float(max(step * decade for step in (1, 2, 5) if step * decade <= exact))


def enlarged(image: np.ndarray, *, at_least: int) -> np.ndarray:
    """Each pixel repeated, until small pictures are about ``at_least`` wide and their pixels can be seen."""
    times = max(1, round(at_least / image.shape[1]))
    return image if times == 1 else image.repeat(times, axis=0).repeat(times, axis=1)


def _scaled(level: np.ndarray) -> Shown:
    """Colours of levels from 0 to 1."""
    stops = np.linspace(0, 1, len(_SCALE))
    channels = [np.interp(level, stops, _SCALE[:, c]) for c in range(3)]
    return np.rint(np.stack(channels, axis=-1)).astype(np.uint8)


def _legend(width: int, *, factor: float, white: float) -> Shown:
    """A strip with the colour scale, its ends in radiance, and how much the difference is emphasised."""
    from PIL import Image as Pillow
    from PIL import ImageDraw

    size = 15 if width >= 420 else 11
    height, left = 3 * size + 8, 8
    strip = Pillow.new("RGB", (width, height), lettering.PAPER)
    draw = ImageDraw.Draw(strip)
    long = max(40, min(width - 2 * left, 360))
    bar = _scaled(np.broadcast_to(np.linspace(0, 1, long), (size, long)))
    strip.paste(Pillow.fromarray(bar), (left, 6))
    y = 6 + size + 3
    lettering.write(draw, (left, y), "0", size=size, colour=lettering.QUIET)
    full = lettering.short(white / factor)
    lettering.write(draw, (left + long, y), full, size=size, anchor="ra", colour=lettering.QUIET)
    words = f"|difference|, emphasised {lettering.short(factor)}×"
    if width - long - 3 * left > lettering.width_of(words, size=size):
        lettering.write(draw, (left + long + 12, 6 + size / 2), words, size=size, anchor="lm")
    else:
        lettering.write(draw, (left + long / 2, y), words, size=max(9, size - 3), anchor="ma")
    return np.asarray(strip)


def panels(
    images: Sequence[Shown], captions: Sequence[str], *, columns: int | None = None, gap: int = 12
) -> Shown:
    """Images in rows of ``columns`` (all in one if not given), a caption under each, on white.

    Smaller images stand at the top in the middle of their cell. Raises InputError for none, or unequal numbers.
    """
    from PIL import Image as Pillow
    from PIL import ImageDraw

    if not images or len(images) != len(captions):
        raise InputError("panels", f"{len(images)} images and {len(captions)} captions, expected as many")
    across = min(columns or len(images), len(images))
    down = -(-len(images) // across)
    wide, high = max(i.shape[1] for i in images), max(i.shape[0] for i in images)
    size = int(np.clip(wide / 30, 13, 26))
    lines = [_wrapped(text, wide, size=size) for text in captions]
    below = (
        round((max(len(each) for each in lines)) * 1.3 * size) + 8 if any(any(each) for each in lines) else 0
    )
    sheet = Pillow.new(
        "RGB", (across * (wide + gap) + gap, down * (high + below + gap) + gap), lettering.PAPER
    )
    draw = ImageDraw.Draw(sheet)
    for k, (image, caption) in enumerate(zip(images, lines, strict=True)):
        row, column = divmod(k, across)
        x, y = gap + column * (wide + gap), gap + row * (high + below + gap)
        sheet.paste(Pillow.fromarray(np.ascontiguousarray(image)), (x + (wide - image.shape[1]) // 2, y))
        for n, line in enumerate(caption):
            lettering.write(draw, (x + wide / 2, y + high + 6 + n * 1.3 * size), line, size=size, anchor="ma")
    return np.asarray(sheet)


def _wrapped(text: str, width: int, *, size: int) -> list[str]:
    """Lines no wider than ``width``, broken between words."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and lettering.width_of(longer, size=size) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def save_figure(image: Shown, path: str | Path, *, force: bool = False) -> None:
    """Write a .png. Raises InputError for another extension, OutputError for an existing file unless ``force``."""
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise InputError(path, "a figure is saved as .png")
    refuse_existing(path, force=force)
    from ..images.formats import write_png

    write_png(path, np.ascontiguousarray(image))

"""Span images as a bake makes them: strips of pixels from the eye, whole pictures from the lamp, chunk by chunk."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import Float32
from ..bases.sampled_set import SampledSet
from ..encoding.principal_components import Images
from ..storage.chunks import ArraySpec, ChunkRecord, open_chunk

_STRIP = 16_000_000  # numbers at a time
_BRIGHT = 99.8  # per cent of the pixels are darker

Chunk = tuple[str, ChunkRecord, int]  # key, record, first pixel


class SpanImages:
    """Images (S, pixels, 3), read in strips from the chunks of an unfinished bake.

    Parameters
    ----------
    root
        The bake's folder.
    strips
        Chunks (S, n, 3) float32 in the order of their pixels, which cover all.
    additions
        Chunks (S, pixels, 3) float32 to be added.
    functions, pixels
        S and how many pixels there are.
    chosen
        Which functions to read.
    """

    def __init__(
        self,
        root: Path,
        strips: Sequence[Chunk],
        additions: Sequence[Chunk],
        *,
        functions: int,
        pixels: int,
        chosen: np.ndarray,
    ) -> None:
        self._chosen = slice(None) if len(chosen) == functions else chosen
        self.shape = (len(chosen), pixels, 3)
        self._firsts = [first for _, _, first in strips] + [pixels]
        counts = np.diff(self._firsts)
        self._strips = [
            _opened(root, strip, functions, int(count)) for strip, count in zip(strips, counts, strict=True)
        ]
        self._additions = [_opened(root, addition, functions, pixels) for addition in additions]

    def __getitem__(self, part: tuple[slice, slice]) -> Float32[np.ndarray, "functions pixels 3"]:
        functions, pixels = part
        first, last, _ = pixels.indices(self.shape[1])
        found = np.empty((self.shape[0], last - first, 3), np.float32)
        for strip, begin in zip(self._strips, self._firsts[:-1], strict=True):
            here = slice(max(first, begin), min(last, begin + strip.shape[1]))
            if here.start < here.stop:
                values = strip[self._chosen, here.start - begin : here.stop - begin]
                found[:, here.start - first : here.stop - first] = values
        for addition in self._additions:
            found += addition[self._chosen, first:last]
        return found[functions]


class Evened:
    """Images (S, pixels, 3) in which no pixel counts much more than others.

    A lamp in a mirror is a thousand times as bright as all else, and a thousand pixels' errors would hide behind it. A
    pixel brighter than nearly all (RMS over functions and channels, against the 99.8th percentile) is dimmed to that.
    """

    def __init__(self, images: Images, basis: SampledSet) -> None:
        self._images, self.shape = images, images.shape
        pixels, strip = self.shape[1], max(1, _STRIP // (3 * self.shape[0]))
        level = np.empty(pixels)
        for first in range(0, pixels, strip):
            part = basis.basis_images(images[:, first : first + strip])
            level[first : first + strip] = np.sqrt(np.square(part, dtype=np.float64).mean(axis=(0, 2)))
        cap = np.percentile(level, _BRIGHT)
        dimmed = np.divide(cap, level, out=np.ones(pixels), where=level > cap)
        self._weight = (dimmed if cap > 0 else np.ones(pixels)).astype(np.float32)

    def __getitem__(self, part: tuple[slice, slice]) -> Float32[np.ndarray, "functions pixels 3"]:
        return self._images[part] * self._weight[part[1], None]


def _opened(root: Path, chunk: Chunk, functions: int, pixels: int) -> np.ndarray:
    key, record, _ = chunk
    shape = [functions, pixels, 3]
    return open_chunk(root, key, ArraySpec(shape=shape, dtype="float32", chunk_shape=shape), record)

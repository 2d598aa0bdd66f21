"""Span images as a bake makes them: strips of pixels from the eye, whole pictures from the lamp, chunk by chunk."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import Float32
from ..storage.chunks import ArraySpec, ChunkRecord, open_chunk

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


def _opened(root: Path, chunk: Chunk, functions: int, pixels: int) -> np.ndarray:
    key, record, _ = chunk
    shape = [functions, pixels, 3]
    return open_chunk(root, key, ArraySpec(shape=shape, dtype="float32", chunk_shape=shape), record)

"""Modes of bounced light: the few shapes that what bounces of any lamp is made of, learnt from lamps here and there.

How much of each a lamp brings is solved backwards, vertex by vertex, so it is known for light that falls anywhere: a
lamp beside a wall lights a spot smaller than any patch of surface that could stand for it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Int32
from ..encoding.modes import BLOCK, in_blocks

_FAINTEST = 1e-7  # of the first eigenvalue
_DARKEST = 1e-6  # share of a lamp that counts in a region, at least
_EACH = 8  # modes that every region has, beside fixed fields
_FIRM = 30.0  # times all lamps: what fixed fields count


@dataclass(frozen=True)
class Mixtures:
    """Modes as sums of what lamps bring, each in one region of the surfaces and nothing elsewhere.

    Attributes
    ----------
    shares
        ``(lamps, modes)``: in its region a mode is Σ share · what the lamp brings.
    squares
        ``(modes,)`` of each mode, area · irradiance² summed over its region and colours.
    region
        ``(modes,)`` the number of each mode's region, ascending.
    """

    shares: Float64[np.ndarray, "lamps modes"]
    squares: Float64[np.ndarray, "modes"]
    region: Int32[np.ndarray, "modes"]

    def __len__(self) -> int:
        return len(self.squares)


def mixtures(grams: list[Float64[np.ndarray, "lamps lamps"]], most: int, *, fixed: int = 0) -> Mixtures:
    """At most so many principal components of what lamps bring, region by region, from its products in each.

    A lamp counts in a region by the share of its light that is there, and so what is far from it, and dark, counts
    more than its squares would say. Every region has a few; the others are where they gain most. Modes' sizes fall off
    as those of lamps do; the first is as bright as a usual lamp. None where nothing bounces.

    The last ``fixed`` of the lamps are fields that the modes have to contain, as near as nothing, whatever they gain.
    """
    real = slice(0, len(grams[0]) - fixed)
    bright = np.sqrt(np.maximum(sum(np.diag(gram)[real] for gram in grams), 0))
    usual = float(np.median(bright[bright > 0])) if (bright > 0).any() else 0.0
    if not usual > 0:
        return Mixtures(np.zeros((len(grams[0]), 0)), np.zeros(0), np.zeros(0, np.int32))
    found, least = [], []
    for gram in grams:
        inverse, wanted = _counted(gram, bright, usual, real)
        raised, vectors = np.linalg.eigh(gram * inverse[:, None] * inverse)
        raised, vectors = np.maximum(raised[::-1], 0), vectors[:, ::-1]
        shares = np.square(vectors[real]).sum(axis=0)  # of a mode that lamps have, not fixed fields
        squares = raised * shares
        is_fixed = np.arange(len(squares)) < wanted  # they count most, so they come first
        is_fixed &= squares > _FAINTEST * squares.max()
        order = np.lexsort((-squares, ~is_fixed))
        found.append((squares[order], (inverse[:, None] * vectors * np.sqrt(shares))[:, order]))
        least.append(int(np.count_nonzero(is_fixed)) + _EACH)
    kept = _shared_out([squares for squares, _ in found], least, most)
    largest = max(float(squares.max()) for squares, _ in found)
    scale = usual / np.sqrt(max(largest, 1e-300))
    return Mixtures(
        scale * np.concatenate([shares[:, :n] for (_, shares), n in zip(found, kept, strict=True)], axis=1),
        scale**2 * np.concatenate([squares[:n] for (squares, _), n in zip(found, kept, strict=True)]),
        np.repeat(np.arange(len(grams), dtype=np.int32), kept),
    )


def _counted(
    gram: Float64[np.ndarray, "lamps lamps"], bright: np.ndarray, usual: float, real: slice
) -> tuple[Float64[np.ndarray, "lamps"], int]:
    """What lamps and fixed fields are multiplied by in a region, and how many such fields it has."""
    there = np.sqrt(np.maximum(np.diag(gram), 0))
    size = np.sqrt(bright * np.maximum(there[real], _DARKEST * bright))
    out = np.zeros(len(gram))
    np.divide(1, size, out=out[real], where=bright > 1e-9 * usual)
    fields = np.flatnonzero(there[real.stop :] > 0) + real.stop
    squares = float(np.square(there[real] * out[real]).sum())
    out[fields] = _FIRM * np.sqrt(squares) / there[fields]
    return out, len(fields) if squares > 0 else 0


def _shared_out(squares: list[Float64[np.ndarray, "n"]], least: list[int], most: int) -> list[int]:
    """How many modes each region has: none that is negligible there."""
    there = [int(np.count_nonzero(own > _FAINTEST * max(float(own.max()), 1e-300))) for own in squares]
    kept = [min(few, count) for few, count in zip(least, there, strict=True)]
    left = most - sum(kept)
    wanted = sorted((-own[n], z, n) for z, own in enumerate(squares) for n in range(kept[z], there[z]))
    for _, z, _ in wanted[: max(left, 0)]:
        kept[z] += 1
    while sum(kept) > most:
        kept[int(np.argmax(kept))] -= 1
    return kept


def products(
    brought: Float32[np.ndarray, "lamps some colours"], areas: Float32[np.ndarray, "some"]
) -> Float64[np.ndarray, "lamps lamps"]:
    """Σ area · irradiance · irradiance of every two lamps, over some vertices."""
    flat = (brought * np.sqrt(areas)[None, :, None]).reshape(len(brought), -1)
    return (flat @ flat.T).astype(np.float64)


@dataclass(frozen=True)
class Sources:
    """How much light on a vertex brings of each mode, 16 bits each.

    ``rows`` (V, modes) of the vertices in ``order``, times ``scales`` (blocks, modes) of each 64 of them: for
    irradiance / π of 1 on 1 m² around the vertex. ``areas`` (V,) m², of the vertices themselves. Bytes do not do: a
    lamp beside a wall lights few vertices, so what is rounded off does not even out.
    """

    rows: np.ndarray
    scales: Float32[np.ndarray, "blocks modes"]
    areas: Float32[np.ndarray, "vertices"]
    order: Int32[np.ndarray, "vertices"]

    @classmethod
    def of(
        cls,
        values: Float32[np.ndarray, "vertices modes"],
        areas: Float32[np.ndarray, "vertices"],
        order: Int32[np.ndarray, "vertices"],
    ) -> Sources:
        return cls(*in_blocks(values, order), areas, order)

    def brought(self, direct: np.ndarray) -> Float64[np.ndarray, "lamps modes"]:
        """Of direct irradiance / π (vertices, lamps)."""
        out = np.zeros((direct.shape[1], self.scales.shape[1]))
        for block, scales in enumerate(self.scales):
            own = slice(block * BLOCK, (block + 1) * BLOCK)
            fallen = direct[self.order[own]] * self.areas[self.order[own], None]
            out += (fallen.T.astype(np.float32) @ self.rows[own].astype(np.float32)) * scales
        return out

"""Vertices in the middle of edges, made once each, whichever triangle asks first."""

from __future__ import annotations

import numpy as np


class Midpoints:
    """The vertices of a mesh, grown by the middles of edges that are longer than ``longest``.

    Whether an edge is too long, and where its middle lies, depends on the places of its ends alone: also across
    a seam, where two triangles share no vertices, both split it alike.
    """

    def __init__(
        self,
        positions: np.ndarray,
        normals: np.ndarray,
        tint: np.ndarray,
        uv: np.ndarray | None,
        *,
        longest: float,
    ) -> None:
        self.positions, self.normals, self.tint, self.uv = positions, normals, tint, uv
        self._longest = longest
        self._edges = np.empty(0, np.int64)  # sorted; the lower end in the upper 32 bits
        self._middles = np.empty(0, np.int64)

    def are_long(self, ends: np.ndarray) -> np.ndarray:
        """(n,) whether edges (n, 2) are to be split: too long, and float32 knows a place between the ends."""
        a, b = (self.positions[ends[:, k]].astype(np.float64) for k in (0, 1))
        long = np.linalg.norm(b - a, axis=1) > self._longest
        if long.any():
            between = ((a[long] + b[long]) / 2).astype(np.float32)
            long[long] = (between != a[long]).any(axis=1) & (between != b[long]).any(axis=1)
        return long

    def of(self, ends: np.ndarray) -> np.ndarray:
        """(n,) the vertices in the middle of edges (n, 2), made where there are none yet."""
        low, high = np.sort(ends.astype(np.int64), axis=1).T
        edges, which = np.unique(low << 32 | high, return_inverse=True)
        at = np.searchsorted(self._edges, edges)
        new = np.ones(len(edges), bool)
        inside = at < len(self._edges)
        new[inside] = self._edges[at[inside]] != edges[inside]
        if new.any():
            made = len(self.positions) + np.arange(int(new.sum()))
            self._grow(np.stack([edges[new] >> 32, edges[new] & 0xFFFFFFFF], axis=1))
            self._edges = np.insert(self._edges, at[new], edges[new])
            self._middles = np.insert(self._middles, at[new], made)
            at = np.searchsorted(self._edges, edges)
        return self._middles[at][which]

    def chains(self, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Edges (n, 2) halved until no part is too long: all their vertices, each from its first end to its
        last, and (n,) how many parts each has (vertices less one).
        """
        parts, counts = ends.astype(np.int64), np.ones(len(ends), np.int64)
        while (long := self.are_long(parts)).any():
            counts += np.add.reduceat(long, np.cumsum(counts) - counts)
            twice = np.repeat(parts, 1 + long, axis=0)
            first = (np.cumsum(1 + long) - 1 - long)[long]
            twice[first, 1] = twice[first + 1, 0] = self.of(parts[long])
            parts = twice
        last = np.cumsum(counts) - 1
        vertices = np.insert(parts[:, 0], last + 1, parts[last, 1])
        return vertices, counts

    def _grow(self, ends: np.ndarray) -> None:
        self.positions = np.concatenate([self.positions, _means(self.positions, ends)])
        self.tint = np.concatenate([self.tint, _means(self.tint, ends)])
        if self.uv is not None:
            self.uv = np.concatenate([self.uv, _means(self.uv, ends)])
        # A zero normal (triangles around it face opposite ways) adds nothing: the other end's is taken.
        total = self.normals[ends].astype(np.float64).sum(axis=1)
        length = np.linalg.norm(total, axis=1, keepdims=True)
        unit = np.divide(total, length, out=np.zeros_like(total), where=length > 1e-6)
        self.normals = np.concatenate([self.normals, unit.astype(np.float32)])


def _means(values: np.ndarray, ends: np.ndarray) -> np.ndarray:
    return values[ends].astype(np.float64).mean(axis=1).astype(np.float32)

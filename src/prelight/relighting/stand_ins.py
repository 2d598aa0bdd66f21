"""Stand-ins: a few vertices spread over a scene, whose light tells that of the others while a hand drags.

What has bounced, or comes through a window, changes little from one vertex to the next on the same side of the same
surface. While a light is dragged layers may find it at the stand-ins alone; every vertex then has a mean of those
nearest to it in place and normal, weighted so that what rises evenly between them stays so. What such a mean lacks of
an earlier light that is known everywhere is added, as far as there is as much light now: so nothing jumps when a drag
begins, and the dark stays dark.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Int32, Normals, Positions, Radiance
from .pace import Pace
from .stand_in_kernels import gathered, halve, nearest, spread

COUNT = 8192  # whatever the scene: what a drag costs
Detail = Float32[np.ndarray, "vertices 6"]

_NO_DETAIL: Detail = np.zeros((0, 6), np.float32)
_NO_DETAIL.setflags(write=False)
_WORTH = 2  # times as many vertices, for stand-ins to be worth it
_NEAR = 6  # stand-ins of a vertex
_TURN = 0.125  # of the scene's extent: a turn of one radian is as far
_LEAF = 8
_FIRM = 0.05  # of the mean square distance: keeps the fit from following few stand-ins too closely


@dataclass(frozen=True)
class StandIns:
    """Some vertices, and how every vertex is made of those near it; ``StandIns.of`` chooses them.

    Attributes
    ----------
    rows
        ``(n,)`` the vertices that stand in for the others, ascending.
    near, weights
        ``(V, 6)`` which of them each vertex is made of, and their shares, 0 to 1, of sum 1.
    """

    rows: Int32[np.ndarray, "n"]
    near: Int32[np.ndarray, "vertices near"]
    weights: Float32[np.ndarray, "vertices near"]
    _pace: Pace

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def of(cls, positions: Positions, normals: Normals, *, count: int = COUNT) -> StandIns | None:
        """About ``count`` of them; None where there are few more vertices than that."""
        if len(positions) < _WORTH * count:
            return None
        extent = float(np.ptp(positions, axis=0).max()) or 1.0
        places = np.concatenate([positions, normals * (_TURN * extent)], axis=1).astype(np.float32)
        order, nodes, _ = _halved(places, -(-len(places) // count))
        leaves = nodes[nodes[:, 2] < 0]
        rows = np.sort(order[(leaves[:, 0] + leaves[:, 1]) // 2])
        chosen = np.ascontiguousarray(places[rows])
        near = np.empty((len(places), _NEAR), np.int32)
        square = np.empty((len(places), _NEAR), np.float32)
        nearest(*map(_frozen, (places, chosen, *_halved(chosen, _LEAF))), near, square)
        weights = _weights(positions, normals, positions[rows], near, square)
        return cls(rows, _frozen(near), _frozen(weights), Pace(spread))

    def spread(self, light: Float32[np.ndarray, "n 3"], before: Detail | None = None) -> Radiance:
        """(V, 3) at all vertices, of light (n, 3) at the stand-ins; ``before``: detail of a light that was alike."""
        out, known = np.empty((len(self.near), 3), np.float32), _NO_DETAIL if before is None else before
        size = self.near.nbytes + self.weights.nbytes + known.nbytes
        self._pace(size, self.near, self.weights, _frozen(light), known, out)
        return out

    def detail(self, light: Radiance, told_by: Float32[np.ndarray, "n 3"] | None = None) -> Detail:
        """What ``spread`` makes of light (V, 3) known everywhere, and what that lacks; (V, 6).

        ``told_by``: the same light as it is found at the stand-ins, where that is done in another way.
        """
        told = self.spread(light[self.rows] if told_by is None else told_by)
        return _frozen(np.concatenate([told, light - told], axis=1))

    def gathered(self, rows: np.ndarray) -> Float32[np.ndarray, "n m"]:
        """(n, m) of int8 rows (V, m) of all vertices: light · rows is the same as spread light · rows of all."""
        out = np.zeros((len(self.rows), rows.shape[1]), np.float32)
        gathered(self.near, self.weights, _frozen(rows), out)
        return out


def _halved(places: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    order = np.empty(len(places), np.int32)
    room = 4 * len(places) // max(most, 2) + 8
    nodes, boxes = np.empty((room, 3), np.int32), np.empty((room, 2, places.shape[1]), np.float32)
    count = halve(_frozen(places), most, order, nodes, boxes)
    return order, nodes[:count], boxes[:count]


def _weights(
    positions: Positions, normals: Normals, chosen: Positions, near: np.ndarray, square: np.ndarray
) -> Float32[np.ndarray, "vertices near"]:
    """Shares of the stand-ins near each vertex: a plane fitted to them, read at the vertex; none below 0."""
    far = square[:, -1:] + np.float32(1e-20)
    trust = np.square(1 - np.sqrt(square / far) * np.float32(0.99)) / (square + far * np.float32(1e-6))
    trust /= trust.sum(axis=1, keepdims=True)
    way = chosen[near] - positions[:, None]
    way -= np.einsum("vkx,vx->vk", way, normals)[..., None] * normals[:, None]
    scale = np.sqrt(np.einsum("vk,vkx,vkx->v", trust, way, way) + 1e-20)
    terms = np.concatenate([np.ones((*near.shape, 1), np.float32), way / scale[:, None, None]], axis=2)
    matrix = np.einsum("vk,vki,vkj->vij", trust, terms, terms).astype(np.float64)
    matrix[:, (1, 2, 3), (1, 2, 3)] += _FIRM
    here = np.linalg.solve(matrix, np.broadcast_to(np.eye(4)[:, :1], (len(matrix), 4, 1)))[..., 0]
    found = np.maximum(trust * np.einsum("vki,vi->vk", terms, here.astype(np.float32)), 0)
    return np.ascontiguousarray(found / found.sum(axis=1, keepdims=True), np.float32)


def _frozen(values: np.ndarray) -> np.ndarray:
    view = np.ascontiguousarray(values).view()
    view.flags.writeable = False
    return view

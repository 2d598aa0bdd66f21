"""Bounces from stand-ins to stand-ins: the one-bounce operator, made small.

What has bounced once is smooth. Where light is known at stand-ins alone, it is not spread to all vertices only to be
gathered again by the operator's tree: the tree is cut where its nodes are some times as many as the stand-ins, and what
a node there sends on is a sum over the stand-ins that its vertices are made of. Differences within it are left out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Float32, Int32
from ..encoding.row_wavelet_kernels import multiply_rows
from .first_bounce import FirstBounce
from .pace import Pace
from .stand_in_kernels import weighted
from .stand_ins import StandIns

_FINER = 4  # times as many nodes as stand-ins, at least, where the tree is cut


class AmongFew:
    """One bounce of light at stand-ins, found at them.

    Parameters
    ----------
    chosen
        The operator's rows of the stand-ins.
    """

    def __init__(self, chosen: FirstBounce, places: StandIns) -> None:
        size = len(chosen.left)
        nodes = min(size, _FINER << (len(places) - 1).bit_length())
        self._sent = np.zeros((nodes, 3), np.float32)  # by each node
        self._sums = _sums_of(chosen, places, nodes)
        self._gather = Pace(weighted)
        ones = np.ones((nodes, 3), np.float32)
        order = np.arange(nodes, dtype=np.int32)
        for array in (ones, order):
            array.setflags(write=False)
        self._operator = replace(_cut(chosen, nodes), order=order, left=chosen.left[:nodes], colours=ones)

    def bounce(self, light: Float32[np.ndarray, "n 3"]) -> Float32[np.ndarray, "n 3"]:
        """Irradiance / π after one bounce of such light; of light that was taken away it may be negative."""
        starts, stand_in, weights = self._sums
        self._gather(stand_in.nbytes + weights.nbytes, starts, stand_in, weights, _frozen(light), self._sent)
        return self._operator.bounce(self._sent)


def _cut(rows: FirstBounce, nodes: int) -> FirstBounce:
    """Rows without the entries of nodes from that number on: the last of each row, for numbers ascend."""
    ends = np.cumsum(rows.steps, dtype=np.int64)
    counts = np.diff(rows.starts)
    before = np.concatenate([[0], ends])[rows.starts[:-1]]
    kept = ends - np.repeat(before, counts) < nodes
    starts = np.concatenate([[0], np.cumsum(kept, dtype=np.int64)])[rows.starts]
    arrays = {"starts": starts, "steps": rows.steps[kept], "codes": rows.codes[kept]}
    for array in arrays.values():
        array.setflags(write=False)
    return replace(rows, **arrays, _pace=Pace(multiply_rows))


def _sums_of(
    rows: FirstBounce, places: StandIns, nodes: int
) -> tuple[np.ndarray, Int32[np.ndarray, "entries"], Float32[np.ndarray, "entries 3"]]:
    """Where each node's entries start, their stand-ins, and how much of their light is in the node's mean."""
    share = np.ones(nodes, np.float32)
    while len(share) < len(rows.left):
        left = rows.left[len(share) : 2 * len(share)]
        share = np.stack([share * left, share * (1 - left)], axis=1).reshape(-1)
    vertices = len(rows.order)
    mean = share[:vertices, None] * rows.colours[rows.order]
    node = np.arange(vertices) // (len(rows.left) // nodes)
    near, weights = places.near[rows.order], places.weights[rows.order]
    pairs, which = np.unique((node[:, None] * len(places) + near).ravel(), return_inverse=True)
    sums = [np.bincount(which, (mean[:, c : c + 1] * weights).ravel()) for c in range(3)]
    starts = np.searchsorted(pairs, np.arange(nodes + 1) * len(places))
    of_entry, weights = (pairs % len(places)).astype(np.int32), np.stack(sums, axis=1).astype(np.float32)
    return starts, _frozen(of_entry), _frozen(weights)


def _frozen(values: np.ndarray) -> np.ndarray:
    view = np.ascontiguousarray(values).view()
    view.flags.writeable = False
    return view

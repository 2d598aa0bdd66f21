"""A binary tree over vertices, and light as means over its halves: the basis in which rows of a bounce are few numbers.

What arrives from a surface far away hardly depends on where on it light leaves. So a row of the one-bounce operator is
kept as how much of it goes to each half of ever smaller groups of vertices, against what their masses would say (Haar
wavelets with weights); most of that is next to nothing. Node 1 is the root, nodes 2k and 2k + 1 are the halves of k,
leaf i is node size + i, where size is a power of two.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Float32, Int32, Normals, Positions
from ..storage.environment_layer import tree_size

_NORMAL_WEIGHT = 0.5  # of the scene's extent: a turn of one radian is as far


def vertex_order(positions: Positions, normals: Normals) -> Int32[np.ndarray, "vertices"]:
    """Leaves of the tree from left to right: halved again and again where places and normals differ most.

    Every left half of a node is full, 2^(height − 1) vertices; only the last nodes of a level are not whole.
    """
    extent = float(np.ptp(positions, axis=0).max()) or 1.0
    points = np.concatenate([positions, normals * (_NORMAL_WEIGHT * extent)], axis=1)
    order = np.empty(len(points), np.int32)
    todo = [(np.arange(len(points)), 0)]
    while todo:  # nodes, not vertices
        part, start = todo.pop()
        if len(part) == 1:
            order[start] = part[0]
            continue
        half = 1 << (len(part) - 1).bit_length() - 1
        place = points[part]
        across = place[:, np.argmax(np.ptp(place, axis=0))]
        sorted_part = part[np.argsort(across, kind="stable")]
        todo += [(sorted_part[:half], start), (sorted_part[half:], start + half)]
    return order


def left_shares(
    order: Int32[np.ndarray, "vertices"], masses: Float32[np.ndarray, "vertices"]
) -> Float32[np.ndarray, "size"]:
    """Of each node, the share of its mass that its left half has; 1 where there is no right one. 0 is no node."""
    size = tree_size(len(order))
    whole = np.zeros(2 * size)
    whole[size : size + len(order)] = masses[order]
    for first, last in _levels(size):
        whole[first:last] = whole[2 * first : 2 * last : 2] + whole[2 * first + 1 : 2 * last : 2]
    left = np.ones(size)
    np.divide(whole[2::2], whole[1:size], out=left[1:], where=whole[1:size] > 0)
    return left.astype(np.float32)


def halves(
    light: Float32[np.ndarray, "vertices n"],
    order: Int32[np.ndarray, "vertices"],
    left: Float32[np.ndarray, "size"],
) -> Float32[np.ndarray, "size n"]:
    """Of each node k from 1 on, how much more its left half has in the mean than its right; at 0, the mean of all.

    Means are by the shares ``left`` of halves.
    """
    size = len(left)
    means = np.zeros((2 * size, light.shape[1]), np.float32)
    means[size : size + len(order)] = light[order]
    out = np.empty((size, light.shape[1]), np.float32)
    for first, last in _levels(size):
        right = means[2 * first + 1 : 2 * last : 2]
        np.subtract(means[2 * first : 2 * last : 2], right, out=out[first:last])
        np.multiply(out[first:last], left[first:last, None], out=means[first:last])
        means[first:last] += right
    out[0] = means[1]
    return out


def from_halves(
    values: Float32[np.ndarray, "size n"],
    order: Int32[np.ndarray, "vertices"],
    left: Float32[np.ndarray, "size"],
) -> Float32[np.ndarray, "vertices n"]:
    """The transpose of ``halves``."""
    size = len(left)
    means = np.empty((2 * size, values.shape[1]), np.float32)
    means[1] = values[0]
    for first, last in reversed(_levels(size)):
        share = left[first:last, None]
        means[2 * first : 2 * last : 2] = share * means[first:last] + values[first:last]
        means[2 * first + 1 : 2 * last : 2] = (1 - share) * means[first:last] - values[first:last]
    out = np.empty((len(order), values.shape[1]), np.float32)
    out[order] = means[size : size + len(order)]
    return out


def _levels(size: int) -> list[tuple[int, int]]:
    """First and last inner node of every level, the lowest first."""
    return [(1 << k, 2 << k) for k in reversed(range(size.bit_length() - 1))]

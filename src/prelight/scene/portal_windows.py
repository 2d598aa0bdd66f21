"""Which panes belong to one window: those that touch, or are parted by no more than a bar."""

from __future__ import annotations

import numpy as np

from ..arrays import Float64, Int64

_BAR = 0.12  # metres between the boxes around two panes of one window
_SAME_PLACE = 1e-6  # of the extent
_MOST_PANES = 2000  # beyond it panes are windows


def windows_of(corners: Float64[np.ndarray, "triangles 3 3"]) -> Int64[np.ndarray, "triangles"]:
    """The window of each triangle, numbered from 0 in the order of their first triangles."""
    pane = _connected(corners)
    count = int(pane.max()) + 1
    if 1 < count <= _MOST_PANES:
        low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        np.minimum.at(low, pane, corners.min(axis=1))
        np.maximum.at(high, pane, corners.max(axis=1))
        gap = np.maximum(0, np.maximum(low[:, None] - high[None], low[None] - high[:, None]))
        first, second = np.nonzero(np.linalg.norm(gap, axis=2) <= _BAR)
        pane = components(count, first, second)[pane]
    _, first = np.unique(pane, return_index=True)
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first, kind="stable")] = np.arange(len(first))
    return rank[pane]


def _connected(corners: np.ndarray) -> Int64[np.ndarray, "triangles"]:
    """Triangles joined by corners at one place."""
    flat = corners.reshape(-1, 3)
    grid = max(float(np.ptp(flat, axis=0).max()), 1e-12) * _SAME_PLACE
    _, place = np.unique(np.round(flat / grid).astype(np.int64), axis=0, return_inverse=True)
    place = place.reshape(-1, 3)
    of_place = components(int(place.max()) + 1, place[:, [0, 1]].ravel(), place[:, [1, 2]].ravel())
    return of_place[place[:, 0]]


def components(
    count: int, first: Int64[np.ndarray, "links"], second: Int64[np.ndarray, "links"]
) -> Int64[np.ndarray, "count"]:
    """Numbers 0 … of the connected parts of a graph: labels sink to the least of their part, by pointer jumping."""
    label = np.arange(count)
    while True:
        before = label.copy()
        least = np.minimum(label[first], label[second])
        np.minimum.at(label, label[first], least)
        np.minimum.at(label, label[second], least)
        label = label[label]
        if (label == before).all():
            return np.unique(label, return_inverse=True)[1]

"""What photons are aimed at: a few balls around the parts of a scene that light must meet first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Int32, Positions

MOST_BALLS = 8
_ROUNDED = 1.0001  # so that nothing lies outside by rounding


@dataclass(frozen=True)
class Balls:
    """Balls that enclose, together, all that photons are aimed at."""

    centres: Float32[np.ndarray, "balls 3"]
    radii: Float32[np.ndarray, "balls"]

    @classmethod
    def around(cls, positions: Positions, triangles: Int32[np.ndarray, "triangles 3"]) -> Balls:
        """Of the connected parts of these triangles; those nearest to each other share one, eight at most."""
        parts = _connected(positions, triangles)
        boxes = np.array([(positions[p].min(axis=0), positions[p].max(axis=0)) for p in parts], np.float64)
        groups = [[k] for k in range(len(parts))]
        while len(boxes) > MOST_BALLS:
            boxes, groups = _nearest_joined(boxes, groups)
        centres = boxes.mean(axis=1)
        radii = [
            max(float(np.linalg.norm(positions[parts[k]] - centre, axis=1).max()) for k in group)
            for centre, group in zip(centres, groups, strict=True)
        ]
        return cls(centres.astype(np.float32), (np.array(radii) * _ROUNDED + 1e-7).astype(np.float32))

    def __len__(self) -> int:
        return len(self.radii)


def _connected(positions: Positions, triangles: np.ndarray) -> list[np.ndarray]:
    """Vertices of each connected part; places that coincide are one vertex."""
    used, corners = np.unique(triangles, return_inverse=True)
    _, same = np.unique(positions[used], axis=0, return_inverse=True)
    same = same.ravel()
    corners = same[corners.reshape(-1, 3)]
    label = np.arange(int(same.max()) + 1)
    while True:
        new, least = label.copy(), label[corners].min(axis=1)
        for k in range(3):
            np.minimum.at(new, corners[:, k], least)
        new = new[new]
        if (new == label).all():
            break
        label = new
    order = np.argsort(label[same], kind="stable")
    return np.split(used[order], np.flatnonzero(np.diff(label[same][order])) + 1)


def _nearest_joined(boxes: np.ndarray, groups: list[list[int]]) -> tuple[np.ndarray, list[list[int]]]:
    """The two boxes whose join is the smallest become one. Of many, only the first few hundred are tried."""
    few = boxes[:256]
    size = np.linalg.norm(
        np.maximum(few[:, None, 1], few[None, :, 1]) - np.minimum(few[:, None, 0], few[None, :, 0]), axis=2
    )
    np.fill_diagonal(size, np.inf)
    i, j = sorted(int(k) for k in np.unravel_index(size.argmin(), size.shape))
    joined = np.stack([np.minimum(boxes[i, 0], boxes[j, 0]), np.maximum(boxes[i, 1], boxes[j, 1])])
    others = [g for k, g in enumerate(groups) if k not in (i, j)]
    return np.concatenate([joined[None], np.delete(boxes, [i, j], axis=0)]), [groups[i] + groups[j], *others]

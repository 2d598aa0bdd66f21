"""Rigid bodies that move, each in a tree of boxes made once, and the light that comes back from what rays meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..arrays import Directions, Float32, Float64, Int32, Positions, Triangles
from ..errors import InputError
from .box_tree_kernels import build
from .shaded_kernels import look

_PADDING = np.float32(1e-6)  # of boxes, in coordinates within [−1, 1]
MOST_TRIANGLES = 20_000_000  # so that leaves, eight numbers a triangle, stay within 31 bits
MOST_SUNS = 16
_LARGEST_HIDING = 8.0  # metres: a bus hides sky from the street, a town does not hide it from a bus


@dataclass(frozen=True)
class Body:
    """Matte triangles that move together.

    ``colour`` and ``emission`` are one for each triangle, linear; ``normals`` those of its corners; ``openness`` how
    much of the light of an even sky reaches each of these, 0 to 1.
    """

    positions: Positions  # (V, 3) metres
    triangles: Triangles  # (F, 3), at least one
    normals: Float32[np.ndarray, "triangles 3 3"]
    colour: Float32[np.ndarray, "triangles 3"]
    emission: Float32[np.ndarray, "triangles 3"]
    openness: Float32[np.ndarray, "triangles 3"]


class Illumination(NamedTuple):
    """What lights bodies, in the world's axes.

    ``sky`` are nine numbers a channel: irradiance on a surface of normal (x, y, z) is their sum with 1, x, y, z, xy,
    yz, zx, x² − y², 3z² − 1. ``suns`` are unit directions and irradiances of surfaces that face them; they cast
    shadows. ``around`` is the irradiance that what does not see the sky has from its surroundings.
    """

    sky: Float32[np.ndarray, "9 3"]
    suns: Float32[np.ndarray, "suns 6"]
    around: Float32[np.ndarray, "3"]


NO_LIGHT = Illumination(*(np.zeros(shape, np.float32) for shape in ((9, 3), (0, 6), (3,))))


class Bodies:
    """Several bodies, traced together wherever they stand. They cast shadows on each other.

    Raises InputError if there are none, or more triangles than can be numbered.
    """

    def __init__(self, bodies: Sequence[Body]) -> None:
        total = sum(len(body.triangles) for body in bodies)
        if not bodies or not total:
            raise InputError("outside", "no triangles: nothing stands there")
        if total > MOST_TRIANGLES:
            raise InputError("outside", f"{total:,} triangles, at most {MOST_TRIANGLES:,} are traced")
        trees = [_Tree.of(body) for body in bodies]
        nodes = np.cumsum([0, *(len(tree.bounds) for tree in trees)])
        before = np.cumsum([0, *(len(body.triangles) for body in bodies)])
        self._children = np.concatenate(
            [np.where(tree.children >= 0, tree.children + nodes[k], tree.children - 8 * before[k])
             for k, tree in enumerate(trees)]
        ).astype(np.int32)  # fmt: skip
        self._bounds = np.concatenate([tree.bounds for tree in trees])
        self._corners = np.concatenate([tree.corners for tree in trees])
        self._roots = nodes[:-1].astype(np.int32)
        self._frames = [(tree.centre, tree.scale, tree.reach, tree.hides) for tree in trees]
        self.colour, self._emission, self._normals, self.openness = (
            np.ascontiguousarray(np.concatenate(parts), np.float32)
            for parts in zip(*(_ordered(body, tree.order) for body, tree in zip(bodies, trees, strict=True)),
                             strict=True)
        )  # fmt: skip
        self.triangles, self._counts = total, np.diff(before)
        self.place([(np.eye(3), np.zeros(3))] * len(bodies))

    @property
    def nbytes(self) -> int:
        """Memory of trees and looks."""
        arrays = (self._children, self._bounds, self._corners, self.colour, self._emission, self._normals)
        return sum(array.nbytes for array in (*arrays, self.openness))

    @property
    def corner_normals(self) -> Float32[np.ndarray, "triangles 9"]:
        """Of the corners of all triangles, in the bodies' own axes."""
        return self._normals

    @property
    def areas(self) -> Float64[np.ndarray, "triangles"]:
        """Of all triangles, square metres."""
        scale = np.repeat([1.0 / frame[1] for frame in self._frames], self._counts)
        a, b, c = (self._corners[:, 3 * k : 3 * k + 3].astype(np.float64) for k in range(3))
        return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1) * scale**2

    def place(self, where: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
        """Move the bodies: of each a rotation (3, 3) from its own axes to the world's, and a shift (3,), metres."""
        to_local, balls, rotations = [], [], []
        for (rotation, shift), (centre, scale, reach, hides) in zip(where, self._frames, strict=True):
            linear = scale * rotation.T
            to_local.append(np.column_stack([linear, -linear @ shift - scale * centre]).ravel())
            balls.append([*(rotation @ centre + shift), reach, hides])
            rotations.append(rotation.ravel())
        self._to_local, self._balls, self._rotations = (
            np.ascontiguousarray(rows, np.float32) for rows in (to_local, balls, rotations)
        )

    def look(
        self, origins: Positions, directions: Directions, light: Illumination
    ) -> Float32[np.ndarray, "n 4"]:
        """Radiance (n, 3) of what rays meet first, and 1 in the last column; zeros where they meet nothing.

        ``origins`` are (n, 3), or (1, 3) for all; ``directions`` (n, 3) unit. Surfaces are matte and seen from both
        sides; their light is the sky's, the suns' where nothing stands before them, and their own.
        """
        out = np.empty((len(directions), 4), np.float32)
        look(
            (self._bounds, self._children, self._corners, self._to_local, self._balls, self._roots),
            (self.colour, self._emission, self._normals, self.openness, self._rotations),
            (light.sky, light.suns, light.around),
            np.ascontiguousarray(origins, np.float32),
            np.ascontiguousarray(directions, np.float32),
            out,
        )
        return out


class _Tree(NamedTuple):
    """Boxes of one body, its triangles' corners in the order of its leaves, and where in space it lies."""

    bounds: Float32[np.ndarray, "nodes 12"]
    children: Int32[np.ndarray, "nodes 2"]
    corners: Float32[np.ndarray, "triangles 9"]
    order: Int32[np.ndarray, "triangles"]
    centre: Float64[np.ndarray, "3"]
    scale: float  # what metres are multiplied by
    reach: float  # of the ball around it, metres
    hides: (
        float  # radius of a ball that is as large from all sides, on average; 0 of what is too large for that
    )

    @classmethod
    def of(cls, body: Body) -> _Tree:
        used = body.positions[body.triangles].astype(np.float64)
        low, high = used.min(axis=(0, 1)), used.max(axis=(0, 1))
        centre = (low + high) / 2
        scale = 2.0 / (float((high - low).max()) or 1.0)
        corners = ((used - centre) * scale).astype(np.float32)
        boxes = np.concatenate([corners.min(axis=1) - _PADDING, corners.max(axis=1) + _PADDING], axis=1)
        count = len(corners)
        order = np.arange(count, dtype=np.int32)
        bounds = np.empty((count, 12), np.float32)
        children, axes = np.empty((count, 2), np.int32), np.empty(count, np.int8)
        nodes = build(boxes, order, bounds, children, axes)
        reach = float(np.linalg.norm(used - centre, axis=-1).max()) * (1.0 + 1e-5) + 1e-6
        ordered = np.ascontiguousarray(corners[order].reshape(-1, 9))
        a, b, c = (high - low).tolist()
        hides = float(
            np.sqrt((a * b + b * c + c * a) / (2.0 * np.pi))
        )  # a quarter of a convex body's surface
        hides = hides if hides < _LARGEST_HIDING else 0.0
        return cls(
            bounds[:nodes].copy(), children[:nodes].copy(), ordered, order, centre, scale, reach, hides
        )


def _ordered(body: Body, order: Int32[np.ndarray, "triangles"]) -> tuple[np.ndarray, ...]:
    """Looks of the triangles in the order of the tree."""
    normals = body.normals[order].reshape(-1, 9)
    return body.colour[order], body.emission[order], normals, body.openness[order]

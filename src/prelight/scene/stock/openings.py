"""Flat walls with arched openings: the wall around one, its reveal through the wall's thickness, and its pane.

A wall's plane has coordinates (s, y), metres: s to the right of one who faces it, y up.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from ...arrays import Float64
from .parts import Part, split_quads, together

Points = Float64[np.ndarray, "n 2"]
Grid = Float64[np.ndarray, "rows columns 3"]


@dataclass(frozen=True)
class Wall:
    """A plane: a corner, and the unit directions of s and y. It is seen from where these turn counter-clockwise."""

    corner: tuple[float, float, float]
    right: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)

    @property
    def normal(self) -> Float64[np.ndarray, "3"]:
        """Toward whom it faces."""
        return np.cross(self.right, self.up)

    def at(self, points: Float64[np.ndarray, "... 2"], depth: float = 0.0) -> Float64[np.ndarray, "... 3"]:
        """In space; ``depth`` behind the plane."""
        flat = (
            np.array(self.corner)
            + points[..., :1] * np.array(self.right)
            + points[..., 1:] * np.array(self.up)
        )
        return flat - depth * self.normal

    def between(self, lower: Points, upper: Points, *, rows: int, depth: float = 0.0) -> Part:
        """A flat part between two lines of as many points, the first below the second."""
        share = np.linspace(0.0, 1.0, rows + 1)[:, None, None]
        grid = self.at((1.0 - share) * lower + share * upper, depth)
        return of_grid(grid, np.broadcast_to(self.normal, grid.shape))

    def rectangle(self, s: Float64[np.ndarray, "m"], y: Float64[np.ndarray, "n"]) -> Part:
        """A flat part with vertices at all places of ascending s and y."""
        grid = self.at(np.stack(np.meshgrid(s, y), axis=-1))
        return of_grid(grid, np.broadcast_to(self.normal, grid.shape))


@dataclass(frozen=True)
class Opening:
    """A window: upright sides from the sill to the spring of its arch; of a circle both are its middle."""

    middle: float  # s
    half_width: float
    sill: float  # y
    spring: float
    arch: Literal["round", "pointed", "circle"] = "round"

    def across(self, count: int) -> Float64[np.ndarray, "n"]:
        """Places from side to side, as even along the arch as can be."""
        return self.middle - self.half_width * np.cos(np.linspace(0.0, np.pi, count + 1))

    def high(self, s: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
        """Its upper edge."""
        off, w = np.abs(s - self.middle), self.half_width
        if self.arch == "pointed":  # two arcs, each around the foot of the other
            return self.spring + np.sqrt(np.maximum(4 * w * w - (off + w) ** 2, 0.0))
        return self.spring + np.sqrt(np.maximum(w * w - off * off, 0.0))

    def low(self, s: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
        """Its lower edge."""
        if self.arch == "circle":
            return 2 * self.spring - self.high(s)
        return np.full_like(s, self.sill)

    @property
    def top(self) -> float:
        """Of its arch."""
        return float(self.high(np.array([self.middle]))[0])

    def around(
        self, wall: Wall, span: tuple[float, float], height: tuple[float, float], *, step: float
    ) -> Part:
        """The wall over a span of s and a height of y, but for the opening; nothing below it where it begins there."""
        count = arch_steps(self, step)
        s = self.across(count)
        edges = np.array([self.middle - self.half_width, self.middle + self.half_width])
        through = sorted({round(y, 9) for y in (self.sill, self.spring) if height[0] < y < height[1]})
        y = ticks(height[0], height[1], step=step, through=tuple(through))
        parts = [
            wall.rectangle(ticks(span[0], edges[0], step=step), y),
            wall.rectangle(ticks(edges[1], span[1], step=step), y),
        ]
        upper = np.stack([s, np.full_like(s, height[1])], axis=1)
        rows = max(1, round((height[1] - self.top) / step))
        parts.append(wall.between(np.stack([s, self.high(s)], axis=1), upper, rows=rows))
        if self.sill > height[0] or self.arch == "circle":
            lower = np.stack([s, np.full_like(s, height[0])], axis=1)
            rows = max(1, round((self.sill - height[0]) / step))
            parts.append(wall.between(lower, np.stack([s, self.low(s)], axis=1), rows=rows))
        return together(parts)

    def reveal(self, wall: Wall, *, depth: float, step: float) -> Part:
        """The sides of the opening, from the wall's plane to ``depth`` behind it, seen from within the opening."""
        s = self.across(arch_steps(self, step))
        rows = max(1, round(depth / step))
        upper = np.stack([s, self.high(s)], axis=1)
        lines = [upper[::-1]]
        if self.arch == "circle":
            lines.append(np.stack([s, self.low(s)], axis=1))
        else:
            jamb = ticks(self.sill, self.spring, step=step)
            left, right = s[0], s[-1]
            lines += [
                np.stack([np.full_like(jamb, right), jamb], axis=1),
                np.stack([np.full_like(jamb, left), jamb[::-1]], axis=1),
                np.stack([s, np.full_like(s, self.sill)], axis=1),
            ]
        return together([drawn(wall, line, depth=depth, rows=rows) for line in lines])

    def pane(self, wall: Wall, *, depth: float, cells: tuple[int, int]) -> Grid:
        """Corners of the panes of glass, (rows + 1, columns + 1, 3): rows from the sill up."""
        rows, columns = cells
        s = self.across(columns)
        share = np.linspace(0.0, 1.0, rows + 1)[:, None]
        y = (1.0 - share) * self.low(s) + share * self.high(s)
        return wall.at(np.stack([np.broadcast_to(s, y.shape), y], axis=-1), depth)


def arch_steps(opening: Opening, step: float) -> int:
    """Into how many pieces an arch is cut: an even number, so that it keeps its point."""
    return max(4, 2 * round(np.pi * opening.half_width / step / 2))


def ticks(
    low: float, high: float, *, step: float, through: tuple[float, ...] = ()
) -> Float64[np.ndarray, "n"]:
    """From ``low`` to ``high`` in steps of about ``step``, some places among them."""
    places = [low, *through, high]
    pieces = [np.linspace(a, b, max(1, round((b - a) / step)), endpoint=False) for a, b in pairwise(places)]
    return np.append(np.concatenate(pieces), high)


def of_grid(grid: Grid, normals: Float64[np.ndarray, "rows columns 3"]) -> Part:
    """A part of a grid of vertices, its triangles on the side of the normals; none of no area."""
    rows, columns = grid.shape[0] - 1, grid.shape[1] - 1
    positions, normal = grid.reshape(-1, 3), normals.reshape(-1, 3)
    i, j = np.divmod(np.arange(rows * columns), columns)
    k = i * (columns + 1) + j
    triangles = split_quads(positions, np.stack([k, k + 1, k + columns + 2, k + columns + 1], axis=1))
    a, b, c = (positions[triangles[:, n]] for n in range(3))
    across = np.cross(b - a, c - a)
    area = np.linalg.norm(across, axis=1)
    keep = area > 1e-9 * max(float(area.max()), 1e-12)
    turned = (across * normal[triangles[:, 0]]).sum(axis=1)[keep].sum() < 0
    triangles = triangles[keep][:, [0, 2, 1]] if turned else triangles[keep]
    used, triangles = np.unique(triangles, return_inverse=True)
    return Part(positions[used], normal[used], triangles.reshape(-1, 3).astype(np.int32))


def drawn(wall: Wall, line: Points, *, depth: float, rows: int) -> Part:
    """A line of a wall's plane drawn into its depth, as a strip; seen from the left of the line's way."""
    grid = np.stack([wall.at(line, d) for d in np.linspace(0.0, depth, rows + 1)])
    along = np.gradient(line, axis=0)
    out = np.stack([-along[:, 1], along[:, 0]], axis=1)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    normals = out[:, :1] * np.array(wall.right) + out[:, 1:] * np.array(wall.up)
    return of_grid(grid, np.broadcast_to(normals, grid.shape))

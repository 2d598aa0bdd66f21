"""From photons to irradiance at vertices: sums over the nearest ones, by what of the surface their kernel covers."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..arrays import Float32, Int32, Int64
from ..errors import InputError
from ..rays.box_tree_kernels import build
from ..rays.packet_kernels import morton_codes
from ..scene.geometry import Scene
from .covered_area_kernels import covered_areas
from .hemisphere import lit_sides
from .photon_density_kernels import build_tree, cell_sums, kernel_pairs, kernel_sums, nearest_radii
from .photon_tracing import Photons
from .specular import specular_materials

NEAREST = 200
FINEST, WIDEST = 0.5, 4.0  # edges of the mesh: how far photons are looked for, at least and at most
_MOST_NEAREST = 1 << 16
_PADDING = 1e-6  # of a scene's size, of boxes


class LitSurface:
    """The vertices of a scene as places where photons are counted, and the triangles that they land on.

    Attributes
    ----------
    spacing
        (V,) metres, the mean length of the edges at each vertex; 0 where there are none.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.points = np.ascontiguousarray(scene.positions, np.float32)
        self.normals = np.ascontiguousarray(scene.normals, np.float32)
        self.sides = lit_sides(scene)
        self.spacing = _spacing(scene)

    @cached_property
    def triangles(self) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray, np.ndarray]:
        """A tree of boxes over the triangles that photons land on, their corners (n, 9) and lit sides (n, 3)."""
        landed_on = np.flatnonzero(~specular_materials(self.scene)[self.scene.material_of])
        if not len(landed_on):
            raise InputError(
                "scene", "all of it is clear glass or mirrors: nothing is there for light to land on"
            )
        corners = np.ascontiguousarray(self.points[self.scene.triangles[landed_on]].reshape(-1, 9))
        wide = corners.reshape(-1, 3, 3)
        padding = np.float32(_PADDING * max(float(np.ptp(self.points, axis=0).max()), 1e-30))
        boxes = np.concatenate([wide.min(axis=1) - padding, wide.max(axis=1) + padding], axis=1)
        count = len(corners)
        order = np.arange(count, dtype=np.int32)
        bounds, children = np.empty((count, 12), np.float32), np.empty((count, 2), np.int32)
        nodes = build(boxes, order, bounds, children, np.empty(count, np.int8))
        tree = bounds[:nodes].copy(), children[:nodes].copy()
        return tree, corners[order], np.ascontiguousarray(self.sides[landed_on[order]])


class PhotonTree:
    """A k-d tree over photons that have landed on a surface.

    Attributes
    ----------
    order
        (photons,) of the tree; None once they lie in it.
    arrays
        Positions, unit normals of the sides landed on, both (photons, 3) in that order, and axes of cuts (photons,).
    """

    def __init__(self, surface: LitSurface, photons: Photons) -> None:
        codes = np.empty(len(photons), np.uint32)
        low, high = surface.points.min(axis=0), surface.points.max(axis=0)
        scale = np.float32(2 / max(float((high - low).max()), 1e-30))
        morton_codes(np.ascontiguousarray((photons.position - (low + high) / 2) * scale, np.float32), codes)
        near = np.argsort(codes, kind="stable").astype(np.int32)  # what is cut lies together in memory
        positions = np.ascontiguousarray(photons.position[near])
        order, axes = np.arange(len(near), dtype=np.int32), np.zeros(len(near), np.int8)
        build_tree(positions, order, axes)
        self.order: Int32[np.ndarray, "photons"] | None = near[order]
        sides = np.ascontiguousarray(surface.sides[photons.triangle[self.order]])
        self.arrays = np.ascontiguousarray(positions[order]), sides, axes

    def sort(self, photons: Photons) -> Photons:
        """The same photons in the tree's order, in which values of theirs are then expected."""
        order, self.order = self.order, None
        return photons if order is None else photons.taken(order)


class PhotonDensity:
    """Kernels around the vertices of a surface, as wide as some photons are sparse.

    Parameters
    ----------
    surface
        Where light is wanted.
    photons
        That have landed there, or their tree if it is used again.
    nearest
        Photons of a vertex' own side that its kernel reaches; more are smoother and less sharp.
    finest, widest
        Edges of the mesh around a vertex that the kernel reaches at least and at most. Finer than the mesh light
        could not be kept; wider, dark places would be lit from far away.

    Attributes
    ----------
    radii
        (V,) metres.
    areas
        (V,) m², the integral of the kernel over the surface of a vertex' own side.
    """

    def __init__(
        self,
        surface: LitSurface,
        photons: Photons | PhotonTree,
        *,
        nearest: int = NEAREST,
        finest: float = FINEST,
        widest: float = WIDEST,
    ) -> None:
        tree = photons if isinstance(photons, PhotonTree) else PhotonTree(surface, photons)
        if not (isinstance(nearest, int) and 1 <= nearest <= _MOST_NEAREST):
            raise InputError(
                "nearest", f"{nearest!r} photons, expected a whole number from 1 to {_MOST_NEAREST}"
            )
        if not 0 < finest <= widest:
            raise InputError("kernel", f"from {finest} to {widest} edges, expected 0 < finest <= widest")
        self._surface, self.order, self._tree = surface, tree.order, tree.arrays
        limits = surface.spacing[:, None] * np.array([finest, widest], np.float32)
        self.radii, self.areas = np.empty((2, len(surface.points)), np.float32)
        nearest_radii(
            self._tree, surface.points, surface.normals, np.ascontiguousarray(limits), nearest, self.radii
        )
        boxes, corners, lit = surface.triangles
        covered_areas(boxes, corners, lit, surface.points, surface.normals, self.radii, self.areas)

    def sums(
        self, values: Float32[np.ndarray, "photons functions"]
    ) -> tuple[Float32[np.ndarray, "vertices functions"], Float32[np.ndarray, "vertices functions"]]:
        """Σ K v / ∫K of each vertex, v in the photons' own order; and the sum of the terms' squares."""
        out, squares = np.empty((2, len(self.radii), values.shape[1]), np.float32)
        ordered = np.ascontiguousarray(values if self.order is None else values[self.order], np.float32)
        points, normals = self._surface.points, self._surface.normals
        kernel_sums(self._tree, ordered, points, normals, self.radii, self.areas, out, squares)
        return out, squares

    def in_cells(
        self,
        values: Float32[np.ndarray, "photons colours"],
        cells: Int32[np.ndarray, "photons"],
        count: int,
        *,
        rows: slice,
    ) -> Float32[np.ndarray, "rows cells colours"]:
        """``sums`` for functions that are 1 in one of ``count`` cells each, of some vertices."""
        points, normals = self._surface.points[rows], self._surface.normals[rows]
        out = np.empty((len(points), count, values.shape[1]), np.float32)
        order = slice(None) if self.order is None else self.order
        ordered = np.ascontiguousarray(values[order], np.float32)
        of_photon = np.ascontiguousarray(cells[order], np.int32)
        cell_sums(self._tree, ordered, of_photon, points, normals, self.radii[rows], self.areas[rows], out)
        return out

    def pairs(
        self, rows: Int64[np.ndarray, "rows"]
    ) -> tuple[Int64[np.ndarray, "rows_and_one"], Int32[np.ndarray, "n"], Float32[np.ndarray, "n"]]:
        """The photons of some vertices one by one: where each begins, numbers of the photons, K / ∫K."""
        points, normals = self._surface.points[rows], self._surface.normals[rows]
        starts = np.zeros(len(rows) + 1, np.int64)
        places = self._tree, points, normals, self.radii[rows], self.areas[rows], starts
        kernel_pairs(*places, np.empty(0, np.int32), np.empty(0, np.float32))
        np.cumsum(starts, out=starts)
        photons, weights = np.empty(starts[-1], np.int32), np.empty(starts[-1], np.float32)
        if len(photons):
            kernel_pairs(*places, photons, weights)
        return starts, photons if self.order is None else self.order[photons], weights


def _spacing(scene: Scene) -> Float32[np.ndarray, "vertices"]:
    corners = scene.positions[scene.triangles].astype(np.float64)
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    total, count = np.zeros((2, len(scene.positions)))
    for k in range(3):
        for vertex in (scene.triangles[:, k], scene.triangles[:, (k + 1) % 3]):
            np.add.at(total, vertex, lengths[:, k])
            np.add.at(count, vertex, 1)
    return np.divide(total, count, out=np.zeros_like(total), where=count > 0).astype(np.float32)

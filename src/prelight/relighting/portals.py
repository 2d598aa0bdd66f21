"""Relighting a room through its portals: shells of what is outside, glass, and what they bring to every vertex.

Portals paper, section 5. Each portal has a shell, a cube map of the radiance that is seen from its middle; its glass
blurs and filters that. Direct light is a product of the shell with rows of pulses or Haar coefficients, bounced light
one with the shell's spherical harmonics. Portals add; glass that only filters costs no more than the adding.

Harmonics of low order know no sun: what is brighter in a few cells than they can hold bounces from where it falls, by
the one-bounce operator itself, where the layer keeps that.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cached_property

import numpy as np

from ..arrays import CubeMap, Directions, Float32, Float64, Radiance
from ..bases import cube_map
from ..bases.harmonic_cells import cell_harmonics
from ..encoding.pulse_or_haar import light_tables, lit
from ..encoding.sparse_tiles import GROUP
from ..errors import InputError
from ..lighting.environment import Environment
from ..lighting.frost import frosted
from ..lighting.glass import AS_BUILT, Glass, glass_of
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from ..storage.bake import Bake
from .bounced_kernels import bounce
from .environment import Update
from .pace import Pace
from .portal_kernels import add_panes, write_scaled
from .portals_layer import PortalsLayer, read_portals
from .shells import Shells
from .through_glass import Panes

_ABOVE = 6.0  # times the mean radiance of a shell: a cell that is brighter is a sun's, or a lamp's
_SHARE = 0.05  # of a shell's light that such cells have, if they are to count
_LITTLE = 0.005  # of the light of suns that falls: what it may leave to bounce
_MOST = 24  # bounces of suns

_View = tuple[
    int, float, tuple[float, ...]
]  # of a shell through glass: which shell, frost, and outward if frosted


class PortalsRelighter:
    """A ``LiveLayer``: a room under what is outside its portals, through the glass that a rig says they have.

    Raises InputError if the bake has no such layer, DamagedBakeError.
    """

    def __init__(self, bake: Bake, name: str | None = None) -> None:
        self.layer: PortalsLayer = read_portals(bake, name)
        self.name = self.layer.name
        self.vertices = len(bake.receivers)
        self._positions = bake.receivers.positions
        self._shells = Shells(bake.receivers.positions, bake.triangles)
        n = self.layer.cube
        self._shell = np.zeros((1, 6, n, n, 3), np.float32)  # as last asked for: one, or one for each portal
        self._version = 0  # of all shells
        self._glass: list[Glass] = [AS_BUILT] * len(self.layer.names)
        self._of_row = np.zeros((len(self.layer.rows), 3), np.float32)  # through clear colourless glass
        self._of_suns = np.zeros_like(self._of_row)  # of that, what suns bring
        self._has_suns = np.zeros(len(self.layer.names), bool)
        self._rows = self.layer.rows.layer()
        self._lit, self._add, self._bounce, self._scale = (
            Pace(lit),
            Pace(add_panes),
            Pace(bounce),
            Pace(write_scaled),
        )
        self._view_of_portal: list[_View | None] = [None] * len(self.layer.names)
        self._coefficients = np.zeros((len(self.layer.names), max(0, self.layer.order + 1) ** 2, 3))
        self._total: Radiance | None = np.zeros((self.vertices, 3), np.float32)
        self.last = Update("none", 0.0, 0, 0)

    # ---- light -----------------------------------------------------------------------------------

    def light(self, rig: Rig) -> bool:
        """Take the environment, what is outside, and the glass. Raises InputError for glass of no portal here."""
        started = time.perf_counter()
        glass = glass_of(self.layer.names, rig.portals)
        changed = self._shells.light(rig)
        if changed:
            self._capture()
        if not changed and glass == self._glass:
            self.last = Update("none", (time.perf_counter() - started) * 1e3, 0, 0)
            return False
        self._glass = glass
        return self._follow(started)

    def set_shells(
        self, shells: Float32[np.ndarray, "portals 6 row column 3"], glass: list[Glass] | None = None
    ) -> None:
        """Light with these shells, (P, 6, n, n, 3) or one for all, whatever a rig said: for whoever captures them.

        Raises InputError for another shape, or values that are negative or not finite.
        """
        started, n = time.perf_counter(), self.layer.cube
        given = np.asarray(shells, np.float32)
        if given.shape[1:] != (6, n, n, 3) or len(given) not in (1, len(self.layer.names)):
            raise InputError("shells", f"{given.shape}, expected (portals or 1, 6, {n}, {n}, 3)")
        if not ((given >= 0).all() and np.isfinite(given).all()):
            raise InputError("shells", "values that are negative or not finite; expected radiance")
        self._shell = np.ascontiguousarray(given)
        self._version += 1
        self._glass = self._glass if glass is None else list(glass)
        self._follow(started)

    def _capture(self) -> None:
        shells, n = self._shells, self.layer.cube
        if shells.same_everywhere:
            self._shell = shells.environment.cube(n)[None]
        else:
            self._shell = shells.shells_of(self.layer.centres, n)
        self._version += 1

    def _follow(self, started: float) -> bool:
        read = changed = 0
        groups: dict[_View, list[int]] = {}
        for p in range(len(self.layer.names)):
            view = self._view(p)
            if view != self._view_of_portal[p]:
                groups.setdefault(view, []).append(p)
                self._view_of_portal[p] = view
        for portals in groups.values():
            shell = self._seen(portals[0])
            suns = strong_cells(shell) if self.layer.first is not None else None
            self._has_suns[portals] = suns is not None
            tables = [(light_tables(shell), self._of_row)]
            if suns is not None:
                tables.append((light_tables(suns), self._of_suns))
            for first, last in self._stretches(portals):
                size = int(self._bytes[last] - self._bytes[first])
                for table, out in tables:
                    self._lit(size, self._rows, table, out, first, last)
                read += len(tables) * size
                changed += last - first
            if self.layer.order >= 0:
                self._coefficients[portals] = self._harmonics(shell if suns is None else shell - suns)
        self._total = self._added()
        if self.layer.modes is not None:
            read += self.layer.modes.nbytes
        kind = "full" if groups and changed == len(self.layer.rows) else "local"
        self.last = Update(kind, (time.perf_counter() - started) * 1e3, read, changed)
        return True

    def _view(self, portal: int) -> _View:
        """What makes a portal's shell through clear or frosted glass, whatever its colour."""
        frost = self._glass[portal].frost
        shell = portal if len(self._shell) > 1 else 0
        outward = tuple(self.layer.outward[portal].tolist()) if frost else ()
        return self._version * len(self.layer.names) + shell, frost, outward

    def _seen(self, portal: int) -> CubeMap:
        shell = self._shell[portal if len(self._shell) > 1 else 0]
        return frosted(shell, self._glass[portal].frost, self.layer.outward[portal])

    def _stretches(self, portals: list[int]) -> list[tuple[int, int]]:
        """Rows first … last of these portals' panes, neighbours together."""
        out: list[tuple[int, int]] = []
        for pane in np.flatnonzero(np.isin(self.layer.portal_of_pane, portals)):
            first, last = int(self.layer.pane_rows[pane]), int(self.layer.pane_rows[pane + 1])
            if out and out[-1][1] == first:
                out[-1] = out[-1][0], last
            elif last > first:
                out.append((first, last))
        return out

    def _harmonics(self, shell: CubeMap) -> Float64[np.ndarray, "functions 3"]:
        _, integrals = cell_harmonics(self.layer.order, self.layer.cube)
        return np.einsum("ck,cj->kj", integrals, shell.reshape(-1, 3), dtype=np.float64)

    @property
    def _factors(self) -> Float32[np.ndarray, "portals 3"]:
        """What the glass of each portal lets through."""
        own = self.layer.tints.tolist()
        return np.array(
            [glass.factor(tint) for glass, tint in zip(self._glass, own, strict=True)], np.float32
        )

    def _added(self) -> Radiance:
        layer, factors = self.layer, self._factors
        total = np.zeros((self.vertices, 3), np.float32)
        if layer.modes is not None:
            assert layer.weights is not None  # with the modes
            assert layer.scales is not None
            weights = np.broadcast_to(layer.weights, (*layer.weights.shape[:2], 3, layer.weights.shape[3]))
            light = self._coefficients * factors[:, None].astype(np.float64)
            of_mode = np.einsum("pkcm,pkc->mc", weights, light).astype(np.float32)
            sums = np.empty((len(layer.modes), 3 * GROUP), np.float32)
            self._bounce(layer.modes.nbytes, layer.modes, self._every, np.ascontiguousarray(of_mode), sums)
            self._scale(sums.nbytes, sums, layer.scales, total)
        of_pane = factors[layer.portal_of_pane] * layer.pane_tints
        if layer.first is not None and (of_pane[self._has_suns[layer.portal_of_pane]] > 0).any():
            total += self._bounced_suns(of_pane)
        self._panes_onto(total, of_pane, self._of_row)
        return total

    def _panes_onto(self, total: Radiance, of_pane: np.ndarray, of_row: np.ndarray) -> None:
        """Add what rows bring, each times the factor of its pane."""
        factors = np.ascontiguousarray(of_pane, np.float32)
        self._add(of_row.nbytes + total.nbytes, *self._by_vertex, factors, of_row, total)

    def _bounced_suns(self, of_pane: Float32[np.ndarray, "panes 3"]) -> Radiance:
        """(V, 3) light of suns after one and more bounces, from where it falls."""
        layer = self.layer
        assert layer.first is not None  # asked by the caller
        light = np.zeros((self.vertices, 3), np.float32)
        own = np.where(self._has_suns[layer.portal_of_pane, None], of_pane, np.float32(0))
        self._panes_onto(light, own, self._of_suns)
        total, fallen = np.zeros_like(light), float(light.sum(dtype=np.float64))
        for _ in range(min(_MOST, layer.most or _MOST)):
            light = layer.first.bounce(light)
            total += light
            if float(light.sum(dtype=np.float64)) <= _LITTLE * fallen:
                break
        return total

    @cached_property
    def _every(self) -> np.ndarray:
        assert self.layer.modes is not None
        return np.arange(self.layer.modes.shape[1], dtype=np.int32)

    @cached_property
    def _bytes(self) -> np.ndarray:
        """Before each row: bytes of runs and data."""
        return self.layer.rows.row_bytes + 4 * self.layer.rows.row_runs

    @cached_property
    def _by_vertex(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        layer = self.layer
        order = np.argsort(layer.receiver, kind="stable").astype(np.int32)
        starts = np.searchsorted(layer.receiver[order], np.arange(self.vertices + 1)).astype(np.int64)
        pane = np.repeat(np.arange(len(layer.portal_of_pane), dtype=np.int32), np.diff(layer.pane_rows))
        return starts, order, np.ascontiguousarray(pane[order])

    # ---- what follows ----------------------------------------------------------------------------

    @property
    def irradiance(self) -> Radiance:
        """(V, 3) irradiance / π before albedo, direct and bounced; a copy."""
        assert self._total is not None
        return self._total.copy()

    @property
    def direct(self) -> Radiance:
        """(V, 3) of ``irradiance``, what has not bounced."""
        total = np.zeros((self.vertices, 3), np.float32)
        of_pane = self._factors[self.layer.portal_of_pane] * self.layer.pane_tints
        self._panes_onto(total, of_pane, self._of_row)
        return total

    def glossy(self, eye: Triple) -> Radiance | None:
        """(V, 3) radiance toward a point: panes show what is outside, as their glass lets it through."""
        layer = self.layer
        if not len(layer.glass):
            return None
        out = np.zeros((self.vertices, 3), np.float32)
        d = self._positions[layer.glass].astype(np.float64) - np.asarray(eye, np.float64)
        d /= np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-12)
        factors = self._factors
        for portal in np.unique(layer.glass_portal):
            own = layer.glass_portal == portal
            shell = self._seen(int(portal))
            out[layer.glass[own]] = factors[portal] * _along(shell, d[own])
        return out

    @property
    def panes(self) -> Panes | None:
        """The glass as it is now, for pictures that look through it; None where none is drawn."""
        layer = self.layer
        if not len(layer.glass):
            return None
        clear = np.array([glass.frost == 0 for glass in self._glass])
        return Panes(layer.glass, self._factors[layer.glass_portal], clear[layer.glass_portal])

    def behind(self, eye: Triple) -> Callable[[Directions], Radiance]:
        """What a camera sees where it sees out through no glass."""
        return self._shells.behind(eye)

    @property
    def environment(self) -> Environment:
        """What is far outside, in the room's axes."""
        return self._shells.environment


def strong_cells(shell: CubeMap) -> CubeMap | None:
    """The light of the brightest cells and nothing else; None where they have little of a shell's light."""
    radiance = shell.sum(axis=3)
    energy = radiance * cube_map.solid_angles(shell.shape[1])
    whole = float(energy.sum(dtype=np.float64))
    strong = radiance > _ABOVE * whole / (4 * np.pi)
    if float(energy[strong].sum(dtype=np.float64)) <= _SHARE * whole:
        return None
    return np.where(strong[..., None], shell, np.float32(0))


def _along(shell: CubeMap, d: Float64[np.ndarray, "n 3"]) -> Float32[np.ndarray, "n 3"]:
    """The texels that directions fall in."""
    n = shell.shape[1]
    face, u, v = cube_map.face_coordinates(d)
    row, column = (np.clip(((t + 1) / 2 * n).astype(np.int64), 0, n - 1) for t in (v, u))
    return shell[face, row, column]

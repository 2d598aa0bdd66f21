"""Relighting a room through its portals: shells of what is outside, glass, and what they bring to every vertex.

Portals paper, section 5. Each portal has a shell, a cube map of the radiance that is seen from its middle; its glass
blurs and filters that. Direct light is a product of the shell with rows of pulses or Haar coefficients, bounced light
one with the shell's spherical harmonics. Portals add; glass that only filters costs no more than the adding.

Small discs, such as the sun, reach receivers by rays through clear panes (``portal_suns``), as sharp as the mesh;
frosted glass blurs them with everything else. Harmonics of low order know no sun: discs, and what is brighter in a few
cells than they can hold, bounce from where they fall, by the one-bounce operator, where the layer keeps that.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cached_property

import numpy as np

from ..arrays import CubeMap, Directions, Float32, Float64, Radiance, Triangles
from ..bases.harmonic_cells import cell_harmonics
from ..drawing.view import View
from ..encoding.pulse_or_haar import light_tables, lit
from ..encoding.sparse_tiles import GROUP
from ..errors import DamagedBakeError, InputError
from ..lighting.disc import Disc, add_discs
from ..lighting.environment import Environment
from ..lighting.frost import through_glass
from ..lighting.glass import AS_BUILT, Glass, glass_of
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from ..storage.bake import Bake
from .bounced_kernels import bounce
from .environment import Update
from .exitant import read_exitant
from .live_gloss import Falling, LiveGloss
from .pace import Pace
from .pane_sums import PaneSums
from .portal_gloss import PortalLight, seen_in
from .portal_kernels import write_scaled
from .portal_sunlight import Sunlight, sunlight_of
from .portals_layer import PortalsLayer, read_portals
from .shells import Shells
from .stand_ins import StandIns
from .strong_cells import strong_cells
from .sun_bounces import BouncedSuns
from .through_glass import Panes

_View = tuple[
    int, float, float, tuple[float, ...], bool
]  # of a shell through glass: which shell, frost, roughness, and outward if frosted; and whether roughly


class PortalsRelighter:
    """A ``LiveLayer``: a room under what is outside its portals, through the glass that a rig says they have.

    Raises InputError if the bake has no such layer, DamagedBakeError.
    """

    def __init__(self, bake: Bake, name: str | None = None) -> None:
        self.layer: PortalsLayer = read_portals(bake, name)
        self.name = self.layer.name
        self.vertices, self.quick_side = len(bake.receivers), self.layer.cube
        self._positions = bake.receivers.positions
        self._normals = bake.receivers.normals
        gloss = read_exitant(bake, f"layers/{self.name}/glossy")
        if gloss is not None and gloss.panes > len(self.layer.portal_of_pane):
            raise DamagedBakeError(
                bake.path, f"layers/{self.name}/glossy/panes names panes that do not exist"
            )
        self._gloss = None if gloss is None else LiveGloss(gloss, bake.receivers)
        self._shells = Shells(bake.receivers.positions, bake.triangles)
        n = self.layer.cube
        self._shell = np.zeros((1, 6, n, n, 3), np.float32)  # as last asked for: one, or one for each portal
        self._discs: list[tuple[Disc, ...]] = [()]  # of each shell, not in it: rays are sent to them
        self._suns = sunlight_of(bake, self.layer)
        self._version = 0  # of all shells
        self._glass: list[Glass] = [AS_BUILT] * len(self.layer.names)
        self._of_row = np.zeros((len(self.layer.rows), 3), np.float32)  # through clear colourless glass
        self._of_suns = np.zeros_like(self._of_row)  # of that, what suns bring
        self._has_suns = np.zeros(len(self.layer.names), bool)
        first, most = self.layer.first, self.layer.most
        self._bounces = None if first is None else BouncedSuns(first, most=most)
        self.is_coarse = self._is_behind = False  # and whether an answer was given up
        self._roughly = self._is_captured_roughly = False  # for a hand that drags
        self._rows = self.layer.rows.lit_layer()
        self._panes_added = PaneSums(self.layer, self.vertices)
        self._lit, self._bounce, self._scale = Pace(lit), Pace(bounce), Pace(write_scaled)
        self._view_of_portal: list[_View | None] = [None] * len(self.layer.names)
        self._coefficients = np.zeros((len(self.layer.names), max(0, self.layer.order + 1) ** 2, 3))
        self._total: Radiance | None = np.zeros((self.vertices, 3), np.float32)
        self.last = Update("none", 0.0, 0, 0)

    # ---- light -----------------------------------------------------------------------------------

    def light(
        self, rig: Rig, *, coarse: StandIns | None = None, check: Callable[[], None] = lambda: None
    ) -> bool:
        """Take the environment, what is outside, and the glass. Raises InputError for glass of no portal here.

        ``coarse``: what suns bring by bouncing is found at stand-ins.
        """
        started = time.perf_counter()
        glass = glass_of(self.layer.names, rig.portals)
        changed = self._shells.light(rig)
        is_wanted = self._is_behind or (coarse is None and self.is_coarse)
        if not (changed or is_wanted or glass != self._glass):
            self.last = Update("none", (time.perf_counter() - started) * 1e3, 0, 0)
            return False
        self._roughly = coarse is not None
        if changed or (coarse is None and self._is_captured_roughly):
            self._capture()
        self._glass = glass
        return self._follow(started, coarse, check)

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
        self._discs = [()] * len(given)
        self._roughly = self._is_captured_roughly = False
        self._version += 1
        self._glass = self._glass if glass is None else list(glass)
        self._follow(started)

    def _capture(self) -> None:
        shells, n = self._shells, self.layer.cube
        self._is_captured_roughly = self._roughly and not shells.same_everywhere
        exact = self._suns is not None
        if shells.same_everywhere:
            self._shell = shells.shell_of((0.0, 0.0, 0.0), n, discs=not exact)[None]
            self._discs = [shells.discs_of((0.0, 0.0, 0.0))] if exact else [()]
        else:
            self._shell = shells.shells_of(self.layer.centres, n, discs=not exact, roughly=self._roughly)
            centres = self.layer.centres.astype(np.float64).tolist()
            self._discs = [shells.discs_of((x, y, z)) if exact else () for x, y, z in centres]
        self._version += 1

    def _follow(
        self, started: float, coarse: StandIns | None = None, check: Callable[[], None] = lambda: None
    ) -> bool:
        read = changed = 0
        self._is_behind = True
        groups: dict[_View, list[int]] = {}
        for p in range(len(self.layer.names)):
            view = self._view(p)
            if view != self._view_of_portal[p]:
                groups.setdefault(view, []).append(p)
        for view, portals in groups.items():
            check()
            for p in portals:
                self._view_of_portal[p] = view
            shell = self._seen(portals[0])
            suns = strong_cells(shell) if self.layer.first is not None else None
            self._has_suns[portals] = suns is not None
            discs, sends_on = self._discs_through(portals[0]), bool(self._caustic.any())
            # What glass and mirrors in the room send on of discs is in the cells, where photons cannot follow it.
            in_cells = discs if sends_on and self._suns is not None and not self._suns.sends_on else ()
            if in_cells and suns is None and self.layer.first is not None:
                suns, self._has_suns[portals] = np.zeros_like(shell), True
            for caustic in (0, 1) if sends_on else (0,):
                lights = [(self._with_discs(shell, in_cells if caustic else ()), self._of_row)]
                if suns is not None:
                    lights.append((self._with_discs(suns, in_cells if caustic else ()), self._of_suns))
                tables = [(light_tables(light, haar=self.layer.has_haar), out) for light, out in lights]
                for first, last in self._stretches(portals, caustic):
                    size = int(self._bytes[last] - self._bytes[first])
                    self._lit(size, self._rows, tables, first, last)
                    read += size
                    changed += last - first
            if self.layer.order >= 0:
                smooth = shell if suns is None else shell - suns
                if self.layer.first is None:  # then harmonics are all that discs can bounce by
                    smooth = self._with_discs(smooth, discs)
                self._coefficients[portals] = self._harmonics(smooth)
        self._total, self._is_behind = self._added(coarse, check), False
        if self._gloss is not None:
            self._gloss.forget()
        if self.layer.modes is not None:
            read += self.layer.modes.nbytes
        kind = "full" if groups and changed == len(self.layer.rows) else "local"
        self.last = Update(kind, (time.perf_counter() - started) * 1e3, read, changed)
        return True

    def _view(self, portal: int) -> _View:
        """What makes a portal's shell through clear or frosted glass, whatever its colour."""
        frost, rough = self._glass[portal].frost, self._glass[portal].rough or 0.0
        shell = portal if len(self._shell) > 1 else 0
        outward = tuple(self.layer.outward[portal].tolist()) if frost else ()
        roughly = bool(frost) and self._roughly
        return self._version * len(self.layer.names) + shell, frost, rough, outward, roughly

    def _seen(self, portal: int) -> CubeMap:
        """The portal's shell through its glass, without the discs that rays are sent to."""
        shell, glass = self._shell[self._shell_of(portal)], self._glass[portal]
        if not glass.frost:
            return shell
        whole = self._with_discs(shell, self._discs_of(portal))
        return through_glass(whole, glass, self.layer.outward[portal], roughly=self._roughly)

    def _shell_of(self, portal: int) -> int:
        return portal if len(self._shell) > 1 else 0

    def _discs_of(self, portal: int) -> tuple[Disc, ...]:
        return self._discs[self._shell_of(portal)]

    def _discs_through(self, portal: int) -> tuple[Disc, ...]:
        """Those that are seen sharp through the portal's glass."""
        return () if self._glass[portal].frost else self._discs_of(portal)

    @staticmethod
    def _with_discs(shell: CubeMap, discs: tuple[Disc, ...]) -> CubeMap:
        if not discs:
            return shell
        whole = shell.copy()
        add_discs(whole, discs)
        return whole

    def _stretches(self, portals: list[int], caustic: int) -> list[tuple[int, int]]:
        """Rows first … last of these portals' panes, of one kind, neighbours together."""
        out: list[tuple[int, int]] = []
        own = np.isin(self.layer.portal_of_pane, portals) & (self._caustic == caustic)
        for pane in np.flatnonzero(own):
            first, last = int(self.layer.pane_rows[pane]), int(self.layer.pane_rows[pane + 1])
            if out and out[-1][1] == first:
                out[-1] = out[-1][0], last
            elif last > first:
                out.append((first, last))
        return out

    def _harmonics(self, shell: CubeMap) -> Float64[np.ndarray, "functions 3"]:
        return np.einsum("kc,jc->kj", self._integrals, shell.reshape(-1, 3).T.astype(np.float64, order="C"))

    @cached_property
    def _integrals(self) -> Float64[np.ndarray, "functions cells"]:
        _, integrals = cell_harmonics(self.layer.order, self.layer.cube)
        return np.ascontiguousarray(integrals.T, np.float64)

    @property
    def _factors(self) -> Float32[np.ndarray, "portals 3"]:
        """What the glass of each portal lets through."""
        own = self.layer.tints.tolist()
        return np.array(
            [glass.factor(tint) for glass, tint in zip(self._glass, own, strict=True)], np.float32
        )

    def _added(self, coarse: StandIns | None, check: Callable[[], None]) -> Radiance:
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
        sharp = self._sunlit(of_pane)
        self.is_coarse = self._is_captured_roughly or (self._suns is not None and self._suns.is_rough)
        self.is_coarse |= any(view is not None and view[-1] for view in self._view_of_portal)
        if layer.first is not None and (
            sharp is not None or (of_pane[self._has_suns[layer.portal_of_pane]] > 0).any()
        ):
            total += self._bounced_suns(of_pane, coarse, check)
            self.is_coarse |= coarse is not None
        self._panes_added.onto(total, of_pane, self._of_row)
        return total if sharp is None else total + sharp

    def _sunlit(self, of_pane: Float32[np.ndarray, "panes 3"]) -> Radiance | None:
        """(V, 3) light of the discs that rays are sent to; None where there are none."""
        if self._suns is None:
            return None
        discs = [self._discs_through(p) for p in range(len(self.layer.names))]
        self._suns.follow(discs, of_pane, roughly=self._roughly)
        return self._suns.at_vertices if self._suns.is_on else None

    def _bounced_suns(
        self, of_pane: Float32[np.ndarray, "panes 3"], coarse: StandIns | None, check: Callable[[], None]
    ) -> Radiance:
        """(V, 3) light of suns after one and more bounces, from where it falls."""
        layer, light = self.layer, np.zeros((self.vertices, 3), np.float32)
        if self._suns is not None and self._suns.is_on:
            light += self._suns.around_vertices
        own = np.where(self._has_suns[layer.portal_of_pane, None], of_pane, np.float32(0))
        self._panes_added.onto(light, own, self._of_suns)
        assert self._bounces is not None  # with the operator
        return self._bounces.of(light, coarse, check)

    def warm(self, places: StandIns) -> None:
        """Make ready what the first drag would wait for."""
        if self._bounces is not None:
            self._bounces.warm(places)

    @cached_property
    def _caustic(self) -> np.ndarray:
        """(panes,) 1 for those that hold what glass and mirrors in the room send on."""
        found = self.layer.pane_caustic
        return np.zeros(len(self.layer.portal_of_pane), np.uint8) if found is None else found

    @cached_property
    def _every(self) -> np.ndarray:
        assert self.layer.modes is not None
        return np.arange(self.layer.modes.shape[1], dtype=np.int32)

    @cached_property
    def _bytes(self) -> np.ndarray:
        """Before each row: bytes of runs and data."""
        return self.layer.rows.row_bytes + 4 * self.layer.rows.row_runs

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
        self._panes_added.onto(total, of_pane, self._of_row)
        sharp = self._sunlit(of_pane)
        return total if sharp is None else total + sharp

    @property
    def point_lit(self) -> Sunlight | None:
        """The suns through clear glass, at any point."""
        return self._suns if self._suns is not None and self._suns.is_on else None

    def glossy(self, eye: Triple) -> Radiance | None:
        """(V, 3) radiance toward a point: of panes, and of glossy vertices where the layer was baked with them."""
        panes = self.pane_shine(eye)
        if self._gloss is None:
            return panes
        shine = self._gloss.toward(eye, self._falling())
        return shine if panes is None else shine + panes

    def drawn_gloss(
        self, view: View, triangles: Triangles, *, eye: Triple, fine: bool
    ) -> Float32[np.ndarray, "height width 3"] | None:
        """``glossy`` without panes as ``view`` sees it of ``triangles``, pixel by pixel."""
        if self._gloss is None:
            return None
        return self._gloss.drawn(view, triangles, eye=eye, falling=self._falling(), fine=fine)

    def _falling(self) -> Falling:
        layer, portals = self.layer, range(len(self.layer.names))
        shells = {self._view(p): self._seen(p) for p in portals}
        of_pane = self._factors[layer.portal_of_pane] * layer.pane_tints
        return PortalLight(
            self.irradiance, [shells[self._view(p)] for p in portals], layer.portal_of_pane, of_pane, self._suns,
            self._normals,
        ).falling()  # fmt: skip

    def pane_shine(self, eye: Triple) -> Radiance | None:
        """(V, 3) radiance toward a point: panes show what is outside, as their glass lets it through."""
        layer = self.layer
        if not len(layer.glass):
            return None
        portals = np.unique(layer.glass_portal).tolist()
        shells = {p: self._with_discs(self._seen(p), self._discs_through(p)) for p in portals}
        out = np.zeros((self.vertices, 3), np.float32)
        shine = seen_in(shells, layer.glass_portal, positions=self._positions[layer.glass], eye=eye)
        out[layer.glass] = self._factors[layer.glass_portal] * shine
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

"""Bounced light through portals: every spherical harmonic of every shell, as columns of one operator.

The paper traces photons for each function of each portal; here direct light of all functions (``DirectLight``) is
bounced together by the gathering operator, which is traced once. After a bounce light is smooth: a few modes hold all
columns, in a byte for each mode and vertex, quantised by the vertex's maximum.

With few portals every column is bounced, and modes are shared; with more, each portal has modes of its own, for the
windows of a nave have little in common. With very many, seeded mixtures of columns are bounced, which span what they
bring, and the operator's transpose then tells how much of each mode any column brings (as in ``baking.bounced``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from ..arrays import Float32, Float64
from ..bases import spherical_harmonics
from ..encoding.range_kernels import answers, eigenvectors, gram, turned
from ..transport.bounces import Bounced, bounced
from ..transport.gathering import Gathering
from ..transport.spreading import Spreading
from .first_bounce import FirstBounce
from .portals_direct import DirectLight
from .portals_room import PortalsRoom
from .portals_suns import bounce_of_suns

TOLERANCE = 1e-3  # of all bounced light: the share that later bounces would add
MOST_MODES = 124
LEFT_OUT = 0.003  # RMS of what the modes leave out, of a portal's bounced light
COLUMNS = 31  # solved together, with one beside them: whole vectors
_TOGETHER = 192  # columns up to which portals share their modes
_MOST_OWN = 512  # modes of all portals, where each has its own
_LEAST_OWN = 4
_STAGE = 72
_LEVELS = 127

Share = Callable[[float], None]


@dataclass(frozen=True)
class IndirectLight:
    """T of bounced light ≈ scales · modes · weights.

    Attributes
    ----------
    modes
        ``(V, m)`` signed bytes.
    scales
        ``(V,)`` of each vertex.
    weights
        ``(P, functions, colours, m)`` of unit coefficients.
    energy
        ``(P, order + 1, colours)``: of each order the most that coefficients of unit length bring, the mean square over
        vertices (Eqs. 4 and 5).
    bounces, remaining
        Products that it took, and a bound on what is missing.
    left_out
        RMS of what the modes leave out, of all bounced light of the worst portal; of some columns where mixtures were
        bounced.
    entries, rays
        Of the operator.
    """

    modes: np.ndarray
    scales: Float32[np.ndarray, "vertices"]
    weights: Float32[np.ndarray, "portals functions colours modes"]
    energy: Float64[np.ndarray, "portals orders colours"]
    bounces: int
    remaining: float
    left_out: float
    entries: int
    rays: int
    first: FirstBounce | None = None

    @property
    def order(self) -> int:
        """Of the harmonics."""
        return self.energy.shape[1] - 1


def bake_indirect(room: PortalsRoom, direct: DirectLight, report: Share) -> IndirectLight:
    """Trace the operator, bounce, and factor."""
    settings = room.settings
    gathering = Gathering.trace(
        room.bouncing, room.occluders, origins=room.origins, rays=settings.gather_rays, seed=settings.seed,
        memory=settings.memory, report=lambda share: report(0.4 * share),
    )  # fmt: skip
    work = _Columns(room, direct, gathering, lambda share: report(0.4 + 0.6 * share))
    return work.found()


class _Columns:
    """Direct light of portals × functions, and what becomes of it."""

    def __init__(self, room: PortalsRoom, direct: DirectLight, gathering: Gathering, report: Share) -> None:
        self.room, self.direct, self.gathering, self.report = room, direct, gathering, report
        self.tinted = bool((direct.pane_tints != direct.pane_tints[:, :1]).any())
        self.colours = 1 if gathering.is_grey and not self.tinted else 3
        self.most = room.settings.bounces
        self.worst = (0, 0.0)

    def found(self) -> IndirectLight:
        portals, order = len(self.room.portals), self.room.settings.order
        together = portals * spherical_harmonics.count(order) <= _TOGETHER
        if together or self.room.settings.accuracy is not None:
            modes, weights, left, order = self._every(order)
        elif portals * _LEAST_OWN <= _MOST_OWN:
            modes, weights, left = self._each(order)
        else:
            modes, weights, left = self._mixed(order)
        return self._kept(modes, weights, left, order)

    # ---- every column ----------------------------------------------------------------------------

    def _every(self, order: int) -> tuple[np.ndarray, np.ndarray, float, int]:
        """Band after band, so that a higher order goes on from a lower one."""
        bands: list[np.ndarray] = []
        energies: list[np.ndarray] = []
        for band in range(order + 1):
            bands.append(self._band(band, order))
            energies.append(np.stack([_largest(part) for part in bands[-1]]))
            self.report((band + 1) ** 2 / (order + 1) ** 2)
            accuracy, spectrum = self.room.settings.accuracy, self.room.settings.spectrum
            if (
                accuracy is not None
                and held_share(np.array(energies).transpose(1, 0, 2), spectrum) >= accuracy
            ):
                break
        light = np.concatenate(bands, axis=2)  # (P, V, functions, colours)
        P, V, K, C = light.shape
        flat = np.ascontiguousarray(light.transpose(1, 0, 2, 3)).reshape(V, P * K * C)
        modes, weights, left = factored(flat, portals=P)
        return modes, weights.reshape(P, K, C, -1), left, len(bands) - 1

    def _band(self, band: int, order: int) -> Float32[np.ndarray, "portals vertices functions colours"]:
        functions = spherical_harmonics.count(order)
        own = slice(band * band, (band + 1) ** 2)
        portals = len(self.room.portals)
        light = np.concatenate([self._direct(p, functions, own) for p in range(portals)], axis=1)
        sent_on = self._sent_on(range(portals), functions, own)
        for start in range(0, light.shape[1], COLUMNS):
            some = slice(start, start + COLUMNS)
            light[:, some] = self._solved(self.gathering, light[:, some], self.most, _part(sent_on, some))
        return np.stack(np.split(light, portals, axis=1))

    def _solved(
        self, operator: Gathering, D: np.ndarray, most: int | None, sent_on: np.ndarray | None = None
    ) -> np.ndarray:
        """What bounces of direct light, and of bounced light that glass and mirrors sent on; with that itself."""
        light = np.ascontiguousarray(D if sent_on is None else D + sent_on)
        result: Bounced = bounced(operator, light, tolerance=TOLERANCE, most=most)
        self.worst = (max(self.worst[0], result.bounces), max(self.worst[1], result.remaining))
        return result.indirect if sent_on is None else result.indirect + sent_on

    # ---- each portal by itself ----------------------------------------------------------------------

    def _each(self, order: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Modes of one portal after another; a portal's columns have weights in its own modes alone."""
        portals, K, C = len(self.room.portals), spherical_harmonics.count(order), self.colours
        found, worst = [], 0.0
        for p in range(portals):
            light, sent_on = self._direct(p, K), self._sent_on([p], K)
            for start in range(0, K, COLUMNS):
                some = slice(start, start + COLUMNS)
                light[:, some] = self._solved(self.gathering, light[:, some], self.most, _part(sent_on, some))
            flat = light.reshape(len(light), K * C)
            modes, weights, left = factored(flat, portals=1, most=_MOST_OWN // portals)
            found.append((modes, weights.reshape(K, C, -1)))
            worst = max(worst, left)
            self.report((p + 1) / portals)
        ends = np.cumsum([modes.shape[1] for modes, _ in found])
        together = np.zeros((portals, K, C, ends[-1]))
        for p, (modes, weights) in enumerate(found):
            together[p, :, :, ends[p] - modes.shape[1] : ends[p]] = weights
        return np.concatenate([modes for modes, _ in found], axis=1), together, worst

    # ---- mixtures --------------------------------------------------------------------------------

    def _mixed(self, order: int) -> tuple[np.ndarray, np.ndarray, float]:
        room, C = self.room, self.colours
        P, K, V = len(room.portals), spherical_harmonics.count(order), self.gathering.rows
        rng = np.random.default_rng(np.random.SeedSequence([room.settings.seed, _STAGE]))
        mixed = np.zeros((C, V, MOST_MODES), np.float32)
        mixed_on = np.zeros_like(mixed) if room.photons else None
        for p in range(P):
            D, sent_on = self._direct(p, K), self._sent_on([p], K)
            strength = max(float(np.sqrt(np.square(D, dtype=np.float64).sum())), 1e-30)
            numbers = (rng.standard_normal((C, K, MOST_MODES)) / strength).astype(np.float32)
            for c in range(C):
                mixed[c] += turned(np.ascontiguousarray(D[:, :, c]), numbers[c].astype(np.float64))
                if mixed_on is not None and sent_on is not None:
                    own = np.ascontiguousarray(sent_on[:, :, c])
                    mixed_on[c] += turned(own, numbers[c].astype(np.float64))
        seen = []
        for start in range(0, MOST_MODES, COLUMNS):
            some = slice(start, start + COLUMNS)
            D = np.moveaxis(mixed[:, :, some], 0, 2)
            sent_on = None if mixed_on is None else np.moveaxis(mixed_on[:, :, some], 0, 2)
            seen.append(self._solved(self.gathering, D, self.most, sent_on))
            self.report(0.5 * (start + COLUMNS) / MOST_MODES)
        del mixed, mixed_on
        flat = np.concatenate(seen, axis=1).reshape(V, -1)
        scale = 1 / np.maximum(np.sqrt(np.diag(gram(flat))), 1e-30)
        modes = _orthonormal(flat, scale, MOST_MODES)
        weights = self._answers(modes, P, K)
        return modes, weights, self._left(modes, weights, rng)

    def _direct(self, portal: int, functions: int, bands: slice | None = None) -> np.ndarray:
        bands = slice(0, functions) if bands is None else bands
        return self.direct.harmonics(self.room, portal, bands, channels=self.colours, functions=functions)

    def _sent_on(
        self, portals: Iterable[int], functions: int, bands: slice | None = None
    ) -> Float32[np.ndarray, "vertices functions colours"] | None:
        """What glass and mirrors send of light that has bounced, of one portal after another; None if nothing does."""
        caustics, order = self.room.caustics, round(functions**0.5) - 1
        if caustics is None:
            return None
        bands, panes = slice(0, functions) if bands is None else bands, self.room.portals
        found = []
        for p in portals:
            own = np.flatnonzero(panes.portal_of_pane == p)
            light = caustics.bounced_harmonics(own, panes.pane_tints[own], bands, order=order)
            found.append(light[:, :, : self.colours])
        return np.concatenate(found, axis=1)

    def _answers(self, modes: np.ndarray, P: int, K: int) -> np.ndarray:
        """How much of each mode every column brings: the operator's transpose on the modes."""
        spreading = Spreading(self.gathering, self.room.bouncing)
        backwards = cast(Gathering, spreading)  # of one, solving needs no more than ``bounce``
        m, C = modes.shape[1], self.colours
        Q = np.empty((C, len(modes), m), np.float32)
        for start in range(0, m, COLUMNS):
            X = np.repeat(modes[:, start : start + COLUMNS, None], C, axis=2)
            result = self._solved(backwards, X / spreading.areas, self.most) * spreading.areas
            Q[:, :, start : start + COLUMNS] = np.moveaxis(result, 2, 0)
            self.report(0.5 + 0.4 * (start + COLUMNS) / m)
        weights = np.zeros((P, K, C, m))
        for p in range(P):
            D, sent_on = self._direct(p, K), self._sent_on([p], K)
            for c in range(C):
                found = np.zeros((K, m))
                answers(np.ascontiguousarray(D[:, :, c].T), Q[c], found)
                if sent_on is not None:
                    answers(np.ascontiguousarray(sent_on[:, :, c].T), Q[c] + modes, found)
                weights[p, :, c] = found
        return weights

    def _left(self, modes: np.ndarray, weights: np.ndarray, rng: np.random.Generator) -> float:
        """What the modes leave out of some columns, bounced by themselves."""
        P, K = weights.shape[:2]
        chosen = [(int(rng.integers(P)), int(rng.integers(K))) for _ in range(COLUMNS)]
        D = np.concatenate([self._direct(p, K, slice(k, k + 1)) for p, k in chosen], axis=1)
        sent_on = [self._sent_on([p], K, slice(k, k + 1)) for p, k in chosen]
        parts = [part for part in sent_on if part is not None]
        whole_on = np.concatenate(parts, axis=1) if parts else None
        truth = self._solved(self.gathering, D, self.most, whole_on)
        said = np.stack([turned(modes, weights[p, k].T) for p, k in chosen], axis=1)
        whole = np.square(truth, dtype=np.float64).sum()
        return float(np.sqrt(np.square(truth - said, dtype=np.float64).sum() / max(whole, 1e-300)))

    # ---- what is kept ----------------------------------------------------------------------------

    def _kept(self, modes: np.ndarray, weights: np.ndarray, left: float, order: int) -> IndirectLight:
        P, C = len(weights), self.colours
        energy = np.zeros((P, order + 1, C))
        many = max(int((np.abs(self.room.open.normals).sum(axis=1) > 0).sum()), 1)
        for band in range(order + 1):
            W = weights[:, band * band : (band + 1) ** 2].transpose(0, 2, 1, 3)  # (P, C, 2l + 1, m)
            squares = W @ W.swapaxes(2, 3)
            energy[:, band] = np.linalg.eigvalsh(squares)[..., -1] / many
        strength = np.sqrt(np.square(weights).sum(axis=(0, 1, 2)))
        strength = np.where(strength > 0, strength, 1)
        bytes_, scales = bytes_by_vertex(modes * strength.astype(np.float32))
        return IndirectLight(
            bytes_, scales, (weights / strength).astype(np.float32), energy, *self.worst, left,
            self.gathering.entries, self.gathering.rays, self._first(),
        )  # fmt: skip

    def _first(self) -> FirstBounce | None:
        """The operator, thinned, for suns."""
        return bounce_of_suns(self.room, self.direct, self.gathering) if self.room.settings.suns else None


def factored(
    light: Float32[np.ndarray, "vertices n"], *, portals: int, most: int = MOST_MODES
) -> tuple[Float32[np.ndarray, "vertices m"], Float64[np.ndarray, "n m"], float]:
    """Orthonormal modes and weights, light ≈ modes · weightsᵀ, no worse than LEFT_OUT for any of the portals.

    Columns are those of one portal after another, equally many; every portal counts alike.
    """
    squares = gram(light)
    energy = np.diag(squares).reshape(portals, -1).sum(axis=1)
    strength = np.repeat(np.sqrt(np.maximum(energy, 1e-30)), light.shape[1] // portals)
    values, vectors = eigenvectors(squares / strength / strength[:, None])
    there = values > 1e-9 * max(float(values[0]), 1e-300)
    if not there.any():  # nothing bounces
        return np.zeros((len(light), 1), np.float32), np.zeros((light.shape[1], 1)), 0.0
    values, vectors = values[there][:most], vectors[:, there][:, :most]
    # A portal's share in a mode: the squares of its columns' weights.
    shares = (np.square(vectors).reshape(portals, -1, len(values)).sum(axis=1) * values).cumsum(axis=1)
    missing = np.sqrt(np.maximum(1 - shares, 0)).max(axis=0)
    kept = min(int(np.searchsorted(-missing, -LEFT_OUT)) + 1, len(values))
    root = np.sqrt(values[:kept])
    modes = turned(light, vectors[:, :kept] / strength[:, None] / root)
    weights = vectors[:, :kept] * root * strength[:, None]
    return modes, weights, float(missing[kept - 1])


def _part(light: np.ndarray | None, some: slice) -> np.ndarray | None:
    """Some functions of it."""
    return None if light is None else light[:, some]


def held_share(
    energy: Float64[np.ndarray, "portals orders colours"], spectrum: Sequence[float] | None = None
) -> float:
    """The share of the energy that these orders hold, of the worst portal; 0 before there are three orders.

    ``spectrum`` is how much a sky has of each order; all have as much if not given.

    What is beyond is taken to fall on as the last two orders fell: one alone may be dark by symmetry.
    """
    total = energy.sum(axis=2)
    if total.shape[1] < 3:
        return 0.0
    if spectrum is not None:
        total = total * np.asarray(spectrum, np.float64)[: total.shape[1]]
    fall = np.sqrt(total[:, -1] / np.maximum(total[:, -3], 1e-300))
    fall = np.clip(fall, 0.0, 0.95)
    beyond = np.maximum(total[:, -1], total[:, -2] * fall) * fall / (1 - fall)
    whole = total.sum(axis=1)
    return float((whole / np.maximum(whole + beyond, 1e-300)).min())


def bytes_by_vertex(
    rows: Float32[np.ndarray, "vertices m"],
) -> tuple[np.ndarray, Float32[np.ndarray, "vertices"]]:
    """Signed bytes and a scale for each row, its maximum over 127."""
    scales = (np.abs(rows).max(axis=1, initial=0.0) / _LEVELS).astype(np.float32)
    inverse = np.divide(1, scales, out=np.zeros_like(scales), where=scales > 0)
    return np.rint(rows * inverse[:, None]).astype(np.int8), scales


def _largest(light: Float32[np.ndarray, "vertices functions colours"]) -> Float64[np.ndarray, "colours"]:
    """Eq. 5: the largest mean square that unit coefficients of one order bring."""
    out = []
    for c in range(light.shape[2]):
        squares = gram(np.ascontiguousarray(light[:, :, c])) / max(len(light), 1)
        out.append(float(np.linalg.eigvalsh(squares)[-1]))
    return np.array(out)


def _orthonormal(light: np.ndarray, scale: np.ndarray, most: int) -> np.ndarray:
    """The principal directions of columns, each first made as long as its scale says."""
    squares = gram(light)
    values, vectors = eigenvectors(squares * scale * scale[:, None])
    there = (values > 1e-9 * max(float(values[0]), 1e-300)) & (np.arange(len(values)) < most)
    return turned(light, vectors[:, there] * scale[:, None] / np.sqrt(values[there]))

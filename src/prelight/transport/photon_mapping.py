"""Photon maps: all the light of a source, or what of it the gathering operator cannot carry, for any basis at once.

The papers on portals and on clouds of lights make a photon map for every basis function. One is enough: photons keep
the direction and place in which they left, and every function weighs the same photons. More photons or more functions
go on from what is there.

What goes with the operator is E = D + C + Gρ (D + C) + …: C are the photons that mirrors and glass have sent at last
(CAUSTIC straight from the light, BOUNCED_CAUSTIC from a diffuse surface), D is direct light, which shadow rays find,
and G is traced on ``specular.without_specular(scene)``. Every path of light belongs to exactly one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..scene.geometry import Scene
from .gathering import Gathering
from .photon_density import FINEST, NEAREST, WIDEST, LitSurface, PhotonDensity, PhotonTree
from .photon_sources import PhotonSource
from .photon_tracing import BATCH, BOUNCED_CAUSTIC, CAUSTIC, EVERY_WAY, Photons, PhotonTracer

CAUSTICS = CAUSTIC | BOUNCED_CAUSTIC
MOST_PHOTONS = 1 << 30
_VALUES_AT_ONCE = 1 << 24  # floats of photons that are weighed together
_WIDEST_OF_BOUNCED = 12.0  # edges: light that bounced before is dim, smooth, and sent by few photons

Functions = Callable[[Photons], Float32[np.ndarray, "photons functions"]]
Light = Float32[np.ndarray, "vertices functions 3"]
Report = Callable[[float], None]


@dataclass(frozen=True)
class PhotonLight:
    """Irradiance / π at vertices, without albedo, of every function; and the standard deviation of its noise."""

    light: Light
    noise: Light

    def __add__(self, other: PhotonLight) -> PhotonLight:
        return PhotonLight(self.light + other.light, np.hypot(self.noise, other.noise))


class PhotonMap:
    """Photons of one source in one scene, and what light they make.

    Parameters
    ----------
    scene, occluders
        Triangles and materials, and the renderer's scene of the same triangles.
    source
        Of ``photon_sources``.
    ways
        Which photons are kept (``photon_tracing``). CAUSTIC alone is aimed at glass and mirrors, many times as
        well as along with others.
    bounces
        Diffuse ones, at most.
    seed
        Of all random numbers; the same photons for the same seed.

    Raises InputError for lights without power, lights inside solids and materials that cannot be.
    """

    def __init__(
        self,
        scene: Scene,
        occluders: Occluders,
        source: PhotonSource,
        *,
        ways: int = EVERY_WAY,
        bounces: int | None = None,
        seed: int = 0,
    ) -> None:
        self.scene, self.source = scene, source
        self._tracer = PhotonTracer(scene, occluders, source, ways=ways, bounces=bounces, seed=seed)
        self._batches: list[Photons] = []
        self._surface = LitSurface(scene)
        self._trees: dict[int, tuple[Photons, PhotonTree]] = {}

    @property
    def emitted(self) -> int:
        return sum(batch.emitted for batch in self._batches)

    @property
    def photons(self) -> Photons:
        """All that have landed so far."""
        if not self._batches:
            raise InputError("photons", "none are traced yet; ask for more of them first")
        if len(self._batches) > 1:
            self._batches = [Photons.together(self._batches)]
        return self._batches[0]

    def more(self, photons: int, *, report: Report | None = None) -> None:
        """So many more, in whole batches of 131,072. Of a scene that none can come in, nothing."""
        if not 1 <= photons <= MOST_PHOTONS - self.emitted:
            raise InputError("photons", f"{photons:,} more, expected 1 to {MOST_PHOTONS - self.emitted:,}")
        if self._tracer.is_dark:
            return
        first, count = self.emitted // BATCH, -(-photons // BATCH)
        for number in range(first, first + count):
            self.add(self._tracer.batch(number))
            if report is not None:
                report((number - first + 1) / count)

    def batch(self, number: int) -> Photons:
        """One batch, to be added here or in another process; they are the same everywhere."""
        return self._tracer.batch(number)

    def add(self, batch: Photons) -> None:
        """The next batch, in the order of their numbers."""
        self._batches.append(batch)

    def light(
        self,
        functions: Functions | None = None,
        *,
        ways: int = EVERY_WAY,
        nearest: int = NEAREST,
        finest: float = FINEST,
        widest: float = WIDEST,
    ) -> PhotonLight:
        """Of photons that came in these ways, weighed by functions; by default each light is one.

        Functions tell how much of the source's own radiance there is in the direction (and from the place) in which
        photons left; they may be below 0. Other parameters as of ``PhotonDensity``. BOUNCED_CAUSTIC photons have wider
        kernels of their own.
        """
        functions = functions or self.by_light
        photons = _NO_PHOTONS if self._tracer.is_dark else self.photons
        if not ways & EVERY_WAY:
            raise InputError(
                "ways", f"{ways}, expected a sum of DIRECT, BOUNCED, CAUSTIC and BOUNCED_CAUSTIC"
            )
        total: PhotonLight | None = None
        for part in (ways & ~BOUNCED_CAUSTIC, ways & BOUNCED_CAUSTIC):
            reach = max(widest, _WIDEST_OF_BOUNCED) if part == BOUNCED_CAUSTIC else widest
            if not (photons.way & part).any():
                continue
            chosen, tree = self._tree_of(part)
            density = PhotonDensity(self._surface, tree, nearest=nearest, finest=finest, widest=reach)
            found = _weighed(density, chosen, functions)
            total = found if total is None else total + found
        if total is None:
            count = functions(_NO_PHOTONS).shape[1]
            return PhotonLight(*np.zeros((2, len(self.scene.positions), count, 3), np.float32))
        return total

    def _tree_of(self, part: int) -> tuple[Photons, PhotonTree]:
        """Photons of these ways and their tree, kept for the next functions."""
        known = self._trees.get(part)
        if known is None or known[0].emitted != self.emitted:
            chosen = self.photons.of(part)
            tree = PhotonTree(self._surface, chosen)
            known = self._trees[part] = tree.sort(chosen), tree
        return known

    def by_light(self, photons: Photons) -> Float32[np.ndarray, "photons lights"]:
        """The functions that are 1 for one light each."""
        return (photons.light[:, None] == np.arange(self.source.lights)).astype(np.float32)


def final_gathered(gathering: Gathering, found: Light) -> Light:
    """Light at vertices by one bounce of what photons say: without their noise, to be added to D + C.

    ``found`` is all light, (V, K, 3); ``gathering`` that of ``specular.without_specular(scene)``.
    """
    return gathering.bounce(np.ascontiguousarray(found, np.float32))


_NO_PHOTONS = Photons(
    *(np.zeros((0, 3), np.float32) for _ in range(4)),
    triangle=np.zeros(0, np.int32), light=np.zeros(0, np.int32), way=np.zeros(0, np.uint8), emitted=0,
)  # fmt: skip


def _weighed(density: PhotonDensity, photons: Photons, functions: Functions) -> PhotonLight:
    weights = functions(photons)
    if weights.ndim != 2 or len(weights) != len(photons):
        raise InputError(
            "functions", f"gave {weights.shape}, expected a row for each of {len(photons)} photons"
        )
    count, V = weights.shape[1], len(density.radii)
    light, squares = np.empty((2, V, count, 3), np.float32)
    step = max(1, _VALUES_AT_ONCE // max(3 * len(photons), 1))
    scale = np.float32(1 / (np.pi * max(photons.emitted, 1)))
    for start in range(0, count, step):
        part = slice(start, min(start + step, count))
        values = (photons.power[:, None, :] * weights[:, part, None] * scale).reshape(len(photons), -1)
        for into, found in zip((light, squares), density.sums(values), strict=True):
            into[:, part] = found.reshape(V, -1, 3)
    return PhotonLight(light, np.sqrt(squares))

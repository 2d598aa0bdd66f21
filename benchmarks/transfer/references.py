"""What the path tracer says of the fifty lights, kept light by light, so that what is compared with it may change."""

from __future__ import annotations

import time
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from prelight.arrays import Int32, Positions
from prelight.checking.placed_emitters import emitter_of
from prelight.lighting.placed_lights import PlacedLight
from prelight.rays.surfaces import SurfaceScene
from prelight.scene.geometry import Scene
from prelight.transport.path_traced_light import LightWithVariance, LitScene

NOISE = 0.02  # of indirect light, RMS: no more rounds are traced below it


@dataclass(frozen=True)
class Reference:
    """The mean of some rounds for one light."""

    light: LightWithVariance
    rounds: int
    seconds: float

    @property
    def is_enough(self) -> bool:
        """Whether the noise of indirect light is small."""
        variance = self.light.indirect_variance.mean()
        return bool(variance < NOISE**2 * np.square(self.light.indirect).mean())


@dataclass(frozen=True)
class References:
    """Direct and indirect light at receivers, of ``samples`` paths each, in at most ``rounds`` of these."""

    folder: Path
    scene: Scene
    rows: Int32[np.ndarray, "receivers"]
    origins: Positions
    samples: int
    rounds: int

    def path(self, k: int) -> Path:
        """Of light ``k``."""
        return self.folder / f"{len(self.rows)}-{self.samples}-{self.rounds}" / f"{k:02}.npz"

    def trace(self, lights: list[PlacedLight], *, seconds: float = np.inf) -> int:
        """Rounds that are missing, the first of all lights before the second of any, until the time is over.

        How many lights need no more.
        """
        began, surfaces = time.perf_counter(), SurfaceScene(self.scene)
        self.path(0).parent.mkdir(parents=True, exist_ok=True)
        for most in range(1, self.rounds + 1):
            for k, light in enumerate(lights):
                known = self.read(k) if self.path(k).exists() else None
                if known is not None and (known.rounds >= most or known.is_enough):
                    continue
                if time.perf_counter() - began > seconds:
                    return self.enough(len(lights))
                lit = LitScene(self.scene, surfaces=surfaces, emitters=[emitter_of(surfaces.mi, light)])
                self._keep(k, self._one_more(known, lit, seed=1000 * k))
                print(f"\rround {most}: {k + 1} of {len(lights)}", end="", flush=True)
        print()
        return self.enough(len(lights))

    def enough(self, count: int) -> int:
        """Of the first lights, those that are done."""
        known = [self.read(k) for k in range(count) if self.path(k).exists()]
        return sum(one.is_enough or one.rounds >= self.rounds for one in known)

    def read(self, k: int) -> Reference:
        """Light ``k``."""
        with np.load(self.path(k)) as kept:
            if not np.array_equal(kept["rows"], self.rows):
                raise ValueError(f"{self.path(k)} is of other receivers")
            values = {field.name: kept[field.name] for field in fields(LightWithVariance)}
            return Reference(LightWithVariance(**values), int(kept["rounds"]), float(kept["seconds"]))

    def _one_more(self, known: Reference | None, lit: LitScene, *, seed: int) -> Reference:
        began, n = time.perf_counter(), 0 if known is None else known.rounds
        found = lit.light(self.rows, origins=self.origins, samples=self.samples, seed=seed + n)
        took = time.perf_counter() - began
        if known is None:
            return Reference(found, 1, took)
        return Reference(_mean(known.light, n, found), n + 1, known.seconds + took)

    def _keep(self, k: int, found: Reference) -> None:
        values = {field.name: getattr(found.light, field.name) for field in fields(found.light)}
        partial = self.path(k).with_suffix(".partial")
        with partial.open("wb") as out:
            np.savez(out, rows=self.rows, seconds=found.seconds, rounds=found.rounds, **values)
        partial.rename(self.path(k))


def _mean(known: LightWithVariance, n: int, one: LightWithVariance) -> LightWithVariance:
    """Of ``n`` rounds and one more."""
    found = {}
    for field in fields(LightWithVariance):
        weight = n * n if field.name.endswith("variance") else n
        over = (n + 1) ** 2 if field.name.endswith("variance") else n + 1
        found[field.name] = (weight * getattr(known, field.name) + getattr(one, field.name)) / over
    return LightWithVariance(**found)

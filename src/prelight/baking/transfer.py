"""The transfer bake: what becomes of direct light at the vertices, whatever light it is (Hašan, Pellacini and Bala,
Direct-to-indirect transfer for cinematic relighting, 2006).

The first bounce of a light is the one-bounce operator, thinned; what follows, few modes. Direct light is traced when
relighting, so a bake has no lights at all.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from ..arrays import Float64
from ..encoding.modes import grouped, in_bytes
from ..scene.geometry import Scene
from ..storage.bake import Bake
from ..storage.chunks import ArraySpec, ChunkRecord, chunk_key, open_chunk
from ..storage.journal import BakeWriter, refuse_target
from ..storage.manifest import FORMAT, VERSION, LayerRecord, Manifest
from ..transport.bounces import bounced
from ..transport.gap_rays import Gaps
from ..transport.gathering import Gathering
from ..transport.mesh_fitness import measure_fitness
from ..transport.specular import without_specular
from ..transport.spreading import vertex_areas
from .bounced import HELD
from .bounced_writer import FIRST
from .carrying_out import carry_out, check_disk
from .exitant import ExitantPart
from .first_bounce import FirstBounce, thinned_operators
from .later_bounces import LaterBounces, later_bounces
from .layer_writer import software
from .scene_arrays import WrittenArrays, not_empty, scene_record, told_digits, whole
from .thinned_gathering import ThinnedGathering
from .transfer_plan import TransferPlan, plan_transfer
from .transfer_settings import COARSER, HELD_OUT, TRIALS, TransferSettings
from .trial_lights import TrialLights

LAYER = "transfer"
Report = Callable[[float], None]  # share done
_AT = f"layers/{LAYER}"
_FIT_POINTS = 4_000
_HELD_OUT_SEED = 1
_CLEAR = 0.03  # of the scene's extent: how far from surfaces lights are that errors are told of
_LEAST_ENTRIES = 16


def bake_transfer(
    scene: Scene,
    path: str | Path,
    *,
    settings: TransferSettings | None = None,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Bake ``scene`` for any light into the new folder ``path``.

    Parameters
    ----------
    settings
        Quality; the defaults if not given.
    resume, force
        Go on with an interrupted bake of the same settings; replace what is there.
    report
        Hears the share done, 0 to 1.

    Raises
    ------
    InputError
        More memory than allowed, or a partial bake of other settings.
    OutputError
        ``path`` exists, the disk is full or cannot be written; what was done can be resumed.
    InterruptedBakeError
        Stopped by Ctrl-C; what was done can be resumed.
    MissingExtraError
        Mitsuba or its LLVM is not installed.
    """
    refuse_target(Path(path), force=force)
    plan = plan_transfer(scene, settings or TransferSettings())
    return bake_planned(path, plan=plan, resume=resume, force=force, report=report)


def bake_planned(
    path: str | Path,
    *,
    plan: TransferPlan,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Carry out a plan; otherwise as ``bake_transfer``."""
    check_disk(Path(path), plan.bytes)
    return carry_out(
        Path(path),
        lambda writer: _Making(plan, writer, report or (lambda _: None)).run(),
        identity=identity(plan),
        kept=lambda entries: "the first bounce" if entries else "nothing",
        resume=resume,
        force=force,
    )


def identity(plan: TransferPlan) -> dict[str, int | float | str | None]:
    """Everything that the bytes of the bake depend on."""
    settings = plan.settings
    names = ("gather_rays", "entries", "operator_bounces", "modes", "glossy_order")
    asked = {name: getattr(settings, name) for name in names}
    if plan.caustics:
        asked["caustics"] = 1
    return {"kind": "transfer", "scene": plan.scene.digest, **asked, **software()}


class _Making:
    """The two parts of the bake, each kept as it is done: the first bounce and what is measured on it, then modes."""

    def __init__(self, plan: TransferPlan, writer: BakeWriter, report: Report) -> None:
        self.plan, self.settings, self.scene = plan, plan.settings, plan.scene
        self.writer, self.report = writer, report
        self.ground = plan.ground
        self.gloss: ExitantPart | None = None
        if order := self.settings.glossy_order:
            self.gloss = ExitantPart.of(
                self.scene, self.ground.occluders, order=order, origins=self.ground.origins
            )
        if self.gloss is not None:  # of seconds, so that the journal need not know it
            self.scene = self.gloss.bouncing(self.scene)
        if plan.caustics:
            self.scene = without_specular(self.scene)
        self.areas = vertex_areas(plan.scene)

    def run(self) -> Manifest:
        """Make what the journal does not have yet."""
        entries = {entry["part"]: entry for entry in self.writer.entries}
        operator = entries.get("operator") or self._operator()
        modes = entries.get("modes") or self._modes()
        self.report(1.0)
        return self._manifest(operator, modes)

    def _operator(self) -> dict[str, Any]:
        """Trace and thin; the light of some lights solved with the whole operator, to measure against."""
        began, settings, scene = time.perf_counter(), self.settings, self.scene
        gathering = Gathering.trace(
            scene, self.ground.occluders, origins=self.ground.origins, rays=settings.gather_rays,
            memory=self.plan.operator_bytes, gaps=Gaps.of(scene, self.ground.occluders, self.ground.origins),
            report=lambda share: self.report(0.4 * share),
        )  # fmt: skip
        most = [settings.entries]
        if settings.operator_bounces > 1:
            most.append(max(_LEAST_ENTRIES, settings.entries // COARSER))
        first, *later = thinned_operators(gathering, scene, rays=settings.gather_rays, most=tuple(most))
        self.report(0.55)
        D = np.repeat(self._lights(HELD_OUT, seed=_HELD_OUT_SEED)[:, :, None], 3, axis=2)
        true = gathering.bounce(D)
        solved = bounced(gathering, D)
        first = replace(first, error=self._lost(first, D, true))
        fit = measure_fitness(
            scene,
            self.ground.occluders,
            most=_FIT_POINTS,
            direct=np.ascontiguousarray(D[:, ::2]),
            indirect=np.ascontiguousarray(solved.indirect[:, ::2]),
        )
        self.report(0.65)
        arrays = {f"first/{name}": not_empty(getattr(first, name)) for name in FIRST}
        for name in FIRST if later else ():
            arrays[f"later/{name}"] = not_empty(getattr(later[0], name))
        arrays["origins"] = self.ground.origins
        told = {
            "rays": gathering.rays, "entries": gathering.entries, "first_error": first.error,
            "first_entries": int(first.counts.sum(dtype=np.int64)), "first_threshold": first.threshold,
            "held": told_digits(fit.share), "edge": told_digits(min(fit.edge_for(HELD), 1e9)),
        }  # fmt: skip
        if later:
            told |= {
                "later_entries": int(later[0].counts.sum(dtype=np.int64)), "later_threshold": later[0].threshold,
                "later_error": self._lost(later[0], true, gathering.bounce(true)),
            }  # fmt: skip
        # What later bounces are measured against: not part of the finished bake.
        kept = {"solved": solved.indirect}
        return self._keep("operator", arrays, kept, told, began)

    def _modes(self) -> dict[str, Any]:
        """Factors of what follows the first bounces, from the thinned operator alone."""
        began, settings = time.perf_counter(), self.settings
        first, solved = ThinnedGathering(self._read_first()), self._read("solved")
        later = ThinnedGathering(self._read_first("later")) if settings.operator_bounces > 1 else first
        found = later_bounces(
            later, self._lights(TRIALS, seed=0), self.areas, operator_bounces=settings.operator_bounces,
            modes=settings.modes, report=lambda share: self.report(0.65 + 0.33 * share),
        )  # fmt: skip
        modes, scales = in_bytes(found.modes)
        sources = [in_bytes(of_colour) for of_colour in found.sources]
        arrays = {
            "modes": grouped(modes), "scales": scales, "sources": np.stack([values for values, _ in sources]),
            "source_scales": np.stack([scale for _, scale in sources]),
        }  # fmt: skip
        held_out = np.repeat(self._lights(HELD_OUT, seed=_HELD_OUT_SEED)[:, :, None], 3, axis=2)
        errors, left_out = self._errors((first, later), found, held_out, solved)
        told = {
            "modes": found.modes.shape[1], "remaining": told_digits(min(found.remaining, 1e9)),
            "left_out": left_out, "error": told_digits(float(np.median(errors))),
            "worst_error": told_digits(float(errors.max())),
        }  # fmt: skip
        return self._keep("modes", arrays, {}, told, began)

    def _errors(
        self,
        thin: tuple[ThinnedGathering, ThinnedGathering],
        found: LaterBounces,
        D: np.ndarray,
        solved: np.ndarray,
    ) -> tuple[np.ndarray, float]:
        """Of lights that no mode was found from: how wrong each one's indirect light is, and the modes' part of it."""
        light, total = D, np.zeros_like(D)
        for n in range(self.settings.operator_bounces):
            light = thin[min(n, 1)].bounce(light)
            total += light
        ours = total + found.of(light)
        truly = total + bounced(cast(Gathering, thin[1]), light).indirect
        by_modes = _shares(ours - truly, truly, self.areas)
        return _shares(ours - solved, solved, self.areas), told_digits(float(np.median(by_modes)))

    def _lost(self, thinned: FirstBounce, light: np.ndarray, truly: np.ndarray) -> float:
        """What thinning takes from a bounce of the middle one of some lights, RMS."""
        ours = ThinnedGathering(thinned).bounce(light)
        return told_digits(float(np.median(_shares(ours - truly, truly, self.areas))))

    def _lights(self, count: int, *, seed: int) -> np.ndarray:
        ground, scene = self.ground, self.scene
        clear = _CLEAR if seed == _HELD_OUT_SEED else 0.0
        lights = TrialLights.anywhere(
            scene, ground.occluders, ground.origins, count=count, seed=seed, clear=clear
        )
        return lights.direct(ground.occluders, ground.origins, scene.normals)

    def _keep(
        self,
        part: str,
        arrays: dict[str, np.ndarray],
        kept: dict[str, np.ndarray],
        told: dict[str, Any],
        began: float,
    ) -> dict[str, Any]:
        """Chunks, and the journal's line that says they are whole; those of ``kept`` only until the bake is done."""
        chunks, specs = {}, {}
        named = {f"{_AT}/{name}": values for name, values in arrays.items()}
        named |= {f"making/{name}": values for name, values in kept.items()}
        for name, values in named.items():
            specs[name] = whole(values)
            key, record = self.writer.write_chunk(name, (0,) * values.ndim, values, specs[name])
            chunks[key] = record.model_dump()
        entry = {
            "part": part, "told": told, "chunks": chunks, "seconds": time.perf_counter() - began,
            "arrays": {name: spec.model_dump() for name, spec in specs.items()},
        }  # fmt: skip
        self.writer.append(entry)
        return entry

    def _read(self, name: str, at: str = "making") -> np.ndarray:
        """An array that an entry of the journal names."""
        name = f"{at}/{name}"
        entry = next(entry for entry in self.writer.entries if name in entry["arrays"])
        spec = ArraySpec(**entry["arrays"][name])
        key = chunk_key(name, (0,) * len(spec.shape))
        return open_chunk(self.writer.partial, key, spec, ChunkRecord(**entry["chunks"][key]))

    def _read_first(self, which: str = "first") -> FirstBounce:
        told = next(entry["told"] for entry in self.writer.entries if entry["part"] == "operator")
        arrays = {name: np.array(self._read(f"{which}/{name}", _AT)) for name in FIRST}
        return FirstBounce(**arrays, threshold=told[f"{which}_threshold"], error=told[f"{which}_error"])

    def _manifest(self, *entries: dict[str, Any]) -> Manifest:
        plan, settings = self.plan, self.settings
        told = {name: value for entry in entries for name, value in entry["told"].items()}
        written = WrittenArrays(self.writer)
        written.write_scene(plan.scene)
        for entry in entries:
            arrays = {n: ArraySpec(**spec) for n, spec in entry["arrays"].items() if n.startswith(_AT)}
            written.arrays |= arrays
            written.chunks |= {
                key: ChunkRecord(**record) for key, record in entry["chunks"].items() if key.startswith(_AT)
            }
        glossy, notes = {}, plan.notes
        if self.gloss is not None:
            told |= written.write_gloss(f"{_AT}/glossy", self.gloss)
            told["rays"] += told["glossy_rays"]
            glossy, notes = {"glossy_order": settings.glossy_order}, (*notes, *self.gloss.notes)
        layer = LayerRecord(
            kind="transfer",
            basis_lights=plan.vertices,
            coefficients=told.pop("modes"),
            rays=told.pop("rays"),
            parameters={
                "gather_rays": settings.gather_rays, "operator_bounces": settings.operator_bounces, "bounces": "all",
                "asked_entries": settings.entries, "asked_modes": settings.modes, **glossy,
                **({"caustics": 1} if plan.caustics else {}),
            },
            statistics=told,
        )  # fmt: skip
        return Manifest(
            format=FORMAT,
            version=VERSION,
            settings=identity(plan),
            scene=scene_record(plan.scene, notes),
            layers={LAYER: layer},
            arrays=written.arrays,
            chunks=written.chunks,
            software=software(),
        )


def _shares(difference: np.ndarray, light: np.ndarray, areas: np.ndarray) -> Float64[np.ndarray, "lights"]:
    """RMS of a difference (V, lights, 3) as a share of each light's own; dark ones left out."""
    lost, of = (
        np.einsum("v,vkc->k", areas.astype(np.float64), np.square(x, dtype=np.float64))
        for x in (difference, light)
    )
    lit = of > 1e-12 * max(float(of.max(initial=0.0)), 1e-300)
    return np.sqrt(lost[lit] / of[lit]) if lit.any() else np.zeros(1)

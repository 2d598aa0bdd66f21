"""The cloud bake: lights that move, their indirect light interpolated between precomputed ones (Kristensen,
Akenine-Möller and Jensen, Precomputed local radiance transfer for real-time lighting design, 2005).

A dense grid of lights, all through one gathering operator; clustered zone by zone; compressed by clustered PCA.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..encoding.light_clustering import Pairs, Weights, near_pairs, suggested_weights
from ..scene.geometry import Scene
from ..storage.bake import Bake
from ..storage.journal import BakeWriter, refuse_target
from ..storage.manifest import FORMAT, VERSION, LayerRecord, Manifest
from .carrying_out import carry_out, check_disk
from .cloud_arrays import light_arrays, row_arrays, zone_modes
from .cloud_columns import CloudColumns
from .cloud_plan import CloudPlan, plan_cloud
from .cloud_settings import CloudSettings
from .cloud_trials import TRIALS, trial_places, tried
from .cloud_zones import Lamps, Lost, Zone, lost, make_zone, thinned
from .exitant import ExitantPart
from .layer_writer import software
from .scene_arrays import WrittenArrays, scene_record, told_digits

LAYER = "cloud"
Report = Callable[[float], None]  # share done
_AT = f"layers/{LAYER}"
_COLUMN_SHARE = 0.7  # of the work, for reporting
_IDENTITY = (
    "lights", "radius", "zone", "clusters", "coefficients", "error", "w1", "w2", "merge", "modes",
    "interpolation", "codes", "gather_rays", "glossy_order",
)  # fmt: skip


def bake_cloud(
    scene: Scene,
    path: str | Path,
    *,
    settings: CloudSettings | None = None,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Bake a cloud of lights in ``scene`` into the new folder ``path``.

    Parameters
    ----------
    settings
        The grid and the quality; the defaults if not given.
    resume, force
        Go on with an interrupted bake of the same settings; replace what is there.
    report
        Hears the share done, 0 to 1.

    Raises
    ------
    InputError
        No light in free space, more memory than allowed, or a partial bake of other settings.
    OutputError
        ``path`` exists, the disk is full or cannot be written; what was done can be resumed.
    InterruptedBakeError
        Stopped by Ctrl-C; what was done can be resumed.
    MissingExtraError
        Mitsuba or its LLVM is not installed.
    """
    refuse_target(Path(path), force=force)
    plan = plan_cloud(scene, settings or CloudSettings())
    return bake_planned(path, plan=plan, resume=resume, force=force, report=report)


def bake_planned(
    path: str | Path,
    *,
    plan: CloudPlan,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Carry out a plan; otherwise as ``bake_cloud``."""
    check_disk(Path(path), plan.bytes + plan.scratch)
    return carry_out(
        Path(path),
        lambda writer: _Making(plan, writer, report or (lambda _: None)).run(),
        identity=identity(plan),
        kept=lambda entries: f"{len(entries)} parts",
        resume=resume,
        force=force,
    )


def identity(plan: CloudPlan) -> dict[str, int | float | str | None]:
    """Everything that the bytes of the bake depend on."""
    settings = plan.settings
    asked = {name: getattr(settings, name) for name in _IDENTITY}
    box = None if settings.box is None else repr(settings.box)
    photons = {"photons": plan.photons} if plan.photons else {}
    shell = {"shell": settings.shell} if settings.shell else {}
    return {
        "kind": "cloud",
        "scene": plan.scene.digest,
        "box": box,
        **asked,
        **photons,
        **shell,
        **software(),
    }


class _Making:
    """Columns first, which the journal keeps; then zone after zone, anew if it was stopped."""

    def __init__(self, plan: CloudPlan, writer: BakeWriter, report: Report) -> None:
        self.plan, self.settings, self.scene = plan, plan.settings, plan.scene
        self.writer, self.report = writer, report
        self.gloss: ExitantPart | None = None
        if order := self.settings.glossy_order:
            ground = plan.ground
            self.gloss = ExitantPart.of(self.scene, ground.occluders, order=order, origins=ground.origins)

    def run(self) -> Manifest:
        """The whole bake."""
        plan = self.plan
        if self.gloss is not None:  # light bounces with all that glossy surfaces reflect
            plan = replace(plan, scene=self.gloss.bouncing(plan.scene))
        columns = CloudColumns(plan, self.writer, lambda share: self.report(_COLUMN_SHARE * share))
        columns.make()
        weights = self._weights(columns)
        pairs = self._pairs(weights.w1)
        lamps = self._lamps(columns)
        parts, zones = columns.zones, []
        for k, part in enumerate(parts):
            zones.append(make_zone(columns, part, pairs, w2=weights.w2, lamps=lamps))
            self.report(_COLUMN_SHARE + (1 - _COLUMN_SHARE) * (k + 1) / len(parts))
        zones = thinned(zones, self.settings)
        losses = [] if lamps is None else [lost(columns, zone, lamps).squares for zone in zones]
        return self._manifest(columns, zones, weights, losses)

    def _lamps(self, columns: CloudColumns) -> Lamps | None:
        """How much lights and modes have to say, and lamps that errors are measured on."""
        if columns.sources is None or columns.brought is None:
            return None
        known = {"brought": columns.brought, "sources": columns.sources, "squares": columns.squares}
        usual = tried(self.plan, trial_places(self.plan, seed=0, count=TRIALS), **known)
        lights = np.sqrt(np.square(columns.brought.astype(np.float64)) @ columns.squares)
        held = tried(self.plan, columns.held, **known)
        return Lamps(usual, lights, columns.brought, columns.squares, held)

    def _weights(self, columns: CloudColumns) -> Weights:
        used = self.scene.positions[np.unique(self.scene.triangles)]
        suggested = suggested_weights(float(np.linalg.norm(np.ptp(used, axis=0))), columns.brightest)
        w1, w2 = self.settings.w1, self.settings.w2
        return Weights(suggested.w1 if w1 is None else w1, suggested.w2 if w2 is None else w2)

    def _pairs(self, w1: float) -> Pairs:
        """Lights near enough that see each other."""
        at = self.plan.grid.positions
        pairs = near_pairs(at, w1=w1)
        first, second = pairs.which.T
        return pairs.chosen(self.plan.ground.segments.are_free(at[first], at[second]))

    def _manifest(
        self, columns: CloudColumns, zones: list[Zone], weights: Weights, losses: list[np.ndarray]
    ) -> Manifest:
        plan, settings = self.plan, self.settings
        written = WrittenArrays(self.writer)
        written.write_scene(self.scene)
        lights, scale = light_arrays(plan.grid, zones, columns.brought)
        arrays = {
            **lights,
            **row_arrays(zones, codes=settings.codes),
            "origins": plan.ground.origins,
        }
        if (sources := columns.sources) is not None:
            arrays |= {
                "sources": sources.rows.view(np.uint16),
                "source_scales": sources.scales,
                "areas": sources.areas,
            }
            arrays |= {"zone_modes": zone_modes(zones), "source_order": sources.order}
        for name, values in arrays.items():
            written.write(f"{_AT}/{name}", values)
        clusters = arrays["clusters"]
        coefficients, V = int((clusters[:, 1] * clusters[:, 2]).sum()), len(self.scene.positions)
        errors = Lost(np.sum(losses, axis=0) if losses else np.zeros((5, 1))).shares()
        corners = {f"{side}_{axis}": float(x) for side in ("low", "high") for axis, x in zip(
            "xyz", getattr(plan.grid, side), strict=True)}  # fmt: skip
        gloss = {} if self.gloss is None else written.write_gloss(f"{_AT}/glossy", self.gloss)
        glossy = {"glossy_order": settings.glossy_order} if gloss else {}
        notes = plan.notes if self.gloss is None else self.gloss.notes
        layer = LayerRecord(
            kind="cloud",
            basis_lights=len(plan.grid),
            coefficients=len(arrays["codes"]),
            rays=columns.rays + int(gloss.get("glossy_rays", 0)),
            parameters={
                "asked_lights": settings.lights, "radius": settings.radius,
                "w1": told_digits(weights.w1), "w2": told_digits(weights.w2),
                "merge": settings.merge, "patches": 0, "modes": columns.modes, "colours": columns.colours,
                "interpolation": settings.interpolation if columns.modes else "kernel",
                "codes": settings.codes, "gather_rays": settings.gather_rays, "bounces": "all", "zone": settings.zone,
                **({"photons": plan.photons} if plan.photons else {}), **corners, "step": float(plan.grid.step.max()),
                **glossy,
            },
            statistics={
                "in_solids": plan.grid.in_solids, "zones": len(zones), "clusters": len(clusters),
                "kept_lights": len(arrays["lights"]), "coefficients_a_vertex": told_digits(coefficients / V),
                "groups": told_digits(float(np.mean([zone.groups.count for zone in zones]))),
                "flux_scale": scale, "remaining": told_digits(columns.remaining),
                **{name: told_digits(share) for name, share in errors.items()}, **gloss,
            },
        )  # fmt: skip
        return Manifest(
            format=FORMAT,
            version=VERSION,
            settings=identity(plan),
            scene=scene_record(self.scene, notes),
            layers={LAYER: layer},
            arrays=written.arrays,
            chunks=written.chunks,
            software=software(),
        )

"""The environment bake: any environment map as clustered environment lights, one byte an element.

Johan and Nishita, "Clustering Environment Lights for an Efficient All-Frequency Relighting". Diffuse
vertices seen from anywhere (the paper's geometry relighting), or any material under a fixed eye, at
vertices (its image relighting) or at pixels. Section 4 is ``clustering``; ``zones`` divides the receivers,
and ``layer_writer`` writes what is found, in an order that does not depend on how.
"""

from __future__ import annotations

from pathlib import Path

from ..camera import Camera
from ..scene.geometry import Scene
from ..storage.bake import Bake
from ..storage.journal import refuse_target
from .carrying_out import carry_out, check_disk
from .environment_plan import EnvironmentPlan, plan_environment
from .environment_settings import GATHER_RAYS, EnvironmentSettings
from .layer_receivers import LayerReceivers
from .layer_writer import LayerWriter, Report, identity


def bake_environment(  # noqa: PLR0913  (the settings, one by one, for notebooks)
    scene: Scene,
    path: str | Path,
    *,
    resolution: int = 256,
    tolerance: float | None = None,
    epsilon: float | None = None,
    samples_per_side: int = 3,
    memory: int | None = None,
    receivers: str = "vertices",
    camera: Camera | str | None = None,
    width: int = 256,
    height: int = 144,
    pixel_samples: int = 4,
    zones: int = 1,
    bounces: int | None = None,
    sun_paths: float | str | None = None,
    glossy_order: int = 0,
    gather_rays: int = GATHER_RAYS,
    photons: int | None = None,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Bake ``scene`` for any environment into the new folder ``path``.

    Parameters
    ----------
    resolution, tolerance, epsilon, samples_per_side, memory
        See EnvironmentSettings.
    receivers, camera, width, height, pixel_samples, zones, sun_paths, bounces, gather_rays, photons, glossy_order
        See EnvironmentSettings.
    resume, force
        Go on with an interrupted bake of the same settings; replace what is there.
    report
        Called after each block of work with the fraction done, the seconds left and the clusters found.

    Raises
    ------
    InputError
        Settings out of range, or a partial bake of other settings.
    OutputError
        ``path`` exists, the disk is full or cannot be written; what was done can be resumed.
    InterruptedBakeError
        Stopped by Ctrl-C; what was done can be resumed.
    MissingExtraError
        Mitsuba or its LLVM is not installed.
    """
    settings = EnvironmentSettings(
        resolution, tolerance, epsilon, samples_per_side, memory,
        receivers=receivers, camera=camera, width=width, height=height,
        pixel_samples=pixel_samples, zones=zones, bounces=bounces, gather_rays=gather_rays, photons=photons,
        sun_paths=sun_paths, glossy_order=glossy_order,
    )  # fmt: skip
    refuse_target(Path(path), force=force)
    plan = plan_environment(scene, settings)
    return bake_planned(scene, path, plan=plan, resume=resume, force=force, report=report)


def bake_planned(
    scene: Scene,
    path: str | Path,
    *,
    plan: EnvironmentPlan,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Carry out a plan of the same scene; otherwise as ``bake_environment``."""
    receivers = LayerReceivers(scene, plan.settings)
    check_disk(Path(path), plan.bytes)
    return carry_out(
        Path(path),
        lambda writer: LayerWriter(receivers, plan, writer, report).run(),
        identity=identity(receivers),
        kept=lambda entries: f"{sum(len(entry.get('leaves', ())) for entry in entries):,} clusters",
        resume=resume,
        force=force,
    )

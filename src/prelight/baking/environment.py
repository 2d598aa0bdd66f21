"""The environment bake: any environment map as clustered environment lights, one byte an element.

Johan and Nishita, "Clustering Environment Lights for an Efficient All-Frequency Relighting". Diffuse
vertices seen from anywhere (the paper's geometry relighting), or any material under a fixed eye, at
vertices (its image relighting) or at pixels. Section 4 is ``clustering``; ``zones`` divides the receivers,
and ``layer_writer`` writes what is found, in an order that does not depend on how.
"""

from __future__ import annotations

import shutil
import time
from pathlib import Path

from ..camera import Camera
from ..errors import InterruptedBakeError, OutputError
from ..scene.geometry import Scene
from ..storage.bake import Bake
from ..storage.journal import BakeWriter, partial_folder, refuse_target
from .environment_plan import EnvironmentPlan, plan_environment
from .environment_settings import GATHER_RAYS, EnvironmentSettings
from .layer_receivers import LayerReceivers
from .layer_writer import LayerWriter, Report, identity

_DISK_MARGIN = 1.1  # the plan is an estimate


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
    gather_rays: int = GATHER_RAYS,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Bake ``scene`` for any environment into the new folder ``path``.

    Parameters
    ----------
    resolution, tolerance, epsilon, samples_per_side, memory
        See EnvironmentSettings.
    receivers, camera, width, height, pixel_samples, zones, sun_paths, bounces, gather_rays
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
        pixel_samples=pixel_samples, zones=zones, bounces=bounces, gather_rays=gather_rays,
        sun_paths=sun_paths,
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
    _check_disk(Path(path), plan)
    writer = BakeWriter(Path(path), settings=identity(receivers), resume=resume, force=force)
    started, earlier = time.perf_counter(), sum(entry.get("seconds", 0.0) for entry in writer.entries)
    try:
        manifest = writer.complete or LayerWriter(receivers, plan, writer, report).run()
        writer.publish(manifest)
    except KeyboardInterrupt as stop:
        kept = sum(len(entry.get("leaves", ())) for entry in writer.entries)
        reason = f"stopped with {kept:,} clusters kept; run the same command with --resume to go on"
        raise InterruptedBakeError(path, reason) from stop
    finally:
        writer.close()
    bake = Bake.open(path)
    bake.note_seconds(earlier + time.perf_counter() - started)
    return bake


def _check_disk(path: Path, plan: EnvironmentPlan) -> None:
    """Raises OutputError if the bake will not fit: better before hours of rays than after."""
    try:
        free = shutil.disk_usage(path.absolute().parent).free
        kept = sum(file.stat().st_size for file in partial_folder(path).rglob("*") if file.is_file())
    except (OSError, ValueError):
        return  # what is wrong with the folder is said where it is written to
    if free + kept < _DISK_MARGIN * plan.bytes:
        reason = f"about {plan.bytes / 1e6:,.0f} MB will be written and {free / 1e6:,.0f} MB are free"
        raise OutputError(path, reason + "; free some space or choose another disk")

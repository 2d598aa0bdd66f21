"""Bakes of steerable lamps against the path tracer, for ``prelight compare``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from . import printing
from .figures_said import say_figures
from .relight_steerable import check_lamps_alone

if TYPE_CHECKING:
    from ..storage.bake import Bake


def compare_lamps(
    bake: Bake,
    rig: str,
    *,
    samples: int,
    seed: int,
    emphasis: float | None,
    output: Path | None,
    force: bool,
    json: bool,
) -> None:
    """Hold all pixels of a bake against the path tracer; the options are those of ``prelight compare``, checked."""
    with printing.waiting("opening the bake and the lights (the first time, compiling too)"):
        from ..checking.against_lamps import LampComparison
        from ..lighting.rig import Rig
        from ..relighting.steerable_bake import SteerableBake

        opened = Rig.open(rig)
        check_lamps_alone(opened, rig)
        light = SteerableBake(bake)
        notes = light.notes(opened.lights)
        work = LampComparison(light, opened.lights)
    with printing.share_bar("tracing paths") as report:
        figures = work.run(samples=samples, seed=seed, report=report)
    if output is not None:
        from ..drawing.figures import save_figure

        save_figure(work.picture(emphasis=emphasis), output, force=force)
    if json:
        printing.say_json(figures | {"notes": notes, "output": None if output is None else str(output)})
        return
    for note in notes:
        printing.say(f"note: {note}")
    if work.left_out:
        printing.say(f"note: in the reference, but in no layer: {work.left_out}")
    say_figures(figures)
    if output is not None:
        printing.say(str(output))

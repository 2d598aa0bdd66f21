"""Relighting bakes of steerable lamps, for ``prelight relight``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from . import printing

if TYPE_CHECKING:
    from ..storage.bake import Bake


def relight_steerable(
    bake: Bake,
    rig: str,
    *,
    output: Path | None,
    brightness: tuple[float, tuple[float, float, float]],
    exposure: tuple[bool, float],
    curve: str,
    force: bool,
    json: bool,
) -> None:
    """Light a bake whose layers are all steerable; the options are those of ``prelight relight``, read.

    ``brightness`` is a factor and a tint; ``exposure`` whether to meter, and stops.
    """
    with printing.waiting("opening the bake and the lights (the first time, compiling too)"):
        from ..drawing.pixels import pixel_picture
        from ..lighting.rig import Rig
        from ..relighting.deep_buffer import first_bounces
        from ..relighting.steerable import SteerableRelighter
        from ..relighting.stored_steerable import open_deep, open_steerable

        opened = Rig.open(rig)
        if not opened.lights or max(opened.environment.total) > 0:
            what = "this bake has steerable lamps alone: expected a rig file with [[spot]] or [[panel]], nothing else"
            raise InputError(rig, what)
        light = SteerableRelighter(open_steerable(bake))
        notes = light.notes(opened.lights)
        update = light.light(opened.lights)
        update = light.light(opened.lights)  # with everything warm
        radiance = light.radiance
        deep, exact = open_deep(bake), 0.0
        if deep:
            started = time.perf_counter()
            radiance = radiance + first_bounces(light, deep, opened.lights)
            exact = 1e3 * (time.perf_counter() - started)
            notes = []  # of shapes that a degree holds roughly: what shows of them is exact
        radiance *= [brightness[0] * tint for tint in brightness[1]]
    width, height = light.size
    figures: dict[str, Any] = {
        "milliseconds": update.milliseconds,
        "first_bounce_milliseconds": exact,
        "bytes_read": update.bytes_read,
        "planes": update.planes,
        "planes_of": update.whole,
        "lights": len(opened.lights),
        "receivers": len(radiance),
        "notes": notes,
        "output": None if output is None else str(output),
    }
    if output is not None and output.suffix.lower() == ".npy":
        from ..images.formats import write_npy

        write_npy(output, radiance)
    elif output is not None:
        import numpy as np

        picture = pixel_picture(np.maximum(radiance, 0), np.ones((height, width), np.float32))
        metered, stops = exposure
        stops += picture.stops("auto") if metered else 0.0
        figures["exposure_stops"] = stops
        picture.save(output, force=force, exposure=stops, curve=curve)
    if json:
        printing.say_json(figures)
        return
    for note in notes:
        printing.say(f"note: {note}")
    what = f"{update.planes} of {update.whole} planes, {printing.size(update.bytes_read)} read"
    printing.say(
        f"relit {width}×{height} pixels in {update.milliseconds:.1f} ms ({what})"
        + ("" if output is None else f"\n{output}")
    )

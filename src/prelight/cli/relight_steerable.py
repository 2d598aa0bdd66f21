"""Relighting bakes of steerable lamps, for ``prelight relight``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from . import arguments, printing

if TYPE_CHECKING:
    from ..lighting.rig import Rig
    from ..storage.bake import Bake


def check_lamps_alone(rig: Rig, path: str | Path) -> None:
    """Raises InputError for a rig without spots and panels, or with more than those."""
    if not rig.lights or max(rig.environment.total) > 0:
        what = "this bake has steerable lamps alone: expected a rig file with [[spot]] or [[panel]], nothing else"
        raise InputError(path, what)


def relight_steerable(
    bake: Bake,
    rig: str,
    *,
    output: Path | None,
    brightness: tuple[float, str],
    exposure: tuple[bool, float],
    curve: str,
    narrow: int,
    force: bool,
    json: bool,
) -> None:
    """Light a bake whose layers are all steerable; the options are those of ``prelight relight``, read.

    ``brightness`` is a factor and a tint; ``exposure`` whether to meter, and stops.
    """
    from ..lighting import quantities

    factor = quantities.amount("--scale", brightness[0], least=0.0, most=1e20)
    tint = quantities.strength("--tint", arguments.colour("--tint", brightness[1]))
    with printing.waiting("opening the bake and the lights (the first time, compiling too)"):
        from ..lighting.rig import Rig
        from ..relighting.steerable_bake import SteerableBake

        opened = Rig.open(rig)
        check_lamps_alone(opened, rig)
        parts = None
        if narrow:
            from ..relighting.viewed import narrow_parts

            parts = narrow_parts(bake, narrow)
        light = SteerableBake(bake, narrow=parts)
        notes = light.notes(opened.lights)
        light.light(opened.lights)
        update = light.light(opened.lights)  # with everything warm
        radiance = light.radiance * [factor * own for own in tint]
    width, height = light.size
    figures: dict[str, Any] = {
        "milliseconds": update.milliseconds,
        "first_bounce_milliseconds": light.first_bounce_milliseconds,
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

        from ..drawing.pixels import pixel_picture

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

"""``prelight solve``: lights from a wanted picture."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ..errors import InputError
from . import printing

if TYPE_CHECKING:
    from ..lighting.panel import Panel
    from ..lighting.spot import Spot

_FREE = ("colour", "aim", "width")


def solve(
    bake: Path,
    /,
    *,
    target: Annotated[Path, Parameter(["--target", "-t"])],
    output: Annotated[Path, Parameter(["--output", "-o"])],
    mask: Path | None = None,
    lights: Path | None = None,
    free: str = "colour,aim,width",
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Find lights whose picture is as near as they can come to one that you painted, and write them as a rig.

    Colours are found by non-negative least squares; directions, positions and widths by going downhill through
    the steering weights. Pixels are read once, so this takes seconds.

    `prelight solve chess.prelight --target wanted.exr -o found.toml`, then
    `prelight relight chess.prelight found.toml -o found.png`.

    Parameters
    ----------
    bake
        NAME.prelight with steerable layers, made by `prelight bake steerable`.
    target
        The picture that is wanted, of the bake's size: .exr or .hdr (linear, best), or .png or .jpg (sRGB; one
        that `prelight relight` wrote has a tone curve and is only roughly what is meant).
    output
        The rig (.toml) to write; relight with it to see the picture.
    mask
        A picture of the same size: white where the target counts, black where anything will do.
    lights
        A rig (.toml) whose [[spot]]s and [[panel]]s are the lights to look for: how many, in which layers, in
        which shapes. One light in each layer if not given.
    free
        What may change: colour always, aim (a panel's position too) and width. `--free colour` keeps the lights
        of --lights where they are.
    force
        Replace the output.
    json
        Print one JSON object on standard output.
    """
    from ..files import publish, refuse_existing

    parts = [part.strip() for part in free.split(",")]
    if not set(parts) <= set(_FREE) or "colour" not in parts:
        raise InputError(
            "--free", f"{free!r}, expected colour, then aim and width as wanted, such as colour,aim"
        )
    if set(parts) == {"colour"} and lights is None:
        raise InputError(
            "--free", "colour alone needs --lights: a rig with the lights that stay where they are"
        )
    if output.suffix.lower() != ".toml":
        raise InputError(output, "expected a name ending in .toml")
    refuse_existing(output, force=force)
    with printing.waiting("looking for lights"):
        from ..lighting.rig_text import rig_text
        from ..solving.goal import solve_bake
        from ..solving.poses import Freedom

        started = time.perf_counter()
        given = None if lights is None else _lights_of(lights)
        freedom = Freedom(aim="aim" in parts, width="width" in parts)
        found = solve_bake(bake, target, mask=mask, lights=given, freedom=freedom)
        seconds = time.perf_counter() - started
    notes = [
        f"prelight solve {bake.name} --target {target.name}",
        f"{100 * found.error:.3g} % RMS from the target",
    ]
    publish(output, rig_text(found.lights, folder=output.parent, notes=notes).encode())
    if json:
        printing.say_json(
            {
                "lights": len(found.lights),
                "relative_rms": found.error,
                "steps": found.steps,
                "seconds": seconds,
                "output": str(output),
            }
        )
        return
    number = len(found.lights)
    printing.say(
        f"{number} light{'s' if number > 1 else ''} ({found.lit} lit), {100 * found.error:.3g} % RMS from the target"
        f" after {found.steps} steps in {printing.duration(seconds)}\n{output}"
    )


def _lights_of(path: Path) -> tuple[Spot | Panel, ...]:
    from ..lighting.rig import Rig

    if path.suffix.lower() != ".toml":
        raise InputError(path, "expected a rig ending in .toml with [[spot]] or [[panel]] tables")
    lights = Rig.open(str(path)).lights
    if not lights:
        raise InputError(path, "has no [[spot]] or [[panel]] to look for")
    return lights

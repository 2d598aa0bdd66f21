"""``prelight bake transfer``: any light, anywhere in the scene, live."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from . import arguments, printing
from .bake_running import AS_IT_IS, AT_ONCE, Reading, Running
from .gloss_said import said_of_gloss

_NO_EDGE = 1e8  # metres: every one holds
_NUMBER = Parameter(converter=arguments.whole_number)


def transfer(
    scene: str,
    /,
    *,
    output: Annotated[Path | None, Parameter(["--output", "-o"])] = None,
    gather_rays: Annotated[int, _NUMBER] = 1600,
    entries: Annotated[int, _NUMBER] = 300,
    operator_bounces: Annotated[int, _NUMBER] = 2,
    modes: Annotated[int, _NUMBER] = 124,
    glossy_order: Annotated[int, _NUMBER] = 0,
    caustics: bool = True,
    subdivide: float | None = None,
    reading: Reading = AS_IT_IS,
    running: Running = AT_ONCE,
) -> None:
    """Bake for any light at all: lamps, spots, panels, skies, moved anywhere, with exact shadows and every bounce.

    Nothing of the light is fixed: a rig (docs/rig.md) puts [[lamp]]s, [[spot]]s and [[panel]]s with a position into
    the scene afterwards, some thirty changes a second:

    `prelight bake transfer stock:room -o room.prelight`, then `prelight relight room.prelight RIG.toml -o picture.png`,
    RIG.toml being `lamp = [{ position = [0.4, 1.9, 0.6], power_w = 40, kelvin = 2900 }]`.

    Surfaces are diffuse, unless --glossy-order shows what glossy ones reflect. Direct light is traced when relighting,
    so that needs Mitsuba too. Shows what it will cost before it begins. Ctrl-C keeps what is done; the same command
    with --resume goes on.

    Parameters
    ----------
    scene
        A mesh or scene file, or stock:NAME, one of the built-in scenes (stock:room).
    output
        The bake, a new folder; SCENE.prelight beside you if not given.
    gather_rays
        Rays from each vertex that find the surfaces which light bounces from, a square number up to 16384: four
        times as many halve the noise of bounced light.
    entries
        Of the operator of one bounce, for each vertex in the mean, 16 to 4096: more make the first bounce truer and
        every change of light slower. Light that has bounced before has a third as many.
    operator_bounces
        How many bounces the operator makes before smooth modes take over, 1 to 3.
    modes
        How many of them at most, 1 to 124.
    glossy_order
        Show what glossy materials reflect, for any camera, in spherical harmonics of this order, 1 to 16; 8 is good for
        most. 0 shows every surface as diffuse.
    caustics
        Photons carry what clear glass and mirrors send of a light, when it is lit or moved; --no-caustics makes them
        diffuse, of their base colour.
    subdivide
        Halve edges longer than this, in metres, for a finer net of vertices.
    """
    target = running.target(scene, output)
    budget = running.budget
    with printing.waiting("reading the scene and estimating the cost (the first time, compiling too)"):
        from ..baking.transfer import bake_planned
        from ..baking.transfer_plan import plan_transfer
        from ..baking.transfer_settings import TransferSettings

        settings = TransferSettings(
            gather_rays, entries, operator_bounces, modes, budget, glossy_order, caustics
        )
        loaded = reading.load(scene, subdivide=subdivide)
        plan = plan_transfer(loaded, settings)
    if not running.json:
        for note in (*loaded.notes, *plan.notes):
            printing.say(f"note: {note}")
        printing.say(
            f"{loaded.name}: {plan.vertices:,} vertices, {plan.triangles:,} triangles\n"
            f"about {printing.count(plan.rays)} rays, {printing.duration(plan.seconds)}, "
            f"{printing.size(plan.bytes)} on disk, at most {printing.size(plan.memory)} of memory"
        )
        if glossy_order:
            printing.say(said_of_gloss(plan.glossy))
    bake = running.bake(target, plan, bake_planned)
    if bake is None:
        return
    summary = bake.summary()
    layer = summary["layers"][0]
    told = layer["statistics"]
    coarse = ""
    if told["edge"] < _NO_EDGE:
        coarse = (
            f"\nthe mesh is too coarse for bounced light on {1 - told['held']:.0%} of the area; "
            f"--subdivide {told['edge']:.2g} would hold it nearly everywhere"
        )
    printing.say(
        f"{target}: {printing.size(summary['bytes'])}"
        + (f", {printing.duration(layer['seconds'])}" if layer["seconds"] is not None else "")
        + f"\nbounced light of lights not close to a surface errs by {told['error']:.1%} in the middle, "
        f"{told['worst_error']:.1%} at worst (thinning adds {told['first_error']:.1%} to a first bounce)"
        f"{coarse}\nnow: prelight relight {target} RIG.toml -o picture.png   (docs/rig.md has lamps to begin with)"
    )

"""``prelight bake``: trace a scene once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from . import arguments, printing

app = App(
    help="Trace a scene once and keep its light transport in NAME.prelight. One subcommand for each kind of light."
)


@app.command
def environment(
    scene: str,
    /,
    *,
    output: Annotated[Path | None, Parameter(["--output", "-o"])] = None,
    resolution: Annotated[int, Parameter(converter=arguments.whole_number)] = 256,
    tolerance: float | None = None,
    epsilon: float | None = None,
    samples_per_side: Annotated[int, Parameter(converter=arguments.whole_number)] = 3,
    floor: float | None = None,
    albedo: str | None = None,
    memory: str | None = None,
    dry_run: Annotated[bool, Parameter(negative="")] = False,
    resume: Annotated[bool, Parameter(negative="")] = False,
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Bake diffuse vertices for any environment map: environment lights in clusters, one byte an element.

    Shows what it will cost before it begins. Ctrl-C keeps what is done; the same command with --resume goes on.

    Parameters
    ----------
    scene
        A PLY or GLB file, or stock:NAME, one of the built-in scenes (stock:sculpture).
    output
        The bake, a new folder; SCENE.prelight beside you if not given.
    resolution
        R: the environment is a cube map of 6·R·R lights, 1 to 4096. More makes shadows of small lights sharper;
        the number of clusters hardly grows.
    tolerance
        How much a light may differ from its cluster: RMS over the vertices, where a fully lit one has 0.32.
        Default 0.0135. A smaller one makes shadows truer and the bake slower and larger: 0.03 for a quick look
        (small lights cast frayed shadows), 0.007 for the last word.
    epsilon
        The same as the paper's threshold: tolerance = epsilon·√vertices. Give one of the two.
    samples_per_side
        s: a cluster is judged by s×s of its lights, 2 to 9.
    floor
        Put a floor of 193×193 vertices under the lowest point, SCALE times the largest extent wide.
    albedo
        Reflectance of vertices that the file gives none, one number or three, 0 to 1; default 0.8.
    memory
        What the bake may use, such as 4GB, at least 500MB; default half of this machine's.
    dry_run
        Only say what it would cost.
    resume
        Go on with an interrupted bake.
    force
        Replace the output, or begin an interrupted bake anew.
    json
        Print one JSON object on standard output.
    """
    from ..storage.journal import refuse_target

    target = output or Path(
        (scene.removeprefix("stock:") if scene.startswith("stock:") else Path(scene).stem) + ".prelight"
    )
    if not dry_run:
        refuse_target(target, force=force)

    budget = arguments.memory(memory)
    colour = None if albedo is None else arguments.colour("--albedo", albedo)
    with printing.waiting("reading the scene and estimating the cost (the first time, compiling too)"):
        from ..baking.environment import bake_planned
        from ..baking.environment_plan import EnvironmentSettings, plan_environment
        from ..scene.loading import load_scene

        settings = EnvironmentSettings(resolution, tolerance, epsilon, samples_per_side, budget)
        loaded = load_scene(scene, floor=floor, albedo=colour)
        plan = plan_environment(loaded, settings)
    if not json:
        for note in loaded.notes:
            printing.say(f"note: {note}")
        printing.say(
            f"{loaded.name}: {plan.receivers:,} receivers, {plan.triangles:,} triangles, "
            f"{6 * resolution**2:,} environment lights\n"
            f"about {plan.clusters:,} clusters, {plan.rays / 1e9:.2f} G rays, {printing.duration(plan.seconds)}, "
            f"{printing.size(plan.bytes)} on disk, at most {printing.size(plan.memory)} of memory"
        )
    if dry_run:
        if json:
            printing.say_json(plan.summary())
        return
    with printing.progress_bar("baking") as report:
        bake = bake_planned(loaded, target, plan=plan, resume=resume, force=force, report=report)
    summary = bake.summary()
    if json:
        printing.say_json(summary)
        return
    layer = summary["layers"][0]
    printing.say(
        f"{target}: {layer['coefficients']:,} clusters, {printing.size(summary['bytes'])}"
        + (f", {printing.duration(layer['seconds'])}" if layer["seconds"] is not None else "")
        + f"\nnow: prelight relight {target} SKY.hdr -o picture.png   (or stock:sunset for a sky of ours)"
    )

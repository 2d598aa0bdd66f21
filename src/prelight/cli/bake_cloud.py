"""``prelight bake cloud``: lamps that move, their light interpolated between a cloud of precomputed ones."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ..errors import InputError
from . import arguments, printing
from .bake_running import AS_IT_IS, AT_ONCE, Reading, Running
from .gloss_said import rows_of_gloss, said_of_gloss

if TYPE_CHECKING:
    from ..baking.cloud_plan import CloudPlan
    from ..storage.bake import Bake

_NUMBER = Parameter(converter=arguments.whole_number)


def cloud(
    scene: str,
    /,
    *,
    output: Annotated[Path | None, Parameter(["--output", "-o"])] = None,
    lights: Annotated[int, _NUMBER] = 384,
    box: str | None = None,
    shell: float = 0.0,
    radius: float = 0.0,
    zone: Annotated[int, _NUMBER] = 1024,
    clusters: Annotated[int | None, _NUMBER] = None,
    coefficients: float = 16.0,
    error: float | None = None,
    w1: float | None = None,
    w2: float | None = None,
    merge: str = "mean",
    modes: Annotated[int, _NUMBER] = 512,
    interpolation: str | None = None,
    codes: str = "bytes",
    gather_rays: Annotated[int, _NUMBER] = 1024,
    photons: Annotated[int | None, _NUMBER] = None,
    glossy_order: Annotated[int, _NUMBER] = 0,
    subdivide: float | None = None,
    reading: Reading = AS_IT_IS,
    running: Running = AT_ONCE,
) -> None:
    """Bake a cloud of lights: any number of lamps, moved anywhere in it, with every bounce.

    What bounces of a lamp's light is interpolated between precomputed lights, what falls directly is
    traced (Kristensen, Akenine-Möller and Jensen 2005). A rig (docs/rig.md) puts [[lamp]]s, [[spot]]s and [[panel]]s
    with a position into the scene afterwards:

    `prelight bake cloud stock:maze -o maze.prelight`, then `prelight relight maze.prelight RIG.toml -o picture.png`,
    RIG.toml being `lamp = [{ position = [0.6, 0.5, 0.6], power_w = 20 }]`.

    Shows what it will cost before it begins. Ctrl-C keeps what is done; the same command with --resume goes on.

    Parameters
    ----------
    scene
        A mesh or scene file, or stock:NAME, one of the built-in scenes (stock:maze).
    output
        The bake, a new folder; SCENE.prelight beside you if not given.
    lights
        About so many in a grid, up to 8192; those inside solids are left out. More err less between them; what is kept
        and how long relighting takes hardly grow.
    box
        Where lights will be moved: X,Y,Z/X,Y,Z, low and high corner in metres; the box around the scene if not given.
    shell
        Lights half as far apart within so many metres of walls and objects: lamps will be there. About eight times as
        many lights in this space.
    radius
        Of the grid's lights, metres: diffuse balls; 0 for points.
    zone
        Vertices of a zone at most: lights are clustered for each, and one is in memory at a time.
    clusters
        Of vertices in each zone, with components of their own; one for each 33 vertices if not given.
    coefficients
        Kept of a vertex and colour, in the mean.
    error
        Keep no more than bring what is left over below this share (RMS), 0 to 1.
    w1
        Of the paper's equation 9: the reciprocal of how far lights of a group may be apart, in metres. Suggested from
        the scene if not given.
    w2
        The same of how differently a vertex may answer to them, in irradiance / π of 1 W/sr.
    merge
        mean, or harmonic: how answers to lights of a group become one.
    modes
        Of bounced light, which make up for what lights of the cloud do not have, up to 1024; 0 for the paper's cloud
        alone.
    interpolation
        fitted to what bounces of the light that falls, or kernel, the paper's. fitted unless there are no modes.
    codes
        bytes, or float16: twice as many bytes, the last half percent.
    gather_rays
        Rays from each vertex that find the surfaces which light bounces from, a square number up to 16384.
    photons
        Of each light, for what clear glass and mirrors send on: caustics; default 65536 where a material needs them.
        Four times as many halve the noise; 0 leaves caustics out.
    glossy_order
        Show what glossy materials reflect, for any camera, in spherical harmonics of this order, 1 to 16; 8 is good for
        most. 0 shows every surface as diffuse.
    subdivide
        Halve edges longer than this, in metres, for a finer net of vertices.
    """
    target = running.target(scene, output)
    budget = running.budget
    with printing.waiting("reading the scene and estimating the cost (the first time, compiling too)"):
        from ..baking.cloud import bake_planned
        from ..baking.cloud_plan import plan_cloud
        from ..baking.cloud_settings import CloudSettings

        settings = CloudSettings(
            lights=lights, box=None if box is None else _corners(box), shell=shell, radius=radius, zone=zone,
            clusters=clusters, coefficients=coefficients, error=error, w1=w1, w2=w2, merge=merge, modes=modes,
            interpolation=interpolation or ("fitted" if modes else "kernel"), codes=codes,
            gather_rays=gather_rays, photons=photons, memory=budget, glossy_order=glossy_order,
        )  # fmt: skip
        loaded = reading.load(scene, subdivide=subdivide)
        plan = plan_cloud(loaded, settings)
    if not running.json:
        _say_plan(plan)
    bake = running.bake(target, plan, bake_planned)
    if bake is not None:
        _say_done(bake, target)


def _corners(text: str) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """X,Y,Z/X,Y,Z."""
    try:
        low, high = ([float(x) for x in part.split(",")] for part in text.split("/"))
        (a, b, c), (d, e, f) = low, high
    except ValueError:
        raise InputError("--box", f"{text!r}, expected X,Y,Z/X,Y,Z, its low and its high corner") from None
    return (a, b, c), (d, e, f)


def _say_plan(plan: CloudPlan) -> None:
    for note in (*plan.scene.notes, *plan.notes):
        printing.say(f"note: {note}")
    grid = plan.grid
    inside = f" ({grid.in_solids:,} more are inside solids)" if grid.in_solids else ""
    printing.say(
        f"{plan.scene.name}: {plan.vertices:,} vertices, {plan.triangles:,} triangles\n"
        f"{len(grid):,} lights, {' × '.join(f'{x:.2g}' for x in grid.step)} m apart{inside}\n"
        f"about {printing.count(plan.rays)} rays, {printing.duration(plan.seconds)}, "
        f"{printing.size(plan.bytes)} on disk ({printing.size(plan.scratch)} more while baking), "
        f"at most {printing.size(plan.memory)} of memory"
    )
    if order := plan.settings.glossy_order:
        from ..baking.exitant import plan_exitant

        printing.say(said_of_gloss(plan_exitant(plan.scene, order)))


def _say_done(bake: Bake, target: Path) -> None:
    summary = bake.summary()
    layer = summary["layers"][0]
    taken = f", {printing.duration(layer['seconds'])}" if layer["seconds"] is not None else ""
    printing.say(f"{target}: {printing.size(summary['bytes'])}{taken}")
    for _, said in rows_of_errors(layer):
        printing.say(said)
    printing.say(
        f"now: prelight relight {target} RIG.toml -o picture.png   (docs/rig.md has lamps to begin with)"
    )


def rows_of_errors(layer: dict) -> list[tuple[str, str]]:
    """What bounced light of lamps between the lights loses, measured while baking; nothing without modes."""
    told = layer["statistics"]
    if not layer["parameters"]["patches"] and not layer["parameters"].get("modes"):
        return []
    return [
        (
            "  errs",
            f"bounced light of lamps anywhere by {told['error']:.1%} in the middle, "
            f"{told['worst_error']:.0%} at worst: "
            f"interpolation {told['interpolation_error']:.1%}, light clusters {told['merged_error']:.1%}, "
            f"components {told['components_error']:.1%}",
        )
    ]


def rows_of_cloud(layer: dict) -> list[tuple[str, str]]:
    """What ``prelight inspect`` says of a cloud layer."""
    settings, told, seconds = layer["parameters"], layer["statistics"], layer["seconds"]
    took = f", {printing.duration(seconds)}" if seconds is not None else ""
    solids = f", {told['in_solids']:,} more were inside solids" if told["in_solids"] else ""
    patches = f", {settings['patches']:,} patches" if settings["patches"] else ""
    modes = f", {settings['modes']:,} modes" if settings.get("modes") else ""
    return [
        ("layer", f"{layer['name']} ({layer['kind']})"),
        ("  receivers", "vertices, seen from anywhere"),
        ("  lights", f"{layer['basis_lights']:,}, at most {settings['step']:.2g} m apart{solids}"),
        (
            "  clusters",
            f"{told['groups']:.0f} groups of lights in the mean of {told['zones']:,} zones "
            f"(w1 {settings['w1']:.3g}, w2 {settings['w2']:.3g}){patches}{modes}",
        ),
        (
            "  components",
            f"{told['coefficients_a_vertex']:.3g} coefficients a vertex and colour in {told['clusters']:,} clusters, "
            f"{settings['codes']}",
        ),
        (
            "  between",
            "weights fitted to direct light"
            if settings["interpolation"] == "fitted"
            else "the paper's kernel",
        ),
        *rows_of_errors(layer),
        *rows_of_gloss(layer),
        ("  size", printing.size(layer["bytes"])),
        ("  cost", f"{printing.count(layer['rays'])} rays{took}"),
    ]

"""``prelight bake``: trace a scene once."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from ..errors import InputError
from . import arguments, printing
from .bake_cloud import cloud
from .bake_portals import portals
from .bake_running import AS_IT_IS, AT_ONCE, Reading, Running
from .bake_steerable import steerable
from .bake_transfer import transfer
from .gloss_said import said_of_gloss

app = App(
    help="Trace a scene once and keep its light transport in NAME.prelight. One subcommand for each kind of light."
)

app.command(steerable)
app.command(portals)
app.command(transfer)
app.command(cloud)


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
    zones: Annotated[int, Parameter(converter=arguments.whole_number)] = 1,
    sun_paths: str | None = None,
    bounces: Annotated[int | None, Parameter(converter=arguments.whole_number)] = None,
    gather_rays: Annotated[int, Parameter(converter=arguments.whole_number)] = 1024,
    photons: Annotated[int | None, Parameter(converter=arguments.whole_number)] = None,
    glossy_order: Annotated[int, Parameter(converter=arguments.whole_number)] = 0,
    receivers: str = "vertices",
    camera: str | None = None,
    size: str | None = None,
    pixel_samples: Annotated[int | None, Parameter(converter=arguments.whole_number)] = None,
    subdivide: float | None = None,
    reading: Reading = AS_IT_IS,
    running: Running = AT_ONCE,
) -> None:
    """Bake for any environment map: environment lights in clusters, one byte an element.

    Diffuse vertices, to be seen from anywhere, with --glossy-order their gloss too; or, with --camera, any material
    as one eye sees it.

    Shows what it will cost before it begins. Ctrl-C keeps what is done; the same command with --resume goes on.

    Parameters
    ----------
    scene
        A mesh or scene file, or stock:NAME, one of the built-in scenes (stock:sculpture).
    output
        The bake, a new folder; SCENE.prelight beside you if not given.
    resolution
        R: the environment is a cube map of 6·R·R lights, 1 to 4096. More makes shadows of small lights sharper;
        the number of clusters hardly grows.
    tolerance
        How much a light may differ from its cluster: RMS over the receivers of a zone, where a fully lit one has 0.32.
        Default 0.0135. A smaller one makes shadows truer and the bake slower and larger: 0.03 for a quick look
        (small lights cast frayed shadows), 0.007 for the last word.
    epsilon
        The same as the paper's threshold: tolerance = epsilon·√receivers. Give one of the two.
    samples_per_side
        s: a cluster is judged by s×s of its lights, 2 to 9.
    zones
        Divide the receivers into about so many parts by place, 1 to 4096, each with clusters of its own: the tolerance
        then holds in each of them, not only on average over all.
    sun_paths
        A latitude in degrees, or any: where the sun stands there at some hour of the year (north is -Z; any: wherever
        above the horizon) lights are clustered four times as strictly, and a sun errs by less than 1 % without rays.
        Two to four times the clusters; not needed where relighting traces the sun, as it does for diffuse vertices.
    bounces
        How often light may bounce from surface to surface before it arrives, at most 1000; 0 for direct light only.
        If not given as often as matters: until what is left is below a thousandth of it.
    gather_rays
        Rays from each receiver that find the surfaces which light bounces from, a square number up to 16384: four
        times as many halve the noise of bounced light.
    photons
        Of the whole sky, that find the caustics of clear glass and mirrors; default 4,194,304 where a material is such,
        none elsewhere. 0 leaves them out: glass then casts a plain shadow.
    glossy_order
        Seen from anywhere, show what glossy materials reflect, in spherical harmonics of this order, 1 to 16; 8 is good
        for most, narrower highlights are widened to what it holds. 0 leaves gloss out.
    receivers
        vertices, or pixels: what --camera sees, at the pixels of a picture of --size.
    camera
        The one eye that what is not Lambertian is baked for: the name of a camera in the scene, or a JSON file with
        eye, target, up and vertical_fov_deg. Without it and --glossy-order every surface is diffuse.
    size
        Width and height of the picture with --receivers pixels, up to 2048 each; default 256x144.
    pixel_samples
        Points in a pixel with --receivers pixels, a square number up to 64; default 4.
    subdivide
        Halve edges longer than this, in metres, for a finer net of vertices.
    """
    for option, value in (("--size", size), ("--pixel-samples", pixel_samples)):
        if value is not None and receivers != "pixels":
            raise InputError(
                option, f"{value}, but receivers are {receivers}; add --receivers pixels or leave it out"
            )
    target = running.target(scene, output)

    budget = running.budget
    with printing.waiting("reading the scene and estimating the cost (the first time, compiling too)"):
        from ..baking.environment import bake_planned
        from ..baking.environment_plan import plan_environment
        from ..baking.environment_settings import EnvironmentSettings

        width, height = arguments.picture_size(size or "256x144")
        settings = EnvironmentSettings(
            resolution, tolerance, epsilon, samples_per_side, budget,
            receivers=receivers, camera=arguments.eye(camera), width=width, height=height,
            pixel_samples=4 if pixel_samples is None else pixel_samples, zones=zones,
            bounces=bounces, gather_rays=gather_rays, sun_paths=sun_paths, glossy_order=glossy_order,
            photons=photons,
        )  # fmt: skip
        loaded = reading.load(scene, subdivide=subdivide)
        plan = plan_environment(loaded, settings)
    if not running.json:
        for note in loaded.notes:
            printing.say(f"note: {note}")
        printing.say(
            f"{loaded.name}: {plan.receivers:,} receivers in {plan.zones:,} {'zone' if plan.zones == 1 else 'zones'}, "
            f"{plan.triangles:,} triangles, "
            f"{6 * resolution**2:,} environment lights\n"
            f"about {plan.clusters:,} clusters, {printing.count(plan.rays)} rays, {printing.duration(plan.seconds)}, "
            f"{printing.size(plan.bytes)} on disk, at most {printing.size(plan.memory)} of memory"
        )
        if bounces != 0:
            light = plan.bounced
            printing.say(
                f"of it for light that has bounced {printing.count(light.rays)} rays, "
                f"{printing.duration(light.seconds)}, {printing.size(light.bytes)} (--bounces 0 leaves it out)"
            )
            if light.photons:
                printing.say(
                    f"{printing.count(light.photons)} photons for glass and mirrors, "
                    f"{printing.duration(light.photon_seconds)} of it (--photons 0 leaves caustics out)"
                )
        if glossy_order:
            printing.say(said_of_gloss(plan.glossy))
    bake = running.bake(target, plan, partial(bake_planned, loaded), bar=printing.progress_bar)
    if bake is None:
        return
    summary = bake.summary()
    layer = summary["layers"][0]
    printing.say(
        f"{target}: {layer['coefficients']:,} clusters, {printing.size(summary['bytes'])}"
        + (f", {printing.duration(layer['seconds'])}" if layer["seconds"] is not None else "")
        + (f"\nthe mesh is {note}" if (note := printing.mesh_note(layer["statistics"])) else "")
        + f"\nnow: prelight relight {target} SKY.hdr -o picture.png   (or stock:sunset for a sky of ours)"
    )

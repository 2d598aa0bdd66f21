"""``prelight bake portals``: a room lit through its windows."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ..errors import InputError
from . import arguments, printing
from .bake_running import AS_IT_IS, AT_ONCE, Reading, Running
from .gloss_said import said_of_gloss

if TYPE_CHECKING:
    from ..baking.portals_plan import PortalsPlan
    from ..baking.portals_settings import PortalsSettings
    from ..scene.geometry import Scene
    from ..storage.bake import Bake

_SUN_CUBE = 64  # of skies whose suns receivers are refined for
_NUMBER = Parameter(converter=arguments.whole_number)


def portals(
    scene: str,
    /,
    *,
    output: Annotated[Path | None, Parameter(["--output", "-o"])] = None,
    portal: Annotated[list[str] | None, Parameter(negative="")] = None,
    portals: str | None = None,
    group: str = "material",
    exterior_distance: float | None = None,
    theta: float = 5.0,
    returned: float = 0.02,
    cube: Annotated[int, _NUMBER] = 32,
    rays: Annotated[int | None, _NUMBER] = None,
    order: Annotated[int | None, _NUMBER] = None,
    accuracy: float | None = None,
    accuracy_for: str | None = None,
    bounces: Annotated[int | None, _NUMBER] = None,
    gather_rays: Annotated[int | None, _NUMBER] = None,
    suns: bool = True,
    photons: Annotated[int | None, _NUMBER] = None,
    glossy_order: Annotated[int, _NUMBER] = 0,
    preset: str | None = None,
    subdivide: float | None = None,
    refine: float | None = None,
    refine_for: Annotated[list[str] | None, Parameter(negative="")] = None,
    seed: Annotated[int, _NUMBER] = 0,
    reading: Reading = AS_IT_IS,
    running: Running = AT_ONCE,
) -> None:
    """Bake a room for the light that comes through its windows, whatever is outside and whatever the glass becomes.

    Portals are found from the scene's glass: materials that transmit light, dielectrics, and names such as glass. What
    is outside (a map, a sky with its sun, a town that moves) and what the glass is (clear, tinted, frosted, behind a
    blind, shut) are free afterwards, in a rig (docs/portals.md):

    `prelight bake portals chapel.glb -o chapel.prelight`, then `prelight relight chapel.prelight RIG.toml -o a.png`.

    Shows what it will cost before it begins, and how near things may come outside. Ctrl-C keeps what is done; the same
    command with --resume goes on.

    Parameters
    ----------
    scene
        A mesh or scene file, or stock:NAME, one of the built-in scenes (stock:portals).
    output
        The bake, a new folder; SCENE.prelight in the current folder if not given.
    portal
        A material whose triangles are portals, by its name; again for more. Glass is looked for if not given.
    portals
        A TOML file of [[portal]]s instead: polygons, or materials by name, with tints (docs/portals.md).
    group
        material: one portal for the glass of each material; window: one for each window and material; one: a single
        portal with the colours of its glass baked in, for a world far away and glass that stays as it is.
    exterior_distance
        How near things come to the portals outside, metres. Portals too large for that are cut. Without it everything
        outside is far away, and one shell serves all.
    theta
        By how many degrees a portal's rim may see things elsewhere than its middle does: the paper's θ_M.
    returned
        The share of the light at things outside that may come back from the room: the paper's R_Θ, for the advice.
    cube
        Cells along a face of the cube map that direct light is kept on: 4, 8, 16, 32 or 64.
    rays
        From each receiver, shared among the portals before it; default 4096. Four times as many halve the noise.
    order
        Of the spherical harmonics that bounced light is kept in, 0 to 12; default 4. Higher for small portals.
    accuracy
        Choose the order: the least that holds this share of the energy of bounced light, such as 0.9, up to --order
        (12 if not given).
    accuracy_for
        A rig, a map or stock:NAME for whose light that is; without it for light that has as much of every order.
    bounces
        How often light may bounce, at most 1000; 0 for direct light only. If not given as often as matters.
    gather_rays
        Rays from each receiver that find the surfaces which light bounces from, a square number; default 1024.
    suns
        Keep the one-bounce operator, some 500 bytes a vertex, from which the bounces of a sun follow; --no-suns leaves
        it out, and a sun bounces as blurred as the harmonics are.
    photons
        How many, of all portals, for what glass objects and mirrors in the room send on: caustics; default 4194304
        where a material needs them. Four times as many halve the noise; 0 leaves caustics out.
    glossy_order
        Show what glossy materials reflect, for any camera, in spherical harmonics of this order, 1 to 16; 8 is good for
        most. 0 shows every surface as diffuse.
    preset
        paper: the parameters of the paper this follows (4096 rays, 4096 gather rays, 9 bounces, order 4); what is given
        besides goes before it.
    subdivide
        Halve edges longer than this, in metres, for a finer net of vertices.
    refine
        Add vertices where direct light through the portals breaks, along the edges of shadows: up to this many times
        as many as there are, such as 2.
    refine_for
        A rig, a map or stock:NAME whose sun's patch shall have a sharp edge; again for more hours. With --refine.
    seed
        Of all randomness.
    """
    target = running.target(scene, output)
    if preset not in (None, "paper"):
        raise InputError("--preset", f"{preset!r}, expected paper")
    if accuracy is not None and order is None:
        order = 12
    budget = running.budget
    with printing.waiting("reading the scene and estimating the cost (the first time, compiling too)"):
        from ..baking.portals import bake_planned
        from ..baking.portals_plan import plan_portals
        from ..baking.portals_settings import PAPER, PortalsSettings
        from ..scene.portals import PortalWish

        wish = PortalWish(
            tuple(portal or ()),
            portals,
            group,
            math.inf if exterior_distance is None else exterior_distance,
            theta,
        )
        given = {"rays": rays, "order": order, "bounces": bounces, "gather_rays": gather_rays}
        asked: dict[str, Any] = {} if preset is None else {name: PAPER[name] for name in given}
        asked |= {name: value for name, value in given.items() if value is not None}
        settings = PortalsSettings(
            wish,
            cube=cube,
            accuracy=accuracy,
            spectrum=_spectrum(accuracy_for, accuracy),
            suns=suns,
            photons=photons,
            glossy_order=glossy_order,
            returned=returned,
            seed=seed,
            memory=budget,
            **asked,
        )
        loaded = reading.load(scene, subdivide=subdivide)
        loaded = _refined(loaded, settings, factor=refine, skies=refine_for)
        plan = plan_portals(loaded, settings)
    if not running.json:
        _say_plan(plan)
    bake = running.bake(target, plan, bake_planned)
    if bake is not None:
        _say_done(bake, target)


def _spectrum(source: str | None, accuracy: float | None) -> tuple[float, ...] | None:
    """Of a sky without its suns, which bounce from where they fall."""
    if source is None:
        return None
    if accuracy is None:
        raise InputError("--accuracy-for", "given without --accuracy, such as --accuracy 0.9")
    from ..baking.portals_settings import MOST_ORDER
    from ..bases.harmonic_cells import spectrum_of
    from ..lighting.rig import Rig
    from ..relighting.portals import strong_cells

    cube = Rig.open(source).environment.cube(32)
    suns = strong_cells(cube)
    return spectrum_of(cube if suns is None else cube - suns, MOST_ORDER)


def _refined(
    scene: Scene, settings: PortalsSettings, *, factor: float | None, skies: list[str] | None
) -> Scene:
    if factor is None:
        if skies:
            raise InputError("--refine-for", "given without --refine, such as --refine 2")
        return scene
    from ..baking.portals_refining import refined
    from ..lighting.rig import Rig

    cubes = [Rig.open(source).environment.cube(_SUN_CUBE) for source in skies or ()]
    return refined(scene, settings, factor=factor, skies=cubes)


def _say_plan(plan: PortalsPlan) -> None:
    scene = plan.room.scene
    for note in (*scene.notes, *plan.room.notes):
        printing.say(f"note: {note}")
    names, areas = plan.room.portals.names, plan.room.portals.areas
    shown = ", ".join(f"{name} ({area:.2g} m²)" for name, area in list(zip(names, areas, strict=True))[:6])
    printing.say(
        f"{scene.name}: {plan.receivers:,} receivers, {plan.triangles:,} triangles, "
        f"{len(names):,} {'portal' if len(names) == 1 else 'portals'}: {shown}{', …' if len(names) > 6 else ''}\n"
        f"about {printing.count(plan.rays)} rays for direct light, {printing.duration(plan.seconds)}, "
        f"{printing.size(plan.bytes)} on disk, at most {printing.size(plan.memory)} of memory"
    )
    if plan.photons:
        printing.say(
            f"of it {printing.count(plan.photons)} photons for what glass objects and mirrors in the room send on "
            "(--photons 0 leaves caustics out)"
        )
    printing.say("\n".join(plan.advice.lines(plan.settings)))
    if order := plan.settings.glossy_order:
        from ..baking.exitant import plan_exitant

        printing.say(said_of_gloss(plan_exitant(scene, order)))


def _say_done(bake: Bake, target: Path) -> None:
    summary = bake.summary()
    layer = summary["layers"][0]
    found = layer["statistics"]
    haar = found["haar_rows"] / max(found["rows"], 1)
    printing.say(
        f"direct light: {found['rows']:,} rows, {haar:.0%} as Haar coefficients, {printing.size(found['row_bytes'])} "
        f"(all as pulses {printing.size(found['pulse_bytes'])}, all as Haar {printing.size(found['haar_bytes'])})"
    )
    if "bounced_modes" in found:
        printing.say(
            f"bounced light: harmonics of order {layer['parameters']['order']} in {found['bounced_modes']} modes, "
            f"{printing.size(layer['bounced_bytes'])}, at least {found['bounced_held']:.0%} of a portal's energy"
        )
    taken = f", {printing.duration(bake.seconds)}" if bake.seconds is not None else ""
    printing.say(
        f"{target}: {printing.size(summary['bytes'])}{taken}\n"
        f"now: prelight relight {target} stock:noon -o picture.png   (or a rig with [[portal]]s)"
    )

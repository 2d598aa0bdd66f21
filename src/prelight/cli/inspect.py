"""``prelight inspect``: what is in a bake, what it cost, what it loses; and pictures of its clusters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..errors import InputError
from . import arguments, printing
from .bake_cloud import rows_of_cloud
from .gloss_said import rows_of_gloss
from .inspect_portals import rows_of_portals
from .inspect_steerable import rows_of_steerable
from .inspect_transfer import rows_of_transfer


def inspect(
    bake: Path,
    /,
    *,
    clusters: Path | None = None,
    zone: Annotated[int | None, Parameter(converter=arguments.whole_number)] = None,
    over: str | None = None,
    light: str | None = None,
    output: Annotated[Path | None, Parameter(["--output", "-o"])] = None,
    camera: str | None = None,
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Say what is in a bake, what it cost and what it loses.

    Two pictures show its clusters of lights: where they are, and what one light loses in its cluster.

    `prelight inspect bunny.prelight --clusters clusters.png --over stock:sunset --light 30,45 -o light.png`

    Parameters
    ----------
    bake
        NAME.prelight.
    clusters
        Draw the clusters of lights on the unfolded cube into this .png: small where shadows are sharp. Of a cloud
        of lights: the lights in the scene, and the groups of them that a zone has.
    zone
        Whose clusters, where the bake has several zones; counted from 0, which is the one if not given.
    over
        An environment, rig or stock:NAME to draw the clusters over.
    light
        A direction, azimuth,elevation in degrees (0,90 is straight above; azimuth from −Z towards +X): draw the
        scene under that one environment light beside what its cluster keeps of it, into --output.
    output
        The .png of --light: the light alone, as its cluster keeps it, and the difference, emphasised.
    camera
        For --light: the name of a camera in the bake, or a JSON file.
    force
        Replace the pictures.
    json
        Print one JSON object on standard output.
    """
    from ..files import refuse_existing
    from ..storage.bake import Bake

    if (light is None) != (output is None):
        raise InputError("--light", "give it and --output together: --light 30,45 -o light.png")
    if clusters is None and (zone is not None or over is not None):
        raise InputError(
            "--zone" if over is None else "--over", "is for the picture of --clusters; give its name"
        )
    if clusters is not None and clusters == output:
        raise InputError(clusters, "cannot be two pictures; give --clusters and --output a name each")
    if light is None and camera is not None:
        raise InputError("--camera", "is for the picture of --light; give its direction")
    for picture in (clusters, output):
        if picture is not None:
            if picture.suffix.lower() != ".png":
                raise InputError(picture, "expected a name ending in .png")
            refuse_existing(picture, force=force)
    summary = Bake.open(bake).summary()
    summary["pictures"] = [str(picture) for picture in (clusters, output) if picture is not None]
    if clusters is not None:
        _draw_clusters(bake, clusters, zone=zone or 0, over=over, force=force)
    if light is not None and output is not None:
        _draw_light(bake, output, towards=light, camera=camera, force=force)
    if json:
        printing.say_json(summary)
    else:
        printing.table(_rows(summary))


def _draw_clusters(bake: Path, path: Path, *, zone: int, over: str | None, force: bool) -> None:
    with printing.waiting("drawing the clusters"):
        if over is None and _is_cloud(bake):
            from ..relighting.cloud_figure import cloud_figure

            cloud_figure(bake, path, zone=zone, force=force)
            return
        from ..drawing.figures import save_figure
        from ..drawing.unfolded import unfolded_clusters
        from ..lighting.rig import Rig
        from ..relighting.relighter import Relighter

        light = Relighter(bake)
        if not 0 <= zone < light.zones:
            raise InputError("--zone", f"{zone}, expected 0 to {light.zones - 1}")
        cube = None if over is None else Rig.open(over).surroundings.cube(light.resolution)
        save_figure(unfolded_clusters(light.clusters(zone), light.resolution, cube=cube), path, force=force)


def _is_cloud(bake: Path) -> bool:
    """Whether a cloud is what clusters of lights are to be drawn of."""
    from ..storage.bake import Bake

    kinds = {layer.kind for layer in Bake.open(bake).layers.values()}
    return "cloud" in kinds and "environment" not in kinds


def _draw_light(bake: Path, path: Path, *, towards: str, camera: str | None, force: bool) -> None:
    parts = towards.split(",")
    try:
        azimuth, elevation = (float(part) for part in parts)
    except ValueError:
        raise InputError("--light", f"{towards!r}, expected AZIMUTH,ELEVATION such as 30,45") from None
    with printing.waiting("drawing the light and its cluster"):
        from ..drawing.figures import save_figure
        from ..relighting.light_figure import light_figure
        from ..relighting.relighter import Relighter

        light = Relighter(bake)
        figure = light_figure(light, azimuth, elevation, camera=arguments.camera_of(light, camera))
        save_figure(figure, path, force=force)


_ROWS = {
    "cloud": rows_of_cloud,
    "transfer": rows_of_transfer,
    "steerable": rows_of_steerable,
    "portals": rows_of_portals,
}


def _rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    rows = [
        ("bake", f"{summary['path']}, {printing.size(summary['bytes'])}"),
        (
            "scene",
            f"{summary['scene']}: {summary['receivers']:,} vertices, {summary['triangles']:,} triangles",
        ),
        ("cameras", ", ".join(summary["cameras"]) or "none; pictures frame the whole scene"),
        *(("note", note) for note in summary["notes"]),
    ]
    for layer in summary["layers"]:
        rows += _ROWS.get(layer["kind"], _rows_of_layer)(layer)
    rows += [("picture", picture) for picture in summary["pictures"]]
    software = ", ".join(f"{name} {version}" for name, version in summary["software"].items())
    return [*rows, ("made with", software)]


def _rows_of_layer(layer: dict[str, Any]) -> list[tuple[str, str]]:
    settings, seconds = layer["parameters"], layer["seconds"]
    lights = f"{layer['basis_lights']:,} (6×{settings['resolution']}²) in {layer['coefficients']:,} clusters"
    threshold = f"{settings['tolerance']:.4g} (epsilon {settings['epsilon']:.4g}), "
    samples = f"{settings['samples_per_side']}² samples a cluster"
    nonzero = f"{layer['statistics']['nonzero_share']:.0%} of the elements are not zero"
    took = f", {printing.duration(seconds)}" if seconds is not None else ""
    what = "diffuse vertices, seen from anywhere"
    bounces = settings.get("bounces", 0)
    bounced = "" if bounces else "bounced light, "
    gloss = "light through glass; " if settings.get("glossy_order") else "gloss; "
    loses = f"{bounced}{gloss}within the tolerance, the edges of shadows"
    if layer["camera"] is not None:
        what = f"vertices, gloss as seen from camera {layer['camera']!r}"
        loses = f"{bounced}mirrors and clear glass; within the tolerance, the edges of shadows and highlights"
        if settings["receivers"] == "pixels":
            size = f"{settings['width']}×{settings['height']} pixels of camera {layer['camera']!r}"
            points = settings["samples"]
            what = f"{size}, {points} {'sample' if points == 1 else 'samples'} each"
    zones = f", {settings['zones']} zones" if settings["zones"] > 1 else ""
    return [
        ("layer", f"{layer['name']} ({layer['kind']})"),
        ("  receivers", what + zones),
        ("  lights", lights),
        ("  tolerance", threshold + samples),
        *_rows_of_sun(settings),
        *(_rows_of_bounces(layer) if bounces else [("  bounces", "none: direct light only")]),
        *_rows_of_caustics(layer),
        *rows_of_gloss(layer),
        ("  size", f"{printing.size(layer['bytes'])}, {nonzero}"),
        ("  cost", f"{printing.count(layer['rays'])} rays{took}"),
        ("  loses", loses),
    ]


def _rows_of_sun(settings: dict[str, Any]) -> list[tuple[str, str]]:
    if (paths := settings.get("sun_paths")) is None:
        return []
    where = "anywhere above the horizon" if paths == "any" else f"where it stands at latitude {paths:g}°"
    return [("  sun", f"{where} a quarter of that")]


def _rows_of_caustics(layer: dict[str, Any]) -> list[tuple[str, str]]:
    settings, found = layer["parameters"], layer["statistics"]
    if not settings.get("photons"):
        return []
    traced, noise = printing.count(found["photons_traced"]), found["caustic_noise"]
    said = f"of glass and mirrors, {traced} photons; {noise:.1%} noise under an even sky"
    return [("  caustics", said)]


def _rows_of_bounces(layer: dict[str, Any]) -> list[tuple[str, str]]:
    settings, found = layer["parameters"], layer["statistics"]
    often = "as often as matters" if settings["bounces"] == "all" else f"up to {settings['bounces']} times"
    kept = (
        f"{found['bounced_modes']:,} modes of {found['bounced_cells']:,} cells of light, "
        f"{printing.size(layer['bounced_bytes'])}; of single cells they leave out {found['bounced_left_out']:.1%}"
    )
    cost = (
        f"{printing.count(found['bounced_rays'])} rays, {settings['gather_rays']:,} from each receiver; "
        f"{found['bounced_remaining']:.2g} of it is left after solving ({found['bounced_products']} products)"
    )
    return [("  bounces", often), ("", kept), *_rows_of_first(found), ("", cost), *_rows_of_mesh(found)]


def _rows_of_mesh(found: dict[str, Any]) -> list[tuple[str, str]]:
    return [("  mesh", said)] if (said := printing.mesh_note(found)) else []


def _rows_of_first(found: dict[str, Any]) -> list[tuple[str, str]]:
    """What is kept for lights that are traced: their first bounces by themselves."""
    if "bounced_first_entries" not in found:
        return []
    entries, error = found["bounced_first_entries"], found["bounced_first_error"]
    return [("", f"a traced sun's first bounces by {printing.count(entries)} entries, {error:.1%} off (RMS)")]

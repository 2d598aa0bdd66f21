"""``prelight rig``: rig files made for you."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import cyclopts
from cyclopts import Parameter

from ..errors import InputError
from . import arguments, printing

_MOST_SAMPLES = 1 << 20

app = cyclopts.App(help="Make rig files: what a designer sets, in TOML (docs/rig.md).")


@app.command
def lamps(
    scene: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(["--output", "-o"])] = None,
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Write the lights of a glTF file (KHR_lights_punctual) as a rig.

    Point lights become [[lamp]]s, spots [[spot]]s with an .ies file of their cone beside the rig, directional lights
    [[disc]]s of the sun's size. Candela and lux become W/sr and W/m² at 683 lumens a watt.

    Parameters
    ----------
    scene
        SCENE.glb or SCENE.gltf.
    output
        The rig; SCENE.toml beside you if not given.
    force
        Replace the output, and .ies files of that name.
    json
        Print one JSON object on standard output.
    """
    from ..files import publish, refuse_existing
    from ..lighting.imported_lights import RigText
    from ..lighting.rig import Rig
    from ..scene.gltf.lights import file_lights

    target = output or Path(f"{scene.stem}.toml")
    if target.suffix.lower() != ".toml":
        raise InputError(target, "expected a name ending in .toml")
    refuse_existing(target, force=force)
    found = file_lights(scene)
    if not found:
        raise InputError(scene, "has no lights (KHR_lights_punctual) in its default scene")
    rig = RigText(target.stem)
    for light in found:
        red, green, blue = (light.intensity * part for part in light.colour)
        strength = red, green, blue
        if light.kind == "point":
            rig.lamp(light.name, light.position, strength)
        elif light.kind == "spot":
            rig.spot(light.name, light.position, light.forward, strength, light.cone)
        else:
            rig.sun(light.name, light.forward, strength)
    for name in rig.files:
        refuse_existing(target.with_name(name), force=force)
    for name, data in rig.files.items():
        publish(target.with_name(name), data)
    publish(target, rig.text.encode())
    Rig.open(str(target))
    cut = sum(light.has_range for light in found)
    counts = {kind: sum(light.kind == kind for light in found) for kind in ("point", "spot", "directional")}
    if json:
        printing.say_json(
            {"output": str(target), "files": sorted(rig.files), "ranges_left_out": cut, **counts}
        )
        return
    if cut:
        printing.say(f"note: {cut:,} lights have a range, beyond which they would be dark; light knows none")
    words = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    printing.say(f"{target}: {words}")


@app.command
def new(
    bake: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(["--output", "-o"])] = None,
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Write a rig to begin with for a bake: what its layers can be lit by, each key with a comment.

    Parameters
    ----------
    bake
        NAME.prelight.
    output
        The rig; NAME.toml beside you if not given.
    force
        Replace the output.
    json
        Print one JSON object on standard output.
    """
    from ..files import publish, refuse_existing
    from ..lighting.rig import Rig
    from ..relighting.new_rig import new_rig
    from ..storage.bake import Bake

    opened = Bake.open(bake)
    target = output or Path(f"{opened.path.name.removesuffix('.prelight')}.toml")
    if target.suffix.lower() != ".toml":
        raise InputError(target, "expected a name ending in .toml")
    refuse_existing(target, force=force)
    publish(target, new_rig(opened).encode())
    Rig.open(str(target))
    if json:
        printing.say_json({"output": str(target), "bake": str(bake)})
        return
    told = f"prelight relight {shlex.quote(str(bake))} {shlex.quote(str(target))} -o picture.png"
    printing.say(f"{target}: change it, then {told}")


@app.command
def export(
    scene: str,
    rig: str,
    /,
    *,
    output: Annotated[Path, Parameter(["--output", "-o"])],
    camera: str | None = None,
    size: str = "1280x720",
    samples: Annotated[int, Parameter(converter=arguments.whole_number)] = 256,
    floor: float | None = None,
    subdivide: float | None = None,
    albedo: str | None = None,
    trust: Annotated[bool, Parameter(negative="")] = False,
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Write a scene under a rig as a file of Mitsuba's, for a final render with every material as it is.

    `prelight rig export room.prelight evening.toml -o evening.xml`, then `mitsuba evening.xml`. Meshes, textures and
    the sky go to a folder of that name beside it. Lights are those at the rig's beginning.

    Parameters
    ----------
    scene
        NAME.prelight, or a mesh or scene file, or stock:NAME.
    rig
        A rig, an environment map, or stock:NAME, one of the built-in skies.
    output
        NAME.xml.
    camera
        One of the scene's by name, or a JSON file; its first if not given, or one that frames it.
    size
        Width and height of the picture.
    samples
        Paths a pixel, up to 1,048,576.
    floor, subdivide, albedo, trust
        As of `prelight bake environment`, where a scene is given.
    force
        Replace the output and its files.
    json
        Print one JSON object on standard output.
    """
    from ..files import publish, refuse_existing

    if output.suffix.lower() != ".xml":
        raise InputError(output, "expected a name ending in .xml")
    if not 1 <= samples <= _MOST_SAMPLES:
        raise InputError("--samples", f"{samples}, expected 1 to {_MOST_SAMPLES:,}")
    folder = output.with_name(f"{output.stem}-files")
    refuse_existing(output, force=force)
    refuse_existing(folder, force=force)
    wide, high = arguments.picture_size(size)
    colour = None if albedo is None else arguments.colour("--albedo", albedo)
    with printing.waiting("reading the scene"):
        from ..camera import Camera
        from ..checking.final_scene import final_scene
        from ..lighting.rig import Rig

        loaded = _scene(scene, floor=floor, subdivide=subdivide, albedo=colour, trust=trust)
        eye = arguments.eye(camera)
        if isinstance(eye, str) and eye not in loaded.cameras:
            known = ", ".join(loaded.cameras) or "none"
            raise InputError("--camera", f"{eye!r} is not one of the scene's: {known}")
        if isinstance(eye, str):
            eye = loaded.cameras[eye]
        eye = eye or next(iter(loaded.cameras.values()), None) or Camera.framing(loaded.positions)
        made = final_scene(loaded, Rig.open(rig), eye, size=(wide, high), samples=samples, folder=folder.name)
    _make_folder(folder)
    for name, data in made.files.items():
        publish(folder / name, data, durable=False)
    publish(output, made.xml)
    if json:
        printing.say_json({"output": str(output), "files": sorted(made.files), "notes": made.notes})
        return
    for note in made.notes:
        printing.say(f"note: {note}")
    printing.say(f"{output}: {len(made.files)} files in {folder}; now: mitsuba {shlex.quote(str(output))}")


def _scene(source: str, *, floor, subdivide, albedo, trust: bool):
    """The scene of a bake, or of a file. Raises InputError."""
    if source.endswith(".prelight") or Path(source).is_dir():
        from ..scene.baked import scene_of
        from ..storage.bake import Bake

        return scene_of(Bake.open(Path(source)))
    from ..scene.loading import load_scene

    return load_scene(source, floor=floor, subdivide=subdivide, albedo=albedo, trust=trust)


def _make_folder(folder: Path) -> None:
    from ..errors import OutputError
    from ..files import explain

    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(folder, f"cannot make the folder: {explain(error)}") from None


@app.command
def schema(
    *,
    output: Annotated[Path | None, Parameter(["--output", "-o"])] = None,
    force: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Print the JSON schema of a rig, which editors complete and check TOML files by.

    It is generated from the tables that read a rig (docs/rig.schema.json is the same); a first line
    `#:schema PATH/rig.schema.json` in a rig tells an editor where it is.

    Parameters
    ----------
    output
        Write it there instead, such as rig.schema.json.
    force
        Replace the output.
    """
    import json

    from ..files import publish, refuse_existing
    from ..lighting.rig_schema import rig_schema

    text = json.dumps(rig_schema(), indent=1)
    if output is None:
        printing.say(text)
        return
    refuse_existing(output, force=force)
    publish(output, f"{text}\n".encode())
    printing.say(f"{output}: the schema of a rig")

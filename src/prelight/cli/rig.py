"""``prelight rig``: rig files made for you."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import cyclopts
from cyclopts import Parameter

from ..errors import InputError
from . import printing

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

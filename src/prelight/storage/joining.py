"""Layers put into a bake of the same scene, and taken out again: chunks are linked, the manifest is written anew."""

from __future__ import annotations

import shutil
from pathlib import Path

from ..errors import InputError
from .bake import Bake
from .chunks import ArraySpec
from .journal import BakeWriter
from .manifest import FORMAT, VERSION, LayerRecord, Manifest, SceneRecord

_MOST_LETTERS = 40


def add_layers(
    bake: Bake | str | Path, other: Bake | str | Path, *, name: str | None = None, force: bool = False
) -> Bake:
    """Put the layers of ``other`` into ``bake``; what was in either stays as it is, byte for byte.

    Every chunk is checked against its hash on the way. ``bake`` is replaced in one step, ``other`` is left alone.

    Parameters
    ----------
    name
        What the layer is called there; for an ``other`` of one layer.
    force
        Replace layers of the same name.

    Raises
    ------
    InputError
        The two are of different scenes or vertices, or both have a layer of that name.
    DamagedBakeError, OutputError
        One of them is not whole, or the disk refuses; both are left as they were.
    """
    into, more = _opened(bake), _opened(other)
    here, there = into.manifest, more.manifest
    refuse_other_scene(into, there.scene.digest, str(more.path))
    names = _names(more, name)
    if (double := sorted(set(names.values()) & here.layers.keys())) and not force:
        what = (
            f"has a layer {double[0]!r} already; --force replaces it, --name gives the new one another name"
        )
        raise InputError(into.path, what)
    cameras = {camera.name: camera for camera in [*there.scene.cameras, *here.scene.cameras]}
    scene = here.scene.model_copy(
        update={"cameras": list(cameras.values()), "notes": _together(here.scene.notes, there.scene.notes)}
    )
    kept = {layer: layer for layer in here.layers if layer not in names.values()}
    return _rewritten(into, scene, [(into, kept), (more, names)], force=force)


def remove_layer(bake: Bake | str | Path, name: str) -> Bake:
    """Take one layer out of a bake. Raises InputError if it has no such layer, or no other one."""
    there = _opened(bake)
    layers = there.manifest.layers
    if name not in layers:
        raise InputError(there.path, f"has no layer {name!r}; it has {', '.join(layers)}")
    if len(layers) == 1:
        raise InputError(there.path, f"{name!r} is its only layer; remove the whole bake instead")
    kept = {layer: layer for layer in layers if layer != name}
    return _rewritten(there, there.manifest.scene, [(there, kept)], force=False)


def refuse_other_scene(bake: Bake, digest: str, what: str) -> None:
    """Raises InputError unless ``digest`` is that of the bake's scene."""
    if bake.manifest.scene.digest != digest:
        reason = f"its scene ({bake.manifest.scene.name}) is not that of {what}, or has other vertices"
        raise InputError(
            bake.path, reason + "; bake both with the same file, --floor, --subdivide and --albedo"
        )


def _opened(bake: Bake | str | Path) -> Bake:
    return bake if isinstance(bake, Bake) else Bake.open(bake)


def _names(bake: Bake, name: str | None) -> dict[str, str]:
    """What each layer is called now, and will be."""
    layers = list(bake.manifest.layers)
    if name is None:
        return {layer: layer for layer in layers}
    if len(layers) != 1:
        raise InputError("--name", f"{name!r}, but {bake.path} has {len(layers)} layers; leave it out")
    if not name.replace("_", "a").isalnum() or not name.isascii() or len(name) > _MOST_LETTERS:
        raise InputError("--name", f"{name!r:.60}, expected letters, digits and _, at most {_MOST_LETTERS}")
    return {layers[0]: name}


def _together(first: list[str], second: list[str]) -> list[str]:
    return list(dict.fromkeys([*first, *second]))


def _rewritten(
    target: Bake, scene: SceneRecord, parts: list[tuple[Bake, dict[str, str]]], *, force: bool
) -> Bake:
    """The first bake's scene with these layers of these bakes, in the place of ``target``."""
    layers: dict[str, LayerRecord] = {}
    arrays: dict[str, ArraySpec] = {}
    moved: dict[str, tuple[Bake, str]] = {}
    for bake, names in parts:
        roots = {f"layers/{old}/": f"layers/{new}/" for old, new in names.items()}
        if bake is target:
            roots["scene/"] = "scene/"
        layers |= {new: bake.manifest.layers[old] for old, new in names.items()}
        for old, new in roots.items():
            arrays |= {
                new + a.removeprefix(old): s for a, s in bake.manifest.arrays.items() if a.startswith(old)
            }
            moved |= {new + k.removeprefix(old): (bake, k) for k in bake.manifest.chunks if k.startswith(old)}
    settings: dict[str, int | float | str | None] = {"kind": "joined", "layers": ", ".join(layers)}
    manifest = Manifest(
        format=FORMAT, version=VERSION, settings=settings, scene=scene, layers=layers, arrays=arrays,
        chunks={key: bake.manifest.chunks[old] for key, (bake, old) in moved.items()},
        software=target.manifest.software,
    )  # fmt: skip
    seconds = [bake.seconds for bake, _ in parts]
    writer = BakeWriter(target.path, settings=settings, resume=False, force=force, replacing=True)
    try:
        for key, (bake, old) in moved.items():
            writer.adopt(key, manifest.chunks[key], root=bake.path, its_key=old)
        writer.publish(manifest)
    except BaseException:
        shutil.rmtree(writer.partial, ignore_errors=True)
        raise
    finally:
        writer.close()
    joined = Bake.open(target.path)
    joined.note_seconds(sum(took or 0.0 for took in seconds))
    return joined

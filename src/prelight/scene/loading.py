"""A scene from whatever the user has: a file, a trimesh object, a built-in name."""

from __future__ import annotations

import math
import struct
import sys
from collections.abc import Callable
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import read_regular
from ..material import GREY
from .floor import with_floor
from .geometry import Scene
from .mesh import MeshAsRead, UnreadableMesh, scene_from, short_name

LARGEST_FILE = 2_000_000_000
_NOT_YET = {
    ".obj": "OBJ",
    ".gltf": "glTF in separate files",
    ".xml": "Mitsuba's XML",
    ".stl": "STL",
    ".off": "OFF",
}
# What a reader may meet in damaged bytes; anything else is a fault of ours.
_DAMAGE = (
    ValueError, KeyError, IndexError, struct.error, UnicodeError, RecursionError, MemoryError, OverflowError,
    TypeError, AttributeError,
)  # fmt: skip


def load_scene(
    source: object, *, floor: float | None = None, albedo: tuple[float, float, float] | None = None
) -> Scene:
    """The scene in a PLY or GLB file, a trimesh object, ``stock:NAME``, or a `Scene` itself.

    Vertices keep the order and count of the file; vertices that no triangle uses stay, with a zero normal. A
    GLB gives the nodes of its default scene by index, of each its mesh's primitives, transforms applied. What
    was read otherwise than the file says is in `Scene.notes`.

    Parameters
    ----------
    source
        Units are metres, +Y is up.
    floor
        Put a 193×193 grid under the lowest point, this many times as wide as the largest extent; (0, 1000].
    albedo
        One colour for every vertex and the floor in place of the file's: linear Rec.709, each in [0, 1].
        Without it: the file's colours, or a grey of 0.8 where a PLY or a trimesh has none.

    Raises InputError.
    """
    colour = None if albedo is None else _checked_colour(albedo)
    scene = _scene(source)
    if colour is not None:
        scene = _of_one_colour(scene, colour)
    if floor is None:
        return scene
    return with_floor(scene, floor, albedo=colour or GREY)


def _of_one_colour(scene: Scene, colour: tuple[float, float, float]) -> Scene:
    plain = tuple(replace(m, colour=colour, colour_texture=None) for m in scene.materials)
    albedo = np.tile(np.array(colour, np.float32), (len(scene.positions), 1))
    return replace(scene, albedo=albedo, tint=None, materials=plain)


def _checked_colour(albedo: object) -> tuple[float, float, float]:
    try:
        red, green, blue = (float(value) for value in albedo)  # ty: ignore[not-iterable]
    except (TypeError, ValueError):
        raise InputError("albedo", f"is {short_name(albedo)}, expected three numbers of 0 to 1") from None
    if not all(math.isfinite(value) and 0 <= value <= 1 for value in (red, green, blue)):
        raise InputError("albedo", f"is {red:g}, {green:g}, {blue:g}, expected three numbers of 0 to 1")
    return red, green, blue


def _scene(source: object) -> Scene:
    if isinstance(source, Scene):
        return source
    if isinstance(source, str) and source.startswith("stock:"):
        from .stock.catalogue import stock_scene

        return stock_scene(source.removeprefix("stock:"))
    if isinstance(source, str | PathLike):
        return _from_file(Path(source))
    trimesh = sys.modules.get("trimesh")  # nobody can hold one of its objects without having imported it
    if trimesh is not None and isinstance(source, trimesh.Trimesh | trimesh.Scene):
        from .trimesh_objects import read_trimesh

        return _guarded(read_trimesh, source, path="trimesh object", kind="mesh", name="mesh")
    raise InputError(
        "scene",
        f"a {type(source).__name__} was given, expected a path, a Scene, a trimesh object or 'stock:NAME'",
    )


def _from_file(path: Path) -> Scene:
    suffix = path.suffix.lower()
    if suffix in _NOT_YET and path.exists():
        raise InputError(path, f"{_NOT_YET[suffix]} is not read yet: convert it to PLY or GLB")
    data = read_regular(path, limit=LARGEST_FILE)
    if data[:3] == b"ply" and data[3:4] in (b"\n", b"\r", b" "):
        from .ply.reading import read_ply

        return _guarded(read_ply, data, path=path, kind="PLY", name=path.stem)
    if data[:4] == b"glTF":
        from .gltf.reading import read_glb

        return _guarded(read_glb, data, path=path, kind="GLB", name=path.stem)
    starts = {".ply": "'ply'", ".glb": "'glTF'"}.get(suffix, "'ply' or 'glTF': give a PLY or GLB file")
    raise InputError(path, f"begins with {data[:8]!r}, expected {starts}")


def _guarded(
    reader: Callable[..., MeshAsRead], source: object, *, path: object, kind: str, name: str
) -> Scene:
    """The one place where whatever a reader stumbles over becomes InputError."""
    try:
        # Numbers from a file may overflow or be no numbers: `scene_from` looks at what comes out.
        with np.errstate(all="ignore"):
            return scene_from(reader(source), name=name)
    except UnreadableMesh as error:
        raise InputError(path, error.reason, error.where) from None
    except MemoryError:
        raise InputError(path, "needs more memory than there is; simplify the mesh") from None
    except _DAMAGE as error:
        raise InputError(path, f"damaged {kind} file: {str(error) or type(error).__name__}") from None

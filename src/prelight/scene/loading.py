"""A scene from whatever the user has: a file, a trimesh object, a built-in name."""

from __future__ import annotations

import math
import os
import struct
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from os import PathLike
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import Resolver, read_regular
from ..material import GREY
from .floor import with_floor
from .geometry import Scene
from .mesh import MeshAsRead, UnreadableMesh, scene_from, short_name

LARGEST_FILE = 2_000_000_000
_NOT_READ = {".stl": "STL", ".off": "OFF", ".dae": "COLLADA", ".fbx": "FBX", ".usd": "USD"}
# What a reader may meet in damaged bytes; anything else is a fault of ours.
_DAMAGE = (
    ValueError, KeyError, IndexError, struct.error, UnicodeError, RecursionError, MemoryError, OverflowError,
    TypeError, AttributeError,
)  # fmt: skip


def load_scene(
    source: object,
    *,
    floor: float | None = None,
    albedo: tuple[float, float, float] | None = None,
    subdivide: float | None = None,
    trust: bool = False,
) -> Scene:
    """The scene in a PLY, GLB, glTF or OBJ file, of a library's objects, ``stock:NAME``, or a `Scene` itself.

    Vertices keep the order and count of the file; vertices that no triangle uses stay, with a zero normal. A
    GLB gives the nodes of its default scene by index, of each its mesh's primitives, transforms applied; an
    OBJ the distinct corners of each material in order of first use. Files that a file names are read from its
    folder alone. What was read otherwise than the file says is in `Scene.notes`.

    Parameters
    ----------
    source
        Units are metres, +Y is up. Beside files: trimesh objects, Mitsuba's, and its scenes as XML or dict.
    floor
        Put a 193×193 grid under the lowest point, this many times as wide as the largest extent; (0, 1000].
    albedo
        One colour for every vertex and the floor in place of the file's: linear Rec.709, each in [0, 1].
        Without it: the file's colours, or a grey of 0.8 where a PLY, an OBJ or a trimesh has none.
    subdivide
        Split triangles until no edge is longer than this, in metres; the floor keeps its grid.
    trust
        Read Mitsuba's XML and dictionaries too: they name plug-ins and files anywhere, so nothing confines
        what they read and run.

    Raises InputError.
    """
    colour = None if albedo is None else _checked_colour(albedo)
    scene = _scene(source, trust=trust)
    if colour is not None:
        scene = _of_one_colour(scene, colour)
    if subdivide is not None:
        from .subdivision import subdivided

        scene = subdivided(scene, subdivide)
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


def _scene(source: object, *, trust: bool) -> Scene:
    if isinstance(source, Scene):
        return source
    if isinstance(source, str) and source.startswith("stock:"):
        from .stock.catalogue import stock_scene

        return stock_scene(source.removeprefix("stock:"))
    if isinstance(source, str | PathLike):
        return _from_file(Path(source), trust=trust)
    if isinstance(source, dict):
        return _from_mitsuba(source, path="Mitsuba dictionary", name="scene", trust=trust)
    trimesh = sys.modules.get("trimesh")  # nobody can hold one of its objects without having imported it
    if trimesh is not None and isinstance(source, trimesh.Trimesh | trimesh.Scene):
        from .trimesh_objects import read_trimesh

        return _guarded(lambda: scene_from(read_trimesh(source), name="mesh"), "trimesh object", kind="mesh")
    if type(source).__module__.partition(".")[0] == "mitsuba":
        return _from_mitsuba(source, path="Mitsuba object", name="scene", trust=True)
    raise InputError(
        "scene",
        f"a {type(source).__name__} was given, expected a path, a Scene, a trimesh or Mitsuba object or "
        "'stock:NAME'",
    )


def _from_file(path: Path, *, trust: bool) -> Scene:
    suffix = path.suffix.lower()
    there = os.path.exists(path)  # a name may be too long for any file: then reading it says so
    if suffix == ".xml" and there:
        return _from_mitsuba(path, path=path, name=path.stem, trust=trust)
    if suffix in _NOT_READ and there:
        raise InputError(path, f"{_NOT_READ[suffix]} is not read: convert it to PLY or GLB")
    data = read_regular(path, limit=LARGEST_FILE)
    kind, reader = _reader(path, data)
    return _guarded(lambda: scene_from(reader(data), name=path.stem), path, kind=kind)


def _reader(path: Path, data: bytes) -> tuple[str, Callable[[bytes], MeshAsRead]]:
    """What reads a file: its first bytes have the word, then its name."""
    suffix, beside = path.suffix.lower(), Resolver(path.parent)
    if data[:3] == b"ply" and data[3:4] in (b"\n", b"\r", b" "):
        from .ply.reading import read_ply

        return "PLY", read_ply
    if data[:4] == b"glTF":
        from .gltf.reading import read_glb

        return "GLB", partial(read_glb, files=beside)
    if suffix == ".gltf":
        from .gltf.reading import read_gltf

        return "glTF", partial(read_gltf, files=beside)
    if suffix == ".obj":
        from .obj.reading import read_obj

        return "OBJ", partial(read_obj, files=beside)
    expected = {".ply": "'ply'", ".glb": "'glTF'"}.get(suffix, "a PLY, GLB, glTF or OBJ file")
    raise InputError(path, f"begins with {data[:8]!r}, expected {expected}")


def _from_mitsuba(source: object, *, path: object, name: str, trust: bool) -> Scene:
    if not trust:
        reason = (
            "a Mitsuba scene names plug-ins and files anywhere: give --trust (trust=True) if you trust it"
        )
        raise InputError(path, reason)
    from .mitsuba_scene.reading import read_mitsuba

    return _guarded(lambda: scene_from(read_mitsuba(source), name=name), path, kind="Mitsuba")


def _guarded(read: Callable[[], Scene], path: object, *, kind: str) -> Scene:
    """The one place where whatever a reader stumbles over becomes InputError."""
    try:
        # Numbers from a file may overflow or be no numbers: `scene_from` looks at what comes out.
        with np.errstate(all="ignore"):
            return read()
    except UnreadableMesh as error:
        raise InputError(path, error.reason, error.where) from None
    except InputError as error:  # about a file that this one names
        within = error.reason if error.path == path else f"{short_name(error.path)}: {error.reason}"
        raise InputError(path, within, error.where) from None
    except MemoryError:
        raise InputError(path, "needs more memory than there is; simplify the mesh") from None
    except _DAMAGE as error:
        raise InputError(path, f"damaged {kind} file: {str(error) or type(error).__name__}") from None

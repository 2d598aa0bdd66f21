"""A van that passes at three metres, window by window and moment by moment, beside the path tracer."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from prelight.bases import cube_map
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.outside import Outside, OutsideObject
from prelight.lighting.outside import Path as Way
from prelight.lighting.regions import Window
from prelight.lighting.rig import Rig
from prelight.rays.mitsuba import triangle_mesh
from prelight.relighting.shells import Shells
from prelight.scene.loading import load_scene
from prelight.scene.variant import mitsuba

_R, _SAMPLES = 32, 400
_SKY, _SUN = 2.0, Disc.at(-60.0, 40.0, radius_deg=1.0, radiance=(3000.0, 2700.0, 2400.0))
_MOMENTS = np.linspace(0.4, 3.6, 9)
_WINDOWS = [(-1.0, 0.0, z) for z in (3.0, 0.0, -3.0)]
_COLOURS = {"street": (0.3, 0.3, 0.3), "van": (0.5, 0.08, 0.05)}
_DRIVES = Way((0.0, 4.0), ((-4.0, -0.4, 9.0), (-4.0, -0.4, -9.0)), curved=False)


def run(data: Path, work: Path) -> dict:
    """Mean |difference| over mean radiance of three windows' shells at nine moments; direct light in both."""
    files = {
        "street": _box(work / "street.obj", (-300.0, -1.6, -300.0), (300.0, -1.5, 300.0), _COLOURS["street"]),
        "van": _box(work / "van.obj", (-1.0, -1.0, -2.2), (1.0, 1.2, 2.2), _COLOURS["van"]),
    }
    below = Window((-180.0, 180.0), (-90.0, 0.0))  # which the street hides from the renderer
    sky = Environment.constant((_SKY,) * 3).painted(below, (0.0, 0.0, 0.0)).with_disc(_SUN)
    objects = (OutsideObject(files["street"], Way.resting()), OutsideObject(files["van"], _DRIVES))
    rig = Rig(sky, outside=Outside(objects, samples=4, bounce=False))
    room = np.array([(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.0, 0.1, 0.0)], np.float32)
    live = Shells(room, np.array([(0, 1, 2)], np.int32))
    rows = []
    for seconds in _MOMENTS.tolist():
        live.light(rig.at(seconds))
        for k, window in enumerate(_WINDOWS):
            shell = live.shell_of(window, _R, discs=False)
            reference = _path_traced(files, np.array(_DRIVES.at(seconds).position), np.array(window))
            rows.append({
                "seconds": seconds,
                "window": k,
                "mean_difference": float(np.abs(shell - reference).mean() / reference.mean()),
                "signed_mean": float(shell.mean() / reference.mean() - 1),
                "toward_street": float(shell[1].mean()),
                "toward_street_reference": float(reference[1].mean()),
            })  # fmt: skip
    differences = [row["mean_difference"] for row in rows]
    dark = {
        name: [
            min((row for row in rows if row["window"] == k), key=lambda row: row[name])["seconds"]
            for k in range(3)
        ]
        for name in ("toward_street", "toward_street_reference")
    }
    return {
        "mean_difference": float(np.mean(differences)),
        "mean_difference_worst": max(differences),
        "signed_mean_worst": max(abs(row["signed_mean"]) for row in rows),
        "darkest_at_seconds": dark,
        "rows": rows,
    }


def _box(path: Path, low, high, colour) -> str:
    corners = [[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)]
    sides = ("1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6")
    lines = [f"mtllib {path.stem}.mtl", "usemtl m", *("v {} {} {}".format(*c) for c in corners)]
    path.write_text("\n".join([*lines, *(f"f {side}" for side in sides)]) + "\n")
    path.with_suffix(".mtl").write_text("newmtl m\nKd {} {} {}\n".format(*colour))
    return str(path)


def _path_traced(files: dict[str, str], van: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """(6, R, R, 3) by the renderer: sky, sun and one meeting with a surface; the sun itself is not seen."""
    mi = mitsuba()
    irradiance = {"type": "rgb", "value": _SUN.total.tolist()}
    scene: dict = {
        "type": "scene",
        "sky": {"type": "constant", "radiance": _SKY},
        "sun": {"type": "directional", "direction": [-x for x in _SUN.direction], "irradiance": irradiance},
    }
    for name, shift in (("street", np.zeros(3)), ("van", van)):
        mesh = load_scene(files[name])
        matte = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(_COLOURS[name])}}
        bsdf = {"type": "twosided", "inner": matte}
        scene[name] = triangle_mesh(mesh.positions + np.float32(shift), mesh.triangles, bsdf=bsdf)
    n = 6 * _R * _R * _SAMPLES
    face, inside = np.divmod(np.repeat(np.arange(6 * _R * _R, dtype=np.int32), _SAMPLES), _R * _R)
    row, column = np.divmod(inside, _R)
    rng = np.random.default_rng(3)
    u, v = (2 * (k + rng.uniform(size=n)) / _R - 1 for k in (column, row))
    d = cube_map.directions(face, u, v).astype(np.float32)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, n)
    origins = np.broadcast_to(np.float32(centre)[:, None], (3, n))
    ray = mi.RayDifferential3f(mi.Point3f(*origins), mi.Vector3f(*d.T))
    light, _, _ = mi.load_dict({"type": "path", "max_depth": 2}).sample(mi.load_dict(scene), sampler, ray)
    return np.array(light).T.reshape(6 * _R * _R, _SAMPLES, 3).mean(axis=1).reshape(6, _R, _R, 3)

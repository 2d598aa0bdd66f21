"""What is measured beside the three-phase method, from what `three_phase` keeps."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import three_phase as tp
from radiance import points_text, read_matrix, sky_vector, write_matrix

from prelight.lighting.rig import Rig

_DIVISIONS = (256, 1024)  # -ad of the view matrix
_REPEATS = 5
_LINE = 160  # points across the sun's patch
_NOON = 15  # the hour of which it is looked at


def truth(data: Path, work: Path) -> dict[str, Any]:
    """What rtrace says of forty hours through clear glass, and of every third through frosted; kept for three-phase."""
    work.mkdir(parents=True, exist_ok=True)
    tp.truth(work, "clear", range(40))
    tp.truth(work, "frosted", range(0, 40, 3))
    return {"hours": 40, "points_an_hour": tp.CHECKED}


def beside(data: Path, work: Path) -> dict[str, Any]:
    """Errors against rtrace by glass, the sun's patch, seconds to bake, milliseconds for a change."""
    work.mkdir(parents=True, exist_ok=True)
    scene, light, seconds = tp.ours(work)
    radiance, _, all_ = tp.prepared(work)
    D, daylight_seconds = tp.daylight_matrix(radiance)
    views = {n: kept_view(work, radiance, tp.points(scene, all_), divisions=n) for n in _DIVISIONS}
    skies = np.stack([sky_vector(day.environment()) for day in tp.hours()])  # (40, 146, 3)
    T = tp.transmissions()
    out: dict[str, Any] = {
        "vertices": len(scene.positions), "sensors": tp.SENSORS, "our_bake_seconds": seconds,
        "our_milliseconds_a_vertex": 1e3 * seconds / len(scene.positions),
        "daylight_matrix_seconds": daylight_seconds,
        "view_milliseconds_a_sensor": {str(n): 1e3 * s / tp.SENSORS for n, (_, s) in views.items()},
        "errors": {}, "changes": _changes(work, radiance, light, views[1024][0], D, T, skies),
        "patch": _patch(work, scene, radiance, light, D, T["clear"], skies),
    }  # fmt: skip
    for name, glass in tp.GLASSES.items():
        known = "frosted" if name == "frosted" else "clear"
        hours = [k for k in range(len(skies)) if (work / f"truth_{known}_{k}.npy").exists()]
        truth = tp.truth(work, known, hours) * np.array(glass.tint)
        places = np.array([tp.checked(k) for k in hours])
        mine = tp.relit(work, light, all_, name)[hours]
        rows = {"ours": _at(mine, places)}
        for n, (V, _) in views.items():
            theirs = np.einsum("nkc,klc,ljc,hjc->hnc", V, T[name], D, skies[hours], optimize=True)
            rows[f"three-phase {n}"] = _at(theirs, places)
        out["errors"][name] = {"hours": len(hours)} | {
            who: _differences(found, truth) for who, found in rows.items()
        }
    return out


def kept_view(work: Path, radiance: Any, given: bytes, *, divisions: int) -> tuple[np.ndarray, float]:
    """The view matrix and its seconds, made the first time."""
    kept = work / f"view-{divisions}.npz"
    if not kept.exists():
        V, seconds = tp.view_matrix(radiance, given, divisions=divisions)
        np.savez(kept, V=V, seconds=seconds)
    with np.load(kept) as found:
        return found["V"], float(found["seconds"])


def _at(values: np.ndarray, places: np.ndarray) -> np.ndarray:
    return np.take_along_axis(values, places[:, :, None], axis=1)


def _differences(found: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    """Each hour by its own mean, so that dusk counts as noon does."""
    mean = truth.mean(axis=(1, 2), keepdims=True)
    relative = (found - truth) / mean
    each = np.abs(relative).mean(axis=(1, 2))
    return {
        "mean_difference": float(each.mean()), "worst_hour": float(each.max()), "signed": float(relative.mean()),
        "median_of_points": float(np.median(np.abs(found - truth).mean(axis=2) / np.maximum(truth.mean(axis=2), 1e-9))),
    }  # fmt: skip


def _changes(
    work: Path, radiance: Any, light: Any, V: np.ndarray, D: np.ndarray, T: dict, skies: np.ndarray
) -> dict:
    """Milliseconds for another hour, and for other glass under the same sky."""
    for name, matrix in (("V.mtx", V), ("D.mtx", D)):
        write_matrix(radiance.work / name, matrix)
    for name, matrix in T.items():
        write_matrix(radiance.work / f"{name}.mtx", matrix)
    days = [day.environment() for day in tp.hours()[:: 40 // _REPEATS]]
    hour, glass, program, product = [], [], [], []
    light.light(Rig(days[0], portals=(tp.GLASSES["clear"],)))
    for sky, vector in zip(days[1:], skies[:: 40 // _REPEATS][1:], strict=True):
        write_matrix(radiance.work / "sky.mtx", vector[:, None])
        hour.append(_timed(lambda sky=sky: light.light(Rig(sky, portals=(tp.GLASSES["clear"],)))))
        glass.append(_timed(lambda sky=sky: light.light(Rig(sky, portals=(tp.GLASSES["tinted"],)))))
        command = ("dctimestep", "-h", "V.mtx", "clear.mtx", "D.mtx", "sky.mtx")
        program.append(_timed(lambda command=command: radiance.run(*command)))
        product.append(
            _timed(lambda v=vector: np.einsum("nkc,klc,ljc,jc->nc", V, T["clear"], D, v, optimize=True))
        )
    told = read_matrix(
        radiance.run("dctimestep", "-h", "V.mtx", "clear.mtx", "D.mtx", "sky.mtx"), (len(V), 3)
    )
    own = np.einsum("nkc,klc,ljc,jc->nc", V, T["clear"], D, skies[:: 40 // _REPEATS][-1], optimize=True)
    return {
        "vertices": light.vertices, "sensors_of_dctimestep": len(V),
        "our_hour": _middle(hour), "our_glass": _middle(glass),
        "dctimestep": _middle(program), "their_product_in_numpy": _middle(product),
        "dctimestep_over_product": float(np.abs(told - own).max() / own.max()),
    }  # fmt: skip


def _timed(what: Any) -> float:
    started = time.perf_counter()
    what()
    return 1e3 * (time.perf_counter() - started)


def _middle(values: list[float]) -> float:
    return float(np.median(values))


def _patch(
    work: Path, scene: Any, radiance: Any, light: Any, D: np.ndarray, T: np.ndarray, skies: np.ndarray
) -> dict[str, Any]:
    """Along a line over the floor: where light falls from 90 to 10 % of its rise at the far edge of the sun's patch."""
    from scipy.interpolate import LinearNDInterpolator

    day = tp.hours()[_NOON]
    environment = day.environment()
    x = np.linspace(-2.0, 1.9, _LINE)
    line = np.stack([x, np.zeros(_LINE), np.full(_LINE, 0.4)], axis=1)
    up = np.tile((0.0, 1.0, 0.0), (_LINE, 1))
    given = points_text(line + 1e-3 * up, up)
    (work / "line").mkdir(exist_ok=True)
    radiance.write_sky(environment, "sky.rad")
    radiance.octree("lit.oct", "room.rad", "sky.rad")
    sun = read_matrix(
        radiance.run("rtrace", "-I", "-h", "-ab", "0", "-ds", "0.02", "lit.oct", given=given), (-1, 3)
    )
    V, _ = kept_view(work / "line", radiance, given, divisions=1024)
    theirs = np.einsum("nkc,klc,ljc,jc->nc", V, T, D, skies[_NOON], optimize=True)
    light.light(Rig(environment, portals=(tp.GLASSES["clear"],)))
    floor = (scene.positions[:, 1] == 0) & (scene.normals[:, 1] > 0.9)
    ours = LinearNDInterpolator(scene.positions[floor][:, [0, 2]], np.pi * light.direct[floor, 1])(
        line[:, [0, 2]]
    )
    whole = float(sun[:, 1].max()) * 0.88
    return {
        "x": x.tolist(), "sun_by_rtrace": (0.88 * sun[:, 1]).tolist(), "three_phase": theirs[:, 1].tolist(),
        "ours": ours.tolist(), "plateau": whole,
        "width_ours": _width(x, ours, whole), "width_three_phase": _width(x, theirs[:, 1], None),
        "width_rtrace": _width(x, 0.88 * sun[:, 1], whole),
        "peak_over_true": {"ours": float(np.nanmax(ours)) / whole, "three_phase": float(theirs[:, 1].max()) / whole},
    }  # fmt: skip


def _width(x: np.ndarray, values: np.ndarray, whole: float | None) -> float:
    """Metres from the last place at 90 % of the peak to the first at 10 %, beyond it."""
    top = float(np.nanmax(values)) if whole is None else whole
    high = np.flatnonzero(values > 0.9 * top)
    if not len(high):
        return float("nan")
    low = np.flatnonzero((values < 0.1 * top) & (np.arange(len(x)) > high[-1]))
    return float(x[low[0]] - x[high[-1]]) if len(low) else float("inf")

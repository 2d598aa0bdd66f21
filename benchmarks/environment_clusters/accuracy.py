"""Errors against exact integration: eight maps as ε grows, the sun, and a whole picture (figure 9)."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

import prelight as pl
from prelight.drawing.figures import difference_picture, panels, save_figure
from prelight.drawing.plots import Axis, line_plot
from prelight.transport.exact import integrate_exactly
from scenes import baked, maps, relative, scan

R = 256
EPSILONS = (4e-5, 5e-5, 7e-5, 1e-4, 2.5e-4)
RECEIVERS = 1000


def _exact(found: pl.Bake, chosen: np.ndarray, cubes: list[np.ndarray]) -> list[np.ndarray]:
    """Radiance under each cube map; they share their rays."""
    receivers = found.receivers
    together = integrate_exactly(
        receivers.positions,
        found.triangles,
        receivers.normals,
        receivers=chosen,
        cube=np.concatenate(cubes, axis=-1),
    )
    return [together[:, 3 * k : 3 * k + 3] * receivers.albedo[chosen] for k in range(len(cubes))]


def eight_maps(data: Path, work: Path) -> dict:
    """1,000 receivers of the Bunny scene under eight maps, for four ε; the sun's skies with and without rays."""
    scene, files = scan(data, "bunny"), maps(data)
    environments = {name: pl.Environment.open(path) for name, path in files.items()}
    chosen = np.sort(np.random.default_rng(7).choice(len(scene.positions), RECEIVERS, replace=False))
    true: list[np.ndarray] = []
    result: dict = {}
    lines: dict[str, list[tuple[float, float]]] = {}
    for epsilon in EPSILONS:
        path = work / f"bunny-{R}-{epsilon * 1e5:g}e-5.prelight"
        found, figures = baked(scene, path, resolution=R, epsilon=epsilon)
        true = true or _exact(found, chosen, [e.cube(R) for e in environments.values()])
        errors: dict = {}
        for (name, environment), reference in zip(environments.items(), true, strict=True):
            for traced in (True, False):
                light = pl.Relighter(found, trace_strong=traced)
                light.environment = environment
                key = name if traced else f"{name}, clusters alone"
                if traced or (len(pl.Relighter(found).bake.layers) and _has_strong(found, environment)):
                    errors[key] = relative(light.radiance[chosen], reference)
                    lines.setdefault(key, []).append((epsilon, errors[key]["relative_rms"]))
        result[f"ε={epsilon:g}"] = {"clusters": figures["clusters"], "errors": errors}
    plot = line_plot(
        {name: tuple(zip(*points, strict=True)) for name, points in lines.items() if name in files},
        x=Axis("ε", log=True),
        y=Axis("relative RMS error", log=True),
    )
    save_figure(plot, Path(__file__).parent / "results" / "error-against-epsilon.png", force=True)
    return result


def _has_strong(found: pl.Bake, environment: pl.Environment) -> bool:
    light = pl.Relighter(found)
    light.environment = environment
    return len(light.strong_lights) > 0


def suns(data: Path, work: Path) -> dict:
    """A sun that is most of the light, turned to eight places: clusters alone, and with its rays traced."""
    scene = scan(data, "bunny")
    found, _ = baked(scene, work / f"bunny-{R}-5e-5.prelight", resolution=R, epsilon=5e-5)
    chosen = np.sort(np.random.default_rng(8).choice(len(found.receivers), RECEIVERS, replace=False))
    result: dict = {}
    for name in ("noon grass (sun)", "kloppenheim (sun)"):
        sky = pl.Environment.open(maps(data)[name])
        turned = [sky.rotated(45.0 * k) for k in range(8)]
        true = _exact(found, chosen, [e.cube(R) for e in turned])
        for traced in (False, True):
            light = pl.Relighter(found, trace_strong=traced)
            errors, seconds = [], []
            for environment, reference in zip(turned, true, strict=True):
                light.environment = environment
                started = time.perf_counter()
                radiance = light.radiance
                seconds.append(time.perf_counter() - started)
                errors.append(relative(radiance[chosen], reference))
            rms = [e["relative_rms"] for e in errors]
            result[f"{name}, {'traced' if traced else 'clusters alone'}"] = {
                "relative_rms_mean": float(np.mean(rms)),
                "relative_rms_largest": max(rms),
                "worst_of_largest": max(e["worst_of_largest"] for e in errors),
                "seconds_of_rays": float(np.median(seconds)),
                "strong_lights": len(light.strong_lights),
                "their_share_of_light": float((light.strong_lights.energy.sum(axis=0) / sky.total).max()),
            }
    return result


def whole_image(data: Path, work: Path) -> dict:
    """A whole picture by exact integration at R = 256, beside bake and relight; figure 9's differences for three ε.

    Every vertex that the picture shows; a bake serves all others too.
    """
    scene = scan(data, "bunny")
    found, figures = baked(scene, work / f"bunny-{R}-5e-5.prelight", resolution=R, epsilon=5e-5)
    environment = pl.Environment.open(maps(data)["grace"])
    light = pl.Relighter(found)
    seen = light.view(light.camera("model"), width=640, height=440).triangles_seen
    chosen = np.unique(found.triangles[seen])
    started = time.perf_counter()
    true = np.zeros((len(found.receivers), 3))
    true[chosen] = _exact(found, chosen, [environment.cube(R)])[0]
    seconds = time.perf_counter() - started
    result = {
        "receivers": len(chosen),
        "exact_seconds": seconds,
        "bake_seconds": figures["seconds"],
        "exact_over_bake": seconds / figures["seconds"],
        "paper": "five hours for an exact picture; 50 minutes for a bake at R=1024, 6.5 s to relight",
    }
    shown, captions, stops = [], [], 0.0
    for epsilon in (5e-5, 1e-4, 2.5e-4):
        path = work / f"bunny-{R}-{epsilon * 1e5:g}e-5.prelight"
        found, figures = baked(scene, path, resolution=R, epsilon=epsilon)
        light = pl.Relighter(found)
        light.environment = environment
        camera = light.camera("model")
        truth = light.picture_of(true.astype(np.float32), camera, width=640, height=440)
        ours = light.picture_of(light.radiance, camera, width=640, height=440)
        stops = truth.stops("auto")
        if not shown:
            shown = [truth.display(exposure=stops)]
            shown.append(np.full_like(shown[0], 255))
            captions = ["exact integration", ""]
        shown += [
            ours.display(exposure=stops),
            difference_picture(ours.linear, truth.linear, factor=5.0, white=2.0**-stops),
        ]
        captions += [f"ε = {epsilon:g}, {figures['clusters']:,} clusters", "its differences"]
        result[f"ε={epsilon:g}"] = relative(light.radiance[chosen], true[chosen]) | {
            "clusters": figures["clusters"],
            "relight_milliseconds": light.refresh().milliseconds,
        }
    save_figure(
        panels(shown, captions, columns=2), Path(__file__).parent / "results" / "figure-9.png", force=True
    )
    return result

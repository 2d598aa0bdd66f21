"""Any light, live: what a transfer layer of a room costs, how fast it follows a light, how true bounces are."""

from __future__ import annotations

import argparse
import json
import platform
import time
from dataclasses import fields
from pathlib import Path
from typing import Any

import lights
import numpy as np

from prelight.baking.transfer import bake_transfer
from prelight.baking.transfer_settings import TransferSettings
from prelight.checking.placed_emitters import emitter_of
from prelight.cli.doctor import _llvm, _machine
from prelight.lighting.distributions import Power
from prelight.lighting.placed_lights import Lamp, PlacedPanel
from prelight.lighting.spot import Spot
from prelight.rays.surfaces import SurfaceScene
from prelight.relighting.transfer import TransferRelighter
from prelight.scene.stock import room as rooms
from prelight.storage.bake import Bake
from prelight.transport.path_traced_light import LightWithVariance, LitScene, as_diffuse
from prelight.transport.spreading import vertex_areas

WARM_UP = 6  # updates before a clock is looked at
NOISE = 0.02  # of indirect light in the reference, RMS


def _room(options: argparse.Namespace):
    return rooms.room(detail=options.detail)


def _bake_path(options: argparse.Namespace) -> Path:
    said = f"{options.detail:g}-{options.bounces}-{options.entries}-{options.modes}-{options.rays}"
    return options.work / f"room-{said}.prelight"


def _settings(options: argparse.Namespace) -> TransferSettings:
    return TransferSettings(options.rays, options.entries, options.bounces, options.modes)


def _baked(options: argparse.Namespace) -> Bake:
    path = _bake_path(options)
    return (
        Bake.open(path) if path.exists() else bake_transfer(_room(options), path, settings=_settings(options))
    )


def bake(options: argparse.Namespace) -> dict[str, Any]:
    """A bake of the stock room, after a small one that compiles."""
    small = options.work / "compiles.prelight"
    bake_transfer(rooms.room(detail=0.3), small, settings=_settings(options), force=True)
    scene = _room(options)
    began = time.perf_counter()
    found = bake_transfer(scene, _bake_path(options), settings=_settings(options), force=True)
    seconds = time.perf_counter() - began
    layer = next(iter(found.layers.values()))
    return {
        "vertices": len(scene.positions), "seconds": seconds, "bytes": found.manifest.bytes_of("layers/"),
        "rays": layer.rays, "statistics": layer.statistics, "parameters": layer.parameters,
    }  # fmt: skip


def speed(options: argparse.Namespace) -> dict[str, Any]:
    """Updates a second: a lamp that moves through the room, a spot, a ball, a panel, one of two lamps."""
    found = _baked(options)
    live = TransferRelighter(found)
    turns = 2 * np.pi * np.arange(WARM_UP + options.updates) / 60

    def place(turn: float) -> tuple[float, float, float]:
        return 0.9 * float(np.cos(turn)), 1.9 + 0.4 * float(np.sin(2 * turn)), 1.1 * float(np.sin(turn))

    white, resting = (1.0, 1.0, 1.0), Lamp((1.2, 2.2, 1.5), Spot((3.0, 2.0, 1.0), direction=(0, -1, 0)))
    down = Spot(white, direction=(0.0, -1.0, 0.0))
    beam = Spot(white, direction=(0.3, -1.0, 0.2), distribution=Power.of_width(45))
    moving = {
        "lamp": lambda t: [Lamp(place(t), down)],
        "spot": lambda t: [Lamp(place(t), beam)],
        "ball of 20 cm": lambda t: [Lamp(place(t), down, 0.10)],
        "panel": lambda t: [PlacedPanel(place(t), (0.6, 0.4), Spot(white, direction=(0.1, -1.0, 0.1)))],
        "one of two lamps": lambda t: [resting, Lamp(place(t), down)],
        "a lamp that dims": lambda t: [Lamp(place(0.0), Spot((1.0 + t, 1.0, 1.0), direction=(0, -1, 0)))],
    }
    figures: dict[str, Any] = {"vertices": len(found.receivers), "shadow_rays": live._placed.shadow_rays}
    for name, at in moving.items():
        took, direct = [], []
        for turn in turns:
            began = time.perf_counter()
            live.shine(at(float(turn)))
            live.irradiance  # noqa: B018 - what a picture would be drawn from
            took.append(time.perf_counter() - began)
            began = time.perf_counter()
            live._placed.of(at(float(turn))[-1])
            direct.append(time.perf_counter() - began)
        middle = float(np.median(took[WARM_UP:]))
        figures[name] = {
            "milliseconds": 1e3 * middle, "updates_per_second": 1 / middle,
            "slowest_of_ten_ms": 1e3 * float(np.quantile(took[WARM_UP:], 0.9)),
            "direct_ms": 1e3 * float(np.median(direct[WARM_UP:])),
        }  # fmt: skip
    one = live._placed.of(resting)
    figures["bounced_ms"] = 1e3 * _median_of(lambda: live._indirect.bounced(one))
    first = live._indirect.first
    figures["operator_ms"] = 1e3 * _median_of(lambda: first.bounce(one))
    figures["modes_ms"] = 1e3 * _median_of(lambda: live._indirect.by_modes(one))
    return figures


def _median_of(work: Any) -> float:
    took = []
    for _ in range(15):
        began = time.perf_counter()
        work()
        took.append(time.perf_counter() - began)
    return float(np.median(took[3:]))


def error(options: argparse.Namespace) -> dict[str, Any]:
    """Indirect light of lamps, spots and panels anywhere in the room against the path tracer, at vertices by area."""
    found, scene = _baked(options), as_diffuse(_room(options))
    live = TransferRelighter(found, shadow_rays=64)
    stand = np.array(found.array("layers/transfer/origins"))
    area = vertex_areas(scene) * (scene.material_of_vertex != scene.materials.index(rooms.OUTSIDE))
    share = area.astype(np.float64) / area.sum(dtype=np.float64)
    rng = np.random.default_rng(12)
    rows = np.sort(rng.choice(len(share), options.receivers, replace=False, p=share)).astype(np.int32)
    surfaces = SurfaceScene(scene)
    kept = options.work / f"lights-{options.receivers}-{options.samples}-{options.rounds}.json"
    each = (
        json.loads(kept.read_text()) if kept.exists() else []
    )  # of a run that was stopped, with these numbers
    for k, light in enumerate(lights.some(options.lights)[len(each) :], start=len(each)):
        began = time.perf_counter()
        live.shine([light])
        reference = LitScene(scene, surfaces=surfaces, emitters=[emitter_of(surfaces.mi, light)])
        said = _figures(light, live, rows, _seen(reference, rows, stand, options, seed=1000 * k))
        each.append({**said, "seconds": time.perf_counter() - began})
        kept.write_text(json.dumps(each, default=float))
        print(f"\r{k + 1} of {options.lights}", end="", flush=True)
    print()
    errors = np.array([one["indirect_rms"] for one in each])
    by_kind = {
        kind: float(np.median([one["indirect_rms"] for one in each if one["kind"] == kind]))
        for kind in ("lamp", "spot", "panel") if any(one["kind"] == kind for one in each)
    }  # fmt: skip
    return {
        "lights": len(each), "receivers": len(rows), "samples": options.samples, "median": float(np.median(errors)),
        "worst": float(errors.max()), "median_by_kind": by_kind,
        "median_total": float(np.median([one["total_rms"] for one in each])),
        "median_signed_mean": float(np.median([one["indirect_signed_mean"] for one in each])),
        "reference_seconds": sum(one["seconds"] for one in each),
        "worst_five": sorted(each, key=lambda one: -one["indirect_rms"])[:5], "all": each,
    }  # fmt: skip


def _seen(
    reference: LitScene, rows: np.ndarray, stand: np.ndarray, options: argparse.Namespace, *, seed: int
):
    """The mean of as many rounds as it takes for the noise of indirect light to be small."""
    rounds = []
    while len(rounds) < options.rounds:
        rounds.append(reference.light(rows, origins=stand, samples=options.samples, seed=seed + len(rounds)))
        mean = _mean(rounds)
        if mean.indirect_variance.mean() < NOISE**2 * np.square(mean.indirect).mean():
            break
    return _mean(rounds)


def _mean(rounds: list[LightWithVariance]) -> LightWithVariance:
    n, found = len(rounds), {}
    for field in fields(LightWithVariance):
        values = np.mean([getattr(one, field.name) for one in rounds], axis=0)
        found[field.name] = values / n if field.name.endswith("variance") else values
    return LightWithVariance(**found)


def _figures(light: Any, live: TransferRelighter, rows: np.ndarray, seen: Any) -> dict[str, Any]:
    """RMS relative to the reference's, its noise taken off; receivers were chosen by area, so all count alike."""
    kind = (
        "panel"
        if isinstance(light, PlacedPanel)
        else "spot"
        if light.beam.distribution is not None
        else "lamp"
    )
    said: dict[str, Any] = {"kind": kind, "position": [round(x, 3) for x in light.position]}
    if kind == "spot":
        said["width_deg"] = round(light.beam.distribution.width_deg, 1)
    if kind != "lamp":
        said["direction"] = [round(x, 3) for x in light.beam.direction]
    ours = {"direct": live.direct[rows], "indirect": live.indirect[rows]}
    ours["total"] = ours["direct"] + ours["indirect"]
    variances = {
        "direct": seen.direct_variance,
        "indirect": seen.indirect_variance,
        "total": seen.total_variance,
    }
    for part, mine in ours.items():
        truth = getattr(seen, part)
        wrong = np.square(mine - truth).mean() - variances[part].mean()
        whole = np.square(truth).mean() - variances[part].mean()
        said[f"{part}_rms"] = float(np.sqrt(max(wrong, 0.0) / whole))
        said[f"{part}_noise"] = float(np.sqrt(variances[part].mean() / whole))
        said[f"{part}_signed_mean"] = float((mine - truth).mean() / truth.mean())
    return said


PARTS = {"bake": bake, "speed": speed, "error": error}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all that have no result yet, if none")
    parser.add_argument("--work", type=Path, required=True, help="where a bake is kept: 60 MB")
    parser.add_argument("--name", default="2-core", help="of this machine, in the results")
    parser.add_argument("--detail", type=float, default=1.23, help="of the room: 1.23 has 45,000 vertices")
    parser.add_argument("--rays", type=int, default=1600, help="gathered from each vertex")
    parser.add_argument("--entries", type=int, default=TransferSettings().entries)
    parser.add_argument("--modes", type=int, default=TransferSettings().modes)
    parser.add_argument(
        "--bounces", type=int, default=TransferSettings().operator_bounces, help="by the operator"
    )
    parser.add_argument("--lights", type=int, default=50)
    parser.add_argument("--receivers", type=int, default=400)
    parser.add_argument("--samples", type=int, default=4096, help="of the path tracer, each receiver")
    parser.add_argument(
        "--rounds", type=int, default=8, help="of so many samples at most, where light is hard to find"
    )
    parser.add_argument("--updates", type=int, default=60)
    parser.add_argument("--trial", action="store_true", help="print the results and keep nothing")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    results = Path(__file__).parent / "results" / options.name
    for name in options.parts or PARTS:
        path = results / f"{name}.json"
        if path.exists() and not options.parts:
            continue
        print(f"== {name}: {(PARTS[name].__doc__ or '').splitlines()[0]}")
        began = time.perf_counter()
        figures = PARTS[name](options)
        report = {
            "what": PARTS[name].__doc__,
            "machine": _machine() | {"python": platform.python_version()} | {"llvm": _llvm()},
            "seconds_in_all": round(time.perf_counter() - began, 1),
            "figures": figures,
        }
        text = json.dumps(report, indent=1, ensure_ascii=False, default=float)
        print(text if not options.trial else json.dumps(figures, indent=1, default=float))
        if not options.trial:
            results.mkdir(parents=True, exist_ok=True)
            path.write_text(text + "\n")


if __name__ == "__main__":
    main()

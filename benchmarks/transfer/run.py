"""Any light, live: what a transfer layer of a room costs, how fast it follows a light, how true bounces are."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import lights
import numpy as np
from references import References

from prelight.baking.transfer import bake_transfer
from prelight.baking.transfer_plan import Ground
from prelight.baking.transfer_settings import TransferSettings
from prelight.checking.kept_parts import measure_parts, parts_parser
from prelight.lighting.distributions import Power
from prelight.lighting.placed_lights import Lamp, PlacedPanel
from prelight.lighting.spot import Spot
from prelight.relighting.transfer import TransferRelighter
from prelight.scene.stock import room as rooms
from prelight.storage.bake import Bake
from prelight.transport.path_traced_light import as_diffuse
from prelight.transport.spreading import vertex_areas

WARM_UP = 6  # updates before a clock is looked at


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


def references(options: argparse.Namespace) -> dict[str, Any]:
    """What the path tracer says of the lights, at vertices chosen by area: traced once, compared as often as wanted."""
    found = _references(options)
    enough = found.trace(lights.some(options.lights), seconds=options.seconds)
    known = [found.read(k) for k in range(options.lights) if found.path(k).exists()]
    return {
        "lights": len(known), "with_noise_small_enough_or_all_rounds": enough, "receivers": len(found.rows),
        "samples_of_a_round": options.samples, "rounds": [one.rounds for one in known],
        "seconds": sum(one.seconds for one in known),
    }  # fmt: skip


def _references(options: argparse.Namespace) -> References:
    scene = as_diffuse(_room(options))
    area = vertex_areas(scene) * (scene.material_of_vertex != scene.materials.index(rooms.OUTSIDE))
    share = area.astype(np.float64) / area.sum(dtype=np.float64)
    rng = np.random.default_rng(12)
    rows = np.sort(rng.choice(len(share), options.receivers, replace=False, p=share)).astype(np.int32)
    folder = options.work / f"references-{options.detail:g}"
    return References(folder, scene, rows, Ground(scene).origins, options.samples, options.rounds)


def error(options: argparse.Namespace) -> dict[str, Any]:
    """Indirect light of lamps, spots and panels anywhere in the room against the path tracer, at vertices by area."""
    known = _references(options)
    live = TransferRelighter(_baked(options), shadow_rays=64)
    each = []
    for k, light in enumerate(lights.some(options.lights)):
        if known.path(k).exists():
            live.shine([light])
            reference = known.read(k)
            each.append(_figures(light, live, known.rows, reference.light) | {"rounds": reference.rounds})
    if not each:
        raise SystemExit("no references are there yet: run the part references")
    errors = np.array([one["indirect_rms"] for one in each])
    by_kind = {
        kind: float(np.median([one["indirect_rms"] for one in each if one["kind"] == kind]))
        for kind in ("lamp", "spot", "panel") if any(one["kind"] == kind for one in each)
    }  # fmt: skip
    return {
        "lights": len(each), "receivers": len(known.rows), "samples_of_a_round": options.samples,
        "median": float(np.median(errors)),
        "worst": float(errors.max()), "tenth_worst": float(np.quantile(errors, 0.9)), "median_by_kind": by_kind,
        "median_total": float(np.median([one["total_rms"] for one in each])),
        "median_signed_mean": float(np.median([one["indirect_signed_mean"] for one in each])),
        "median_without_the_five_worst_receivers": float(np.median([one["indirect_rms_but_for_five"] for one in each])),
        "worst_five": sorted(each, key=lambda one: -one["indirect_rms"])[:5], "all": each,
    }  # fmt: skip


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
    square = (np.square(ours["indirect"] - seen.indirect) - seen.indirect_variance).mean(axis=1)
    whole = np.square(seen.indirect).mean() - seen.indirect_variance.mean()
    first = np.argsort(-square)
    said["indirect_rms_but_for_five"] = float(np.sqrt(max(square[first[5:]].sum() / len(rows), 0.0) / whole))
    said["worst_receiver"] = {
        "position": [round(float(x), 3) for x in live.bake.receivers.positions[rows[first[0]]]],
        "share_of_squares": float(square[first[0]] / square.sum()),
        "ours": float(ours["indirect"][first[0]].mean()), "reference": float(seen.indirect[first[0]].mean()),
        "rms_of_all": float(np.sqrt(whole)),
    }  # fmt: skip
    return said


PARTS = {"bake": bake, "speed": speed, "references": references, "error": error}


def main() -> None:
    parser = parts_parser(__doc__, PARTS, work="where a bake is kept: 60 MB")
    parser.add_argument("--detail", type=float, default=1.23, help="of the room: 1.23 has 45,000 vertices")
    parser.add_argument("--rays", type=int, default=1600, help="gathered from each vertex")
    parser.add_argument("--entries", type=int, default=TransferSettings().entries)
    parser.add_argument("--modes", type=int, default=TransferSettings().modes)
    parser.add_argument(
        "--bounces", type=int, default=TransferSettings().operator_bounces, help="by the operator"
    )
    parser.add_argument("--lights", type=int, default=50)
    parser.add_argument("--receivers", type=int, default=400)
    parser.add_argument("--samples", type=int, default=2048, help="of the path tracer, each receiver")
    parser.add_argument(
        "--rounds", type=int, default=16, help="of so many samples at most, where light is hard to find"
    )
    parser.add_argument("--seconds", type=float, default=np.inf, help="after which references stop for now")
    parser.add_argument("--updates", type=int, default=60)
    parser.add_argument("--trial", action="store_true", help="print the results and keep nothing")
    options = parser.parse_intermixed_args()
    options.work.mkdir(parents=True, exist_ok=True)
    results = Path(__file__).parent / "results" / options.name
    measure_parts(PARTS, options.parts, results, call=lambda part: part(options), keep=not options.trial)


if __name__ == "__main__":
    main()

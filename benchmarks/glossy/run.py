"""Gloss for a free eye against the path tracer; each part kept as soon as it is there."""

from __future__ import annotations

import argparse
import json
import platform
import time
from pathlib import Path

import accuracy

from prelight.cli.doctor import _llvm, _machine

PARTS = accuracy.PARTS
KEPT = ("detail", "side", "samples", "pixels", "order", "resolution", "tolerance")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder with bunny/; without it a ball is looked at")
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all that have no result yet, if none")
    parser.add_argument("--work", type=Path, required=True, help="for bakes and pictures: some 100 megabytes")
    parser.add_argument("--name", default="2-core", help="of this machine, in the results")
    parser.add_argument("--detail", type=float, default=0.5, help="1 for the bunny and the full room")
    parser.add_argument("--side", type=int, default=72, help="pixels of a picture's side")
    parser.add_argument("--samples", type=int, default=18432, help="of the path tracer, a pixel")
    parser.add_argument("--pixels", type=int, default=160, help="of the object that are compared, by chance")
    parser.add_argument("--order", type=int, default=8, help="of the harmonics")
    parser.add_argument("--tolerance", type=float, default=0.005, help="of the clusters")
    parser.add_argument("--resolution", type=int, default=64, help="R of the environment")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    for name in KEPT:
        setattr(accuracy.Settings, name, getattr(options, name))
    results = Path(__file__).parent / "results" / options.name
    results.mkdir(parents=True, exist_ok=True)
    for name in options.parts or PARTS:
        path = results / f"{name}.json"
        if path.exists() and not options.parts:
            continue
        print(f"== {name}: {(PARTS[name].__doc__ or '').splitlines()[0]}")
        started = time.perf_counter()
        figures = PARTS[name](options.data, options.work)
        report = {
            "what": PARTS[name].__doc__,
            "machine": _machine() | {"python": platform.python_version()} | {"llvm": _llvm()},
            "settings": {name: getattr(options, name) for name in KEPT},
            "seconds_in_all": round(time.perf_counter() - started, 1),
            "figures": figures,
        }
        text = json.dumps(report, indent=1, ensure_ascii=False, default=float)
        print(text)
        path.write_text(text + "\n")


if __name__ == "__main__":
    main()

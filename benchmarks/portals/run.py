"""Rooms through their portals against a path tracer, a clock and the paper; each part kept as soon as it is there."""

from __future__ import annotations

import argparse
import json
import platform
import time
from pathlib import Path

import three_phase
from parts import PARTS

from prelight.cli.doctor import _llvm, _machine


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder with bunny/, sibenik/ and skies/")
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all that have no result yet, if none")
    parser.add_argument("--work", type=Path, required=True, help="where bakes are made: a gigabyte")
    parser.add_argument("--name", default="2-core", help="of this machine, in the results")
    parser.add_argument("--radiance", type=Path, help="folder of the pyradiance package, for three-phase")
    options = parser.parse_args()
    three_phase.FOLDER = options.radiance
    options.work.mkdir(parents=True, exist_ok=True)
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
            "seconds_in_all": round(time.perf_counter() - started, 1),
            "figures": figures,
        }
        text = json.dumps(report, indent=1, ensure_ascii=False, default=float)
        print(text)
        path.write_text(text + "\n")


if __name__ == "__main__":
    main()

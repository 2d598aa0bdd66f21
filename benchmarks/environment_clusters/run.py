"""Everything the environment-clusters paper reports, measured again; each part kept as soon as it is there."""

from __future__ import annotations

import argparse
import json
import platform
import time
from pathlib import Path

import accuracy
import edits
import gloss
import tables

from prelight.cli.doctor import _llvm, _machine

PARTS = {
    "bunny": tables.bunny,
    "edits": edits.two_discs,
    "maps": accuracy.eight_maps,
    "sun": accuracy.suns,
    "small-light": edits.small_light,
    "zones": gloss.zones,
    "glossy-pixels": gloss.pixels,
    "figure": tables.figure,
    "sweep": tables.sweep,
    "dragon": tables.dragon,
    "table-2": tables.table_2,
    "whole-image": accuracy.whole_image,
    "dragon-floor-3": tables.dragon_on_the_bunnys_floor,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, help="folder with bunny/, dragon/, probes/ and skies/")
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all that have no result yet, if none")
    parser.add_argument("--work", type=Path, required=True, help="where the bakes go: about 6 GB")
    parser.add_argument("--name", default="2-core", help="of this machine, in the results")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    results = Path(__file__).parent / "results" / options.name
    results.mkdir(parents=True, exist_ok=True)
    for name in options.parts or PARTS:
        path = results / f"{name}.json"
        if path.exists() and not options.parts:
            continue
        print(f"== {name}: {PARTS[name].__doc__.splitlines()[0]}")
        started = time.perf_counter()
        figures = PARTS[name](options.data, options.work)
        report = {
            "what": PARTS[name].__doc__,
            "machine": _machine() | {"python": platform.python_version()} | {"llvm": _llvm()},
            "seconds_in_all": round(time.perf_counter() - started, 1),
            "figures": figures,
        }
        text = json.dumps(report, indent=1, ensure_ascii=False, default=float)
        path.write_text(text + "\n")
        print(text)


if __name__ == "__main__":
    main()

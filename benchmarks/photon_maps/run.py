"""Photon maps against path tracing and the gathering operator; each part kept as soon as it is there."""

from __future__ import annotations

import argparse
import json
import platform
import time
from pathlib import Path

import caustic
import in_layers
import in_rooms

from prelight.cli.doctor import _llvm, _machine

PARTS = {
    "caustic": caustic.glass_ball,
    "room": in_rooms.both_ways,
    "portal": in_rooms.portal,
    "sky": caustic.sky_layer,
    "portals": in_layers.portals,
    "cloud": in_layers.cloud,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all that have no result yet, if none")
    parser.add_argument("--work", type=Path, required=True, help="where references are kept: some megabytes")
    parser.add_argument("--name", default="2-core", help="of this machine, in the results")
    parser.add_argument(
        "--small", action="store_true", help="in seconds, to see that it runs; nothing is kept"
    )
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    results = Path(__file__).parent / "results" / options.name
    for name in options.parts or PARTS:
        path = results / f"{name}.json"
        if path.exists() and not options.parts:
            continue
        print(f"== {name}: {(PARTS[name].__doc__ or '').splitlines()[0]}")
        started = time.perf_counter()
        figures = PARTS[name](options.work, small=options.small)
        report = {
            "what": PARTS[name].__doc__,
            "machine": _machine() | {"python": platform.python_version()} | {"llvm": _llvm()},
            "seconds_in_all": round(time.perf_counter() - started, 1),
            "figures": figures,
        }
        text = json.dumps(report, indent=1, ensure_ascii=False, default=float)
        print(text)
        if not options.small:
            results.mkdir(parents=True, exist_ok=True)
            path.write_text(text + "\n")


if __name__ == "__main__":
    main()

"""The figures of steerable lights, measured again; each part kept as soon as it is there."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import speed

from prelight.cli.doctor import _llvm, _machine

PARTS = {"relighting": speed.relighting}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all that have no result yet, if none")
    parser.add_argument("--name", default="2-core", help="of this machine, in the results")
    options = parser.parse_args()
    results = Path(__file__).parent / "results" / options.name
    results.mkdir(parents=True, exist_ok=True)
    for name in options.parts or PARTS:
        path = results / f"{name}.json"
        if path.exists() and not options.parts:
            continue
        started = time.perf_counter()
        figures = PARTS[name]()
        report = {
            "what": PARTS[name].__doc__,
            "machine": _machine() | {"llvm": _llvm()},
            "seconds_in_all": round(time.perf_counter() - started, 1),
            "figures": figures,
        }
        text = json.dumps(report, indent=1, ensure_ascii=False, default=float)
        path.write_text(text + "\n")
        print(text)


if __name__ == "__main__":
    main()

"""Shells of a world outside: what a capture costs, a frame of a moving world, and the path tracer beside it."""

from __future__ import annotations

from pathlib import Path

import capturing
import frames
import passing

from prelight.checking.kept_parts import measure_parts, parts_parser

PARTS = {"capture": capturing.run, "frame": frames.run, "passing": passing.run}


def main() -> None:
    parser = parts_parser(__doc__, PARTS, work="where meshes and a bake are kept", data="folder with city/")
    options = parser.parse_intermixed_args()
    results = Path(__file__).parent / "results" / options.name
    options.work.mkdir(parents=True, exist_ok=True)
    measure_parts(PARTS, options.parts, results, call=lambda part: part(options.data, options.work))


if __name__ == "__main__":
    main()

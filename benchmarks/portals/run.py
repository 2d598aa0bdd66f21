"""Rooms through their portals against a path tracer, a clock and the paper; each part kept as soon as it is there."""

from __future__ import annotations

import math
from pathlib import Path

import sibenik_day
import three_phase
from parts import PARTS

from prelight.checking.kept_parts import measure_parts, parts_parser


def main() -> None:
    parser = parts_parser(
        __doc__,
        PARTS,
        work="where bakes are made: a gigabyte",
        data="folder with bunny/, sibenik/ and skies/",
    )
    parser.add_argument("--radiance", type=Path, help="folder of the pyradiance package, for three-phase")
    parser.add_argument(
        "--minutes", type=float, default=math.inf, help="of tracing sibenik-day's reference this time"
    )
    options = parser.parse_intermixed_args()
    results = Path(__file__).parent / "results" / options.name
    three_phase.FOLDER = options.radiance
    sibenik_day.MINUTES = options.minutes
    options.work.mkdir(parents=True, exist_ok=True)
    measure_parts(PARTS, options.parts, results, call=lambda part: part(options.data, options.work))


if __name__ == "__main__":
    main()

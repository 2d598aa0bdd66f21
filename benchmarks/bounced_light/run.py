"""Bounced light against a path tracer, a clock and Radiance; each part kept as soon as it is there."""

from __future__ import annotations

from pathlib import Path

import accuracy
import beside_radiance
import summary
import timing

from prelight.checking.kept_parts import measure_parts, parts_parser

PARTS = {"time": timing.room, "radiance": beside_radiance.room} | accuracy.PARTS


def main() -> None:
    parser = parts_parser(
        __doc__,
        PARTS,
        work="where references are kept: some megabytes",
        data="folder with bunny/, cornell/, sponza/ and sibenik/",
    )
    parser.add_argument("--radiance", type=Path, help="folder of the pyradiance package, for that part")
    parser.add_argument("--table", action="store_true", help="only print what the results say, in Markdown")
    options = parser.parse_intermixed_args()
    results = Path(__file__).parent / "results" / options.name
    options.work.mkdir(parents=True, exist_ok=True)
    if options.table:
        print(summary.table(results))
        return
    beside_radiance.FOLDER = options.radiance
    measure_parts(PARTS, options.parts, results, call=lambda part: part(options.data, options.work))


if __name__ == "__main__":
    main()

"""Everything the environment-clusters paper reports, measured again; each part kept as soon as it is there."""

from __future__ import annotations

from pathlib import Path

import accuracy
import edits
import gloss
import tables

from prelight.checking.kept_parts import measure_parts, parts_parser

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
    parser = parts_parser(
        __doc__,
        PARTS,
        work="where the bakes go: about 6 GB",
        data="folder with bunny/, dragon/, probes/ and skies/",
    )
    options = parser.parse_intermixed_args()
    results = Path(__file__).parent / "results" / options.name
    options.work.mkdir(parents=True, exist_ok=True)
    measure_parts(PARTS, options.parts, results, call=lambda part: part(options.data, options.work))


if __name__ == "__main__":
    main()

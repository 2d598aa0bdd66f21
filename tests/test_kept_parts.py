"""A benchmark in parts: what has a result is not measured again, and what was skipped leaves none."""

from __future__ import annotations

import json
from functools import partial

from prelight.checking.kept_parts import measure_parts, parts_parser


def test_parts_are_kept_one_by_one(tmp_path, capsys):
    asked = []

    def first(folder):
        """One line.

        More.
        """
        asked.append(folder)
        return {"answer": 42}

    def second(word, folder):
        """Another."""
        asked.append(word)
        return {"skipped": "no data"}

    parts = {"first": first, "second": partial(second, "x")}

    def measured(*wanted, keep=True):
        measure_parts(
            parts, wanted, tmp_path / "r", call=lambda part: part(1), keep=keep, more={"settings": 7}
        )

    measured("first", keep=False)
    assert not (tmp_path / "r").exists()
    measured()
    report = json.loads((tmp_path / "r" / "first.json").read_text())
    assert (report["figures"], report["settings"], report["seconds_in_all"] >= 0) == ({"answer": 42}, 7, True)
    assert report["machine"]["processors"] >= 1
    assert [path.name for path in (tmp_path / "r").iterdir()] == ["first.json"]
    measured()
    assert asked == [1, 1, "x", "x"]
    measured("first")
    assert asked[4:] == [1]
    assert "== second: Another.\n" in capsys.readouterr().out


def test_what_every_benchmark_is_asked(tmp_path):
    parser = parts_parser("words", {"a": dict, "b": dict}, work="bakes", data="a folder")
    found = parser.parse_args([str(tmp_path), "b", "--work", str(tmp_path / "w")])
    assert (found.data, found.parts, found.work, found.name) == (tmp_path, ["b"], tmp_path / "w", "2-core")

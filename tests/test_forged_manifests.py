"""Manifests made to harm, their own hash right: refused in one line, at once, in little memory (P11)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from prelight.cli.main import run
from prelight.errors import DamagedBakeError
from prelight.storage import environment_layer
from prelight.storage.bake import Bake
from prelight.storage.manifest import NAME

from .disk import copy, light_of, quick_bake, refusal, rewrite_manifest

LAYER = "layers/environment"


@pytest.fixture(scope="module")
def original(tmp_path_factory) -> Path:
    return quick_bake(tmp_path_factory.mktemp("original") / "ball.prelight").path


@pytest.fixture
def bake(original, tmp_path) -> Path:
    """A copy to be forged."""
    return copy(original, tmp_path / "ball.prelight")


def at(*path: str | int) -> Callable[[object], Callable[[dict], None]]:
    """A change of one member of the manifest."""

    def of(value: object) -> Callable[[dict], None]:
        def change(document: dict) -> None:
            inner = document
            for step in path[:-1]:
                inner = inner[step]
            inner[path[-1]] = value

        return change

    return of


def renamed(old: str, new: str) -> Callable[[dict], None]:
    """An array and its chunks under another name."""

    def change(document: dict) -> None:
        document["arrays"][new] = document["arrays"].pop(old)
        for key in [k for k in document["chunks"] if k.startswith(f"{old}/c/")]:
            document["chunks"][new + key[len(old) :]] = document["chunks"].pop(key)

    return change


def camera(view: object) -> Callable[[dict], None]:
    return at("scene", "cameras")([{"name": "a", "view": view}])


POSITIONS = ("arrays", "scene/positions")
RECORD, LAYER_RECORD = ("chunks", "scene/positions/c/0/0"), ("layers", "environment")
MANIFESTS: dict[str, Callable[[dict], object]] = {
    "shape 2^50": at(*POSITIONS, "shape")([2**50, 3]),
    "shape and chunk 2^50": lambda d: d["arrays"]["scene/positions"].update(shape=[2**50, 3], chunk_shape=[2**50, 3]),
    "shape of 10^30": at(*POSITIONS, "shape")([10**30, 3]),
    "shape of a million chunks": at(*POSITIONS, "shape")([75 * 10**6, 3]),
    "a thousand arrays of a million chunks": lambda d: d["arrays"].update(
        {f"x{i}": {"shape": [10**6], "dtype": "uint8", "chunk_shape": [1]} for i in range(1000)}
    ),
    "shape negative": at(*POSITIONS, "shape")([-75, 3]),
    "shape zero": at(*POSITIONS, "shape")([0, 3]),
    "shape of no axis": at(*POSITIONS, "shape")([]),
    "shape of floats": at(*POSITIONS, "shape")([75.0, 3]),
    "shape of text": at(*POSITIONS, "shape")(["75", "3"]),
    "shape of truth": at(*POSITIONS, "shape")([True, True]),
    "shape of 99 axes": at(*POSITIONS, "shape")([1] * 99),
    "chunk shape of other length": at(*POSITIONS, "chunk_shape")([75]),
    "chunk shape zero": at(*POSITIONS, "chunk_shape")([0, 3]),
    "chunk shape smaller": at(*POSITIONS, "chunk_shape")([10, 3]),
    "type object": at(*POSITIONS, "dtype")("object"),
    "type float64": at(*POSITIONS, "dtype")("float64"),
    "type of another size": at(*POSITIONS, "dtype")("uint8"),
    "type of the same size": at(*POSITIONS, "dtype")("int32"),
    "type null": at(*POSITIONS, "dtype")(None),
    "array extra key": at(*POSITIONS, "codecs")(["blosc"]),
    "array null": at(*POSITIONS)(None),
    "array a list": at(*POSITIONS)([]),
    "array without its chunk": lambda d: d["chunks"].pop("scene/positions/c/0/0"),
    "array missing": lambda d: (d["arrays"].pop("scene/positions"), d["chunks"].pop("scene/positions/c/0/0")),
    "layer array missing": lambda d: (d["arrays"].pop(f"{LAYER}/order"), d["chunks"].pop(f"{LAYER}/order/c/0")),
    "zones missing": lambda d: (d["arrays"].pop(f"{LAYER}/zones"), d["chunks"].pop(f"{LAYER}/zones/c/0/0")),
    "parcel without tiles": lambda d: (
        d["arrays"].pop(f"{LAYER}/tiles/00000"), d["chunks"].pop(f"{LAYER}/tiles/00000/c/0/0/0")
    ),
    "parcels with a gap": renamed(f"{LAYER}/rectangles/00001", f"{LAYER}/rectangles/00003"),
    "parcel of another name": renamed(f"{LAYER}/scales/00000", f"{LAYER}/scales/0"),
    "parcel of another type": lambda d: d["arrays"][f"{LAYER}/rectangles/00000"].update(dtype="float32"),
    "name absolute": renamed("scene/albedo", "/etc/albedo"),
    "name climbing": renamed("scene/albedo", "../albedo"),
    "name climbing inside": renamed("scene/albedo", "scene/../albedo"),
    "name with a point": renamed("scene/albedo", "scene/./albedo"),
    "name empty": renamed("scene/albedo", ""),
    "name with a NUL": renamed("scene/albedo", "scene/al\0bedo"),
    "name with an escape": renamed("scene/albedo", "scene/\x1b[31mred"),
    "name with a backslash": renamed("scene/albedo", "scene\\albedo"),
    "name of a file": renamed("scene/albedo", "manifest.json"),
    "name a mile long": renamed("scene/albedo", "a" * 5000),
    "chunk nobody has": at("chunks", "scene/extra/c/0")({"size": 8, "crc32c": 0, "sha256": "0" * 64}),
    "chunk climbing": at("chunks", "../../etc/passwd")({"size": 8, "crc32c": 0, "sha256": "0" * 64}),
    "chunk absolute": at("chunks", "/etc/passwd")({"size": 8, "crc32c": 0, "sha256": "0" * 64}),
    "chunk of another size": at(*RECORD, "size")(2**50),
    "chunk of negative size": at(*RECORD, "size")(-1),
    "chunk of no size": at(*RECORD, "size")(0),
    "chunk size as text": at(*RECORD, "size")("904"),
    "chunk crc wrong": at(*RECORD, "crc32c")(1),
    "chunk crc too large": at(*RECORD, "crc32c")(2**32),
    "chunk sha not hex": at(*RECORD, "sha256")("z" * 64),
    "chunk sha with a new line": at(*RECORD, "sha256")("0" * 64 + "\n"),
    "chunk extra key": at(*RECORD, "url")("http://127.0.0.1/"),
    "chunk a number": at(*RECORD)(7),
    "chunks a list": at("chunks")([]),
    "arrays null": at("arrays")(None),
    "arrays empty": lambda d: (d["arrays"].clear(), d["chunks"].clear()),
    "layers empty": at("layers")({}),
    "layers a list": at("layers")([]),
    "layer of text": at(*LAYER_RECORD)("environment"),
    "layer of another kind": at(*LAYER_RECORD, "kind")("cloud"),
    "layer extra key": at(*LAYER_RECORD, "plugin")("evil"),
    "layer without parameters": at(*LAYER_RECORD, "parameters")({}),
    "layer without statistics": at(*LAYER_RECORD, "statistics")({}),
    "coefficients one less": lambda d: d["layers"]["environment"].update(coefficients=618),
    "coefficients 2^40": at(*LAYER_RECORD, "coefficients")(2**40),
    "coefficients 10^30": at(*LAYER_RECORD, "coefficients")(10**30),
    "coefficients zero": at(*LAYER_RECORD, "coefficients")(0),
    "basis lights wrong": at(*LAYER_RECORD, "basis_lights")(487),
    "rays without end": at(*LAYER_RECORD, "rays")(10**4000),
    "receivers of nobody": at(*LAYER_RECORD, "parameters", "receivers")("pixels"),
    "receivers faces": at(*LAYER_RECORD, "parameters", "receivers")("faces"),
    "receivers a number": at(*LAYER_RECORD, "parameters", "receivers")(1),
    "receivers null": at(*LAYER_RECORD, "parameters", "receivers")(None),
    "a picture of other size": lambda d: d["layers"]["environment"]["parameters"].update(
        receivers="pixels", width=9, height=9, samples=1
    ),
    "a picture without end": lambda d: d["layers"]["environment"]["parameters"].update(
        receivers="pixels", width=2**20, height=2**20, samples=1
    ),
    "a picture of negative size": lambda d: d["layers"]["environment"]["parameters"].update(
        receivers="pixels", width=-43, height=-2, samples=1
    ),
    "a picture of truth": lambda d: d["layers"]["environment"]["parameters"].update(
        receivers="pixels", width=True, height=86, samples=1
    ),
    "eye a name": at(*LAYER_RECORD, "camera")("a"),
    "eye without a view": at(*LAYER_RECORD, "camera")({"name": "a"}),
    "resolution other": at(*LAYER_RECORD, "parameters", "resolution")(10),
    "resolution 2^31": at(*LAYER_RECORD, "parameters", "resolution")(2**31),
    "resolution zero": at(*LAYER_RECORD, "parameters", "resolution")(0),
    "resolution negative": at(*LAYER_RECORD, "parameters", "resolution")(-8),
    "resolution a float": at(*LAYER_RECORD, "parameters", "resolution")(8.0),
    "resolution text": at(*LAYER_RECORD, "parameters", "resolution")("8"),
    "resolution true": at(*LAYER_RECORD, "parameters", "resolution")(True),
    "resolution null": at(*LAYER_RECORD, "parameters", "resolution")(None),
    "sun paths of text": at(*LAYER_RECORD, "parameters", "sun_paths")("noon"),
    "sun paths beyond the pole": at(*LAYER_RECORD, "parameters", "sun_paths")(-90.5),
    "sun paths null": at(*LAYER_RECORD, "parameters", "sun_paths")(None),
    "tolerance NaN": at(*LAYER_RECORD, "parameters", "tolerance")(float("nan")),
    "tolerance infinite": at(*LAYER_RECORD, "parameters", "tolerance")(float("inf")),
    "tolerance text": at(*LAYER_RECORD, "parameters", "tolerance")("a"),
    "statistics nested": at(*LAYER_RECORD, "statistics", "tiles")({}),
    "statistics NaN": at(*LAYER_RECORD, "statistics", "nonzero_share")(float("nan")),
    "version newer": at("version")(4),
    "version older": at("version")(1),
    "version text": at("version")("2"),
    "version float": at("version")(2.0),
    "version true": at("version")(True),
    "version null": at("version")(None),
    "format other": at("format")("zarr"),
    "format a mile long": at("format")("\x1b" * 10**6),
    "format nested": at("format")([[[[{}]]]]),
    "extra key": at("extra")(1),
    "missing key": lambda d: d.pop("software"),
    "software of numbers": at("software", "numpy")(2),
    "settings nested": at("settings", "kind")({}),
    "scene a list": at("scene")([]),
    "scene digest short": at("scene", "digest")("0"),
    "scene name a number": at("scene", "name")(1),
    "notes of numbers": at("scene", "notes")([1]),
    "notes without end": at("scene", "notes")(["n" * 50] * 50_000),
    "camera a list": at("scene", "cameras")({"a": 1}),
    "camera without eye": camera({"target": [0, 0, 0]}),
    "camera of text": camera({"eye": "abc", "target": [0, 0, 0]}),
    "camera NaN": camera({"eye": [float("nan"), 0, 0], "target": [0, 0, 0]}),
    "camera of huge numbers": camera({"eye": [10**400, 0, 0], "target": [0, 0, 0]}),
    "camera at its target": camera({"eye": [0, 0, 0], "target": [0, 0, 0]}),
    "camera extra": camera({"eye": [1, 0, 0], "target": [0, 0, 0], "lens": 1}),
}  # fmt: skip


@pytest.mark.parametrize("forgery", MANIFESTS)
def test_forged_manifests(bake, forgery):
    rewrite_manifest(bake, MANIFESTS[forgery])
    error = refusal(lambda: light_of(bake))
    assert error is not None
    assert isinstance(error, DamagedBakeError) or forgery in ("layers empty", "layer of another kind"), repr(
        error
    )


@pytest.mark.parametrize("forgery", MANIFESTS)
def test_forged_manifests_on_the_command_line(bake, forgery, capsys):
    """`inspect` and `verify` never fail otherwise than in one line with exit code 4, or they succeed."""
    rewrite_manifest(bake, MANIFESTS[forgery])
    for command in (
        ["inspect", str(bake)],
        ["inspect", str(bake), "--json"],
        ["verify", str(bake), "--json"],
    ):
        code = run(command)
        out, err = capsys.readouterr()
        assert code in (0, 4), err
        if code:
            assert not out
            assert err.count("\n") == 1
            assert err.startswith("prelight: ")
            assert len(err) <= 301
        assert "\x1b" not in out + err


@pytest.mark.parametrize(
    "forgery",
    [
        "layer array missing", "zones missing", "parcel without tiles", "parcels with a gap",
        "parcel of another name", "parcel of another type", "coefficients one less", "receivers faces",
        "receivers null", "a picture without end", "a picture of negative size",
        "a picture of truth", "layer without parameters",
    ],
)  # fmt: skip
def test_layers_that_do_not_fit_are_refused_on_opening(bake, forgery):
    """Before an array is read, whoever reads it: `Bake.open` looks at the manifest alone."""
    rewrite_manifest(bake, MANIFESTS[forgery])
    assert isinstance(refusal(lambda: Bake.open(bake)), DamagedBakeError)


def test_more_parcels_or_zones_than_a_bake_may_have(bake, monkeypatch):
    assert refusal(lambda: Bake.open(bake)) is None
    for bound, words in (("MOST_PARCELS", "expected 1 to 1"), ("MOST_ZONES", "at most 1 zones")):
        with monkeypatch.context() as patch:
            patch.setattr(environment_layer, bound, 1)
            error = refusal(lambda: Bake.open(bake))
        assert isinstance(error, DamagedBakeError)
        assert words in str(error)


def test_colours_need_an_eye(bake):
    def change(document: dict) -> None:
        for name, width in (("scales", 3), ("present", 6)):
            spec = document["arrays"][f"{LAYER}/{name}/00000"]
            spec["shape"][1] = spec["chunk_shape"][1] = width
            size = 4 * 339 * 3 if name == "scales" else 2 * 2 * 6
            document["chunks"][f"{LAYER}/{name}/00000/c/0/0"]["size"] = size + 4

    rewrite_manifest(bake, change)
    error = refusal(lambda: Bake.open(bake))
    assert isinstance(error, DamagedBakeError)
    assert "without an eye" in str(error)


RAW: dict[str, bytes] = {
    "not JSON": b"\x89PNG\r\n\x1a\n",
    "a number": b"1",
    "null": b"null",
    "a list": b"[]",
    "an empty object": b"{}",
    "NUL": b"\0" * 1000,
    "not UTF-8": b'{"format": "\xff\xfe"}',
    "nested lists": b"[" * 100_000 + b"]" * 100_000,
    "nested objects": b'{"a":' * 100_000 + b"1" + b"}" * 100_000,
    "a long number": b'{"version": ' + b"9" * 5_000_000 + b"}",
    "a long name": b'{"' + b"a" * 10_000_000 + b'": 1}',
    "many lists": b"[" + b"[]," * 5_000_000 + b"[]]",
    "many objects": b'{"chunks": {' + b",".join(b'"%d":{}' % i for i in range(500_000)) + b"}}",
    "many numbers": b"[" + b"1.5," * 3_900_000 + b"1]",
    "sixteen megabytes of blank": b" " * 15_999_999,
}


@pytest.mark.parametrize(
    "name",
    [
        "../outside",
        "/outside",
        "scene/../../outside",
        "",
        "a//b",
        ".",
        "a.b",
        "a b",
        "a\\b",
        "a\0b",
        "a\x1bb",
    ],
)
def test_arrays_lie_inside_and_have_plain_names(bake, name):
    """One more array, all there and whole: only its name is wrong."""

    def add(document: dict) -> None:
        document["arrays"][name] = document["arrays"]["scene/albedo"]
        document["chunks"][f"{name}/c/0/0"] = document["chunks"]["scene/albedo/c/0/0"]

    rewrite_manifest(bake, add)
    error = refusal(lambda: Bake.open(bake))
    assert isinstance(error, DamagedBakeError)
    assert "plain words" in str(error)


@pytest.mark.parametrize("text", RAW)
def test_hostile_text(bake, text):
    (bake / NAME).write_bytes(RAW[text])
    error = refusal(lambda: Bake.open(bake))
    assert isinstance(error, DamagedBakeError)
    assert "manifest" in str(error) or "this Prelight reads" in str(error)


def test_a_manifest_of_300_megabytes(bake):
    with (bake / NAME).open("wb") as file:
        file.truncate(300_000_000)
    error = refusal(lambda: Bake.open(bake))
    assert isinstance(error, DamagedBakeError)
    assert "300 MB" in str(error)


def test_many_wrong_entries_are_not_all_told(bake):
    """A report of every one of fifty thousand errors would take seconds and hundreds of megabytes."""

    def change(document: dict) -> None:
        document["chunks"].update(
            {f"some/rather/long/name/of/a/chunk/c/{i}": {"size": -1} for i in range(50_000)}
        )

    rewrite_manifest(bake, change)
    assert isinstance(refusal(lambda: Bake.open(bake)), DamagedBakeError)


def test_numbers_that_json_should_not_have(bake):
    text = (bake / NAME).read_text()
    document = json.loads(text)
    del document["sha256"]
    document["layers"]["environment"]["statistics"]["tiles"] = float("inf")
    canonical = json.dumps(document, sort_keys=True, separators=(",", ":")).encode()
    forged = json.dumps(document | {"sha256": hashlib.sha256(canonical).hexdigest()}, sort_keys=True)
    for spelling in ("Infinity", "1e999"):
        (bake / NAME).write_text(forged.replace("Infinity", spelling))
        assert isinstance(refusal(lambda: Bake.open(bake)), DamagedBakeError)

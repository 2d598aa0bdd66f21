"""The bake on disk: what is written is read again, by us and by zarr-python, and twice is the same bytes."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import resource
import sys
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st

from prelight.baking.environment import bake_planned
from prelight.baking.environment_plan import Cut, plan_environment
from prelight.baking.environment_settings import EnvironmentSettings
from prelight.bases.cube_map import solid_angles
from prelight.errors import DamagedBakeError, InputError, OutputError
from prelight.relighting.bounced_layer import read_bounced
from prelight.relighting.environment import EnvironmentRelighter
from prelight.relighting.layer import EnvironmentLayer
from prelight.storage.bake import Bake
from prelight.storage.chunks import DTYPES, ArraySpec, ChunkRecord, chunk_key, encode, open_chunk
from prelight.storage.manifest import FORMAT, NAME, VERSION, LayerRecord, Manifest, SceneRecord

from .disk import RESOLUTION, TOLERANCE, copy, quick_bake, rewrite_manifest, tree
from .scenes import ball_on_floor

INSPECTED = {"receivers", "triangles", "layers"}
INSPECTED_LAYER = {"kind", "basis_lights", "coefficients", "bytes", "seconds", "rays", "parameters"}


@pytest.fixture(scope="module")
def bake(tmp_path_factory) -> Bake:
    return quick_bake(tmp_path_factory.mktemp("bake") / "ball.prelight")


def some_values(dtype: str, shape: list[int], seed: int = 0) -> np.ndarray:
    """Numbers over the whole range of a type, its ends among them."""
    rng = np.random.default_rng(seed)
    if dtype == "float32":
        values = rng.normal(size=shape).astype(np.float32)
        values.flat[0] = np.float32(-1e-40)  # a subnormal
        return values
    limits = np.iinfo(dtype)
    values = rng.integers(limits.min, limits.max, size=shape, dtype=dtype, endpoint=True)
    values.flat[0] = limits.max
    return values


def write_array(root: Path, name: str, values: np.ndarray, chunk_shape: list[int]) -> Manifest:
    """A manifest with one array besides the scene's, its chunks on disk under ``root``."""
    scene = {
        "scene/positions": np.zeros((3, 3), np.float32),
        "scene/normals": np.zeros((3, 3), np.float32),
        "scene/albedo": np.zeros((3, 3), np.float32),
        "scene/triangles": np.array([[0, 1, 2]], np.int32),
        "scene/material_of": np.zeros(1, np.int32),
    }
    arrays, chunks = {}, {}
    for key, array in (scene | {name: values}).items():
        shape = chunk_shape if key == name else list(array.shape)
        spec = arrays[key] = ArraySpec(shape=list(array.shape), dtype=array.dtype.name, chunk_shape=shape)
        for index in spec.chunk_indices():
            part = array[tuple(slice(i * c, (i + 1) * c) for i, c in zip(index, shape, strict=True))]
            data, record = encode(part, spec)
            path = root / chunk_key(key, index)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
            chunks[chunk_key(key, index)] = record
    manifest = Manifest(
        format=FORMAT,
        version=VERSION,
        settings={},
        scene=SceneRecord(name="none", digest="0" * 64, cameras=[], notes=[], materials=[{}]),
        layers={},
        arrays=arrays,
        chunks=chunks,
        software={},
    )
    for file, data in manifest.metadata().items():
        (root / file).write_bytes(data)
    (root / NAME).write_bytes(manifest.to_bytes())
    return manifest


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize(
    ("shape", "chunk_shape"),
    [
        ([7], [7]),
        ([7], [3]),
        ([8], [4]),
        ([5, 3], [2, 3]),
        ([5, 3], [2, 2]),
        ([3, 4, 5], [2, 3, 4]),
        ([1, 1], [4, 4]),
    ],
    ids=str,
)
def test_arrays_come_back(tmp_path, dtype, shape, chunk_shape):
    values = some_values(dtype, shape)
    write_array(tmp_path, "x", values, chunk_shape)
    read = Bake.open(tmp_path).array("x")
    assert (read.dtype, read.shape) == (np.dtype(dtype), tuple(shape))
    assert read.tobytes() == values.tobytes()
    with pytest.raises(ValueError, match="read-only"):
        read[...] = 0
    assert np.asarray(zarr.open_array(tmp_path / "x", mode="r")[...]).tobytes() == values.tobytes()


@settings(max_examples=40)
@given(
    shape=st.lists(st.integers(1, 9), min_size=1, max_size=4),
    chunk=st.lists(st.integers(1, 9), min_size=4, max_size=4),
    dtype=st.sampled_from(sorted(DTYPES)),
    seed=st.integers(0, 1000),
)
def test_any_shape_comes_back(tmp_path_factory, shape, chunk, dtype, seed):
    root = tmp_path_factory.mktemp("any")
    values = some_values(dtype, shape, seed)
    write_array(root, "deep/er/x", values, chunk[: len(shape)])
    assert Bake.open(root).array("deep/er/x").tobytes() == values.tobytes()


def test_a_chunk_is_little_endian_bytes_and_their_crc32c():
    """Known answers: 123456789 has the CRC-32C e3069283 (RFC 3720, B.4 gives the same polynomial)."""
    data, record = encode(
        np.frombuffer(b"123456789", np.uint8), ArraySpec(shape=[9], dtype="uint8", chunk_shape=[9])
    )
    assert data == b"123456789" + bytes.fromhex("839206e3")
    assert (record.size, record.crc32c) == (13, 0xE3069283)
    assert record.sha256 == hashlib.sha256(data).hexdigest()
    data, _ = encode(np.array([1, -2], np.int32), ArraySpec(shape=[2], dtype="int32", chunk_shape=[3]))
    assert data[:-4] == bytes.fromhex("01000000 feffffff 00000000")


def test_chunks_beyond_a_megabyte_and_maps(tmp_path):
    """The crc is taken in blocks; a whole chunk is mapped, not copied."""
    values = some_values("float32", [700, 1000])
    manifest = write_array(tmp_path, "x", values, [700, 1000])
    read = Bake.open(tmp_path).array("x")
    assert read.tobytes() == values.tobytes()
    base = read
    while isinstance(base, np.ndarray):
        base = base.base
    assert type(base.obj if isinstance(base, memoryview) else base).__name__ == "mmap"
    key = chunk_key("x", (0, 0))
    wrong = manifest.chunks[key].model_copy(update={"crc32c": 1})
    with pytest.raises(DamagedBakeError, match=key):
        open_chunk(tmp_path, key, manifest.arrays["x"], wrong)


def test_an_array_of_many_chunks_needs_few_open_files(tmp_path):
    values = some_values("int32", [300])
    write_array(tmp_path, "x", values, [1])
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (100, hard))
    try:
        bake = Bake.open(tmp_path)
        assert bake.array("x").tobytes() == values.tobytes()
        assert sum(1 for _ in bake.verify()) == 305
        if sys.version_info < (3, 13):  # where every map keeps a handle: as many panels would
            with pytest.raises(OutputError, match="ulimit -n"):
                _ = [bake.array("scene/positions") for _ in range(200)]
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.mark.filterwarnings("ignore:Object at manifest.json is not recognized")
def test_zarr_python_reads_every_array(bake):
    """Our bakes are Zarr v3: found from the group down, the same numbers, nothing missing."""
    group = zarr.open_group(bake.path, mode="r")
    assert sorted(group.group_keys()) == ["layers", "scene"]
    found = {name: member for name, member in group.members(max_depth=None) if isinstance(member, zarr.Array)}
    assert sorted(found) == sorted(bake.manifest.arrays)
    for name, array in found.items():
        assert array.metadata.zarr_format == 3
        values = bake.array(name)
        assert (array.shape, array.dtype) == (values.shape, values.dtype)
        np.testing.assert_array_equal(array[...], values, err_msg=name)
    assert group["layers/environment/tiles"]["00001"].shape[1:] == (16, 32)


def test_the_format_is_specified(bake, rng):
    """The reader that docs/bake-format.md gives in full, in place of somebody else's program."""
    text = (Path(__file__).resolve().parents[1] / "docs" / "bake-format.md").read_text(encoding="utf-8")
    code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.S))
    theirs: dict = {}
    exec(compile(code, "bake-format.md", "exec"), theirs)
    layer = EnvironmentLayer(bake)
    light = EnvironmentRelighter(layer, bake.receivers.albedo, read_bounced(bake, layer))
    cube = rng.random((6, RESOLUTION, RESOLUTION, 3)).astype(np.float32)
    light.set_cube(cube)
    radiance = theirs["radiance"](bake.path, cube, solid_angles(RESOLUTION))
    np.testing.assert_allclose(light.radiance, radiance, atol=1e-6 * radiance.max())
    for member in json.loads((bake.path / NAME).read_bytes()):
        assert f"`{member}`" in text


def test_two_bakes_are_the_same_bytes(bake, tmp_path):
    again = quick_bake(tmp_path / "again.prelight", replay=False)
    assert tree(again.path) == tree(bake.path)


def test_two_real_bakes_are_the_same_bytes(tmp_path):
    """P2: with the renderer, once with small launches and blocks and one thread for our own kernels."""
    scene = ball_on_floor()
    plan = plan_environment(scene, EnvironmentSettings(resolution=12))
    one = bake_planned(scene, tmp_path / "one.prelight", plan=plan)
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        two = bake_planned(scene, tmp_path / "two.prelight", plan=replace(plan, cuts=(Cut(5000, 9),)))
    finally:
        numba.set_num_threads(threads)
    assert plan.cuts[0].lanes > 5000
    assert plan.cuts[0].block > 9
    assert tree(one.path) == tree(two.path)
    assert one.seconds is None or one.seconds > 0  # a file system may not keep the note


def test_the_tree_holds_what_the_manifest_says_and_nothing_else(bake):
    files = {name for name, what in tree(bake.path).items() if what != "folder"}
    assert files == {NAME, *bake.manifest.metadata(), *bake.manifest.chunks}
    assert sum((bake.path / key).stat().st_size for key in bake.manifest.chunks) == bake.manifest.bytes_of("")
    for key, record in bake.manifest.chunks.items():
        data = (bake.path / key).read_bytes()
        assert (len(data), hashlib.sha256(data).hexdigest()) == (record.size, record.sha256), key


def test_the_manifest_is_canonical_and_knows_its_own_hash(bake):
    text = (bake.path / NAME).read_bytes()
    document = json.loads(text)
    assert text == json.dumps(document, sort_keys=True, indent=1).encode()
    digest = document.pop("sha256")
    assert (
        digest
        == hashlib.sha256(json.dumps(document, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
    )
    assert Manifest.open(bake.path).to_bytes() == text
    assert (
        document["settings"]["scene"] == document["scene"]["digest"] == ball_on_floor(side=6, rings=5).digest
    )


def test_no_time_or_place_is_in_the_bytes(bake, tmp_path):
    """What differs between two runs would show here: dates, seconds, folders, hosts."""
    other = quick_bake(tmp_path / "another name.prelight")
    assert (other.path / NAME).read_bytes() == (bake.path / NAME).read_bytes()
    assert not {"seconds", "date", "time", "host", "user"} & set(
        json.dumps(bake.manifest.model_dump()).split('"')
    )


def test_summary_has_the_names_that_programs_depend_on(bake):
    summary = json.loads(json.dumps(bake.summary(), allow_nan=False))
    assert summary.keys() >= INSPECTED
    (layer,) = summary["layers"]
    assert layer.keys() >= INSPECTED_LAYER
    scene = ball_on_floor(side=6, rings=5)
    assert summary["receivers"] == len(scene.positions)
    assert summary["triangles"] == len(scene.triangles)
    assert layer["kind"] == "environment"
    assert layer["basis_lights"] == 6 * RESOLUTION**2
    assert layer["coefficients"] == len(EnvironmentLayer(bake).rectangles)
    on_disk = sum(
        p.stat().st_size for p in (bake.path / "layers").rglob("*") if p.is_file() and p.name != "zarr.json"
    )
    assert layer["bytes"] == on_disk
    assert layer["rays"] > layer["coefficients"]
    assert layer["parameters"]["resolution"] == RESOLUTION
    assert layer["parameters"]["tolerance"] == TOLERANCE
    assert math.isclose(layer["parameters"]["epsilon"], TOLERANCE / summary["receivers"] ** 0.5)


def test_seconds_are_kept_beside_the_bytes(bake):
    before = tree(bake.path)
    bake.note_seconds(12.5)
    if bake.seconds is None:
        pytest.skip("this file system keeps no attributes")
    assert bake.seconds == 12.5
    assert tree(bake.path) == before
    for wrong in (b"", b"abc", b"\xff" * 8, b"\0" * 7 + b"\xff"):  # a NaN and a negative among them
        os.setxattr(bake.path / NAME, "user.prelight.seconds", wrong)
        assert bake.seconds is None
        assert bake.summary()["layers"][0]["seconds"] is None


def test_scene_arrays_come_back(bake):
    scene = ball_on_floor(side=6, rings=5)
    for name in ("positions", "normals", "albedo"):
        np.testing.assert_array_equal(getattr(bake.receivers, name), getattr(scene, name))
    np.testing.assert_array_equal(bake.triangles, scene.triangles)


def test_what_is_no_bake_is_said_so(tmp_path):
    (tmp_path / "file.prelight").write_bytes(b"x")
    (tmp_path / "empty.prelight").mkdir()
    for name in ("missing.prelight", "file.prelight", "n" * 300, "nul\0"):
        with pytest.raises(InputError, match=r"no such bake|expected a bake"):
            Bake.open(tmp_path / name)
    with pytest.raises(DamagedBakeError, match="never finished"):
        Bake.open(tmp_path / "empty.prelight")


def test_a_layer_of_another_kind_is_left_alone(bake, tmp_path):
    """A bake of a later version of the same format may hold layers that this one cannot light."""
    folder = copy(bake.path, tmp_path / "later.prelight")
    strange = LayerRecord(
        kind="hologram", basis_lights=1, coefficients=1, rays=0, parameters={}, statistics={}
    )
    rewrite_manifest(folder, lambda m: m["layers"].update(cloud=strange.model_dump()))
    later = Bake.open(folder)
    assert {layer["kind"] for layer in later.summary()["layers"]} == {"hologram", "environment"}
    assert len(EnvironmentLayer(later).rectangles) == later.layers["environment"].coefficients


def test_records_refuse_nonsense():
    for wrong in ({"size": 3}, {"crc32c": -1}, {"crc32c": 2**32}, {"sha256": "A" * 64}, {"extra": 1}):
        with pytest.raises(ValueError, match="validation error"):
            ChunkRecord.model_validate({"size": 8, "crc32c": 0, "sha256": "0" * 64} | wrong)

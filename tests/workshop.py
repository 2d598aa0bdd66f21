"""What a careless or hostile user brings to the command line, and what it must answer."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from prelight.images.formats import write_exr

from .disk import quick_bake
from .scenes import ball_on_floor


@dataclass(frozen=True)
class Answer:
    code: int
    out: str
    err: str


def assert_refusal(answer: Answer, code: int, *words: str) -> None:
    """One line that names what is wrong; nothing on standard output."""
    assert answer.code == code, answer
    assert answer.out == ""
    assert answer.err.startswith("prelight: ")
    assert answer.err.endswith("\n")
    line = answer.err[:-1]
    assert line.isprintable(), line
    assert len(line) <= 300
    assert "Traceback" not in line
    assert "fault of Prelight" not in line
    for word in words:
        assert word in line


def ply(rows: list[str], faces: list[str], *, vertices: int | None = None) -> bytes:
    head = ["ply", "format ascii 1.0", f"element vertex {len(rows) if vertices is None else vertices}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    return ("\n".join(head + rows + faces) + "\n").encode()


TRIANGLE = ["0 0 0", "1 0 0", "0 0 1"]
MESHES: dict[str, bytes | None] = {
    "missing.ply": None,
    "empty.ply": b"",
    "truncated.ply": ply(TRIANGLE, ["3 0 2 1"])[:-12],
    "header only.ply": ply(TRIANGLE, ["3 0 2 1"])[:40],
    "picture.ply": b"\x89PNG\r\n\x1a\n" + bytes(100),
    "text.ply": b"this is no mesh\n",
    "no faces.ply": ply(TRIANGLE, []),
    "no vertices.ply": ply([], []),
    "nan.ply": ply(["nan 0 0", *TRIANGLE[1:]], ["3 0 2 1"]),
    "infinite.ply": ply(["1e999 0 0", *TRIANGLE[1:]], ["3 0 2 1"]),
    "beyond.ply": ply(TRIANGLE, ["3 0 2 9"]),
    "negative.ply": ply(TRIANGLE, ["3 0 2 -1"]),
    "two billion.ply": ply(TRIANGLE, ["3 0 2 1"], vertices=2_000_000_000),
    "empty.glb": b"",
    "truncated.glb": b"glTF\x02\0\0\0\xff\0\0\0",
    "picture.glb": b"\x89PNG\r\n\x1a\n" + bytes(100),
    "mesh.obj": b"v 0 0 0\n",
    "mesh.xml": b"<scene/>",
    "esc\x1b[31m\n.ply": b"no mesh",
}


def make_workshop(folder: Path) -> Path:
    """Fill a folder with meshes, maps, cameras and rigs, most of them bad, and one good bake."""
    for name, data in MESHES.items():
        if data is not None:
            (folder / name).write_bytes(data)
    good = ball_on_floor(side=6, rings=5)
    rows = [" ".join(map(str, p)) for p in good.positions.tolist()]
    (folder / "ball.ply").write_bytes(
        ply(rows, ["3 " + " ".join(map(str, t)) for t in good.triangles.tolist()])
    )
    quick_bake(folder / "ball.prelight")
    _write_maps(folder)
    eye = {"eye": [2, 2, 2], "target": [0, 0, 0]}
    cameras = {
        "good.json": json.dumps(eye),
        "empty.json": "",
        "text.json": "a camera",
        "list.json": "[]",
        "deep.json": "[" * 100_000,
        "missing field.json": json.dumps({"eye": [1, 2, 3]}),
        "extra field.json": json.dumps(eye | {"lens": 1}),
        "nan.json": json.dumps(eye | {"eye": [float("nan"), 0, 0]}),
        "huge.json": json.dumps(eye | {"eye": [10**400, 0, 0]}),
        "two numbers.json": json.dumps(eye | {"eye": [1, 2]}),
        "words.json": json.dumps(eye | {"eye": "abc"}),
        "at target.json": json.dumps(eye | {"eye": [0, 0, 0]}),
        "field of view.json": json.dumps(eye | {"vertical_fov_deg": 180}),
        "not UTF-8.json": None,
    }
    for name, text in cameras.items():
        (folder / name).write_bytes(b"\xff\xfe\xff" if text is None else text.encode())
    rigs = {
        "good.toml": '[environment]\nmap = "good.exr"\nrotate_deg = 30\n',
        "stock.toml": '[environment]\nmap = "stock:sunset"\n',
        "empty.toml": "",
        "text.toml": "a rig",
        "unknown.toml": '[environment]\nmap = "good.exr"\nblur = 1\n',
        "unknown table.toml": '[lamp]\nwatts = 1\n[environment]\nmap = "good.exr"\n',
        "missing map.toml": '[environment]\nmap = "nowhere.exr"\n',
        "nan.toml": '[environment]\nmap = "good.exr"\nscale = nan\n',
        "negative.toml": '[environment]\nmap = "good.exr"\nscale = -1.0\n',
        "number.toml": "[environment]\nmap = 1\n",
        "nul.toml": '[environment]\nmap = "a\\u0000b"\n',
        "loop.toml": '[environment]\nmap = "loop.toml"\n',
        "deep.toml": "a = " + "[" * 50_000,
    }
    for name, text in rigs.items():
        (folder / name).write_text(text)
    os.mkfifo(folder / "pipe.ply")
    os.mkfifo(folder / "pipe.hdr")
    os.mkfifo(folder / "pipe.json")
    os.mkfifo(folder / "pipe.toml")
    (folder / "folder.ply").mkdir()
    (folder / "folder.hdr").mkdir()
    return folder


def _write_maps(folder: Path) -> None:
    sky = np.ones((8, 16, 3), np.float32)
    write_exr(folder / "good.exr", sky)
    good = (folder / "good.exr").read_bytes()
    lines = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n"
    maps = {
        "empty.hdr": b"",
        "text.hdr": b"a sky\n",
        "picture.hdr": b"\x89PNG\r\n\x1a\n" + bytes(100),
        "huge.hdr": lines + b"-Y 2000000000 +X 2000000000\n",
        "truncated.hdr": lines + b"-Y 8 +X 16\n" + bytes(100),
        "empty.exr": b"",
        "truncated.exr": good[: len(good) // 2],
        "text.exr": b"a sky\n",
        "square-ish.hdr": lines + b"-Y 7 +X 5\n" + bytes(7 * 5 * 4),
    }
    for name, data in maps.items():
        (folder / name).write_bytes(data)
    for name, value in (("nan", np.nan), ("negative", -1.0), ("infinite", np.inf)):
        where = good.replace(np.float32(1).tobytes(), np.float32(value).tobytes())
        if where == good:  # compressed, or halves: let the library write it
            where = _exr_with(folder, value)
        (folder / f"{name}.exr").write_bytes(where)


def _exr_with(folder: Path, value: float) -> bytes:
    import OpenEXR

    pixels = np.ones((8, 16, 3), np.float32)
    pixels[3, 4] = value
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    path = folder / "made.exr"
    with OpenEXR.File(header, {"RGB": OpenEXR.Channel(pixels)}) as file:
        file.write(str(path))
    data = path.read_bytes()
    path.unlink()
    return data

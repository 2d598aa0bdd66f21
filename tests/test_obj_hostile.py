"""OBJ and MTL from strangers: confined, mutated, and made to be slow."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from prelight.errors import InputError
from prelight.material import GREY
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene

from .corpus import faults, in_child
from .obj_files import SQUARE, outcome, png


def escapes(secret: Path) -> list[str]:
    """Ways to name a file outside the folder of the scene."""
    up, full = f"../{secret.name}", str(secret)
    plain = [
        up,
        f"./{up}",
        f"a/../{up}",
        f"a/b/../../{up}",
        f"../../{secret.parent.name}/{secret.name}",
        full,
    ]
    plain += [f"/{full}", f"//localhost{full}", f"/proc/self/root{full}", f"~/{up}", f"{up}/.", f"{up}//"]
    plain += [f"link/{secret.name}", "direct", "loop", "hard/../" + up, "../root-x/" + secret.name]
    plain += [f"file:{full}", f"file://{full}", f"FILE:///{full}", f"http://127.0.0.1{full}", f"C:{full}"]
    plain += [text.replace("/", "\\") for text in (up, f"./{up}", full, f"a/../{up}")]
    plain += [up.replace("..", "%2e%2e"), up.replace("/", "%2f"), up.replace("..", "%252e%252e")]
    plain += [up.replace("..", ".%2e"), up.replace("/", "\u2215"), up.replace("..", "\uff0e\uff0e")]
    plain += ["/dev/zero", "/dev/stdin", "/etc/passwd", "pipe", ".", "..", "a", f"{up}\u202etxt", "x" * 5000]
    return [*plain, f"-s 1 {up}", f"-o {up}"]


def test_L5_nothing_outside_the_folder_is_opened(tmp_path: Path) -> None:
    root, secret = tmp_path / "root", tmp_path / "secret.mtl"
    (root / "a" / "b").mkdir(parents=True)
    (tmp_path / "root-x").mkdir()
    for path in (secret, tmp_path / "root-x" / secret.name):
        path.write_bytes(b"newmtl m\nKd 1 0 0\n")
    os.symlink("..", root / "link")
    os.symlink("../secret.mtl", root / "direct")
    os.symlink("loop", root / "loop")
    os.mkfifo(root / "pipe")
    (root / "ok.mtl").write_text("newmtl m\nmap_Kd absent.png\n")
    path = root / "scene.obj"
    scene = b"mtllib ok.mtl\n" + SQUARE + b"usemtl m\nf 1/1 2/2 3/3\n"
    path.write_bytes(scene)
    load_scene(path)  # whatever is imported late is imported now
    names = escapes(secret)
    assert len(names) >= 40

    def load() -> None:
        for name in names:
            path.write_bytes(scene.replace(b"ok.mtl", name.encode()))
            assert load_scene(path).materials[0].colour == GREY, name
            for statement in ("map_Kd", "map_Ke"):
                (root / "ok.mtl").write_text(f"newmtl m\n{statement} {name}\n", encoding="utf-8")
                path.write_bytes(scene)
                assert not load_scene(path).textures, name

    idle = in_child(lambda: None, root).growth
    assert faults(in_child(load, root), path, idle) == []


SEEDS = (
    SQUARE + b"mtllib m.mtl\nusemtl m\nf 1/1/1 2/2/1 3/3/1 4/4/1\ng a b\ns 1\nf -1 -2 -3\n# end \\\nl 1 2\n",
    b"\xef\xbb\xbfv 0 0 0 1 1 1\r\nv 1 0 0 1\r\nv 1e0 1. .5\r\nf 1 2 \\\r\n3\r\nusemtl a b\r\nf 3//2 2// 1/\r\n",
)
LIBRARY = (
    b"newmtl m\nKd .5 .5 .5\nKs 1 1 1\nNs 50\nd 0.5\nillum 2\nmap_Kd -s 1 2 -o 0 0 t.png\nPr .5\nTf 1\nNi 2"
)


def mutations(seed: int, count: int) -> list[tuple[bytes, bytes, bytes]]:
    """Scenes, libraries and textures with bytes flipped, cut out, doubled, swapped for others, or cut off."""
    rng = np.random.default_rng(seed)
    tokens = [b"-1", b"0", b"99999999999", b"nan", b"1e999", b"/", b"//", b"\\\n", b"\n", b"\r", b"f ", b"v "]
    tokens += [b"usemtl ", b"mtllib ", b"\0", b"\xff", b"#", b"-s ", b" " * 99, b"../", b"map_Kd "]
    picture = png(rng.integers(0, 255, (9, 7, 3)))

    def mutated(text: bytes) -> bytes:
        for _ in range(rng.integers(0, 4)):
            at, end = sorted(rng.integers(0, len(text) + 1, 2).tolist())
            match rng.integers(5):
                case 0:
                    text = text[:at] + bytes(rng.integers(0, 256, 1, np.uint8)) + text[at + 1 :]
                case 1:
                    text = text[:at] + text[end:]
                case 2:
                    text = text[:end] + text[at:]
                case 3:
                    text = text[:at] + tokens[rng.integers(len(tokens))] + text[at:]
                case _:
                    text = text[:end]
        return text

    return [(mutated(SEEDS[k % 2]), mutated(LIBRARY), mutated(picture)) for k in range(count)]


def test_L4_mutations_give_a_scene_or_one_line(tmp_path: Path) -> None:
    count = int(os.environ.get("PRELIGHT_MUTATIONS", "600"))
    seen = set()
    for k, (scene, library, picture) in enumerate(mutations(7, count)):
        path = tmp_path / str(k) / "a.obj"
        path.parent.mkdir()
        path.write_bytes(scene or b"\n")
        (path.parent / "m.mtl").write_bytes(library)
        (path.parent / "t.png").write_bytes(picture)
        start = time.process_time()
        found = outcome(path)
        assert time.process_time() - start < 2, k
        lines = found.notes if isinstance(found, Scene) else (str(found),)
        assert all(line.isprintable() and len(line) < 900 for line in lines), k
        if isinstance(found, Scene):
            seen.add("textured" if found.textures else "plain")
        else:
            assert str(path) in str(found), k
            seen.add("refused")
    assert seen == {"refused", "plain", "textured"}


WORDS = [
    "v",
    "vt",
    "vn",
    "f",
    "usemtl",
    "mtllib",
    "1",
    "2",
    "-1",
    "0.5",
    "1/1",
    "1//1",
    "#",
    "\\",
    "\n",
    "\r",
    "é",
]


@given(st.lists(st.sampled_from(WORDS)))
@example(["f", "1", "1", "1"])
def test_any_words_give_a_scene_or_one_line(tmp_path_factory, words: list[str]) -> None:
    path = tmp_path_factory.getbasetemp() / "words.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + " ".join(words), encoding="utf-8")
    found = outcome(path)
    assert str(found).isprintable() if isinstance(found, InputError) else len(found.triangles)


@pytest.mark.parametrize(
    "what", ["line", "names", "faces", "polygon", "library", "spiral", "materials", "libraries"]
)
def test_large_files_take_no_more_than_their_share(tmp_path: Path, what: str) -> None:
    """A few megabytes each, made to be slow: refused or read within two seconds and 256 MB."""
    turns = np.linspace(1, 40, 250)
    spiral = np.stack([turns * np.cos(turns), turns * np.sin(turns), 0 * turns], axis=1)
    ring = np.concatenate([spiral, spiral[::-1] * 1.01])[:256]
    text = {
        "line": SQUARE + b"f " + b"1 2 3 " * 300_000,
        "names": SQUARE + b"".join(b"usemtl m%d\n" % k for k in range(100_000)) + b"f 1 2 3\n",
        "faces": SQUARE + b"f 1 2 3\n" * 400_000,
        "polygon": SQUARE + b"f 1 2 3 4 2\n" * 60_000,
        "materials": SQUARE + b"".join(b"usemtl %d\nf 1 2 3\n" % k for k in range(100_000)),
        "libraries": b"".join(b"mtllib a%d b c d e\n" % k for k in range(100_000)) + SQUARE + b"f 1 2 3\n",
        "library": b"mtllib m.mtl\n" * 1000 + SQUARE + b"usemtl m\nf 1 2 3\n",
        "spiral": b"".join(b"v %g %g %g\n" % tuple(p) for p in ring)
        + (b"f " + b" ".join(b"%d" % k for k in range(1, 257)) + b"\n") * 100,
    }[what]
    path = tmp_path / "a.obj"
    path.write_bytes(text)
    (tmp_path / "m.mtl").write_bytes(b"newmtl m\n" + b"Kd 1 1 1\n" * 300_000)
    idle = in_child(lambda: None, tmp_path).growth
    outcome = in_child(lambda: load_scene(path), tmp_path)
    assert faults(outcome, path, idle) == []

"""Radiance's programs on a scene of ours: points, a sky of a picture and a sun, matrices. Z is up there: (x, −z, y)."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from prelight.lighting.environment import Environment
from prelight.scene.geometry import Scene

ROWS = (30, 30, 24, 24, 18, 12, 6, 1)  # patches of the sky, 12° high, from the horizon up (Tregenza 1987)
KLEMS = ((0, 5, 1), (5, 15, 8), (15, 25, 16), (25, 35, 20), (35, 45, 24), (45, 55, 24), (55, 65, 24), (65, 75, 16),
         (75, 90, 12))  # fmt: skip
_ELEVATIONS, _AZIMUTHS = 181, 361
_SUNS = 4  # patches that share a sun, as gendaymtx has it

_SKY_CAL = """\
elevation = Asin(Dz) * 57.29577951308232;
azimuth = Atan2(Dx, Dy) * 57.29577951308232;
same(r,g,b) = r;
"""


class Radiance:
    """The programs in ``folder``/bin (the pyradiance package), run in ``work``."""

    def __init__(self, folder: Path, work: Path) -> None:
        its = folder.resolve()
        self.work = work
        work.mkdir(parents=True, exist_ok=True)
        self._environment = os.environ | {
            "PATH": f"{its / 'bin'}:{os.environ['PATH']}",
            "RAYPATH": f".:{its / 'lib'}",
        }

    def run(self, *command: str, given: bytes | None = None) -> bytes:
        """What a program writes."""
        told = subprocess.run(
            command, cwd=self.work, env=self._environment, input=given, capture_output=True, check=False
        )
        if told.returncode:
            raise RuntimeError(f"{command[0]}: {told.stderr.decode()[-400:]}")
        return told.stdout

    def octree(self, name: str, *files: str) -> None:
        (self.work / name).write_bytes(self.run("oconv", *files))

    def write_scene(self, scene: Scene, name: str) -> None:
        """Triangles as polygons, each material a plastic without gloss."""
        out = [
            f"void plastic m{k} 0 0 5 {m.colour[0]:.6g} {m.colour[1]:.6g} {m.colour[2]:.6g} 0 0\n"
            for k, m in enumerate(scene.materials)
        ]
        corners = turned(scene.positions.astype(np.float64))[scene.triangles].reshape(-1, 9)
        for k, (material, values) in enumerate(
            zip(scene.material_of.tolist(), corners.tolist(), strict=True)
        ):
            out.append(f"m{material} polygon p{k} 0 0 9 {' '.join(f'{x:.9g}' for x in values)}\n")
        (self.work / name).write_text("".join(out))

    def write_sky(self, environment: Environment, name: str) -> None:
        """The map as a picture of every direction, and discs as sources."""
        up, around = np.linspace(-90, 90, _ELEVATIONS), np.linspace(-180, 180, _AZIMUTHS)
        e, a = np.meshgrid(np.radians(up), np.radians(around), indexing="ij")
        z_up = np.stack([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)], axis=-1).reshape(-1, 3)
        seen = environment.with_discs([]).radiance_along(back(z_up).astype(np.float32))
        stem = Path(name).stem
        for k, colour in enumerate("rgb"):
            lines = " ".join(f"{x:.6g}" for x in seen[:, k])
            head = f"2\n-90 90 {_ELEVATIONS}\n-180 180 {_AZIMUTHS}\n"
            (self.work / f"{stem}_{colour}.dat").write_text(head + lines + "\n")
        (self.work / "sky.cal").write_text(
            _SKY_CAL + "take_r(r,g,b) = r;\ntake_g(r,g,b) = g;\ntake_b(r,g,b) = b;\n"
        )
        files = " ".join(f"{stem}_{colour}.dat" for colour in "rgb")
        out = [
            f"void colordata seen\n9 take_r take_g take_b {files} sky.cal elevation azimuth\n0\n0\n",
            "seen glow glowing 0 0 4 1 1 1 0\nglowing source all 0 0 4 0 0 1 360\n",
        ]
        for k, disc in enumerate(environment.discs):
            x, y, z = turned(np.array([disc.direction]))[0]
            radius = np.radians(0.2666)
            r, g, b = disc.total / (2 * np.pi * (1 - np.cos(radius)))
            out.append(f"void light l{k} 0 0 3 {r:.6g} {g:.6g} {b:.6g}\n")
            out.append(f"l{k} source s{k} 0 0 4 {x:.8f} {y:.8f} {z:.8f} {2 * np.degrees(radius):.6f}\n")
        (self.work / name).write_text("".join(out))


def turned(a: np.ndarray) -> np.ndarray:
    """To Radiance's axes."""
    return np.stack([a[:, 0], -a[:, 2], a[:, 1]], axis=1)


def back(a: np.ndarray) -> np.ndarray:
    """From them."""
    return np.stack([a[:, 0], a[:, 2], -a[:, 1]], axis=1)


def points_text(origins: np.ndarray, normals: np.ndarray) -> bytes:
    lines = np.concatenate([turned(origins), turned(normals)], axis=1)
    return ("\n".join(" ".join(f"{x:.7g}" for x in line) for line in lines.tolist()) + "\n").encode()


def patch_of(z_up: np.ndarray) -> np.ndarray:
    """Ground 0, then rows of patches from the horizon; azimuth from +Y towards +X, the first patch around it."""
    height = np.degrees(np.arcsin(np.clip(z_up[:, 2], -1, 1)))
    row = np.minimum(height // 12, 7).astype(int)
    count = np.array(ROWS)[np.maximum(row, 0)]
    first = 1 + np.concatenate([[0], np.cumsum(ROWS)[:-1]])[np.maximum(row, 0)]
    turn = np.arctan2(z_up[:, 0], z_up[:, 1]) / (2 * np.pi)
    return np.where(height < 0, 0, first + np.floor(turn * count + 0.5).astype(int) % count)


def sky_vector(environment: Environment) -> np.ndarray:
    """(146, 3): mean radiance of each patch; a sun on the four nearest, nearer ones more, as gendaymtx has it."""
    n = 400_000
    i = np.arange(n) + 0.5
    z, around = 1 - 2 * i / n, np.pi * (1 + 5**0.5) * i
    d = np.stack([np.sqrt(1 - z * z) * np.cos(around), np.sqrt(1 - z * z) * np.sin(around), z], axis=1)
    patch = patch_of(d)
    seen = environment.with_discs([]).radiance_along(back(d).astype(np.float32)).astype(np.float64)
    many = np.bincount(patch, minlength=146)
    out = np.stack([np.bincount(patch, seen[:, c], minlength=146) / many for c in range(3)], axis=1)
    middle = np.stack([np.bincount(patch, d[:, c], minlength=146) for c in range(3)], axis=1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    angle = 4 * np.pi * many / n
    for disc in environment.discs:
        near = middle[1:] @ turned(np.array([disc.direction]))[0]
        few = 1 + np.argsort(-near)[:_SUNS]
        weight = 1 / (1.002 - near[few - 1])
        out[few] += (weight / weight.sum() / angle[few])[:, None] * disc.total
    return out


def klems_directions() -> tuple[np.ndarray, np.ndarray]:
    """Middle directions (145, 3) of the basis about +Z, and projected solid angles."""
    d, angle = [], []
    for low, high, count in KLEMS:
        s0, s1 = np.sin(np.radians([low, high]))
        theta = 0.0 if low == 0 else np.radians((low + high) / 2)
        turn = 2 * np.pi * np.arange(count) / count
        d += [(np.sin(theta) * np.cos(t), np.sin(theta) * np.sin(t), np.cos(theta)) for t in turn]
        angle += [np.pi * (s1**2 - s0**2) / count] * count
    return np.array(d), np.array(angle)


def write_matrix(path: Path, matrix: np.ndarray, colours: int = 3) -> None:
    """As Radiance reads matrices."""
    rows, columns = matrix.shape[:2]
    wide = matrix if matrix.ndim == 3 else np.repeat(matrix[..., None], colours, axis=2)
    head = f"#?RADIANCE\nNROWS={rows}\nNCOLS={columns}\nNCOMP={colours}\nFORMAT=ascii\n\n"
    lines = (" ".join(f"{x:.7g}" for x in row) for row in wide.reshape(rows, -1).tolist())
    path.write_text(head + "\n".join(lines) + "\n")


def read_matrix(told: bytes, shape: Sequence[int]) -> np.ndarray:
    """The numbers behind a header, if there is one."""
    text = told.split(b"\n\n", 1)[-1] if told.startswith(b"#?") else told
    return np.array(text.split(), np.float64).reshape(shape)

"""Small environment layers of random transfer, written plainly in the layout of a bake, and decoded as plainly."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prelight.bases.cube_map import solid_angles
from prelight.bases.quadtree import roots, split
from prelight.camera import Camera
from prelight.encoding.sparse_tiles import GROUP, PANEL, TILE, encode_panel, groups_of, panels_of_parcel
from prelight.lighting.disc import Disc
from prelight.material import Material
from prelight.relighting.environment import EnvironmentRelighter
from prelight.relighting.layer import EnvironmentLayer
from prelight.storage.bake import Bake
from prelight.storage.chunks import ArraySpec, chunk_key, encode
from prelight.storage.manifest import (
    FORMAT,
    NAME,
    VERSION,
    CameraRecord,
    LayerRecord,
    Manifest,
    SceneRecord,
)

from .scenes import grid

LAYER = "layers/environment"
EYE = Camera((0.3, 2.0, 2.5), (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class RandomZone:
    """Rows, leaves, and T = scales · bytes of them."""

    rows: np.ndarray
    leaves: np.ndarray  # (C, 5)
    columns: np.ndarray  # (C, channels, rows) uint8
    scales: np.ndarray  # (C, channels) float32

    @property
    def transfer(self) -> np.ndarray:
        return self.columns * self.scales[:, :, None].astype(np.float64)


def random_leaves(rng: np.random.Generator, resolution: int, *, splits: float) -> np.ndarray:
    """Leaves of six quadtrees in Z-order, nodes split with a probability until they are texels."""
    nodes = roots(resolution)
    is_open = np.ones(len(nodes), bool)
    while is_open.any():
        is_open &= (rng.random(len(nodes)) < splits) & (nodes[:, 3] * nodes[:, 4] > 1)
        parts, flags = [], []
        for node, opened in zip(nodes, is_open, strict=True):
            inside = split(node[None])[0] if opened else node[None]
            parts.append(inside)
            flags.append(np.full(len(inside), opened))
        nodes, is_open = np.concatenate(parts), np.concatenate(flags)
    return nodes


def random_zone(
    rng: np.random.Generator, rows: np.ndarray, *, channels: int, resolution: int, splits: float
) -> RandomZone:
    """Blocks of zeros among the bytes, so that tiles are missing."""
    leaves = random_leaves(rng, resolution, splits=splits)
    C = len(leaves)
    columns = rng.integers(0, 256, (C, channels, len(rows)), dtype=np.uint8)
    blocks = rng.random((-(-C // TILE), channels, groups_of(len(rows)))) < 0.6
    columns *= blocks.repeat(TILE, 0)[:C].repeat(GROUP, 2)[:, :, : len(rows)]
    return RandomZone(rows, leaves, columns, (rng.random((C, channels)) / 255).astype(np.float32))


def random_zones(
    rng: np.random.Generator,
    rows: int,
    channels: tuple[int, ...],
    *,
    resolution: int,
    splits: float = 0.85,
) -> list[RandomZone]:
    """All rows, in random order, dealt to zones of these channels."""
    parts = np.array_split(rng.permutation(rows).astype(np.int32), len(channels))
    return [
        random_zone(rng, part, channels=c, resolution=resolution, splits=splits)
        for part, c in zip(parts, channels, strict=True)
    ]


def _layer_arrays(zones: list[RandomZone]) -> dict[str, np.ndarray]:
    arrays, order, table, q = {}, [], [], 0
    for zone in zones:
        C, channels, n = zone.columns.shape
        groups = groups_of(n)
        order.append(np.append(zone.rows, np.full(groups * GROUP - n, -1, np.int32)))
        size = int(panels_of_parcel(groups, channels)) * PANEL
        starts = range(0, C, size)
        table.append((groups, channels, C, len(starts)))
        for start in starts:
            part = slice(start, start + size)
            panels = [
                encode_panel(zone.columns[part][k : k + PANEL])
                for k in range(0, len(zone.columns[part]), PANEL)
            ]
            tiles = np.concatenate([t for t, _ in panels])
            arrays[f"tiles/{q:05d}"] = tiles if len(tiles) else np.zeros((1, TILE, GROUP), np.uint8)
            arrays[f"present/{q:05d}"] = np.stack([p for _, p in panels])
            arrays[f"rectangles/{q:05d}"] = zone.leaves[part]
            arrays[f"scales/{q:05d}"] = zone.scales[part]
            q += 1
    return arrays | {"order": np.concatenate(order), "zones": np.array(table, np.int32)}


def write_bake(
    folder: Path,
    zones: list[RandomZone],
    *,
    resolution: int,
    rows: int,
    picture: tuple[int, int] | None = None,
) -> Bake:
    """A bake of a square of vertices (or of the pixels of a picture of one) with this layer."""
    side = 4 if picture else int(np.ceil(rows**0.5))
    positions, triangles = grid(side)
    if not picture:
        positions = np.resize(positions, (rows, 3))  # a few more vertices in the same places, or fewer
        triangles = triangles[(triangles < rows).all(axis=1)]
    arrays = {
        "scene/positions": positions,
        "scene/normals": np.tile(np.float32([0, 1, 0]), (len(positions), 1)),
        "scene/albedo": np.linspace(0.1, 0.9, 3 * len(positions), dtype=np.float32).reshape(-1, 3),
        "scene/triangles": triangles,
        "scene/material_of": np.zeros(len(triangles), np.int32),
    } | {f"{LAYER}/{name}": values for name, values in _layer_arrays(zones).items()}
    specs, chunks = {}, {}
    for name, values in arrays.items():
        spec = ArraySpec(shape=list(values.shape), dtype=values.dtype.name, chunk_shape=list(values.shape))
        specs[name], key = spec, chunk_key(name, (0,) * values.ndim)
        data, chunks[key] = encode(values, spec)
        (folder / key).parent.mkdir(parents=True, exist_ok=True)
        (folder / key).write_bytes(data)
    parameters: dict[str, Any] = {
        "resolution": resolution, "tolerance": 0.01, "epsilon": 1e-4, "samples_per_side": 3,
        "zones": len(zones), "receivers": "pixels" if picture else "vertices",
    }  # fmt: skip
    if picture:
        parameters |= {"width": picture[0], "height": picture[1], "samples": 4}
    has_eye = any(zone.columns.shape[1] == 3 for zone in zones)
    eye = CameraRecord(name="eye", view={k: _listed(v) for k, v in EYE.to_dict().items()})
    layer = LayerRecord(
        kind="environment", basis_lights=6 * resolution**2, coefficients=sum(len(z.leaves) for z in zones),
        rays=1, camera=eye if has_eye else None, parameters=parameters, statistics={"nonzero_share": 0.5},
    )  # fmt: skip
    scene = SceneRecord(
        name="square", digest="0" * 64, cameras=[], notes=[],
        materials=[{k: _listed(v) for k, v in Material().to_dict().items()}],
    )  # fmt: skip
    manifest = Manifest(
        format=FORMAT, version=VERSION, settings={}, scene=scene, layers={"environment": layer},
        arrays=specs, chunks=chunks, software={},
    )  # fmt: skip
    (folder / NAME).write_bytes(manifest.to_bytes())
    return Bake.open(folder)


def _listed(value: object) -> object:
    return list(value) if isinstance(value, tuple) else value


def plainly(bake: Bake, zones: list[RandomZone], cube: np.ndarray, *, rows: int) -> np.ndarray:
    """Eq. 8 in float64, from the bytes: radiance (rows, 3)."""
    omega = solid_angles(cube.shape[1]).astype(np.float64)[..., None]
    radiance = np.full((rows, 3), np.nan)
    for zone in zones:
        light = np.array(
            [
                (cube[f, i : i + h, j : j + w] * omega[i : i + h, j : j + w]).sum(axis=(0, 1))
                for f, i, j, h, w in zone.leaves
            ]
        )
        T = np.broadcast_to(zone.transfer, (len(light), 3, len(zone.rows)))
        B = np.einsum("kc,kcr->rc", light, T)
        if zone.columns.shape[1] == 1:
            B *= bake.receivers.albedo[zone.rows]
        radiance[zone.rows] = B
    return radiance


R, ROWS = 13, 331  # odd, so that nodes split unevenly; eleven groups, the last not full
PICTURE = (20, 12)
CHANNELS = {"one": (1,), "viewed": (3,), "several": (1, 3, 1, 1, 3, 1), "pixels": (3, 3)}


@dataclass(frozen=True)
class Sample:
    """A bake, what is in it, and its layer opened."""

    bake: Bake
    zones: list[RandomZone]
    layer: EnvironmentLayer
    rows: int = ROWS

    def relighter(self) -> EnvironmentRelighter:
        albedo = None if self.layer.picture_size else self.bake.receivers.albedo
        return EnvironmentRelighter(self.layer, albedo)

    def plainly(self, cube: np.ndarray) -> np.ndarray:
        return plainly(self.bake, self.zones, cube, rows=self.rows)


def make_sample(folder: Path, kind: str) -> Sample:
    """Zones of the channels that ``CHANNELS`` says, at a resolution of ``R``."""
    picture = PICTURE if kind == "pixels" else None
    rows = math.prod(PICTURE) if picture else ROWS
    zones = random_zones(np.random.default_rng(7), rows, CHANNELS[kind], resolution=R)
    bake = write_bake(folder, zones, resolution=R, rows=rows, picture=picture)
    return Sample(bake, zones, EnvironmentLayer(bake), rows)


def hdr(rng: np.random.Generator) -> np.ndarray:
    """A cube of random light over a wide range."""
    return (rng.random((6, R, R, 3)) ** 6 * 50).astype(np.float32)


def assert_like(found: np.ndarray, expected: np.ndarray, *, within: float = 1e-6) -> None:
    """Alike, to a share of the largest value expected."""
    assert np.isfinite(expected).all()
    np.testing.assert_allclose(found, expected, rtol=0, atol=within * expected.max())


def discs_at(step: float, brightness: float) -> list[Disc]:
    """Four discs, of all sizes and edges, further on and brighter."""
    return [
        Disc.at(10 + step, 5, radius_deg=11, radiance=(brightness, 0.5, 0), softness=0.4),
        Disc.at(93 + 2 * step, -60, radius_deg=25, radiance=(0, brightness, 2)),
        Disc.at(-100, 40 + step, radius_deg=0.5, radiance=(90, 80, 60 * brightness), softness=1.0),
        Disc.at(180, 0, radius_deg=80, radiance=(0.1, 0.1, 0.3), softness=0.7),
    ]

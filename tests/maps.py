"""Maps of radiance that tests share, and where their pixels look: written out anew, not from ``layouts``."""

from __future__ import annotations

import numpy as np

from prelight.bases import cube_map

SHAPES = {"latlong": (64, 128, 3), "angular": (90, 90, 3), "cross": (128, 96, 3), "cube": (6, 32, 32, 3)}
OTHER_FACES = {"horizontal-cross": (96, 128, 3), "strip": (32, 192, 3), "tall-strip": (192, 32, 3)}
RESOLUTIONS = (1, 2, 3, 17, 64, 255)


def turned(d: np.ndarray, degrees: float) -> np.ndarray:
    """R_y(degrees)·d, counter-clockwise seen from above."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    x, y, z = np.moveaxis(d, -1, 0)
    return np.stack([c * x + s * z, y, c * z - s * x], axis=-1)


def areas(resolution: int) -> np.ndarray:
    edges = np.linspace(-1.0, 1.0, resolution + 1)
    return cube_map.rectangle_solid_angles(edges, edges)


def energy(cube: np.ndarray) -> np.ndarray:
    return np.einsum("fijk,ij->k", cube.astype(np.float64), areas(cube.shape[1]))


def texel_directions(resolution: int) -> np.ndarray:
    texels = np.arange(6 * resolution**2)
    return (
        cube_map.texel_directions(texels, resolution).reshape(6, resolution, resolution, 3).astype(np.float64)
    )


def disc_only(pixels: np.ndarray) -> np.ndarray:
    """An angular map as probes are: black where a pixel's centre is outside the disc."""
    side = (2.0 * np.arange(len(pixels)) + 1.0) / len(pixels) - 1.0
    return np.where((np.hypot(side[:, None], side[None, :]) <= 1.0)[..., None], pixels, 0.0).astype(
        np.float32
    )


def textured(layout: str, rng: np.random.Generator) -> np.ndarray:
    pixels = rng.lognormal(0.0, 1.5, SHAPES[layout]).astype(np.float32)
    return disc_only(pixels) if layout == "angular" else pixels


def latlong_direction(row: int, column: int) -> np.ndarray:
    polar, azimuth = np.pi * (row + 0.5) / 64, 2.0 * np.pi * ((column + 0.5) / 128 - 0.5)
    return np.array([np.sin(polar) * np.sin(azimuth), np.cos(polar), -np.sin(polar) * np.cos(azimuth)])


def angular_direction(row: int, column: int) -> np.ndarray:
    p, q = (2 * column + 1) / 90 - 1, 1 - (2 * row + 1) / 90
    r = np.hypot(p, q)
    return np.array([np.sin(np.pi * r) * p / r, np.sin(np.pi * r) * q / r, -np.cos(np.pi * r)])


def cross_direction(row: int, column: int) -> np.ndarray:
    s, t = (2 * (column % 32) + 1) / 32 - 1, (2 * (row % 32) + 1) / 32 - 1
    d = {
        (0, 1): (s, 1, -t), (1, 0): (-1, -t, -s), (1, 1): (s, -t, -1),
        (1, 2): (1, -t, s), (2, 1): (s, -1, t), (3, 1): (s, t, 1),
    }[row // 32, column // 32]  # fmt: skip
    return np.array(d) / np.linalg.norm(d)


def upright_direction(face: str, s: float, t: float) -> np.ndarray:
    """A point of a picture of a face as seen from the middle: s to the right, t down."""
    d = {
        "right": (1, -t, s), "left": (-1, -t, -s), "top": (s, 1, -t), "bottom": (s, -1, t),
        "front": (s, -t, -1), "back": (-s, -t, 1),
    }[face]  # fmt: skip
    return np.array(d) / np.linalg.norm(d)


def face_direction(layout: str, row: int, column: int) -> np.ndarray:
    order = ["right", "left", "top", "bottom", "front", "back"]
    across = ["left", "front", "right", "back"]
    i, j = row // 32, column // 32
    face = {"strip": order[j % 6], "tall-strip": order[i % 6]}.get(layout)
    if face is None:
        face = {(0, 1): "top", (2, 1): "bottom"}.get((i, j)) or across[j]
    return upright_direction(face, (2 * (column % 32) + 1) / 32 - 1, (2 * (row % 32) + 1) / 32 - 1)


DIRECTION = {"latlong": latlong_direction, "angular": angular_direction, "cross": cross_direction}
# Ordinary places and awkward ones: next to a pole, at the rim of the disc, in corners and on edges of faces.
SUNS = [
    ("latlong", 20, 77), ("latlong", 40, 3), ("latlong", 0, 50), ("latlong", 63, 0), ("latlong", 31, 47),
    ("angular", 44, 60), ("angular", 20, 22), ("angular", 45, 88), ("angular", 3, 52),
    ("cross", 45, 40), ("cross", 70, 50), ("cross", 32, 0), ("cross", 127, 63), ("cross", 63, 95), ("cross", 5, 45),
]  # fmt: skip


BEYOND = [(20, 77), (44, 60), (45, 40)]

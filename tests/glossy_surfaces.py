"""Glossy materials and their lobes, for tests of gloss."""

from __future__ import annotations

import dataclasses

import numpy as np

from prelight.baking.exitant import ExitantPart
from prelight.bases import exitant
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.relighting.exitant import Exitant, StoredExitant
from prelight.scene.geometry import Scene
from prelight.transport.vantage import vantage_points

PHONG = Material(
    name="phong", colour=(0.2, 0.2, 0.2),
    bsdf={"type": "phong", "exponent": 10.0, "diffuse_reflectance": 0.2, "specular_reflectance": 0.5},
)  # fmt: skip
GOLD = Material(
    name="gold", colour=(0.9, 0.7, 0.4),
    bsdf={"type": "roughconductor", "alpha": 0.3, "specular_reflectance": {"type": "rgb", "value": [0.9, 0.7, 0.4]}},
)  # fmt: skip
LACQUER = Material(name="lacquer", colour=(0.6, 0.1, 0.1), roughness=0.5, specular=1.0)


def made_of(scene: Scene, material: Material) -> Scene:
    colours = np.broadcast_to(np.float32(material.colour), scene.positions.shape).copy()
    return dataclasses.replace(scene, materials=(material,), albedo=colours)


def phong_values(power: float = 10.0) -> exitant.BrdfValues:
    """The highlight alone, of reflectance 1, at the nodes of a table."""
    incident, z, azimuth = exitant.nodes()
    sine = np.sqrt(1 - z * z)
    mirrored = np.cos(incident)[:, None, None] * z[:, None] - (
        np.sin(incident)[:, None, None] * sine[:, None] * np.cos(azimuth)
    )
    lobe = (power + 2) / (2 * np.pi) * np.maximum(mirrored, 0) ** power
    return np.repeat(lobe[..., None], 3, axis=3)


def opened(scene: Scene, part: ExitantPart) -> Exitant:
    """As if it had been on disk."""
    lobes, seen = part.lobes, part.seen
    stored = StoredExitant(
        part.rows, seen.counts, seen.texels, seen.codes, lobes.lobe_of, lobes.tables, lobes.highlights,
        lobes.matt, lobes.strength, lobes.reflectance,
    )  # fmt: skip
    return Exitant(stored, positions=scene.positions, normals=scene.normals, albedo=scene.albedo)


def part_of(scene: Scene, order: int = 8) -> ExitantPart:
    occluders = Occluders(scene.positions, scene.triangles)
    part = ExitantPart.of(scene, occluders, order=order, origins=vantage_points(scene, occluders))
    assert part is not None
    return part

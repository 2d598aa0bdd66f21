"""Tests of the tests: six faults put in on purpose, each found by the very check that the honest build passes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from prelight.checking.comparison import compare
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.scene.mesh import textured
from prelight.transport import gathering, hemisphere, hit_colour, lamps
from prelight.transport.bounces import bounced
from prelight.transport.direct import DiffuseTransfer
from prelight.transport.exact import integrate
from prelight.transport.gathering import Gathering
from prelight.transport.lamps import SphereLamps, lamp_light
from prelight.transport.path_traced_light import LightWithVariance, LitScene
from prelight.transport.visibility import Visibility

from .scenes import ball_on_floor, grid, scene_of

_ROWS = 32  # of a tile, where there must be many

# ---- checks: each answers whether what was built is right -------------------------------------------------------


def chamber(albedo: float) -> Scene:
    """A closed box seen from within."""
    sides = []
    for k in range(3):
        p, t = grid(6, size=2.0, height=-1.0)
        sides += [(np.roll(p, k, axis=1), t), (np.roll(-p * (1, 1, -1), k, axis=1).astype(np.float32), t)]
    return scene_of(*sides, albedo=albedo)


def traced(scene: Scene, *, rays: int = 1024) -> Gathering:
    return Gathering.trace(scene, Occluders(scene.positions, scene.triangles), rays=rays)


def furnace_is_right() -> bool:
    """A closed room that shines everywhere: within 0.1 % of Le / (1 − ρ)."""
    scene = chamber(0.8)
    D = np.ones((len(scene.positions), 1, 1), np.float32)
    E = D + bounced(traced(scene, rays=64), D).indirect
    return bool(np.abs(E * (1 - 0.8) - 1).max() < 1e-3)


def lamps_are_right() -> bool:
    """The sum of 64 lamps against the path tracer: no bias beyond 0.2 % and noise, and it detects one of 1 %."""
    scene = ball_on_floor(side=21, rings=8)
    rng = np.random.default_rng(5)
    centres = rng.uniform((-1.2, 1.3, -1.2), (1.2, 1.6, 1.2), (64, 3)).astype(np.float32)
    power = np.ones((64, 3), np.float32)
    of = SphereLamps(centres, np.zeros(64, np.float32), power)
    rows = np.flatnonzero(scene.positions[:, 1] < 0.01)[::4].astype(np.int32)
    occluders = Occluders(scene.positions, scene.triangles)
    E = lamp_light(occluders, scene.positions[rows], scene.normals[rows], lamps=of).sum(axis=1)
    found = LitScene(scene, lamps=of).light(rows, bounces=0, samples=4096)
    figures = compare(E, found.direct, found.direct_variance)
    return abs(figures.signed_mean) <= max(figures.detectable_bias, 2e-3) < 0.01


def shadows_are_right() -> bool:
    """No light of a sky gets into a closed room."""
    scene = chamber(0.5)
    away = np.float32(0.77) * scene.positions + np.float32([0.03, 0.05, 0.02])  # no ray goes along an edge
    inside = DiffuseTransfer(Occluders(scene.positions, scene.triangles), away, scene.normals)
    return not integrate(inside, np.ones((6, 8, 8, 1), np.float32)).any()


def niche() -> Scene:
    """A floor and a wall with a chequered texture each, dark and light, under an open sky."""
    wall, triangles = grid(25, size=2.0)
    wall = np.stack(
        [wall[:, 0], -wall[:, 2] + 1.02, wall[:, 1] - 1.0], axis=1
    )  # stands behind the floor, faces +Z
    scene = scene_of(grid(25, size=2.0), (wall.astype(np.float32), triangles))
    side = np.indices((64, 64)).sum(axis=0) // 8 % 2
    texture = np.repeat(np.where(side, 200, 90).astype(np.uint8)[..., None], 3, axis=2)
    uv = np.tile((grid(25, size=2.0)[0][:, [0, 2]] + 1) / 2, (2, 1)).astype(np.float32)
    materials = (Material(colour=(1.0, 0.9, 0.8), colour_texture=0),)
    tint = np.tile(np.float32([1.0, 0.9, 0.8]), (len(uv), 1))
    return textured(replace(scene, materials=materials, textures=(texture,), uv=uv, tint=tint))


LAMP = SphereLamps(np.float32([[0.3, 0.9, 0.2]]), np.float32([0.1]), np.float32([[9, 9, 9]]))


@cache
def bounced_reference() -> tuple[np.ndarray, LightWithVariance]:
    scene = niche()
    rows = np.flatnonzero(np.abs(scene.positions[:, 0]) < 0.9)[::11].astype(np.int32)
    return rows, LitScene(scene, lamps=LAMP).light(rows, samples=16384)


def bounce_is_right() -> bool:
    """One textured corner under a lamp: the light that bounces, against the path tracer within its stated bounds."""
    scene = niche()
    occluders = Occluders(scene.positions, scene.triangles)
    D = lamp_light(occluders, scene.positions, scene.normals, lamps=LAMP, rays=64)
    indirect = bounced(traced(scene), D).indirect[:, 0]
    rows, found = bounced_reference()
    figures = compare(indirect[rows], found.indirect, found.indirect_variance)
    return (
        abs(figures.signed_mean) < 0.015 and figures.mean_difference < 0.04 and figures.detectable_bias < 0.01
    )


def samples_are_independent() -> bool:
    """Receivers in the same place: their errors, summed over all, are those of as many independent estimates.

    Σ z² over 32 lights has 32 degrees of freedom; beyond 66 is one in 2,500.
    """
    roof = grid(9, size=3.0, height=1.0)
    floor = grid(32, size=1e-3)
    scene = scene_of(floor, (roof[0], roof[1][:, ::-1]), albedo=1.0)
    light = np.random.default_rng(8).normal(size=(len(scene.positions), 32, 1)).astype(np.float32)
    here = slice(0, 1024)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gathering, "_RAYS_AT_ONCE", _ROWS * 16)
        estimates = traced(scene, rays=16).bounce(light)[here, :, 0]
    occluders = Occluders(scene.positions, scene.triangles)
    truth = Gathering.trace(scene, occluders, rays=1024, seed=99).bounce(light)[here, :, 0].mean(axis=0)
    z = (estimates.mean(axis=0) - truth) / (estimates.std(axis=0) / 32)
    return bool((z**2).sum() < 66)


# ---- faults -----------------------------------------------------------------------------------------------------


def too_much_energy(patch: pytest.MonkeyPatch) -> None:
    honest = gathering.LightBlocks.multiplied

    def multiplied(self, starts, columns, values, out):
        honest(self, starts, columns, values, out)
        out *= np.float32(1.01)

    patch.setattr(gathering.LightBlocks, "multiplied", multiplied)


def a_light_forgotten(patch: pytest.MonkeyPatch) -> None:
    honest = lamps._Pairs.sums

    def sums(self, seen):
        found = honest(self, seen)
        found[:, 37] = 0
        return found

    patch.setattr(lamps._Pairs, "sums", sums)


def leaking_shadows(patch: pytest.MonkeyPatch) -> None:
    honest = Visibility._launch

    def launch(self, directions):
        state = honest(self, directions).copy()
        chance = np.random.default_rng(1).random(len(state))
        state[(state == 2) & (chance < 0.005)] = 3
        return state

    patch.setattr(Visibility, "_launch", launch)


def a_cosine_forgotten(patch: pytest.MonkeyPatch) -> None:
    """Directions spread evenly over the hemisphere, and not weighted."""
    honest = hemisphere.HemisphereRays._directions

    def directions(self, receiver, ray):
        import drjit as dr

        d = honest(self, receiver, ray)
        z = d.z * d.z  # of a cosine-distributed direction cos² is uniform
        across = dr.sqrt(dr.maximum(1 - z * z, 0)) / dr.maximum(dr.sqrt(d.x * d.x + d.y * d.y), 1e-9)
        return type(d)(d.x * across, d.y * across, z)

    patch.setattr(hemisphere.HemisphereRays, "_directions", directions)


def a_cosine_forgotten_by_lamps(patch: pytest.MonkeyPatch) -> None:
    honest = lamps._through_cone

    def through_cone(mi, centre, radius, origin, normal, numbers):
        import drjit as dr

        d, length, weight = honest(mi, centre, radius, origin, normal, numbers)
        return d, length, weight / dr.maximum(dr.dot(normal, d), 1e-3)

    patch.setattr(lamps, "_through_cone", through_cone)


def a_texture_read_as_linear(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(hit_colour, "_LINEAR", np.arange(256, dtype=np.float32) / 255)


def numbers_used_again(patch: pytest.MonkeyPatch) -> None:
    """Every tile of rows begins with the same random numbers."""
    honest = hemisphere.HemisphereRays._directions

    def directions(self, receiver, ray):
        return honest(self, receiver % _ROWS, ray)

    patch.setattr(hemisphere.HemisphereRays, "_directions", directions)


FAULTS = {
    "energy x 1.01": (too_much_energy, furnace_is_right),
    "one light in 64 dropped": (a_light_forgotten, lamps_are_right),
    "a shadow leak of 0.5 %": (leaking_shadows, shadows_are_right),
    "cosine missing in gathering": (a_cosine_forgotten, bounce_is_right),
    "cosine missing in lamps": (a_cosine_forgotten_by_lamps, lamps_are_right),
    "texture in the wrong space": (a_texture_read_as_linear, bounce_is_right),
    "random numbers reused across tiles": (numbers_used_again, samples_are_independent),
}


@pytest.mark.parametrize("check", dict.fromkeys(check for _, check in FAULTS.values()))
def test_the_honest_build_passes(check: Callable[[], bool]) -> None:
    assert check()


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found(fault: str, monkeypatch) -> None:
    put_in, check = FAULTS[fault]
    put_in(monkeypatch)
    assert not check()

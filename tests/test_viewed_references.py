"""Image relighting against references: exact integration, the path tracer, and faults that must not pass."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from prelight.checking.comparison import Figures, compare
from prelight.material import Material
from prelight.rays.mitsuba import Occluders
from prelight.rays.surfaces import SurfaceScene
from prelight.scene.geometry import Scene
from prelight.transport.exact import integrate, integrate_exactly
from prelight.transport.eye import SeenPoints, vertex_points
from prelight.transport.path_tracing import path_traced_view
from prelight.transport.viewed import ViewedTransfer

from .scenes import ball_on_floor, grid, plane, scene_of, sphere
from .test_viewed import LACQUER, WHITE, all_texels, made_of, seen_by, viewed


@pytest.fixture(scope="module")
def white_ball() -> Scene:
    return made_of(ball_on_floor(side=15, rings=10), WHITE)


def gentle_sky(R: int) -> np.ndarray:
    """Bright above and to one side, coloured; smooth, so that texels are as good as areas."""
    d, _ = all_texels(R)
    glow = np.exp(4 * (d @ np.float32([0.6, 0.64, 0.48]) - 1))
    sky = np.stack(
        [0.3 + 3.0 * glow, 0.4 + 2.5 * glow + 0.2 * d[:, 1], 0.6 + 1.5 * glow + 0.3 * d[:, 1]], axis=1
    )
    return sky.reshape(6, R, R, 3).astype(np.float32)


def test_maps_share_their_rays_and_dark_lights_cost_none(white_ball):
    R = 12
    cube = gentle_sky(R)
    half = cube.copy()
    half[2] = 0
    heard = []
    points = seen_by(white_ball)
    transfer = viewed(made_of(white_ball, LACQUER), points)
    both = integrate(transfer, np.concatenate([cube, half], axis=-1), report=heard.append)
    np.testing.assert_allclose(both[:, :3], integrate(transfer, cube), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(both[:, 3:], integrate(transfer, half), rtol=1e-5, atol=1e-6)
    assert heard[-1] == 1
    traced = []
    trace = transfer.trace
    transfer.trace = lambda d, **options: traced.append(len(d)) or trace(d, **options)
    integrate(transfer, half)
    assert sum(traced) == 5 * R * R
    # The diffuse function is the same integral: brute force over all lights, without occlusion on a plane.
    flat = plane(3)
    d, omega = all_texels(R)
    ours = integrate_exactly(flat.positions, flat.triangles, flat.normals, receivers=np.int32([4]), cube=cube)
    expected = (np.maximum(d[:, 1], 0) * omega) @ cube.reshape(-1, 3) / math.pi
    np.testing.assert_allclose(ours[0], expected, rtol=1e-5)


@pytest.fixture(scope="module")
def glossy() -> Scene:
    """A ball of brushed gold on a floor with a sheen, textured in half of its triangles."""
    ball, floor = sphere(28), grid(12, size=3.0)
    scene = scene_of(ball, floor)
    texture = np.random.default_rng(5).integers(60, 255, (8, 8, 3), dtype=np.uint8)
    gold = Material(colour=(0.9, 0.6, 0.3), roughness=0.5, metallic=1.0)
    materials = (
        gold,
        Material(colour=(0.8, 0.8, 0.8), colour_texture=0, roughness=0.6, specular=1.0),
        Material(),
    )
    of = np.concatenate([np.zeros(len(ball[1])), 1 + (np.arange(len(floor[1])) % 2)]).astype(np.int32)
    uv = np.ascontiguousarray(scene.positions[:, [0, 2]])
    scene = dataclasses.replace(scene, uv=uv, textures=(texture,))
    return made_of(scene, *materials, of=of)


@pytest.fixture(scope="module")
def by_paths(glossy) -> tuple[SeenPoints, np.ndarray, np.ndarray]:
    points = seen_by(glossy, width=32, height=18)
    mean, variance = path_traced_view(SurfaceScene(glossy), points, cube=gentle_sky(32), samples=1024)
    return points, mean, variance


def against(paths, radiance: np.ndarray) -> Figures:
    _, mean, variance = paths
    return compare(radiance, mean, variance)


def fails(figures: Figures) -> bool:
    return not figures.is_unbiased or figures.z_rejected_share > 0.0025


def test_pixels_agree_with_the_path_tracer(glossy, by_paths):
    radiance = integrate(viewed(glossy, by_paths[0]), gentle_sky(32))
    figures = against(by_paths, radiance)
    assert figures.z_rejected_share <= 0.0025
    assert figures.is_unbiased, figures
    assert figures.noise < 0.02
    assert figures.detectable_bias < 0.0075
    assert fails(against(by_paths, radiance * 1.01)), "one percent goes unnoticed"


def test_vertices_agree_with_the_path_tracer(glossy):
    """Where rays do not begin within an offset of something else, and at no grazing angle."""
    points = vertex_points(glossy, (0.4, 1.7, 2.0))
    position = glossy.positions
    toward = np.float32(points.eye) - position
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    clear = (toward * glossy.normals).sum(axis=1) > 0.15
    clear &= np.linalg.norm(position[:, [0, 2]], axis=1) > 0.1
    clear &= np.abs(position[:, [0, 2]]).max(axis=1) < 1.4
    clear &= (points.material(glossy) == 0) | (glossy.positions[:, 1] == 0)
    chosen = np.flatnonzero(clear)[::5].astype(np.int32)
    reference = path_traced_view(
        SurfaceScene(glossy), points, cube=gentle_sky(32), receivers=chosen, samples=1024, seed=1
    )
    figures = compare(integrate(viewed(glossy, points, chosen), gentle_sky(32)), *reference)
    assert figures.z_rejected_share <= 0.0025
    assert figures.is_unbiased, figures


@pytest.mark.parametrize("fault", ["cosine", "frame", "texture", "shadow", "sample"])
def test_seeded_faults_are_caught(glossy, by_paths, fault, monkeypatch):
    import mitsuba as mi

    scene, points = glossy, by_paths[0]
    if fault == "cosine":
        plain = mi.BSDFPtr.eval
        monkeypatch.setattr(
            mi.BSDFPtr, "eval", lambda self, ctx, si, wo, active: plain(self, ctx, si, wo, active) / abs(wo.z)
        )
    elif fault == "frame":  # of the light alone: it turns about the normal
        transfer = viewed(scene, points)
        monkeypatch.setattr(
            mi.SurfaceInteraction3f, "to_local", lambda si, d: mi.Frame3f(si.sh_frame.n).to_local(d)
        )
    elif fault == "texture":
        raw = Material(
            bsdf={
                "type": "twosided",
                "one": {
                    "type": "principled", "roughness": 0.6, "eta": 1.5,
                    "base_color": {"type": "stored_texture", "index": 0, "raw": True},
                },
            }
        )  # fmt: skip
        scene = dataclasses.replace(glossy, materials=(glossy.materials[0], raw, glossy.materials[2]))
    elif fault == "shadow":
        nothing = Occluders(glossy.positions + np.float32(100), glossy.triangles)
        transfer = ViewedTransfer(nothing, SurfaceScene(scene), points)
    else:
        points = dataclasses.replace(points, triangle=points.triangle.copy())
        points.triangle[::2, 3] = -1  # one sample of four lost in every second pixel
    if fault not in ("shadow", "frame"):
        transfer = viewed(scene, points)
    assert fails(against(by_paths, integrate(transfer, gentle_sky(32))))

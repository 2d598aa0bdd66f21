"""Views against what a pinhole camera must see, in closed form."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from prelight.camera import Camera
from prelight.drawing import view as view_module
from prelight.drawing.view import View, draw, sample_offsets
from prelight.errors import InputError

WIDE = Camera(eye=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), vertical_fov_deg=90.0)  # x, y at z = 0 fill ±5
TILTED = Camera(eye=(2.0, 3.0, 4.0), target=(0.3, -0.2, 0.1), up=(0.2, 1.0, 0.1), vertical_fov_deg=50.0)
SIZE = {"width": 160, "height": 90}


def triangle(*corners: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    return np.array(corners, np.float32), np.array([[0, 1, 2]], np.int32)


def closed(rings: int = 24, segments: int = 48) -> tuple[np.ndarray, np.ndarray]:
    """A unit sphere without a hole or a double vertex."""
    theta = np.linspace(0, np.pi, rings + 1)[1:-1]
    phi = np.arange(segments) * (2 * np.pi / segments)
    t, p = (x.ravel() for x in np.meshgrid(theta, phi, indexing="ij"))
    ring = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=1)
    positions = np.concatenate([ring, [(0, 1, 0), (0, -1, 0)]])
    i, j = np.divmod(np.arange((rings - 2) * segments), segments)
    a, b = i * segments + j, i * segments + (j + 1) % segments
    j = np.arange(segments)
    north, south = np.full(segments, len(ring)), np.full(segments, len(ring) + 1)
    last = (rings - 2) * segments
    faces = [
        np.stack([a, b, b + segments], 1), np.stack([a, b + segments, a + segments], 1),
        np.stack([north, (j + 1) % segments, j], 1), np.stack([south, last + j, last + (j + 1) % segments], 1),
    ]  # fmt: skip
    return positions.astype(np.float32), np.concatenate(faces).astype(np.int32)


def rays(camera: Camera, width: int, height: int) -> np.ndarray:
    """Unnormalised directions (H, W, 3) through the pixels' centres, one unit deep, written out anew."""
    half = np.tan(np.radians(camera.vertical_fov_deg) / 2)
    back = np.subtract(camera.eye, camera.target)
    back /= np.linalg.norm(back)
    right = np.cross(camera.up, back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * half * width / height
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * half
    return x[None, :, None] * right + y[:, None, None] * up - back


def centroid(coverage: np.ndarray) -> tuple[float, float]:
    y, x = np.indices(coverage.shape) + 0.5
    return float((coverage * x).sum() / coverage.sum()), float((coverage * y).sum() / coverage.sum())


@pytest.mark.parametrize("point", [(0.0, 0.0), (4.0, 2.5), (-7.0, 1.0), (1.3, -4.1)])
def test_a_point_lands_where_a_pinhole_puts_it(point: tuple[float, float]) -> None:
    x, y = point
    mesh = triangle((x - 0.2, y - 0.2, 0), (x + 0.2, y - 0.2, 0), (x, y + 0.4, 0))
    found = centroid(View(*mesh, camera=WIDE, width=320, height=180).coverage)
    assert found == pytest.approx((160 + x * 18, 90 - y * 18), abs=0.05)


@pytest.mark.parametrize("samples", [1, 2, 3, 4])
def test_coverage_adds_up_to_the_area(samples: int) -> None:
    mesh = triangle((-3.1, -2.7, 0), (3.3, -1.9, 0), (0.4, 3.6, 0))
    coverage = View(*mesh, camera=WIDE, **SIZE, samples_per_side=samples).coverage
    area = 0.5 * (6.4 * 6.3 - 0.8 * 3.5) * 9**2
    assert coverage.sum() == pytest.approx(area, rel=0.01 / samples)
    assert coverage.min() == 0
    assert coverage.max() == 1


@pytest.mark.parametrize(("samples", "error"), [(2, 0.078), (3, 0.045), (4, 0.031)])
def test_edges_of_any_slope_are_even(samples: int, error: float) -> None:
    """RMS against the tent filter's integral over all slopes, and no slope much worse."""
    many, few = sample_offsets(64) - 0.5, sample_offsets(samples) - 0.5
    slopes = np.radians(np.arange(0, 180, 3))
    normals = np.stack([np.cos(slopes), np.sin(slopes)])
    shifts = np.linspace(-1.3, 1.3, 60)[:, None, None]
    wrong = (many @ normals < shifts).mean(axis=1) - (few @ normals < shifts).mean(axis=1)
    assert np.sqrt((wrong**2).mean()) < error
    assert np.sqrt((wrong**2).mean(axis=0)).max() < 1.6 * error


def test_samples_lie_about_the_middle_of_the_pixel() -> None:
    for n in range(1, 9):
        offsets = sample_offsets(n)
        assert offsets.mean(axis=0) == pytest.approx([0.5, 0.5], abs=1e-12)
        assert len(np.unique(offsets[:, 0].round(9))) == len(np.unique(offsets[:, 1].round(9))) == n * n


def test_interpolation_is_correct_in_perspective() -> None:
    """A steep plane whose radiance is its world position must show where each ray meets it."""
    positions = np.array([(-9, -3, 2), (9, -3, 2), (9, 1.5, -60), (-9, 1.5, -60)], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    picture = draw(positions, triangles, positions, WIDE, **SIZE, samples_per_side=1)
    d = rays(WIDE, **SIZE)
    normal = np.cross(positions[1] - positions[0], positions[2] - positions[0]).astype(float)
    t = ((positions[0] - WIDE.eye) @ normal) / np.where(d @ normal == 0, np.nan, d @ normal)
    expected = WIDE.eye + t[..., None] * d
    seen = picture.coverage == 1
    assert seen.sum() > 3000
    assert np.abs(picture.linear[seen] - expected[seen]).max() < 2e-4
    affine = (expected[60, 80, 2] + expected[70, 80, 2]) / 2
    assert abs(affine - expected[65, 80, 2]) > 0.1  # the test would see the difference


def test_a_plane_under_the_eye_reaches_the_horizon_and_no_further() -> None:
    """Its triangles cross the near plane and lie behind the eye: no smear, no hole."""
    camera = Camera(eye=(0.0, 1.0, 0.0), target=(0.0, 1.0, -1.0), vertical_fov_deg=60.0)
    positions = np.array([(-3e4, 0, 3e4), (3e4, 0, 3e4), (3e4, 0, -3e4), (-3e4, 0, -3e4)], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    picture = draw(positions, triangles, positions, camera, **SIZE, samples_per_side=1)
    assert (picture.coverage[:45] == 0).all()
    assert (picture.coverage[45:] == 1).all()
    d = rays(camera, **SIZE)[45:]
    expected = camera.eye - d / d[..., 1:2]
    assert np.abs(picture.linear[45:] - expected).max() < 0.02  # of 3e4 in float32


def test_what_is_behind_the_eye_or_nearer_than_the_near_plane_is_not_drawn() -> None:
    behind = triangle((-9, -9, 6), (9, -9, 6), (0, 9, 6))
    assert not View(*behind, camera=WIDE, **SIZE).coverage.any()
    too_near = triangle((-9, -9, 4.996), (9, -9, 4.996), (0, 9, 4.996))
    assert not View(*too_near, camera=WIDE, **SIZE).coverage.any()
    just_right = triangle((-9, -9, 4.99), (9, -9, 4.99), (0, 9, 4.99))
    assert (View(*just_right, camera=WIDE, **SIZE).coverage == 1).all()


def test_the_near_plane_cuts_where_it_stands() -> None:
    """A floor half a millimetre under a leaning eye whose near plane is at one: seen at slopes below a half."""
    camera = Camera(eye=(0, 0, 0), target=(0, 0, -1), up=(0.7, 1.0, 0.0), vertical_fov_deg=90.0)
    positions = np.array([(-9, -5e-4, 9), (9, -5e-4, 9), (9, -5e-4, -9), (-9, -5e-4, -9)], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    coverage = View(positions, triangles, camera=camera, **SIZE).coverage
    slope = rays(camera, **SIZE)[..., 1]
    pixel = 2 / SIZE["height"]
    assert (coverage[(slope < -2 * pixel) & (slope > -0.5 + 2 * pixel)] == 1).all()
    assert (coverage[slope < -0.5 - 2 * pixel] == 0).all()
    assert (coverage[slope > 2 * pixel] == 0).all()


def test_the_nearer_of_two_crossing_triangles_shows() -> None:
    """Planes z = x and z = −x meet along x = 0; seen from +z, each hides the other on its own side."""
    positions = np.array([(-4, -4, -4), (4, -4, 4), (4, 4, 4), (-4, 4, -4)], np.float32)
    positions = np.concatenate([positions, positions * (-1, 1, 1)])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    radiance = np.repeat(np.array([(1, 0, 0), (0, 1, 0)], np.float32), 4, axis=0)
    camera = Camera(eye=(0, 0, 12), target=(0, 0, 0), vertical_fov_deg=30.0)
    picture = draw(positions, np.concatenate([faces, faces + 4]), radiance, camera, **SIZE).linear
    assert np.abs(picture[30:60, 85:100] - (1, 0, 0)).max() < 1e-6
    assert np.abs(picture[30:60, 60:75] - (0, 1, 0)).max() < 1e-6


def test_the_order_of_triangles_does_not_matter(rng: np.random.Generator) -> None:
    """Not even where two lie in one place."""
    positions = rng.normal(size=(90, 3)).astype(np.float32)
    positions = np.concatenate([positions, positions[:30]])
    triangles = rng.permutation(np.arange(120)).reshape(40, 3).astype(np.int32)
    triangles = np.concatenate([triangles, [[0, 1, 2], [90, 91, 92]]]).astype(np.int32)
    radiance = rng.random((120, 3), np.float32)
    first = draw(positions, triangles, radiance, TILTED, **SIZE).linear
    second = draw(positions, rng.permutation(triangles), radiance, TILTED, **SIZE).linear
    assert first.any()
    assert np.array_equal(first, second)


@pytest.mark.parametrize("camera", [TILTED, Camera((0.0, 0.0, 1.001), (0.0, 0.0, 0.0))])
def test_a_closed_body_has_no_cracks_and_keeps_a_constant(camera: Camera) -> None:
    positions, triangles = closed()
    light = np.full_like(positions, 0.7)
    picture = draw(positions, triangles, light, camera, **SIZE, background=(0.7, 0.7, 0.7))
    assert np.abs(picture.linear - 0.7).max() < 1e-6
    d = rays(camera, **SIZE)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    past_centre = np.linalg.norm(np.cross(d, camera.eye), axis=-1)
    inside = past_centre < 0.9  # of 1, well within the silhouette
    assert inside.sum() > 100
    assert (picture.coverage[inside] == 1).all()


@pytest.mark.parametrize("side", [45, 90])
def test_samples_exactly_on_a_shared_edge_are_seen(side: int) -> None:
    """Triangles of different sizes meet along the diagonals, where the pixels' centres lie."""
    positions = np.array([(0, 0, 0), (9, 9, 0), (-7, 7, 0), (-8, -8, 0), (6.1, -6.1, 0)], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]], np.int32)
    for order in (triangles, triangles[:, [1, 2, 0]], triangles[:, ::-1]):
        seen = View(positions, order, camera=WIDE, width=side, height=side, samples_per_side=1)
        assert (seen.coverage == 1).all()


def test_both_sides_of_a_triangle_show() -> None:
    positions, triangles = triangle((-3, -3, 0), (3, -3, 0), (0, 3, 0))
    front = draw(positions, triangles, positions, WIDE, **SIZE).linear
    back = draw(positions, triangles[:, ::-1], positions, WIDE, **SIZE).linear
    assert front.any()
    assert np.abs(front - back).max() < 1e-6


def test_the_background_is_asked_for_the_right_directions() -> None:
    asked = []

    def sky(directions: np.ndarray) -> np.ndarray:
        asked.append(directions)
        return directions

    mesh = triangle((-1, -1, 0), (1, -1, 0), (0, 1, 0))
    picture = draw(*mesh, np.zeros((3, 3), np.float32), TILTED, **SIZE, background=sky)
    expected = rays(TILTED, **SIZE)
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    empty = picture.coverage == 0
    assert np.abs(picture.linear[empty] - expected[empty]).max() < 1e-6
    edge = (picture.coverage > 0) & (picture.coverage < 1)
    through = (1 - picture.coverage[edge])[:, None] * expected[edge]
    assert np.abs(picture.linear[edge] - through).max() < 1e-6
    assert sum(map(len, asked)) == (picture.coverage < 1).sum() < picture.coverage.size


def test_a_view_shows_what_draw_shows_again_and_again(rng: np.random.Generator) -> None:
    positions, triangles = closed()
    view = View(positions, triangles, camera=TILTED, **SIZE)
    for _ in range(2):
        radiance = rng.random(positions.shape, np.float32)
        once = draw(positions, triangles, radiance, TILTED, **SIZE, background=(0.1, 0.2, 0.3))
        again = view.draw(radiance, background=(0.1, 0.2, 0.3))
        assert np.array_equal(once.linear, again.linear)
        assert np.array_equal(once.coverage, view.coverage)


def test_strips_and_threads_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    positions, triangles = closed()
    whole = draw(positions, triangles, positions, TILTED, **SIZE).linear
    monkeypatch.setattr(view_module, "_SAMPLES_AT_ONCE", 1)
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        assert len(View(positions, triangles, camera=TILTED, **SIZE)._strips) == 12
        assert np.array_equal(draw(positions, triangles, positions, TILTED, **SIZE).linear, whole)
    finally:
        numba.set_num_threads(threads)


def test_nothing_to_see_is_background() -> None:
    none = np.empty((0, 3), np.int32)
    picture = draw(np.zeros((1, 3), np.float32), none, np.zeros((1, 3)), WIDE, **SIZE, background=(1, 2, 3))
    assert (picture.linear == (1, 2, 3)).all()
    flat = triangle((0, 0, 0), (1, 1, 0), (2, 2, 0))
    assert not View(*flat, camera=WIDE, **SIZE).coverage.any()


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"width": 0}, "width: 0"),
        ({"height": 20_000}, "height: 20000"),
        ({"width": 3.5}, "width: 3.5"),
        ({"samples_per_side": 9}, "samples_per_side: 9"),
        ({"positions": np.zeros((3, 2), np.float32)}, r"positions: shape \(3, 2\)"),
        ({"positions": np.full((3, 3), np.nan, np.float32)}, "positions: some are not finite"),
        ({"triangles": np.array([[0, 1, 3]])}, "triangles: indices 0 to 3, expected 0 to 2"),
        ({"triangles": np.array([[0.0, 1.0, 2.0]])}, "triangles: "),
        ({"radiance": np.zeros((4, 3))}, r"radiance: shape \(4, 3\)"),
        ({"radiance": np.full((3, 3), np.inf)}, "radiance: some values"),
        ({"background": "blue"}, "background: 'blue'"),
        ({"background": lambda d: d[:, :2]}, "background: returned shape"),
        ({"background": lambda d: d * np.float32(np.nan)}, "background: returned values"),
    ],
)
def test_what_cannot_be_drawn_is_named(change: dict, complaint: str) -> None:
    positions, triangles = triangle((-1, -1, 0), (1, -1, 0), (0, 1, 0))
    given = {"positions": positions, "triangles": triangles, "radiance": positions, "camera": WIDE, **SIZE}
    with pytest.raises(InputError, match=f"^{complaint}"):
        draw(**{**given, **change})

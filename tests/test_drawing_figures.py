"""Figures for documents: the right pixel at the right place."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.bases.cube_map import face_coordinates
from prelight.bases.quadtree import roots, split
from prelight.drawing.figures import difference_picture, panels, save_figure
from prelight.drawing.plots import Axis, line_plot
from prelight.drawing.unfolded import unfolded_clusters
from prelight.errors import InputError, OutputError
from prelight.lighting.layouts import PICTURE_LAYOUTS, Faces


def quadtree(resolution: int, rng: np.random.Generator) -> np.ndarray:
    nodes, done = roots(resolution), []
    while len(nodes):
        deeper = (nodes[:, 3] > 1) & (rng.uniform(size=len(nodes)) < 0.7)
        done.append(nodes[~deeper])
        nodes, _ = split(nodes[deeper])
    return np.concatenate(done)


def cross_directions(pixels: int) -> tuple[np.ndarray, np.ndarray]:
    """Of each pixel of a vertical cross as ``docs/conventions.md`` describes it; and where there is none."""
    y, x = np.meshgrid(np.arange(4 * pixels) + 0.5, np.arange(3 * pixels) + 0.5, indexing="ij")
    row, column = (y // pixels).astype(int), (x // pixels).astype(int)
    s, t = 2 * (x / pixels - column) - 1, 1 - 2 * (y / pixels - row)  # to the right, up
    one = np.ones_like(s)
    of = {
        (0, 1): (s, one, t), (1, 0): (-one, t, -s), (1, 1): (s, t, -one), (1, 2): (one, t, s),
        (2, 1): (s, -one, -t), (3, 1): (s, -t, one),
    }  # fmt: skip
    d = np.zeros((*s.shape, 3))
    for (i, j), parts in of.items():
        here = (row == i) & (column == j)
        d[here] = np.stack(parts, axis=-1)[here]
    d[(row == 0) & (column == 1), 2] *= 1.0
    return d, ~d.any(axis=-1)


def test_faces_lie_as_in_a_vertical_cross(rng: np.random.Generator) -> None:
    """Each pixel shows the texel that its direction meets, between the lines."""
    cube = rng.uniform(0, 1, (6, 4, 4, 3)).astype(np.float32)
    whole = unfolded_clusters(roots(4), 4, cube=cube, face_pixels=64, exposure=0.0)
    d, nowhere = cross_directions(64)
    assert (whole[nowhere] > 90).all()  # white, and the grey of letters
    face, u, v = face_coordinates(np.where(nowhere[..., None], 1.0, d).reshape(-1, 3))
    column, row = (np.clip((x + 1) * 2, 0, 3).astype(int) for x in (u, v))
    texel = (face * 16 + row * 4 + column).reshape(nowhere.shape)
    inside = np.minimum(np.abs(u), np.abs(v)).reshape(nowhere.shape) < 0.9
    inside &= (np.maximum(np.abs(u), np.abs(v)) < 0.95).reshape(nowhere.shape) & ~nowhere
    for k in range(96):
        shown = whole[inside & (texel == k)]
        assert len(shown)
        assert (shown == shown[0]).all(), k


def test_each_cluster_has_its_outline(rng: np.random.Generator) -> None:
    leaves = quadtree(8, rng)
    picture = unfolded_clusters(leaves, 8, face_pixels=64)
    label = np.empty((6, 8, 8), int)
    for k, (f, r, c, h, w) in enumerate(leaves):
        label[f, r : r + h, c : c + w] = k
    cross = PICTURE_LAYOUTS["cross"]
    assert isinstance(cross, Faces)
    drawn = cross.faces(picture.astype(np.float32)).sum(axis=3) < 200
    # Lines of pixels through the middle of each row, and of each column, of texels.
    across = drawn.reshape(6, 8, 8, 8, 8)[:, :, 3]
    between = across[:, :, :-1, 7] | across[:, :, 1:, 0]
    assert np.array_equal(between, label[:, :, 1:] != label[:, :, :-1])
    down = drawn.reshape(6, 8, 8, 8, 8)[..., 3]
    between = down[:, :-1, 7] | down[:, 1:, 0]
    assert np.array_equal(between, label[:, 1:] != label[:, :-1])


@pytest.mark.parametrize("resolution", [1, 3, 100, 4096])
def test_any_resolution_fits(resolution: int) -> None:
    picture = unfolded_clusters(roots(resolution), resolution, face_pixels=32)
    assert picture.shape == (128, 96, 3)
    assert picture.dtype == np.uint8


def test_wrong_clusters_are_refused() -> None:
    with pytest.raises(InputError, match=r"^rectangles"):
        unfolded_clusters(roots(8), 4)
    with pytest.raises(InputError, match=r"^face_pixels"):
        unfolded_clusters(roots(8), 8, face_pixels=5000)
    with pytest.raises(InputError, match=r"^cube"):
        unfolded_clusters(roots(8), 8, cube=np.zeros((5, 8, 8, 3)))


def test_a_difference_is_emphasised_and_said() -> None:
    a = np.zeros((40, 500, 3), np.float32)
    b = a.copy()
    b[:, 100:200, 1], b[:, 200:300, 2], b[:, 300:] = 0.01, -0.05, np.nan
    picture = difference_picture(a, b, factor=10, white=0.5)
    shown = picture[:40].astype(int).sum(axis=2)
    assert (shown[:, :100] == shown[0, 0]).all()
    assert shown[0, 0] < shown[0, 100] < shown[0, 200]
    assert (
        picture[:40, 200:] == picture[0, 200]
    ).all()  # at the end of the scale, 0.05, as is what is no number
    assert picture.shape[0] > 60
    assert np.array_equal(
        difference_picture(b[:, :300], a[:, :300], factor=10, white=0.5, legend=False), picture[:40, :300]
    )
    levels = np.linspace(0, 1, 50, dtype=np.float32)[None, :, None] * np.ones(3, np.float32)
    lightness = difference_picture(levels, 0 * levels, factor=1, legend=False) @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(lightness[0]) > 0).all()
    for change in ({"factor": 0}, {"factor": 1, "white": np.nan}):
        with pytest.raises(InputError):
            difference_picture(a, b, **change)
    with pytest.raises(InputError, match=r"^pictures"):
        difference_picture(a, b[1:], factor=1)


def test_panels_keep_each_image_whole(rng: np.random.Generator) -> None:
    images = [rng.integers(0, 200, (60, 80, 3), dtype=np.uint8) for _ in range(3)]
    sheet = panels(
        images,
        ["ours", "exact", "a caption so long that it takes several lines, ε = 5e-5"],
        columns=2,
        gap=10,
    )
    assert np.array_equal(sheet[10:70, 10:90], images[0])
    assert np.array_equal(sheet[10:70, 100:180], images[1])
    below = sheet[70 + 10 :, 10:90]
    found = [y for y in range(len(below) - 59) if np.array_equal(below[y : y + 60], images[2])]
    assert len(found) == 1
    assert (sheet[72:90, 10:90] < 128).any()  # the caption
    with pytest.raises(InputError, match=r"^panels"):
        panels(images, ["one"])


def test_points_lie_where_their_numbers_say() -> None:
    """Marks of a line of slope one are on one straight line at even distances; bottom left to top right."""
    x = np.array([1e-5, 1e-4, 1e-3])
    picture = line_plot({"a": (x, 10 * x)}, x=Axis("ε"), y=Axis("error"))
    blue = np.abs(picture.astype(int) - (0, 96, 160)).max(axis=2) < 12
    blue[:, 885:] = False  # the legend
    rows, columns = np.nonzero(blue)
    assert np.corrcoef(rows, columns)[0, 1] < -0.99
    first, last = (np.array([columns[k], rows[k]]) for k in (columns.argmin(), columns.argmax()))

    def blue_around(share: float) -> int:
        x, y = np.rint(first + share * (last - first)).astype(int)
        return int(blue[y - 6 : y + 7, x - 6 : x + 7].sum())

    assert blue_around(0.5) > 1.5 * blue_around(0.25)  # a mark, and only line
    assert blue_around(0.5) > 1.5 * blue_around(0.75)
    even = line_plot({"a": (np.arange(5), np.arange(5.0))}, x=Axis("n", log=False), y=Axis("t", log=False))
    assert even.shape == (600, 960, 3)


@pytest.mark.parametrize(
    "series",
    [{}, {"a": ([], [])}, {"a": ([1, 2], [1])}, {"a": ([0, 1], [1, 1])}, {"a": ([1, 2], [np.inf, 1])}],
)
def test_what_no_axis_can_show_is_refused(series: dict) -> None:
    with pytest.raises(InputError, match=r"^series"):
        line_plot(series, x=Axis("x"), y=Axis("y"))


def test_one_point_and_constant_lines_can_be_shown() -> None:
    for image in (
        line_plot({"a": ([3.0], [7.0]), "b": ([1.0, 2.0], [7.0, 7.0])}, x=Axis("x"), y=Axis("y")),
        line_plot({"a": ([0.0], [0.0])}, x=Axis("x", log=False), y=Axis("y", log=False)),
    ):
        assert image.shape == (600, 960, 3)
        plotted = image[100:560, 60:780].astype(int)  # without the legend
        assert (np.ptp(plotted, axis=2) > 60).any(), "no coloured mark"


def test_figures_are_saved_as_png(tmp_path) -> None:
    image = np.zeros((4, 4, 3), np.uint8)
    save_figure(image, tmp_path / "a.png")
    with pytest.raises(OutputError):
        save_figure(image, tmp_path / "a.png")
    with pytest.raises(InputError):
        save_figure(image, tmp_path / "a.jpg")

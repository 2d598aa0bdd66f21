"""Radiance pictures: known bytes, known values, every layout, and what must be refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from prelight.errors import InputError
from prelight.images import formats, map_checks, radiance_hdr
from prelight.scene.variant import mitsuba

HEADER = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n"
PROBE_MAXIMA = {  # as other programs read them
    "probes/grace_cross.hdr": 2352.0,
    "probes/galileo_cross.hdr": 1012.0,
    "probes/uffizi_latlong.hdr": 15.9375,
    "probes/grace_probe.hdr": 652.0,
    "skies/noon_grass_1k.hdr": 64256.0,
}


def read(folder: Path, content: bytes) -> np.ndarray:
    path = folder / "map.hdr"
    path.write_bytes(content)
    return formats.read_radiance_map(path)


def pixels_of(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    """RGBE bytes with runs and without, as an encoder would normalise them (the largest is 128 or more)."""
    rgbe = rng.integers(0, 256, (height, width, 4), np.uint8)
    rgbe[..., 1] |= 128
    rgbe[..., 3] = rng.integers(120, 136, (height, width))
    rgbe[:, width // 3 : 2 * width // 3] = rgbe[:, width // 3, None]
    return rgbe


def values_of(rgbe: np.ndarray) -> np.ndarray:
    """The definition, written down once more."""
    scale = np.where(rgbe[..., 3] > 0, 2.0 ** (rgbe[..., 3].astype(float) - 136), 0.0)
    return (rgbe[..., :3] * scale[..., None]).astype(np.float32)


def new_runs(rgbe: np.ndarray) -> bytes:
    out = bytearray()
    for line in rgbe:
        out += bytes([2, 2, len(line) >> 8, len(line) & 255])
        for component in line.T:
            at = 0
            while at < len(component):
                run = 1
                while at + run < len(component) and run < 127 and component[at + run] == component[at]:
                    run += 1
                out += bytes([128 + run, component[at]]) if run > 1 else bytes([1, component[at]])
                at += run
    return bytes(out)


def old_runs(rgbe: np.ndarray) -> bytes:
    out = bytearray()
    for line in rgbe:
        at = 0
        while at < len(line):
            run = 1
            while at + run < len(line) and (line[at + run] == line[at]).all():
                run += 1
            out += line[at].tobytes()
            repeats = run - 1
            while repeats:  # the count in base 256, lowest first
                out += bytes([1, 1, 1, repeats & 255])
                repeats >>= 8
            at += run
    return bytes(out)


@pytest.mark.parametrize("encoding", [np.ndarray.tobytes, new_runs, old_runs], ids=["flat", "new", "old"])
@pytest.mark.parametrize("width", [1, 7, 8, 130, 900])
def test_every_run_length_gives_the_same_pixels(tmp_path, rng, encoding, width) -> None:
    if encoding is new_runs and width < 8:
        pytest.skip("new run lengths begin at 8 pixels")
    rgbe = pixels_of(rng, 3, width)
    got = read(tmp_path, HEADER + f"-Y 3 +X {width}\n".encode() + encoding(rgbe))
    np.testing.assert_array_equal(got, values_of(rgbe))


ORIENTATIONS = {
    "-Y 2 +X 3": lambda p: p,
    "+Y 2 +X 3": lambda p: p[::-1],
    "-Y 2 -X 3": lambda p: p[:, ::-1],
    "+Y 2 -X 3": lambda p: p[::-1, ::-1],
    "+X 3 -Y 2": lambda p: p.transpose(1, 0, 2),
    "+X 3 +Y 2": lambda p: p[::-1].transpose(1, 0, 2),
    "-X 3 -Y 2": lambda p: p[:, ::-1].transpose(1, 0, 2),
    "-X 3 +Y 2": lambda p: p[::-1, ::-1].transpose(1, 0, 2),
}


@pytest.mark.parametrize("resolution", ORIENTATIONS)
def test_the_eight_orientations_show_one_picture(tmp_path, rng, resolution) -> None:
    rgbe = pixels_of(rng, 2, 3)
    stored = np.ascontiguousarray(ORIENTATIONS[resolution](rgbe))
    got = read(tmp_path, HEADER + resolution.encode() + b"\n" + stored.tobytes())
    np.testing.assert_array_equal(got, values_of(rgbe))
    assert got.flags.c_contiguous
    assert got.flags.writeable


def one_pixel(header: bytes, rgbe: tuple[int, ...] = (128, 64, 32, 129)) -> bytes:
    return header + b"\n-Y 1 +X 1\n" + bytes(rgbe)


def test_a_pixel_of_known_bytes(tmp_path) -> None:
    np.testing.assert_array_equal(read(tmp_path, one_pixel(b"#?RGBE\n")), [[[1.0, 0.5, 0.25]]])
    np.testing.assert_array_equal(read(tmp_path, one_pixel(b"#?RGBE\n", (9, 9, 9, 0))), [[[0, 0, 0]]])


def test_exposures_multiply_and_are_divided_out(tmp_path) -> None:
    header = b"#?RADIANCE\n# a comment\r\nEXPOSURE=2\nEXPOSURE= 4.0\nCOLORCORR=1 2 4\n\tEXPOSURE=100\n"
    np.testing.assert_allclose(read(tmp_path, one_pixel(header)), [[[1 / 8, 0.5 / 16, 0.25 / 32]]])


def test_xyz_white_becomes_white(tmp_path) -> None:
    header = b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n"
    np.testing.assert_allclose(
        read(tmp_path, one_pixel(header, (128, 128, 128, 129))), [[[1, 1, 1]]], atol=1e-6
    )
    red, green, blue = read(tmp_path, one_pixel(header, (128, 64, 0, 129)))[0, 0]
    assert red > 2 * green
    assert blue == 0


def test_wide_primaries_are_converted_and_ordinary_ones_left(tmp_path) -> None:
    ordinary = b"#?RADIANCE\nPRIMARIES=.640 .330 .290 .600 .150 .060 .333 .333\n"
    unknown = b"#?RADIANCE\nPRIMARIES=0 0 0 0 0 0 0 0\n"
    wide = b"#?RADIANCE\nPRIMARIES=0.708 0.292 0.17 0.797 0.131 0.046 0.3127 0.329\n"  # Rec.2020
    plain = read(tmp_path, one_pixel(b"#?RADIANCE\n"))
    np.testing.assert_array_equal(read(tmp_path, one_pixel(ordinary)), plain)
    np.testing.assert_array_equal(read(tmp_path, one_pixel(unknown)), plain)
    white = read(tmp_path, one_pixel(wide, (128, 128, 128, 129)))
    np.testing.assert_allclose(white, np.ones((1, 1, 3)), atol=1e-6)
    # ITU-R BT.2087: red of Rec.2020 in Rec.709 is (1.6605, -0.1246, -0.0182); with some green it is inside
    got = read(tmp_path, one_pixel(wide, (128, 64, 64, 129)))[0, 0]
    expected = np.array([1.6605, -0.1246, -0.0182]) + 0.5 * (1 - np.array([1.6605, -0.1246, -0.0182]))
    np.testing.assert_allclose(got, expected, atol=2e-4)


REFUSED = {
    "cut in the header": (b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", "ends in its header"),
    "endless header": (b"#?RADIANCE\n" + b"A=B\n" * 200_000, "first 64 KB"),
    "no resolution": (HEADER + b"hello\n", "resolution line"),
    "negative size": (HEADER + b"-Y -1 +X 4\n", "resolution line"),
    "same axis twice": (HEADER + b"-Y 4 +Y 4\n" + bytes(64), "resolution line"),
    "no pixels": (HEADER + b"-Y 0 +X 4\n", "at least 1×1"),
    "bomb": (HEADER + b"-Y 30000 +X 6000\n", "cut short"),
    "larger bomb": (HEADER + b"-Y 999999999 +X 999999999\n", "at most 32,768"),
    "endless number": (HEADER + b"-Y 1" + b"0" * 9000 + b" +X 1\n", "resolution line"),
    "flat, cut": (HEADER + b"-Y 2 +X 2\n" + bytes([9, 9, 9, 9] * 3), "scan-line 1 of 2"),
    "repeat first": (HEADER + b"-Y 1 +X 2\n" + bytes([1, 1, 1, 2]), "begins with a repeat"),
    "old run too long": (HEADER + b"-Y 1 +X 2\n" + bytes([9, 9, 9, 9, 1, 1, 1, 7]), "past the end"),
    "old run, huge": (HEADER + b"-Y 1 +X 3\n" + bytes([9] * 4 + [1, 1, 1, 0] * 9), "past the end"),
    "new run too long": (
        HEADER + b"-Y 1 +X 16\n" + bytes([2, 2, 0, 16]) + bytes([255, 1] * 4),
        "past the end",
    ),
    "new run of none": (HEADER + b"-Y 1 +X 16\n" + bytes([2, 2, 0, 16, 0, 0]), "past the end"),
    "other width": (HEADER + b"-Y 1 +X 16\n" + bytes([2, 2, 0, 17]) + bytes(80), "another width"),
    "new, no value": (HEADER + b"-Y 1 +X 16\n" + bytes([2, 2, 0, 16, 144]), "cut short"),
    "exposure 0": (one_pixel(b"#?RADIANCE\nEXPOSURE=0\n"), "above 0"),
    "exposure of words": (one_pixel(b"#?RADIANCE\nEXPOSURE=bright\n"), "finite number"),
    "exposure NaN": (one_pixel(b"#?RADIANCE\nEXPOSURE=nan\n"), "finite number"),
    "exposure that overflows": (one_pixel(b"#?RADIANCE\nEXPOSURE=1e-45\n", (255, 1, 1, 255)), "1 infinite"),
    "other format": (one_pixel(b"#?RADIANCE\nFORMAT=32-bit_float\n"), "32-bit_rle_rgbe"),
    "gamma": (one_pixel(b"#?RADIANCE\nGAMMA=2.2\n"), "linear"),
    "primaries on a line": (one_pixel(b"#?RADIANCE\nPRIMARIES=.3 .3 .4 .4 .5 .5 .33 .33\n"), "colour space"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_damaged_is_refused_in_one_line(tmp_path, case) -> None:
    content, reason = REFUSED[case]
    with pytest.raises(InputError, match=reason) as caught:
        read(tmp_path, content)
    assert str(caught.value).startswith(str(tmp_path / "map.hdr: "))
    assert "\n" not in str(caught.value)


def test_cut_anywhere_it_is_refused(tmp_path, rng) -> None:
    for encode in (new_runs, old_runs, np.ndarray.tobytes):
        whole = HEADER + b"-Y 3 +X 20\n" + encode(pixels_of(rng, 3, 20))
        for length in [*range(2, len(whole), 7), len(whole) - 1]:
            with pytest.raises(InputError):
                read(tmp_path, whole[:length])


@given(st.data())
def test_changed_bytes_never_get_past_the_reader(tmp_path_factory, data) -> None:
    rng = np.random.default_rng(3)
    whole = bytearray(HEADER + b"-Y 4 +X 40\n" + new_runs(pixels_of(rng, 4, 40)))
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    try:
        picture, _ = radiance_hdr.decode_radiance_hdr("map", bytes(whole))
    except InputError:
        return
    assert picture.shape[2] == 3
    assert not np.isnan(picture).any()


LINEAR = st.floats(0, 2.0**100, width=32) | st.floats(2.0**-100, 4.0, width=32) | st.just(0.0)


@given(
    arrays.arrays(np.float32, st.tuples(st.integers(1, 4), st.integers(1, 40), st.just(3)), elements=LINEAR)
)
def test_shared_exponents_err_by_a_256th_of_the_largest(picture) -> None:
    got, _ = radiance_hdr.decode_radiance_hdr("map", radiance_hdr.encode_radiance_hdr(picture))
    assert got.shape == picture.shape
    largest = picture.max(axis=-1, keepdims=True).astype(np.float64)
    assert (np.abs(got.astype(np.float64) - picture) <= largest / 256 + 2.0**-127).all()
    again, _ = radiance_hdr.decode_radiance_hdr("map", radiance_hdr.encode_radiance_hdr(got))
    np.testing.assert_array_equal(again, got)


@pytest.mark.parametrize("value", [0.0, 1e-45, 2.0**-127, 0.999, 255.5, 2.0**127, 3.4e38])
def test_the_ends_of_the_range(value) -> None:
    picture = np.full((1, 9, 3), value, np.float32)
    got, _ = radiance_hdr.decode_radiance_hdr("map", radiance_hdr.encode_radiance_hdr(picture))
    expected = min(value, 255 * 2.0**119)
    np.testing.assert_allclose(got, expected if value >= 2.0**-127 else 0.0, rtol=1 / 256)


@pytest.mark.parametrize("width", [5, 8, 127, 128, 129, 300, 5000])
def test_written_runs_read_back(tmp_path, rng, width) -> None:
    rgbe = pixels_of(rng, 5, width)
    rgbe[1] = rgbe[1, :1]
    rgbe[2, ::3] = rgbe[2, :1]
    formats.write_hdr(tmp_path / "a.hdr", values_of(rgbe))
    np.testing.assert_array_equal(formats.read_radiance_map(tmp_path / "a.hdr"), values_of(rgbe))
    assert (tmp_path / "a.hdr").stat().st_size <= 100 + 5 * (4 + 4 * (width + width // 128 + 1))


def test_a_constant_map_is_small(tmp_path) -> None:
    formats.write_hdr(tmp_path / "a.hdr", np.ones((100, 1000, 3), np.float32))
    assert (tmp_path / "a.hdr").stat().st_size < 100 * 4 * 20


@pytest.mark.parametrize("name", PROBE_MAXIMA)
def test_public_maps_have_their_known_maxima(data, name) -> None:
    picture = formats.read_radiance_map(data / name)
    assert picture.max() == PROBE_MAXIMA[name]
    assert np.isfinite(picture).all()
    assert picture.min() >= 0


@pytest.mark.parametrize("name", ["probes/grace_cross.hdr", "skies/venice_sunset_1k.hdr"])
def test_another_program_reads_the_same(data, name) -> None:
    mi = mitsuba()
    theirs = np.array(mi.Bitmap(str(data / name)), copy=False)[..., :3]
    np.testing.assert_array_equal(formats.read_radiance_map(data / name), theirs)


@pytest.mark.parametrize(("value", "name"), [(np.nan, "NaN"), (np.inf, "infinite"), (-1e-6, "negative")])
def test_values_that_no_light_has_are_counted_and_placed(value, name) -> None:
    picture = np.ones((6, 7, 3), np.float32)
    picture[2, 5, 1] = picture[2, 5, 2] = picture[4, 0, 0] = value
    with pytest.raises(InputError, match=rf"2 {name}.*\(first at row 2, column 5\)"):
        map_checks.check_radiance("map", picture)
    with pytest.raises(InputError, match=f"2 {name}"):
        formats.write_hdr("never.hdr", picture)

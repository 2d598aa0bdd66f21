"""The light of the studio: taken apart by linearity, coarse in the hand, at rest what the relighter says."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.errors import InputError, OutputError
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.relighting.relighter import Relighter
from prelight.storage.bake import Bake
from prelight.studio import environments, kept, rig_state
from prelight.studio.environments import Environments
from prelight.studio.light import Light
from prelight.studio.protocol import RemoveDisc, SetDisc, SetEnvironment, State

from .live_studio import ball_bake
from .test_studio_rgb9e5 import unpacked


@pytest.fixture(scope="module")
def bake(tmp_path_factory) -> Bake:
    return Bake.open(ball_bake(tmp_path_factory))


@pytest.fixture
def light(bake) -> Light:
    return Light(bake, Environments())


def rig(*changes, start: State | None = None) -> State:
    state = start or rig_state.initial("stock:noon")
    for change in changes:
        state = rig_state.changed(state, change, author=1)
    return state


def lit(light: Light, state: State, *, exact: bool = True) -> np.ndarray:
    light.relight(state, exact=exact, check=lambda: None)
    return np.frombuffer(light.frame(state), np.uint32, offset=32)


LAMP = SetDisc("lamp", -125.0, 35.0, 8.0, (6.0, 5.0, 4.0), 0.5)
SUN = SetDisc("sun", 100.0, 50.0, 0.3, (3000.0, 2000.0, 1000.0))


def test_at_rest_it_is_what_the_relighter_says(light, bake) -> None:
    """Map, turn, scale, tint and a broad disc at once; the sun of the map traced in both."""
    state = rig(SetEnvironment(rotation_deg=40.0, scale=1.5, tint=(1.0, 0.7, 0.2)), LAMP)
    found = unpacked(lit(light, state))
    other = Relighter(bake)
    lamp = Disc.at(-125, 35, radius_deg=8, radiance=(6, 5, 4), softness=0.5)
    other.environment = (
        Environment.stock("noon").rotated(40).scaled(1.5).tinted((1, 0.7, 0.2)).with_disc(lamp)
    )
    assert len(other.strong_lights) > 0
    expected = other.irradiance
    assert np.abs(found - expected).max() <= expected.max() * 2.0**-9
    assert (
        np.abs(found / 0.8 - other.radiance / 0.64).max() < 0.02 * expected.max()
    )  # before the albedo of 0.8


def test_what_is_seen_depends_on_the_state_alone(light, bake) -> None:
    """By whatever way, and in another studio: the same bits."""
    state = rig(SetEnvironment("stock:sunset", 25.0, 0.8), LAMP, SUN)
    first = lit(light, state).copy()
    rng = np.random.default_rng(3)
    for k in range(12):
        moved = rig(SetEnvironment(rotation_deg=float(rng.uniform(0, 360)) if k % 4 == 0 else 25.0),
                    SetDisc("lamp", float(rng.uniform(-180, 180)), 35.0, 8.0, (6.0, 50.0, 4.0)),
                    RemoveDisc("sun") if k % 3 else SUN, start=state)  # fmt: skip
        lit(light, moved, exact=k % 6 == 0)
    assert (lit(light, state) == first).all()
    assert (lit(Light(bake, Environments()), state) == first).all()


def test_the_order_of_lights_is_no_part_of_the_state() -> None:
    assert rig(LAMP, SUN).discs == rig(SUN, LAMP).discs == rig(LAMP, SUN, LAMP).discs


def test_scale_and_tint_read_no_transport(light) -> None:
    state = rig(LAMP)
    lit(light, state)
    for change in (
        SetEnvironment(scale=3.0),
        SetEnvironment(tint=(0.0, 2.0, 1.0)),
        SetEnvironment(scale=0.0),
    ):
        state = rig(change, start=state)
        is_exact, kind, _ = light.relight(state, exact=False, check=pytest.fail)
        assert (is_exact, kind) == (True, "gain")
    alone = unpacked(lit(light, rig(LAMP, SetEnvironment(scale=0.0))))
    both = unpacked(lit(light, rig(LAMP)))
    sky = unpacked(lit(light, rig()))
    assert np.abs(both - sky - alone).max() <= 2.0**-8 * both.max()
    assert alone.max() > 0.1


def test_a_disc_is_a_local_change(light) -> None:
    lit(light, rig())
    state = rig(LAMP)
    light.relight(state, exact=False, check=pytest.fail)
    light.relight(rig(SetDisc("lamp", -124.0, 35.0, 8.0, (6.0, 5.0, 4.0))), exact=False, check=pytest.fail)
    assert light._front.last.kind == "local"
    assert light._front.last.clusters < 0.1 * light._front.refresh().clusters


def test_no_light_is_exactly_dark(light) -> None:
    state = rig(LAMP, SUN)
    lit(light, state)
    dark = rig(SetEnvironment(scale=0.0), RemoveDisc("lamp"), RemoveDisc("sun"), start=state)
    assert not lit(light, dark, exact=False).any()
    assert not lit(light, dark).any()


def test_in_the_hand_it_is_nearly_the_same(light) -> None:
    """The same light altogether, shadows a little softer; and no flicker as the sun passes over texels."""
    total = []
    for turn in np.linspace(0, 12, 7).tolist():
        state = rig(SetEnvironment("stock:noon", turn))
        coarse = unpacked(lit(light, state, exact=False))
        exact = unpacked(lit(light, state))
        assert (
            np.abs(coarse - exact).mean() < 0.06 * exact.mean()
        )  # of that the clusters' part, with one sun, 0.04
        total.append(coarse.mean() / exact.mean())
    assert np.abs(np.array(total) - 1).max() < 0.06
    assert np.ptp(total) < 0.05


def test_an_exact_answer_is_given_up_for_a_newer_state(light) -> None:
    class Newer(Exception):
        pass

    before = lit(light, rig(LAMP)).copy()

    def check() -> None:
        raise Newer

    with pytest.raises(Newer):
        light.relight(rig(SetEnvironment("stock:sunset"), SUN), exact=True, check=check)
    assert (lit(light, rig(LAMP), exact=False) == before).all()


def test_nothing_is_disturbed_by_warming(light) -> None:
    before = lit(light, rig(LAMP)).copy()
    light.warm(rig(LAMP))
    assert (lit(light, rig(LAMP), exact=False) == before).all()
    moved = rig(SetDisc("lamp", 10.0, 20.0, 30.0, (1.0, 1.0, 1.0)))
    fresh = lit(Light(light._sky.bake, Environments()), moved)
    assert (lit(light, moved) == fresh).all()


# ---- The rig, kept ---------------------------------------------------------------------------------------------


def test_the_rig_survives_the_file(tmp_path) -> None:
    state = rig(SetEnvironment("stock:stage", 359.5, 0.25, (1.0, 0.5, 0.0)), LAMP, SUN, RemoveDisc("lamp"))
    kept.save(state, tmp_path / "a.json")
    found, _ = kept.load(tmp_path / "a.json", rig_state.initial("stock:noon"))
    for name in ("environment", "rotation_deg", "scale", "tint", "discs"):
        assert getattr(found, name) == getattr(state, name)
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]


@pytest.mark.parametrize(
    "text",
    ["", "{}", "[]", "null", '{"format": "prelight-studio"',
     '{"format": "prelight-studio", "version": 2, "messages": []}',
     '{"format": "prelight-studio", "version": 1, "messages": 3}', "[" * 50_000, "x" * 200_000,
     '{"format": "prelight-studio", "version": 1, "messages": [{"type": "SetEnvironment", "scale": NaN}]}',
     '{"format": "prelight-studio", "version": 1, "messages": [{"type": "Seen", "frame": 1}]}',
     '{"format": "prelight-studio", "version": 1, "messages": [{"type": "RemoveDisc", "id": "a"}]}'],
    ids=range(12),
)  # fmt: skip
def test_a_damaged_rig_is_refused_in_a_line(tmp_path, text) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(InputError) as refused:
        kept.load(tmp_path / "a.json", rig_state.initial("stock:noon"))
    assert str(refused.value).isprintable()
    assert "a.json" in str(refused.value)


def test_the_rig_lies_beside_its_bake(tmp_path) -> None:
    assert kept.state_file(tmp_path / "a.b.prelight") == tmp_path / "a.b.studio.json"
    assert kept.state_file(tmp_path / "a.b") == tmp_path / "a.b.studio.json"
    with pytest.raises(OutputError):
        kept.save(rig(), tmp_path / "none" / "a.json")


# ---- The maps to choose from -----------------------------------------------------------------------------------


def test_a_folder_offers_its_maps_and_nothing_outside(tmp_path) -> None:
    from prelight.images.formats import write_exr

    inside, outside = tmp_path / "in", tmp_path / "out"
    for folder in (inside, outside):
        folder.mkdir()
        write_exr(folder / f"{folder.name}.exr", np.ones((4, 8, 3), np.float32))
    (inside / "notes.txt").write_text("no map")
    (inside / "link.exr").symlink_to(outside / "out.exr")
    (inside / "dir.exr").mkdir()
    known = Environments(folder=inside)
    assert [c.id for c in known.choices if not c.id.startswith("stock:")] == ["in.exr", "daylight"]
    assert known.preview("in.exr").startswith(b"\x89PNG")
    assert not known._opened  # a folder of previews is not kept in memory
    assert known.open("in.exr").pixels.max() == 1
    assert known.stops("in.exr") == pytest.approx(0, abs=0.02)
    for name in ("link.exr", "../out/out.exr", str(outside / "out.exr"), "stock:nothing", ""):
        with pytest.raises(InputError, match="expected one of"):
            known.open(name)
    with pytest.raises(InputError, match="expected a folder"):
        Environments(folder=tmp_path / "none")


def test_a_suitable_exposure_shows_white_as_one() -> None:
    """Under a constant sky of radiance L a white surface has radiance L."""
    assert environments.suitable_stops(Environment.constant((4.0, 4.0, 4.0))) == pytest.approx(-2, abs=0.02)
    assert environments.suitable_stops(Environment.dark()) == 0


def test_the_sky_behind_looks_where_it_should() -> None:
    """Lat-long, the middle along −Z, the top row up; the same light as the map."""
    cube = np.zeros((6, 8, 8, 3), np.float32)
    cube[5] = (1, 0, 0)  # −Z
    cube[0] = (0, 1, 0)  # +X
    cube[2] = (0, 0, 1)  # +Y
    sky = unpacked(environments.sky_words(Environment.from_cube(cube))).reshape(256, 512, 3)
    assert sky[128, 256].tolist() == [1, 0, 0]
    assert sky[128, 384].tolist() == [0, 1, 0]
    assert sky[0, 0].tolist() == [0, 0, 1]
    weight = np.sin((np.arange(256) + 0.5) / 256 * np.pi)[:, None, None] * (np.pi / 256) * (2 * np.pi / 512)
    assert (sky * weight).sum(axis=(0, 1)) == pytest.approx(4 * np.pi / 6, rel=0.01)

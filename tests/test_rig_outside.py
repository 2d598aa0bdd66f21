"""The tables [sun] and [outside] of a rig: what they say, and one line for what is wrong in them."""

from __future__ import annotations

from datetime import UTC
from pathlib import Path

import pytest

from prelight.errors import InputError
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.rig import Rig

SUN = '[sun]\nplace = [43.7, 15.9]\ntime = "2026-06-21T15:00"\nzone = "Europe/Zagreb"\n'


@pytest.fixture
def rig(tmp_path: Path):
    def opened(text: str) -> Rig:
        (tmp_path / "rig.toml").write_text(text)
        return Rig.open(str(tmp_path / "rig.toml"))

    return opened


def test_a_sun_makes_the_environment(rig) -> None:
    air = "turbidity = 3\nground_albedo = 0.4\nnorth_deg = 30\nscale = 0.5\n"
    found = rig(SUN + air + "[[disc]]\ndirection = [0, 1, 0]\nradius_deg = 5\nradiance = [1, 1, 1]\n")
    day = found.daylight
    assert day is not None
    assert (day.when.astimezone(UTC).hour, day.turbidity, day.ground, day.scale) == (13, 3.0, (0.4,) * 3, 0.5)
    sun, lamp = found.environment.discs
    assert sun == day.sun
    assert lamp == Disc((0.0, 1.0, 0.0), 5.0, (1.0, 1.0, 1.0))
    assert found.environment.cube(4) == pytest.approx(day.environment().with_disc(lamp).cube(4))


def test_another_hour_keeps_what_is_the_rig_s_own(rig) -> None:
    found = rig(SUN + "[[disc]]\ndirection = [0, 1, 0]\nradius_deg = 5\nradiance = [1, 1, 1]\n[[paint]]\n"
                "elevation_range_deg = [-90, 0]\nradiance = [0, 0, 0]\n")  # fmt: skip
    evening = found.daylight.at(found.daylight.when.replace(hour=20))
    later = found.under(evening)
    assert later.environment.discs == (evening.sun, found.environment.discs[1])
    assert later.environment.paints == found.environment.paints
    over_a_map = Rig(Environment.stock("noon").with_disc(found.environment.discs[1])).under(evening)
    assert over_a_map.environment.discs == later.environment.discs


def test_times_may_stand_without_quotes(rig) -> None:
    found = rig("[sun]\nplace = [0, 0]\ntime = 2026-06-21T15:00:00+02:00\n")
    assert found.daylight.when.astimezone(UTC).hour == 13


OUTSIDE = """
[outside]
scene = "stock:town"
samples = 3
bounce = false

[[outside.object]]
scene = "taxi.glb"
name = "taxi"
scale = 1.5
turn_deg = 180
position = [3, 0, 20]
keys = [{ at = 4, position = [3, 0, -20] }, { at = 5 }]

[outside.room]
position = [20, 0, 50]
heading_deg = 10
along = "line"
keys = [{ at = 2, heading_deg = 30 }]
"""


def test_a_world_and_its_paths(rig, tmp_path: Path) -> None:
    found = rig(SUN + OUTSIDE)
    outside = found.outside
    town, taxi = outside.objects
    assert (town.source, town.path.duration) == ("stock:town", 0.0)
    assert (taxi.source, taxi.name, taxi.scale) == (str(tmp_path / "taxi.glb"), "taxi", 1.5)
    along = [taxi.path.at(t).position[2] for t in (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)]
    assert along == sorted(along, reverse=True)
    assert taxi.path.at(2.0).position[0] == 3.0
    assert taxi.path.at(2.0).heading_deg == pytest.approx(0)
    assert taxi.path.at(4.5).position == pytest.approx((3, 0, -20), abs=1e-9)
    assert outside.room.at(1.0).heading_deg == pytest.approx(20)
    assert (outside.samples, outside.bounce, found.duration) == (3, False, 5.0)
    assert found.at(1.5).seconds == 1.5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (SUN.replace("43.7", "143.7"), r"less than or equal to 90.*/sun/place/0"),
        (SUN.replace("06-21", "06-31"), r"no time: day is out of range.*/sun/time"),
        (SUN.replace("Europe/Zagreb", "Europe/Atlantis"), r"'Europe/Atlantis' is not known.*/sun/zone"),
        (SUN.replace("06-21T15:00", "03-29T02:30"), r"does not exist in Europe/Zagreb.*/sun/time"),
        (SUN + "moon = 1\n", r"'moon' is not known here; known are place, time, zone"),
        (SUN + "turbidity = 0\n", r"/sun/turbidity"),
        ('[sun]\ntime = "2026-06-21T15:00"\n', r"place is missing"),
        (SUN + '[environment]\nmap = "stock:noon"\n', r"\[sun\] has a sky of its own"),
        (SUN + "[outside]\n", r"nothing outside"),
        (SUN + '[outside]\nscene = "a.glb"\nsamples = 9\n', r"/outside/samples"),
        (SUN + '[outside]\nscene = "a.glb"\nspeed = 1\n', r"'speed' is not known here"),
        (SUN + '[[outside.object]]\nscene = "a.glb"\nkeys = [{ at = 2 }, { at = 1 }]\n', r"/outside/object/0/keys"),
        (SUN + '[[outside.object]]\nname = "b"\n', r"scene is missing"),
        (SUN + '[outside]\nscene = "a.glb"\n[outside.room]\nalong = "road"\n', r"expected curve or line"),
        (SUN + '[[outside.object]]\nscene = "a.glb"\nkeys = [{ at = 2, colour = 1 }]\n', r"'colour' is not known"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_a_line(rig, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        rig(text)
    assert "\n" not in str(refused.value)


def test_a_bake_without_portals_has_no_outside(rig) -> None:
    with pytest.raises(InputError, match=r"\[outside\].*portals"):
        _ = rig(SUN + '[outside]\nscene = "a.glb"\n').surroundings

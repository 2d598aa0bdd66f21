"""Caustics of a window's harmonics: one map of photons for all, against lamps of the same light."""

from __future__ import annotations

import numpy as np
import pytest

from prelight.bases import spherical_harmonics
from prelight.rays.mitsuba import Occluders
from prelight.transport.photon_mapping import PhotonMap
from prelight.transport.photon_sources import TriangleSource
from prelight.transport.photon_tracing import BATCH, CAUSTIC
from prelight.transport.portal_caustics import PortalCaustics

from .glass import GLASS, ball, joined
from .rooms import SIZE, rectangle, room, scene_of_rectangles

X, Y, Z = SIZE
WINDOW = np.float32([[[0, 0.5, 1], [0, 2.5, 1], [0, 2.5, 4]], [[0, 0.5, 1], [0, 2.5, 4], [0, 0.5, 4]]])


def open_room():
    """A room without the wall at x = 0, but for a sill and a lintel; a glass ball in it."""
    sides = (
        ((0, 0, 0), (0, 0, Z), (X, 0, 0)), ((0, Y, 0), (X, 0, 0), (0, 0, Z)), ((X, 0, 0), (0, 0, Z), (0, Y, 0)),
        ((0, 0, 0), (X, 0, 0), (0, Y, 0)), ((0, 0, Z), (0, Y, 0), (X, 0, 0)),
        ((0, 0, 0), (0, 0.5, 0), (0, 0, Z)), ((0, 2.5, 0), (0, 0.5, 0), (0, 0, Z)),
        ((0, 0.5, 0), (0, 2, 0), (0, 0, 1)), ((0, 0.5, 4), (0, 2, 0), (0, 0, 1)),
    )  # fmt: skip
    walls = scene_of_rectangles(*(rectangle(*side, cells=4) for side in sides))
    return joined(walls, *ball(radius=0.5, centre=(1.5, 1.0, 2.5), rings=16), GLASS)


@pytest.fixture(scope="module")
def scene():
    return open_room()


def test_the_first_harmonic_is_an_even_panel_behind_which_nothing_stands(scene) -> None:
    occluders = Occluders(scene.positions, scene.triangles)
    portal_of = np.zeros(2, np.int32)
    of_portal = PortalCaustics(scene, occluders, WINDOW, portal_of, photons=2 * BATCH)
    inward = WINDOW if np.cross(*(WINDOW[0, 1:] - WINDOW[0, 0]))[0] > 0 else WINDOW[:, ::-1]
    source = TriangleSource(np.ascontiguousarray(inward), np.ones((2, 3), np.float32), portal_of)
    panel = PhotonMap(scene, occluders, source, ways=CAUSTIC)
    panel.more(2 * BATCH)
    power = panel.photons.power.sum() / panel.photons.emitted
    found = of_portal._maps[CAUSTIC].photons
    assert found.power.sum() / found.emitted == pytest.approx(power, rel=0.02)

    both = of_portal.harmonics(0, slice(0, 4), order=1)
    assert (both == of_portal.harmonics(0, slice(0, 4), order=2)).all()  # an order more changes nothing
    first = of_portal._maps[CAUSTIC].light(lambda p: np.ones((len(p), 1), np.float32)).light[:, 0]
    even = both[:, 0] / np.float32(spherical_harmonics.evaluate(0, np.float32([[0, 1, 0]]))[0, 0])
    assert (even >= first * 0.999).all()  # and what has bounced before
    assert even.sum() < 3 * first.sum()


def test_a_room_without_glass_has_none() -> None:
    bare = room(3)
    dark = PortalCaustics(
        bare, Occluders(bare.positions, bare.triangles), WINDOW, np.zeros(2, np.int32), photons=BATCH
    )
    assert dark.is_dark
    assert not dark.harmonics(0, slice(0, 9), order=2).any()

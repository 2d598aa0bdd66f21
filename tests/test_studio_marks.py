"""Marks: how a page knows which of its changes have reached the studio; and what a drag asks for once."""

from __future__ import annotations

import time
from dataclasses import replace

from prelight.studio.environments import Environments
from prelight.studio.protocol import Mark, RemoveDisc, SetEnvironment, SetSun
from prelight.studio.rig_state import FIRST_SUN

from .live_studio import ball_bake, running


def test_a_mark_is_answered_when_all_before_it_is_carried_out(tmp_path, tmp_path_factory) -> None:
    """Also where a change before it was refused: then the state is as it was."""
    bake = ball_bake(tmp_path_factory)
    with running(bake, state_file=tmp_path / "state.json") as studio, studio.page() as page:
        start = page.message("Welcome")["state"]["sequence"]
        page.send(SetEnvironment("stock:sunset", rotation_deg=4.0))
        page.send(RemoveDisc("nobody"))
        page.send(Mark(7))
        marked = page.message("Marked")
        assert (marked["number"], marked["sequence"]) == (7, start + 1)
        states = [said for said in page.messages if said["type"] == "State" and said["author"] is not None]
        assert states[-1]["sequence"] == start + 1, "the state comes before its mark's answer"
        assert any(said["type"] == "Refused" for said in page.messages)


def test_the_exposure_of_an_hour_is_asked_for_once_in_a_drag(tmp_path, tmp_path_factory, monkeypatch) -> None:
    """Whatever comes while it is found: else every step of the drag would make the whole sky."""
    asked = []
    stops = Environments.stops

    def noted(self: Environments, key: str) -> float:
        asked.append(key)
        time.sleep(0.1)
        return stops(self, key)

    monkeypatch.setattr(Environments, "stops", noted)
    bake = ball_bake(tmp_path_factory)
    with running(bake, state_file=tmp_path / "state.json") as studio, studio.page() as page:
        start = page.message("Welcome")["state"]["sequence"]
        for k in range(30):
            page.send(SetSun(replace(FIRST_SUN, hour=10 + 0.02 * k), dragging=True))
            time.sleep(0.02)
        page.exact(start + 30)
        assert len([key for key in asked if key.startswith("daylight:")]) == 1


def test_what_one_sets_all_are_told(tmp_path, tmp_path_factory) -> None:
    bake = ball_bake(tmp_path_factory)
    with (
        running(bake, state_file=tmp_path / "s.json") as studio,
        studio.page() as one,
        studio.page() as other,
    ):
        welcome = one.message("Welcome")
        one.exact(welcome["state"]["sequence"])  # its exposure is known, and told, by now
        other.exact(welcome["state"]["sequence"])
        one.send(SetEnvironment(scale=0.5))
        told = other.message("State")
        assert (told["scale"], told["author"]) == (0.5, welcome["visitor"])

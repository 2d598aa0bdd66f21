"""Marks: how a page knows which of its changes have reached the studio."""

from __future__ import annotations

from prelight.studio.protocol import Mark, RemoveDisc, SetEnvironment

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

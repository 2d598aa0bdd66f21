"""The table [[portal]] of a rig: what the glass of a portal is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from ..errors import InputError
from .glass import CLEAR, EVERY, FROSTED, LARGEST_FROST_DEG, USUAL_FROST_DEG, Glass
from .rig_fields import Number, Share, Table, Text
from .rough_pane import LARGEST_ROUGH, LEAST_ROUGH

Transmittance = tuple[Share, Share, Share]


class PortalTable(Table):
    """Glass of one portal, or of all whose names a pattern fits."""

    name: Text = EVERY
    glass: Literal["clear", "frosted", "shut"] | None = None
    tint: Transmittance | None = None
    frost_deg: Annotated[Number, Field(ge=0, le=LARGEST_FROST_DEG)] | None = None
    rough: Annotated[Number, Field(ge=LEAST_ROUGH, le=LARGEST_ROUGH)] | None = None
    blind: Share = 0.0

    @model_validator(mode="after")
    def _check(self) -> PortalTable:
        for name in ("frost_deg", "rough"):
            if getattr(self, name) is not None and self.glass not in (None, FROSTED):
                raise ValueError(f"{name} is of frosted glass, and this is {self.glass}; leave it out")
        if self.rough is not None and self.frost_deg is not None:
            raise ValueError("give frost_deg or rough, not both")
        return self


def glass_table(table: PortalTable, path: Path, number: int) -> Glass:
    """What a table says. Raises InputError."""
    kind = table.glass or (CLEAR if table.frost_deg is None and table.rough is None else FROSTED)
    frost = USUAL_FROST_DEG if table.frost_deg is None else table.frost_deg
    try:
        return Glass(table.name, kind, table.tint, frost, table.blind, table.rough)
    except InputError as error:
        raise InputError(path, error.reason, f"/portal/{number}") from None

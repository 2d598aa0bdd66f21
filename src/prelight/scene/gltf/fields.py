"""What the models of a glTF document's parts share: strict types, no numbers that are not finite."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, FailFast, Field

MOST_ITEMS = 100_000  # nodes, meshes, accessors, ...: each
Count = Annotated[int, Field(ge=1, lt=2**31)]
Index = Annotated[int, Field(ge=0, lt=2**31)]
Pair = tuple[float, float]
Vector = tuple[float, float, float]
Quad = tuple[float, float, float, float]
Matrix = Annotated[list[float], Field(min_length=16, max_length=16)]  # by columns
Limit = Field(max_length=MOST_ITEMS)
Names = Annotated[list[str], FailFast(), Limit]
Unread = Annotated[list[Any], Limit]  # only counted


class Part(BaseModel):
    """An object of the document; keys that no model names are passed over."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)

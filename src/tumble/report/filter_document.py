"""filter.json: the sensor states that a navigation filter could have, with their sigmas at its start."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

FORMAT: Literal["tumble filter states"] = "tumble filter states"
VERSION: Literal[1] = 1
MODEL = "corrected = (1 + E) true + bias (a rate also + G specific_force); a state is an entry of E, G, bias"


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class StateBlock(_Strict):
    """A state of a sensor, in SI."""

    name: str = Field(description="in words")
    kind: Literal["accelerometer", "gyroscope", "g-sensitivity"]
    row: int = Field(ge=0, le=2, description="axis of the sensor: 0 for x")
    column: int | None = Field(
        ge=0, le=2, description="axis of the input for an entry of E or G; null for a bias"
    )
    sigma: float = Field(ge=0.0, description="one standard deviation at the start, from the calibration")
    unit: str = Field(description="of sigma")
    walk_per_root_second: float = Field(
        ge=0.0, description="by how much it wanders: root of the density that drives it"
    )
    largest_share_of_variance: float = Field(
        ge=0.0,
        description="of the variance of horizontal or vertical position, tilt or heading, after any of the times",
    )
    carry: bool = Field(description="whether a filter on such a trajectory should have it")


class FilterDocument(_Strict):
    """The sensor states that a filter could have, and which of them it should."""

    format: Literal["tumble filter states"]
    version: Literal[1]
    model: str = Field(description="what a state is an entry of")
    trajectory: str = Field(description="that they were judged on")
    seconds: list[float] = Field(description="s of free navigation after which they were judged")
    states: list[StateBlock]
    remarks: list[str]


def filter_schema() -> dict[str, Any]:
    """Return the JSON schema of the document."""
    return FilterDocument.model_json_schema()

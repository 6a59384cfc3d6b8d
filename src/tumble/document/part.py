"""What every part of a document is: a model that refuses what is no number, and passes over what it does not know."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class DocumentPart(BaseModel):
    """A part of a document; its validator is built when it is first needed, as most are within another's."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False, defer_build=True)

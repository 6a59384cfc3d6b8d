"""What a laboratory says of itself and of its work, in a YAML file: nothing of it does tumble know or check."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import msgspec

from tumble.document import DocumentPart, read_part, refusal
from tumble.errors import UsageError
from tumble.files import opened, read_yaml, reading

LARGEST_LOGO = 4 << 20
_LOGOS = (".svg", ".png", ".jpg", ".jpeg")


class _Told(DocumentPart, forbid_unknown_fields=True):
    """What the laboratory states; a key that is none of these is a mistake."""


class Laboratory(_Told):
    """Who calibrated: name and address; `contact` a mail address, `country` of two letters (for the DCC)."""

    name: str
    address: str = ""
    contact: str = ""
    country: str = "DE"


class Customer(_Told):
    """For whom."""

    name: str
    address: str = ""
    contact: str = ""


class Item(_Told):
    """What was calibrated, beyond what the document says of it."""

    manufacturer: str = ""
    model: str = ""
    serial_number: str = ""
    condition: str = ""
    received: str = ""


class Profile(_Told):
    """What stands on a certificate beside the numbers.

    Attributes
    ----------
    place : where it was measured, where not in the laboratory's rooms.
    method : in words, or the number of a procedure of the laboratory.
    conditions : name -> value with its unit, such as temperature and humidity.
    traceability : what the results rest on, as the laboratory states it.
    adjustment : what was adjusted, and results before it; "none" if nothing was.
    statement : such as the scope of an accreditation; the laboratory alone answers for it.
    authorised_by : name and function.
    logo : file beside the profile.
    """

    laboratory: Laboratory
    customer: Customer | None = None
    item: Item = Item()
    place: str = ""
    method: str = ""
    conditions: dict[str, str] = msgspec.field(default_factory=dict[str, str])
    traceability: str = ""
    adjustment: str = ""
    statement: str = ""
    authorised_by: str = ""
    logo: str = ""


def read_profile(path: Path) -> tuple[Profile, bytes | None]:
    """Read a profile, with the logo that it names.

    Parameters
    ----------
    path : of the YAML file.

    Raises
    ------
    UsageError
        If it cannot be read, or an entry is none; the sentence names it.
    """
    with reading(path, "a profile", hint="see docs/certificate.md for what it says"):
        document: Any = read_yaml(path)
    if not isinstance(document, dict):
        raise UsageError(f"{path} is no profile: it needs `laboratory:` with a `name:` under it.")
    try:
        profile = read_part(Profile, _words(cast("dict[Any, Any]", document)))
    except msgspec.ValidationError as error:
        raise UsageError(f"{path}: {refusal(error)}; see docs/certificate.md for what it says.") from None
    return profile, None if not profile.logo else _logo(path.parent / profile.logo)


def _words(document: dict[Any, Any]) -> dict[str, Any]:
    """Keys with spaces or hyphens are the same; days and numbers are read as they are written."""
    return {
        str(key).replace(" ", "_").replace("-", "_"): (
            {
                (str(inner) if key == "conditions" else str(inner).replace(" ", "_").replace("-", "_")): str(
                    value
                )
                for inner, value in cast("dict[Any, Any]", entry).items()
            }
            if isinstance(entry, dict)
            else str(entry)
        )
        for key, entry in document.items()
    }


def _logo(path: Path) -> bytes:
    if path.suffix.lower() not in _LOGOS:
        raise UsageError(f"The logo {path} is none of {', '.join(_LOGOS)}.")
    with reading(path, "a logo"), opened(path) as file:
        content = file.read(LARGEST_LOGO + 1)
    if len(content) > LARGEST_LOGO:
        raise UsageError(f"The logo {path} is longer than 4 MB.")
    return content

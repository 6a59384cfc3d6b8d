"""What people note with a calibration: operator, place, instrument, remarks, and whatever else they name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tumble.errors import UsageError
from tumble.files import HIDDEN

USUAL = ("operator", "place", "instrument", "remarks")
"""Names that a manifest's columns, a certificate and a registry know too."""

Notes = Mapping[str, str] | Sequence[str] | None


def notes_of(given: Notes) -> dict[str, str]:
    """Return notes by name, in the order in which they were given.

    Parameters
    ----------
    given : by name, or as texts ``KEY=VALUE``.

    Raises
    ------
    UsageError
        If one has no name or no value, is given twice, or holds a line break or another control character.
    """
    if given is None:
        return {}
    if isinstance(given, str):
        given = [given]
    pairs = list(given.items()) if isinstance(given, Mapping) else [_parted(text) for text in given]
    notes: dict[str, str] = {}
    for key, value in pairs:
        name, said = str(key).strip().lower(), str(value).strip()
        if not name or not said:
            raise UsageError(f"--note {key}={value}: give a name and a value, as --note operator='A. Smith'.")
        if HIDDEN.search(name) or HIDDEN.search(said):
            raise UsageError(
                f"--note {name!r}: it holds a line break or another control character: leave it out."
            )
        if name in notes:
            raise UsageError(f"--note {name} is given twice: give it once.")
        notes[name] = said
    return notes


def _parted(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals:
        raise UsageError(f"--note {text}: give a name and a value, as --note operator='A. Smith'.")
    return key, value

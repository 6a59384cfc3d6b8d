"""What a source of samples is, and which there are: one file of `capture.sources` each, found by itself."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from functools import cache
from typing import TypeAlias

from tumble.errors import UsageError
from tumble.recording import Samples
from tumble.records import dataclass


@dataclass(frozen=True)
class Channels:
    """What a source sends.

    Attributes
    ----------
    specific_force_unit, angular_rate_unit : names that `tumble.units` knows, or "counts"; None where a triad is
        missing.
    rate : nominal, Hz.
    temperature : whether there is one, in °C.
    remarks : what was found or assumed, as sentences.
    magnetic_field_unit : of the magnetometer, empty where nobody says it; None without one.
    """

    specific_force_unit: str | None
    angular_rate_unit: str | None
    rate: float
    temperature: bool = False
    remarks: tuple[str, ...] = ()
    magnetic_field_unit: str | None = None


@dataclass(frozen=True)
class Notice:
    """Something about the stream itself that a person is told.

    Attributes
    ----------
    kind : of the event: "silence", "back", "caution" or "remark".
    words : a sentence.
    """

    kind: str
    words: str


Piece: TypeAlias = Channels | Samples | Notice | None
"""What a source yields: first its channels, then samples; a notice; None when nothing came for a moment."""


@dataclass(frozen=True)
class SourceOptions:
    """What is said of a source on the command line.

    Attributes
    ----------
    columns, units, rate : what the stream does not say itself, as for a recording.
    """

    columns: str | None = None
    units: str | None = None
    rate: float | None = None


@dataclass(frozen=True)
class Source:
    """A kind of source.

    Attributes
    ----------
    name : that an address begins with, before a colon.
    title : what it is, in a few words.
    example : an address.
    open : from what stands behind the colon, and options, to pieces. It waits no longer than a fifth of a second
        between pieces, so that whoever watches stays awake, and ends where the stream ends for good. Closing the
        iterator lets go of the port.
    live : whether samples come now, and not from a file.
    """

    name: str
    title: str
    example: str
    open: Callable[[str, SourceOptions], Iterator[Piece]]
    live: bool = True


@cache
def known_sources() -> dict[str, Source]:
    """Return the sources by name."""
    import tumble.capture.sources as room

    records: list[Source] = []
    for module in sorted(m.name for m in pkgutil.iter_modules(room.__path__)):
        found = importlib.import_module(f"{room.__name__}.{module}")
        records += [found.SOURCE] if hasattr(found, "SOURCE") else found.SOURCES
    return {record.name: record for record in records}


def find_source(address: str) -> tuple[Source, str]:
    """Return the source that an address means, and what stands behind its name.

    Parameters
    ----------
    address : such as ``serial:/dev/ttyACM0``; a path of a device alone is a serial port, ``-`` standard input.

    Raises
    ------
    UsageError
        If there is no such source.
    """
    known = known_sources()
    if address == "-":
        return known["stdin"], ""
    name, colon, rest = address.partition(":")
    if colon and name in known:
        return known[name], rest
    if address.startswith("/dev/") or address.upper().startswith("COM"):
        return known["serial"], address
    listed = ", ".join(source.example for source in known.values())
    raise UsageError(f"{address} is no source of samples. Sources are: {listed}.")

"""What a registry is asked: what is there, how a unit changes, when it is due, how units differ; and certificates."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble.arrays import Series
from tumble.certificate import Laboratory, Profile, certificate_content, certificate_pdf, read_profile
from tumble.document import Calibration, read_calibration
from tumble.errors import UsageError
from tumble.files import check_target, read_text, results_folder, shown, write_texts
from tumble.limits import read_limits
from tumble.records import dataclass
from tumble.workflows.request import CertificateRequest

if TYPE_CHECKING:
    from tumble.fleet import Between, Drift
    from tumble.registry import Entry, ParameterSeries, Registry


SHORTEST_HISTORY = 14
"""Days from the first calibration to the newest from which a rate a year is stated: what a unit did within minutes,
its warm-up, is no drift of years."""

BASELINE = 5
"""Calibrations whose mean is the reference of a unit's chart."""

MOST_UNITS = 200
"""Units by whose newest calibrations a fleet is known, and other units by which a unit's scatter is: more would
not tell a standard deviation better than to 5 %, which they themselves change by over the years."""


@contextmanager
def registry_at(name: str | None, *, make: bool = False) -> Generator[Registry, None, None]:
    """Give the registry that is meant, open.

    Parameters
    ----------
    name : file or URL; None for that of the environment, or the one in this folder.
    make : whether to make it.

    Raises
    ------
    RegistryError, UsageError
        If it cannot be opened.
    """
    from tumble.registry import open_registry, registry_name

    registry = open_registry(registry_name(name), make=make)
    try:
        yield registry
    finally:
        registry.close()


def add_files(
    name: str | None, paths: Sequence[Path], *, unit: str | None = None
) -> list[tuple[Entry, bool]]:
    """Add calibrations; return their entries, and which are new.

    Parameters
    ----------
    name : of the registry, which is made where it is not there.
    paths : of the files or their folders.
    unit : which one they are of; None for what each document says.

    Raises
    ------
    CalibrationFileError, UsageError, RegistryError
        If one cannot be read, or says no unit: none is added; or if one cannot be added: those before it are.
    """
    from tumble.registry import add, unit_of

    units = [(one, unit_of(one, unit)) for one in map(read_calibration, paths)]
    with registry_at(name, make=True) as registry:
        return [add(registry, one, unit=who) for one, who in units]


def add_calibration(name: str | None, calibration: Calibration) -> Entry:
    """Add a calibration that was just made.

    Parameters
    ----------
    name, calibration : of the registry, and the document.

    Raises
    ------
    UsageError, RegistryError
        If it cannot be added.
    """
    from tumble.registry import add

    with registry_at(name, make=True) as registry:
        return add(registry, calibration)[0]


def require_registry(name: str, serial: str | None) -> None:
    """Find out before minutes of work that a registry cannot take what comes.

    Parameters
    ----------
    name, serial : of the registry, which is made where it is not there, and of the unit.

    Raises
    ------
    UsageError, RegistryError
        If nobody says which unit it is, or the registry cannot be opened.
    """
    if serial is None:
        raise UsageError("A registry has to know which unit it is: give --imu-serial.")
    with registry_at(name, make=True):
        pass


@dataclass(frozen=True)
class Signal:
    """Where the chart of a unit is beyond its limit, in standard deviations of a calibration; `time` : s since 1970."""

    time: float
    parameter: str
    ewma: float
    limit: float


@dataclass(frozen=True)
class History:
    """A unit over time: its parameters at each calibration, their drift, and where the chart signals.

    `signals` is None of a unit with `BASELINE` calibrations or fewer: there is no chart of it.
    """

    unit: str
    parameters: ParameterSeries
    drift: Drift
    signals: list[Signal] | None


def history(name: str | None, unit: str) -> History:
    """Return how a unit changed.

    Parameters
    ----------
    name, unit : of the registry and of the unit.

    Raises
    ------
    UsageError
        If it has no calibration that is fit.
    RegistryError
        If the registry cannot be read.
    """
    from tumble.fleet import find_drift
    from tumble.registry import series

    with registry_at(name) as registry:
        found = series(registry, unit)
        if not found:
            raise UsageError(
                f"The registry {registry.name} has no calibration of unit {unit} that is fit for use."
            )
        one = found[0]
        drift = find_drift(one.unit, one.created, one.values, one.sigmas)
        signals = _signals(registry, unit, one) if len(one.created) > BASELINE else None
    return History(unit, one, drift, signals)


def _signals(registry: Registry, unit: str, parameters: ParameterSeries) -> list[Signal]:
    """Where the EWMA chart of a unit signals; the first calibrations are its reference."""
    from tumble.fleet import ewma_chart, find_drift
    from tumble.registry import series

    layout = parameters.names, parameters.units
    group = next(one for one in series(registry, unit, others=MOST_UNITS) if (one.names, one.units) == layout)
    own = group.unit == group.unit_names.index(unit)
    # What changes from one calibration to the next is known from the reference alone: a shift after it is to be seen.
    first = np.flatnonzero(own)[:BASELINE]
    keep = ~own | np.isin(np.arange(len(own)), first)
    _, number = np.unique(group.unit[keep], return_inverse=True)
    scatter = find_drift(number, group.created[keep], group.values[keep], group.sigmas[keep]).scatter
    chart = ewma_chart(group.values[own], group.sigmas[own], scatter, BASELINE)
    created: Series = group.created[own]
    return [
        Signal(float(created[i]), group.names[k], float(chart.ewma[i, k]), float(chart.limit[i]))
        for i, k in np.argwhere(chart.signals).tolist()
    ]


@dataclass(frozen=True)
class Due:
    """When a unit is due.

    Attributes
    ----------
    parameter : that is due first.
    last, due : s since 1970; NaN for `due` where nothing is known of the drift, infinite for never.
    calibrations : of the unit.
    """

    unit: str
    parameter: str
    last: float
    due: float
    calibrations: int


def due_units(name: str | None, tolerances: Path, before: str | None = None) -> list[Due]:
    """Return when each unit is due, the first one first.

    Parameters
    ----------
    name : of the registry.
    tolerances : file as for limits, each with `within`: the largest change since the calibration that is allowed.
    before : YYYY-MM-DD; units that are due later are left out, those of which nobody knows are not.

    Raises
    ------
    UsageError
        If the tolerances cannot be read, none is of a parameter in the registry, or the day is none.
    RegistryError
        If the registry cannot be read.
    """
    from tumble.registry import series

    try:
        day = math.inf if before is None else datetime.fromisoformat(before).replace(tzinfo=UTC).timestamp()
    except ValueError:
        raise UsageError(f"--before {before}: give a day as 2027-03-31.") from None
    limits = read_limits(tolerances)
    with registry_at(name) as registry:
        groups = series(registry)
        where = registry.name
    made: dict[str, Due] = {}
    compared = False
    for group in groups:
        tolerance = np.full(len(group.names), np.inf)
        for k, (parameter, unit) in enumerate(zip(group.names, group.units, strict=True)):
            limit = limits.limit_of(parameter)
            within = None if limit is None or limit.within is None else limit.within.in_unit(unit)
            tolerance[k] = math.inf if within is None else within
        if not np.any(np.isfinite(tolerance)):
            continue
        compared = True
        for one in _due_of(group, tolerance):
            if one.unit not in made or one.last > made[one.unit].last:
                made[one.unit] = one
    if not compared:
        raise UsageError(
            f"No tolerance of {tolerances} is of a parameter in the registry {where}, with `within`."
        )
    found = sorted(made.values(), key=lambda one: (math.isnan(one.due), one.due, one.unit))
    return [one for one in found if before is None or not one.due >= day]


def _due_of(group: ParameterSeries, tolerance: Series) -> Iterator[Due]:
    """When each unit is due of those with the same parameters."""
    from tumble.fleet import YEAR, due_after, find_drift

    asked = np.flatnonzero(np.isfinite(tolerance))
    drift = find_drift(group.unit, group.created, group.values[:, asked], group.sigmas[:, asked])
    after = due_after(drift, tolerance[asked])
    # What nobody knows is not never: it stands before infinity, after all that is known.
    order = np.where(np.isnan(after), 1e9, np.where(np.isinf(after), 2e9, after))
    first = np.argmin(order, axis=1)
    for number, unit in enumerate(group.unit_names):
        k = int(first[number])
        last = float(drift.last_time[number])
        until = last + float(after[number, k]) * YEAR
        yield Due(unit, group.names[int(asked[k])], last, until, int(drift.count[number]))


def fleet(name: str | None, output: Path | None = None) -> tuple[Calibration, Between]:
    """Return the mean unit as a document, and how units differ; write the document.

    Of more units than `MOST_UNITS` those count that were calibrated last.

    Parameters
    ----------
    name : of the registry.
    output : file for the document; None writes none.

    Raises
    ------
    UsageError
        If there are too few units.
    RegistryError, OutputError
        If the registry cannot be read, or the file not be written.
    """
    from tumble.fleet import fleet_document
    from tumble.registry import documents

    with registry_at(name) as registry:
        found = documents(registry, most=MOST_UNITS)
    document, between = fleet_document([calibration for _, calibration in found])
    if output is not None:
        document.write(output)
    return document, between


def date_words(seconds: float) -> str:
    """Return a day as YYYY-MM-DD, UTC, or words where there is none.

    Parameters
    ----------
    seconds : since 1970.

    Examples
    --------
    >>> date_words(0.0), date_words(float("inf"))
    ('1970-01-01', 'never')
    """
    if math.isnan(seconds):
        return "unknown"
    if seconds > 32_503_680_000.0:
        return "never"
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d")


def history_rows(found: History) -> list[dict[str, Any]]:
    """Return what is said of each parameter of a unit: newest value, change, rate, each with its uncertainty.

    Parameters
    ----------
    found : of the unit.
    """
    one, drift = found.parameters, found.drift
    days = float(one.created[-1] - one.created[0]) / 86400.0
    rows: list[dict[str, Any]] = []
    for k, (name, unit) in enumerate(zip(one.names, one.units, strict=True)):
        values: Series = one.values[:, k]
        sigmas: Series = one.sigmas[:, k]
        rate_sigma = float(drift.rate_sigma[0, k]) if days >= SHORTEST_HISTORY else math.inf
        rows.append(
            {
                "name": name,
                "unit": unit,
                "first": float(values[0]),
                "last": float(values[-1]),
                "standard_uncertainty": float(sigmas[-1]),
                "change": float(values[-1] - values[0]),
                "change_standard_uncertainty": float(np.hypot(sigmas[0], sigmas[-1])),
                "rate_a_year": float(drift.rate[0, k]) if math.isfinite(rate_sigma) else None,
                "rate_standard_uncertainty": rate_sigma if math.isfinite(rate_sigma) else None,
                "scatter": float(drift.scatter[k]),
            }
        )
    return rows


NOBODY = "–"


@dataclass(frozen=True)
class Certificate:
    """A certificate that was written: its number, the document's hash, its files, and what it lacks, in sentences."""

    number: str
    sha256: str
    files: list[Path]
    lacking: list[str]


def make_certificate(request: CertificateRequest) -> Certificate:
    """Write a certificate.

    Parameters
    ----------
    request : the calibration, the laboratory's profile, and where it goes. The certificate's number is by default made
        of the day and the calibration's identity; the same day makes the same bytes.

    Raises
    ------
    CalibrationFileError, UsageError, OutputError
        If an input is wrong, or a file cannot be written.
    """
    calibration, output, profile = request.calibration, request.output, request.profile
    document = read_calibration(calibration)
    told, logo = (
        (Profile(laboratory=Laboratory(name=NOBODY)), None) if profile is None else read_profile(profile)
    )
    _require_same_item(document, told)
    day = _day_of(request.date)
    number = request.number or f"{day.replace('-', '')}-{document.identity}"
    if shown(number) != number or len(number) > 80 or not number.strip():
        raise UsageError(f"--number {shown(number)[:40]!r}: give up to 80 visible characters.")
    check_target(output)
    results_folder(output.parent)
    if output.suffix.lower() not in (".pdf", ".xml"):
        raise UsageError(f"-o {output}: a certificate is a .pdf for people or a .xml for machines.")
    # The file itself is attached, so that its hash is the certificate's.
    text = read_text(calibration / "calibration.json" if calibration.is_dir() else calibration)
    content = certificate_content(document, told, number, day, request.language, text)
    if output.suffix.lower() == ".xml":
        from tumble.certificate import dcc_text

        made = dcc_text(document, told, number, day, request.language, text).encode()
    else:
        made = certificate_pdf(content, logo=logo)
    if request.registry is not None:
        from tumble.registry import add_certificate, document_hash

        with registry_at(request.registry) as kept:
            add_certificate(kept, document_hash(document.to_json()), number)
    return Certificate(number, content.sha256, write_texts({output: made}), _lacking(told))


def _day_of(date: str | None) -> str:
    """The day of issue as YYYY-MM-DD, today by default."""
    if date is None:
        return datetime.now(UTC).strftime("%Y-%m-%d")
    try:
        return datetime.strptime(date, "%Y-%m-%d").strftime("%Y-%m-%d")
    except ValueError:
        raise UsageError(f"--date {shown(date)[:40]}: give a day as 2026-11-22.") from None


def _require_same_item(document: Calibration, profile: Profile) -> None:
    """Refuse a profile of another unit."""
    item, unit = profile.item, document.imu
    for what, said, noted in (
        ("serial number", item.serial_number, unit.serial_number),
        ("model", item.model, unit.model),
    ):
        if said and noted and said != noted:
            raise UsageError(
                f"The profile's item has the {what} {shown(said)}, and the calibration is of {shown(noted)}: "
                "correct the profile, or leave it out there."
            )


def _lacking(profile: Profile) -> list[str]:
    """What ISO/IEC 17025 asks for and nobody has said."""
    asked: Sequence[tuple[str, str]] = (
        ("the laboratory (laboratory: name)", profile.laboratory.name.replace(NOBODY, "")),
        ("the customer (customer: name)", "" if profile.customer is None else profile.customer.name),
        ("what the results are traceable to (traceability)", profile.traceability),
        ("the item's condition (item: condition)", profile.item.condition),
        ("who authorised it (authorised_by)", profile.authorised_by),
        ("conditions such as temperature (conditions)", "".join(profile.conditions)),
    )
    missing = [name for name, said in asked if not said]
    if not missing:
        return []
    return [f"ISO/IEC 17025 asks for more than the profile says: {'; '.join(missing)}."]

"""What goes into a registry and comes out of it: calibrations with their units, and the columns they are found by."""

from __future__ import annotations

import getpass
import hashlib
import json
import os
import re
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import DecodeError

from tumble.arrays import Series, Table
from tumble.document import Calibration, calibration_of
from tumble.errors import OutputError, TumbleError, UsageError, install
from tumble.files import shown
from tumble.records import dataclass

try:
    from sqlalchemy import URL, Connection, Engine, create_engine, event, func, inspect, make_url, select
    from sqlalchemy.exc import ArgumentError, SQLAlchemyError

    from tumble.registry import schema
except ImportError:
    raise UsageError(f"A registry needs SQLAlchemy: {install('registry')}.") from None

VARIABLE = "TUMBLE_REGISTRY"
"""Environment variable that names the registry where nobody else does."""
DEFAULT = "tumble-registry.sqlite"
FIRST, NEWEST = "0001", "0002"
"""Versions of the tables."""
WAIT = 30.0
"""Seconds that a writer waits for another one."""
# Any number that all programs agree on: writers of one database wait for one another while tables are made.
_LOCK = 7_241_011
# A URL whose colon or slashes were forgotten is no file: its name would be shown with the password.
_LIKE_URL = re.compile(r"(postgres|mysql|mariadb|sqlite)\w*(:|//)")


class RegistryError(TumbleError):
    """A registry cannot be opened, read or written; nothing that was in it is lost."""


class Registry:
    """An open registry.

    Attributes
    ----------
    engine : SQLAlchemy's.
    name : its URL without the password.
    """

    def __init__(self, engine: Engine, name: str, secret: str | None) -> None:
        self.engine, self.name, self._secret = engine, name, secret

    @contextmanager
    def reading(self) -> Generator[Connection, None, None]:
        """Give a connection to read by.

        Raises
        ------
        RegistryError
            If the database fails.
        """
        with self.told(), self.engine.connect() as connection:
            yield connection

    @contextmanager
    def writing(self) -> Generator[Connection, None, None]:
        """Give a connection whose writes all come to be, or none of them.

        Raises
        ------
        RegistryError
            If the database fails.
        """
        with (
            self.told(),
            self.engine.connect().execution_options(writes=True) as connection,
            connection.begin(),
        ):
            yield connection

    @contextmanager
    def told(self) -> Generator[None, None, None]:
        """Say what goes wrong in the database in one sentence.

        Raises
        ------
        RegistryError
            Instead of the library's own errors.
        """
        try:
            yield
        except SQLAlchemyError as error:
            raise RegistryError(self._sentence(error)) from None

    def _sentence(self, error: Exception) -> str:
        cause = getattr(error, "orig", None) or error
        words = _first_line(str(cause), self._secret)
        low = words.lower()
        if "not a database" in low or "malformed" in low:
            return (
                f"The registry {self.name} is damaged ({words}): nothing was changed. Put a copy of it in its place, "
                "or begin a new one and add the calibration.json files again."
            )
        if "locked" in low:
            return f"The registry {self.name} has been in use by another program for {WAIT:g} s: try again."
        # Of a schema that a user may not use, PostgreSQL says that none was selected.
        if any(word in low for word in ("readonly", "read-only", "permission denied", "no schema has been")):
            return f"The registry {self.name} cannot be read or written to ({words}): ask for the right to."
        if "full" in low:
            return f"The disk of the registry {self.name} is full: nothing was changed."
        return f"The registry {self.name} could not do it: {words}."

    def close(self) -> None:
        """Let the database go."""
        self.engine.dispose()


def registry_name(given: str | None) -> str:
    """Return the registry that is meant: as named, else by the environment, else a file in this folder.

    Parameters
    ----------
    given : by an option.
    """
    return given or os.environ.get(VARIABLE) or DEFAULT


def open_registry(name: str, *, make: bool = False) -> Registry:
    """Open a registry, and bring an earlier version's tables up to date.

    Parameters
    ----------
    name : a file, or a URL such as ``postgresql://user:password@host/database``.
    make : whether to make a file that is not there.

    Raises
    ------
    RegistryError
        If it cannot be opened, is damaged, or is of a newer tumble.
    UsageError
        If the name is none.
    """
    url = _url(name)
    hidden = _hidden(url)
    if url.get_backend_name() == "sqlite":
        _check_file(Path(url.database or ""), make)
    try:
        engine = create_engine(url, connect_args=_arguments(url))
    except (SQLAlchemyError, ImportError) as error:
        raise UsageError(
            f"The registry {hidden} cannot be opened: {_first_line(str(error), url.password)}."
        ) from None
    _begin_as_said(engine)
    registry = Registry(engine, hidden, url.password)
    try:
        with registry.told():
            _bring_up_to_date(registry)
    except BaseException:
        registry.close()
        raise
    return registry


def _url(name: str) -> URL:
    if "://" not in name and not _LIKE_URL.match(name):
        return make_url("sqlite:///").set(database=str(Path(name)))
    if name.count("@") > 1:
        raise UsageError(
            f"{_masked(name)} has more than one @: in a user's name or password it is written %40, a colon %3A."
        )
    try:
        url = make_url(name)
    except (ArgumentError, ValueError):
        raise UsageError(
            f"{_masked(name)} is no URL of a registry: give a file, or postgresql://user:password@host/database."
        ) from None
    backend = url.get_backend_name()
    if backend not in ("sqlite", "postgresql"):
        raise UsageError(
            f"A registry is a SQLite file or a PostgreSQL database, and {_masked(name)} is neither."
        )
    return url.set(drivername="postgresql+psycopg") if backend == "postgresql" else url


def _hidden(url: URL) -> str:
    if url.get_backend_name() == "sqlite":
        return url.database or "in memory"
    return url.set(drivername="postgresql", query={}).render_as_string(hide_password=True)


def _masked(name: str) -> str:
    """A name that may be a URL with a password, without it."""
    before, mark, rest = name.rpartition("@")
    scheme = re.match(r"\w*", before)
    return shown(f"{scheme[0]}://***@{rest}" if mark and scheme else name)[:160]


def _first_line(text: str, secret: str | None) -> str:
    line = re.split(r"\n|\(Background on", text)[0].strip().rstrip(".")
    if secret:
        line = line.replace(secret, "***")
    return shown(line)[:300]


def _check_file(path: Path, make: bool) -> None:
    if not str(path) or path.is_dir():
        raise UsageError(f"The registry {path} is a folder: name a file.")
    if path.exists():
        if not path.is_file():
            raise UsageError(f"The registry {path} is no ordinary file: name one.")
        if path.stat().st_size and not os.access(path, os.R_OK):
            raise RegistryError(f"The registry {path} cannot be read: ask for the right to.")
        with path.open("rb") as file:
            head = file.read(16)
        if head and head != b"SQLite format 3\x00":
            raise RegistryError(
                f"The registry {path} is damaged, or no registry: it does not begin as a SQLite file. Nothing was "
                "changed."
            )
        return
    if not make:
        raise UsageError(f"There is no registry {path}: `tumble registry add CALIBRATION` makes it.")
    if not path.parent.is_dir():
        raise OutputError(f"The registry {path} cannot be made: there is no folder {path.parent}.")
    if not os.access(path.parent, os.W_OK):
        raise OutputError(f"The registry {path} cannot be made: {path.parent} cannot be written to.")


def _arguments(url: URL) -> dict[str, Any]:
    if url.get_backend_name() == "sqlite":
        return {"timeout": WAIT}
    return {"connect_timeout": 10}


def _begin_as_said(engine: Engine) -> None:
    """Let SQLite's transactions begin when we say so, and writers take their turn from the beginning."""
    if engine.dialect.name != "sqlite":
        return

    def connected(connection: Any, _: Any) -> None:
        connection.isolation_level = None
        connection.execute("PRAGMA foreign_keys=ON")

    def begun(connection: Connection) -> None:
        writes = connection.get_execution_options().get("writes")
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    event.listen(engine, "connect", connected)
    event.listen(engine, "begin", begun)


def _is_newest(connection: Connection, name: str) -> bool:
    """Whether the tables are of this version; one that nobody here knows is refused."""
    found = _version(connection)
    if found not in (None, FIRST, NEWEST):
        raise RegistryError(
            f"The registry {name} is of a newer tumble (version {shown(found)[:20]}; this one knows up to {NEWEST}): "
            "update tumble. Nothing was changed."
        )
    return found == NEWEST


def _version(connection: Connection) -> str | None:
    """The version of the tables; None where there are none."""
    if not inspect(connection).has_table("alembic_version"):
        return None
    return str(connection.exec_driver_sql("SELECT version_num FROM alembic_version").scalar())


def _bring_up_to_date(registry: Registry) -> None:
    with registry.engine.connect() as connection:
        if _is_newest(connection, registry.name):
            return
    with registry.engine.connect().execution_options(writes=True) as connection, connection.begin():
        if registry.engine.dialect.name == "postgresql":
            connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({_LOCK})")
        if _is_newest(connection, registry.name):
            return  # another one was faster
        if _version(connection) == FIRST:
            _move_documents(connection)
        else:
            schema.metadata.create_all(connection, checkfirst=False)
        connection.execute(schema.version.delete())
        connection.execute(schema.version.insert().values(version_num=NEWEST))


def _move_documents(connection: Connection) -> None:
    """Give the documents of the first version, which stood among the columns, a table of their own."""
    schema.documents.create(connection)
    for line in (
        "INSERT INTO documents (calibration_id, document) SELECT id, document FROM calibrations",
        "ALTER TABLE calibrations DROP COLUMN document",
        "CREATE INDEX calibrations_by_time ON calibrations (created)",
    ):
        connection.exec_driver_sql(line)


@dataclass(frozen=True)
class Entry:
    """A calibration in a registry, without its document.

    `created`, `added` : s since 1970, UTC. `limits` : decision, empty without limits.
    """

    unit: str
    sha256: str
    identity: str
    created: float
    added: float
    added_by: str
    operator: str
    remark: str
    procedure: str
    fit: bool
    limits: str
    temperature: float | None


@dataclass(frozen=True)
class ParameterSeries:
    """Calibrations with the same parameters, in the order of units and time.

    Attributes
    ----------
    names, units : of the parameters, (p,).
    unit : (n,) numbers of units in `unit_names`.
    created : (n,) s since 1970.
    values, sigmas : (n, p).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    unit_names: tuple[str, ...]
    unit: np.ndarray
    created: Series
    values: Table
    sigmas: Table


def document_hash(text: str) -> str:
    """Return the SHA-256 of a document as its file has it.

    Parameters
    ----------
    text : of ``calibration.json``.
    """
    return hashlib.sha256(text.encode()).hexdigest()


def unit_of(calibration: Calibration, unit: str | None = None) -> str:
    """Return the name of the unit that a calibration is of.

    Parameters
    ----------
    calibration, unit : the one, and the unit's name if it is given; by default the document's serial number.

    Raises
    ------
    UsageError
        If nobody says which unit it is of.
    """
    name = unit or calibration.imu.serial_number
    if not name:
        raise UsageError(
            "The calibration does not say which unit it is of: give --unit NAME (or --imu-serial when calibrating)."
        )
    return name


def add(registry: Registry, calibration: Calibration, *, unit: str | None = None) -> tuple[Entry, bool]:
    """Add a calibration; return its entry, and whether it is new.

    Parameters
    ----------
    registry, calibration : the one and the other.
    unit : its name; by default the document's serial number.

    Raises
    ------
    UsageError
        If nobody says which unit it is of, or the document is already another unit's.
    RegistryError
        If the database fails; it is then as it was.
    """
    text = calibration.to_json()
    entry = Entry(
        unit_of(calibration, unit),
        document_hash(text),
        calibration.identity,
        _seconds(calibration.created),
        time.time(),
        _user(),
        calibration.notes.get("operator", "")[:200],
        calibration.notes.get("remarks", "")[:200],
        calibration.procedure,
        calibration.verdict.fit,
        "" if calibration.limits is None else calibration.limits.decision,
        calibration.temperature_celsius,
    )
    with registry.writing() as connection:
        return _insert(connection, entry, calibration, text)


def _insert(connection: Connection, entry: Entry, calibration: Calibration, text: str) -> tuple[Entry, bool]:
    table = schema.calibrations
    if connection.dialect.name == "postgresql":
        # Two writers of one unit or document wait for one another; others do not.
        for key in sorted({_lock(entry.sha256), _lock(entry.unit), _lock("layouts")}):
            connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({key})")
    known = connection.execute(
        select(schema.units.c.name).join(table).where(table.c.sha256 == entry.sha256)
    ).scalar()
    if known is not None:
        if known != entry.unit:
            raise UsageError(f"This calibration is in the registry already, as one of unit {known}.")
        return entry, False
    unit_id = _row_of(connection, schema.units, "name", entry.unit, {"model": calibration.imu.model})
    names = json.dumps([[p.name, p.unit] for p in calibration.parameters])
    layout_id = _row_of(connection, schema.layouts, "sha256", document_hash(names), {"names": names})
    numbers = np.array(
        [[p.value for p in calibration.parameters], [p.standard_uncertainty for p in calibration.parameters]],
        dtype="<f8",
    )
    told = {key: getattr(entry, key) for key in vars(entry) if key != "unit"} | {
        "unit_id": unit_id,
        "layout_id": layout_id,
        "numbers": numbers.tobytes(),
    }
    made = connection.execute(table.insert().values(**told)).inserted_primary_key
    assert made is not None
    connection.execute(schema.documents.insert().values(calibration_id=made[0], document=text))
    rows = [{"calibration_id": made[0], "name": r.name, "sha256": r.sha256} for r in calibration.recordings]
    if rows:
        unique = {(row["name"], row["sha256"]): row for row in rows}
        connection.execute(schema.recordings.insert(), list(unique.values()))
    return entry, True


def _lock(text: str) -> int:
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:7], "big")


def _row_of(connection: Connection, table: Any, column: str, value: str, more: dict[str, Any]) -> int:
    """The number of the row with a value, made where it is not there."""
    found = connection.execute(select(table.c.id).where(table.c[column] == value)).scalar()
    if found is None:
        made = connection.execute(table.insert().values({column: value, **more})).inserted_primary_key
        assert made is not None
        found = made[0]
    return int(found)


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return ""


def _seconds(created: str) -> float:
    try:
        moment = datetime.fromisoformat(created)
    except ValueError:
        raise UsageError(f"The calibration's date {created[:40]!r} is none.") from None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def entries(
    registry: Registry, unit: str | None = None, *, sha256: str | None = None, most: int | None = None
) -> list[Entry]:
    """Return entries, the newest first.

    Parameters
    ----------
    registry : to look in.
    unit : only its own.
    sha256 : only the one of this document.
    most : as many at most.

    Raises
    ------
    RegistryError
        If the database fails.
    """
    table = schema.calibrations
    columns = [schema.units.c.name, *(table.c[key] for key in Entry.__match_args__ if key != "unit")]
    query = select(*columns).join(schema.units, table.c.unit_id == schema.units.c.id)
    if unit is not None:
        query = query.where(schema.units.c.name == unit)
    if sha256 is not None:
        query = query.where(table.c.sha256 == sha256)
    order = (table.c.created.desc(), table.c.id.desc())
    with registry.reading() as connection:
        return [Entry(*row) for row in connection.execute(query.order_by(*order).limit(most))]


def counted(registry: Registry) -> tuple[int, int]:
    """Return how many units and calibrations there are.

    Raises
    ------
    RegistryError
        If the database fails.
    """
    with registry.reading() as connection:
        units = connection.execute(select(func.count()).select_from(schema.units)).scalar()
        found = connection.execute(select(func.count()).select_from(schema.calibrations)).scalar()
    return int(units or 0), int(found or 0)


def find(registry: Registry, which: str) -> tuple[Entry, Calibration]:
    """Return a calibration: the newest of a unit, or the one whose identity or hash begins so.

    Parameters
    ----------
    registry : to look in.
    which : a unit's name, or at least six digits of an identity or of a document's SHA-256.

    Raises
    ------
    UsageError
        If there is none, or several begin so.
    RegistryError
        If the database fails.
    """
    found = entries(registry, which, most=1)
    if not found and len(which) >= 6 and not set(which) - set("0123456789abcdef"):
        table = schema.calibrations
        query = select(table.c.sha256).where(
            table.c.sha256.startswith(which) | table.c.identity.startswith(which)
        )
        with registry.reading() as connection:
            hashes = list(connection.execute(query.limit(3)).scalars())
        if len(hashes) > 1:
            raise UsageError(f"Several calibrations begin with {which}: give more of its digits.")
        found = [one for sha256 in hashes for one in entries(registry, sha256=str(sha256))]
    if not found:
        raise UsageError(f"The registry {registry.name} has no unit and no calibration {which}.")
    table, kept = schema.calibrations, schema.documents
    query = select(kept.c.document).join(table).where(table.c.sha256 == found[0].sha256)
    with registry.reading() as connection:
        text = connection.execute(query).scalar()
    try:
        return found[0], calibration_of(str(text))
    except DecodeError:
        raise RegistryError(f"The calibration of {found[0].unit} in {registry.name} is damaged.") from None


def documents(registry: Registry, most: int | None = None) -> list[tuple[str, Calibration]]:
    """Return of each unit the newest document that is fit for use, with the unit's name, in the order of names.

    Parameters
    ----------
    registry : to look in.
    most : of so many units at most, those that were calibrated last.

    Raises
    ------
    RegistryError
        If the database fails.
    """
    table = schema.calibrations
    last = func.max(table.c.created).label("last")
    newest = select(table.c.unit_id, last).where(table.c.fit).group_by(table.c.unit_id)
    chosen = newest.order_by(last.desc()).limit(most).subquery()
    query = select(schema.units.c.name, schema.documents.c.document).select_from(table)
    query = query.join(schema.units).join(schema.documents).where(table.c.fit)
    query = query.join(chosen, (table.c.unit_id == chosen.c.unit_id) & (table.c.created == chosen.c["last"]))
    with registry.reading() as connection:
        rows = connection.execute(query.order_by(schema.units.c.name, table.c.created, table.c.id)).all()
    found = {str(name): str(text) for name, text in rows}
    return [(name, calibration_of(text)) for name, text in found.items()]


def series(registry: Registry, unit: str | None = None, *, others: int = 0) -> list[ParameterSeries]:
    """Return parameters of calibrations fit for use over time, those with the same parameters together, the most first.

    A unit's calibrations whose numbers are all equal are one, the first.

    Parameters
    ----------
    registry : to look in.
    unit : only its own.
    others : beside the unit's, those of about so many other units, evenly chosen.

    Raises
    ------
    RegistryError
        If the database fails.
    """
    table = schema.calibrations
    query = select(table.c.layout_id, schema.units.c.name, table.c.created, table.c.numbers)
    query = query.join(schema.units, table.c.unit_id == schema.units.c.id).where(table.c.fit)
    if unit is not None and not others:
        query = query.where(schema.units.c.name == unit)
    elif unit is not None:
        every = max(counted(registry)[0] // others, 1)
        query = query.where((schema.units.c.name == unit) | (schema.units.c.id % every == 0))
    with registry.reading() as connection:
        rows = connection.execute(query.order_by(schema.units.c.name, table.c.created, table.c.id)).all()
        named = connection.execute(select(schema.layouts.c.id, schema.layouts.c.names)).all()
    layouts = {int(number): str(names) for number, names in named}
    # One estimate that was judged by other limits is another document, and no other measurement.
    first: dict[tuple[str, bytes], Any] = {}
    for row in rows:
        first.setdefault((row[1], row[3]), row)
    by_layout: dict[int, list[Any]] = {}
    for row in first.values():
        by_layout.setdefault(row[0], []).append(row)
    made = [_series(json.loads(layouts[number]), members) for number, members in by_layout.items()]
    return sorted(made, key=lambda one: -len(one.created))


def _series(layout: Sequence[Sequence[str]], rows: Sequence[Any]) -> ParameterSeries:
    names = tuple(name for name, _ in layout)
    numbers = np.frombuffer(b"".join(row[3] for row in rows), "<f8").reshape(len(rows), 2, len(names))
    unit_names = list(dict.fromkeys(row[1] for row in rows))
    number = {name: at for at, name in enumerate(unit_names)}
    return ParameterSeries(
        names,
        tuple(unit for _, unit in layout),
        tuple(unit_names),
        np.array([number[row[1]] for row in rows]),
        np.array([row[2] for row in rows], dtype=float),
        numbers[:, 0].copy(),
        numbers[:, 1].copy(),
    )


def add_certificate(registry: Registry, sha256: str, number: str) -> None:
    """Keep the number of a certificate.

    Parameters
    ----------
    registry : that has the calibration.
    sha256 : of the calibration's document.
    number : of the certificate.

    Raises
    ------
    UsageError
        If the registry has no such calibration, or the number is another one's.
    RegistryError
        If the database fails.
    """
    table, kept = schema.calibrations, schema.certificates
    with registry.writing() as connection:
        calibration = connection.execute(select(table.c.id).where(table.c.sha256 == sha256)).scalar()
        if calibration is None:
            raise UsageError(
                f"The registry {registry.name} has no such calibration: add it first (`tumble registry add`)."
            )
        known = connection.execute(select(kept.c.calibration_id).where(kept.c.number == number)).scalar()
        if known is not None and known != calibration:
            raise UsageError(f"The certificate number {number} is in the registry, for another calibration.")
        if known is None:
            connection.execute(
                kept.insert().values(
                    calibration_id=calibration, number=number, sha256=sha256, issued=time.time()
                )
            )

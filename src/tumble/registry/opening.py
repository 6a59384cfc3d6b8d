"""Opening a registry: its file or URL, its version, and what goes wrong there in one sentence, without a password."""

from __future__ import annotations

import os
import re
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tumble.errors import OutputError, TumbleError, UsageError, install
from tumble.files import shown

if TYPE_CHECKING:
    from sqlalchemy import URL, Connection, Engine

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
        from sqlalchemy.exc import SQLAlchemyError

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
        If the name is none, or the library is not installed.
    """
    try:
        from sqlalchemy import create_engine
        from sqlalchemy.exc import SQLAlchemyError
    except ImportError:
        raise UsageError(f"A registry needs SQLAlchemy: {install('registry')}.") from None
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
    from sqlalchemy import make_url
    from sqlalchemy.exc import ArgumentError

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
    from sqlalchemy import event

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
    from sqlalchemy import inspect

    if not inspect(connection).has_table("alembic_version"):
        return None
    return str(connection.exec_driver_sql("SELECT version_num FROM alembic_version").scalar())


def _bring_up_to_date(registry: Registry) -> None:
    with registry.engine.connect() as connection:
        if _is_newest(connection, registry.name):
            return
    from tumble.registry import schema

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
    from tumble.registry import schema

    schema.documents.create(connection)
    for line in (
        "INSERT INTO documents (calibration_id, document) SELECT id, document FROM calibrations",
        "ALTER TABLE calibrations DROP COLUMN document",
        "CREATE INDEX calibrations_by_time ON calibrations (created)",
    ):
        connection.exec_driver_sql(line)

"""Registries to try: a SQLite file, and a PostgreSQL server of its own."""

import os
import pwd
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pytest
from tests.unit.written import parameters, written

from tumble.registry import open_registry

REQUIRED = "TUMBLE_REQUIRE_POSTGRESQL"
NAMES = ("accelerometer bias x", "accelerometer scale factor error z", "gyro bias y")


def calibration_of(unit, year, values, sigmas):
    """A document of a unit at a time, with three parameters."""
    moment = np.datetime64("2020-01-01T00:00:00") + np.timedelta64(int(year * 365.25 * 86400), "s")
    rows = zip(NAMES, values.tolist(), sigmas.tolist(), ("m/s^2", "1", "rad/s"), strict=True)
    return written(
        created=f"{moment}+00:00",
        recordings=[{"name": "a.csv", "sha256": "00ff"}],
        parameters=parameters(*rows),
        imu={"serial_number": unit},
    )


@pytest.fixture(scope="session")
def document():
    return calibration_of


def program(name, place):
    """A program on the path, or else in the last of the folders where its package has it."""
    found = shutil.which(name)
    elsewhere = sorted(Path("/").glob(f"{place.lstrip('/')}/{name}"))
    return Path(found) if found else elsewhere[-1] if elsewhere else None


@pytest.fixture(scope="session")
def postgresql():
    """URL of a server that was started for the tests, with a password."""
    folder, as_owner = program("initdb", "/usr/lib/postgresql/*/bin"), program("runuser", "/usr/sbin")
    missing = [] if folder else ["PostgreSQL server (apt-get install postgresql)"]
    # A server does not run as root: it is started as its own user.
    missing += ["runuser"] if os.getuid() == 0 and not as_owner else []
    if folder is None or missing:
        words = f"Not installed: {', '.join(missing)}."
        pytest.fail(words) if os.environ.get(REQUIRED) else pytest.skip(words)
    with tempfile.TemporaryDirectory(prefix="tumble-pg-") as place:
        home, user = Path(place), []
        (home / "password").write_text("gehe:im@\n", encoding="utf-8")
        if os.getuid() == 0:
            owner = pwd.getpwnam("postgres")
            user = [str(as_owner), "-u", "postgres", "--"]
            for path in (home, home / "password"):
                os.chown(path, owner.pw_uid, owner.pw_gid)

        def run(*call):
            done = subprocess.run([*user, *call], cwd=place, capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stdout + done.stderr

        data = str(home / "data")
        init = ("-A", "scram-sha-256", "-U", "keeper", f"--pwfile={home / 'password'}", "-N")
        run(str(folder), "-D", data, *init)
        options = f"-k {place} -c listen_addresses='' -F"
        run(
            str(folder.with_name("pg_ctl")), "-D", data, "-l", str(home / "log"), "-o", options, "-w", "start"
        )
        try:
            yield f"postgresql://keeper:gehe%3Aim%40@/postgres?host={place}"
        finally:
            run(str(folder.with_name("pg_ctl")), "-D", data, "-m", "immediate", "-w", "stop")


@pytest.fixture(params=["sqlite", "postgresql"])
def address(request, tmp_path):
    """File or URL of an empty registry."""
    if request.param == "sqlite":
        yield str(tmp_path / "units.sqlite")
        return
    from sqlalchemy import create_engine

    url = request.getfixturevalue("postgresql")
    yield url
    engine = create_engine(url.replace("postgresql://", "postgresql+psycopg://"))
    with engine.begin() as connection:
        connection.exec_driver_sql("DROP SCHEMA public CASCADE")
        connection.exec_driver_sql("CREATE SCHEMA public")
    engine.dispose()


@pytest.fixture
def registry(address):
    opened = open_registry(address, make=True)
    yield opened
    opened.close()

"""A registry keeps what it was given, through two writers, a kill, damage and a newer version, in both databases."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from tumble.errors import UsageError
from tumble.registry import open_registry
from tumble.registry.store import RegistryError, add, counted, documents, entries, find, series

SIGMAS = np.array([1e-3, 2e-4, 3e-5])
VALUES = np.array([0.1, -0.02, 0.003])
WRITER = """
import sys
sys.path[:0] = [sys.argv[1], sys.argv[1] + "/../../.."]
from conftest import calibration_of
import numpy as np
from tumble.registry import open_registry
from tumble.registry.store import add
for k in range(int(sys.argv[4])):
    registry = open_registry(sys.argv[2], make=True)
    add(registry, calibration_of(f"{sys.argv[3]}-{k % 5}", k, np.arange(3.0) + k, np.ones(3)))
    registry.close()
"""


def every_document(registry):
    """All documents, in the order of units and time."""
    found = sorted(entries(registry), key=lambda one: (one.unit, one.created))
    return [find(registry, one.sha256)[1] for one in found]


def test_what_is_added_comes_out_whole(registry, document):
    notes = {"operator": "Ida", "remarks": "after repair"}
    made = structs.replace(document("A", 1.0, VALUES, SIGMAS), notes=notes)
    entry, new = add(registry, made)
    assert new
    assert add(registry, made)[1] is False
    found, back = find(registry, "A")
    assert back == made
    assert (found.operator, found.remark, found.unit) == ("Ida", "after repair", "A")
    assert find(registry, entry.sha256[:10])[1] == made
    assert counted(registry) == (1, 1)


def test_numbers_come_out_to_the_last_digit_in_the_order_of_time(registry, document):
    rng = np.random.default_rng(1)
    values = rng.normal(size=(4, 3))
    for k in (2, 0, 3, 1):
        add(registry, document("B" if k % 2 else "A", k, values[k], SIGMAS * (k + 1)))
    (found,) = series(registry)
    assert found.unit_names == ("A", "B")
    assert np.array_equal(found.values, values[[0, 2, 1, 3]])
    assert np.array_equal(found.sigmas, SIGMAS * np.array([1, 3, 2, 4])[:, None])
    assert [name for name, _ in documents(registry)] == ["A", "B"]
    assert [entry.unit for entry in entries(registry)] == ["B", "A", "B", "A"]


def test_an_estimate_that_was_judged_twice_is_one_measurement(registry, document):
    """By other limits it is another document; two of them would look like a perfect repetition."""
    made = document("A", 1.0, VALUES, SIGMAS)
    add(registry, made)
    add(registry, structs.replace(made, remarks=["judged by other limits"]))
    add(registry, document("A", 1.0, VALUES + 1e-9, SIGMAS))
    assert counted(registry) == (1, 3)
    (found,) = series(registry)
    assert np.array_equal(found.values, [VALUES, VALUES + 1e-9])


def test_a_unit_without_a_name_and_a_document_of_another_unit_are_refused(registry, document):
    made = document("A", 1.0, VALUES, SIGMAS)
    nameless = structs.replace(made, imu=structs.replace(made.imu, serial_number=None))
    with pytest.raises(UsageError, match="--unit"):
        add(registry, nameless)
    add(registry, made)
    with pytest.raises(UsageError, match="as one of unit A"):
        add(registry, made, unit="B")
    with pytest.raises(UsageError, match="no unit and no calibration"):
        find(registry, "C")


def test_two_writers_at_once_lose_nothing(address):
    """Both begin with nothing there, and so make the tables at the same time, too."""
    here = str(Path(__file__).parent)
    writers = [
        subprocess.Popen([sys.executable, "-c", WRITER, here, address, name, "8"], stderr=subprocess.PIPE)
        for name in ("one", "two")
    ]
    for writer in writers:
        _, error = writer.communicate(timeout=300)
        assert writer.returncode == 0, error.decode()
    registry = open_registry(address)
    assert counted(registry) == (10, 16)
    registry.close()


def test_a_writer_that_is_killed_leaves_whole_calibrations(address):
    here = str(Path(__file__).parent)
    writer = subprocess.Popen([sys.executable, "-c", WRITER, here, address, "one", "100000"])
    for _ in range(600):
        time.sleep(0.1)
        if Path(address).exists() or "://" in address:
            try:
                registry = open_registry(address)
            except (RegistryError, UsageError):
                continue
            _, count = counted(registry)
            registry.close()
            if count > 5:
                break
    os.kill(writer.pid, signal.SIGKILL)
    writer.wait()
    registry = open_registry(address)
    units, count = counted(registry)
    assert units == 5
    assert count > 5
    assert len(every_document(registry)) == count == sum(len(one.created) for one in series(registry))
    registry.close()


def test_a_newer_version_is_left_alone(registry, address, document):
    add(registry, document("A", 1, VALUES, SIGMAS))
    with registry.writing() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
    with pytest.raises(RegistryError, match="newer tumble") as caught:
        open_registry(address)
    assert "gehe" not in str(caught.value)
    assert str(caught.value).count("\n") == 0
    assert counted(registry) == (1, 1)


def test_damage_is_one_sentence_and_a_file_that_is_not_there_is_made_by_add_alone(tmp_path, document):
    path = tmp_path / "units.sqlite"
    registry = open_registry(str(path), make=True)
    for k in range(30):
        add(registry, document(f"U{k}", k, VALUES, SIGMAS))
    registry.close()
    whole = path.read_bytes()
    path.write_bytes(b"rubbish" * 1000)
    with pytest.raises(RegistryError, match="damaged"):
        open_registry(str(path))
    path.write_bytes(whole[: len(whole) // 2])

    def read():
        documents(open_registry(str(path)))

    with pytest.raises(RegistryError, match="damaged") as caught:
        read()
    assert "\n" not in str(caught.value)
    with pytest.raises(UsageError, match="There is no registry"):
        open_registry(str(tmp_path / "none.sqlite"))
    assert not (tmp_path / "none.sqlite").exists()


ADDRESSES = """mysql://me:secret@host/x postgresql://me:secret@127.0.0.1:1/x postgresql//me:secret@127.0.0.1/x
postgresql://me:very@secret@127.0.0.1:1/x postgres:me:secret@127.0.0.1/x nonsense://a:secret@b ://secret@x"""


@pytest.mark.parametrize("name", ADDRESSES.split())
def test_a_wrong_address_is_one_sentence_without_the_password(name):
    with pytest.raises((RegistryError, UsageError)) as caught:
        open_registry(name)
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("may", ["nothing", "see", "read"])
def test_a_wrong_password_and_a_user_without_rights_are_told_in_one_sentence(postgresql, document, may):
    from sqlalchemy import create_engine

    with pytest.raises(RegistryError, match="password") as caught:
        open_registry(postgresql.replace("gehe%3Aim%40", "falsch%21"))
    assert "falsch" not in str(caught.value)
    owner = open_registry(postgresql, make=True)
    add(owner, document("A", 1.0, VALUES, SIGMAS))
    owner.close()
    engine = create_engine(postgresql.replace("postgresql://", "postgresql+psycopg://"))
    with engine.begin() as connection:
        connection.exec_driver_sql("CREATE ROLE guest LOGIN PASSWORD 'offen'")
        connection.exec_driver_sql("REVOKE ALL ON SCHEMA public FROM PUBLIC")
        if may in ("see", "read"):
            connection.exec_driver_sql("GRANT USAGE ON SCHEMA public TO guest")
        if may == "read":
            connection.exec_driver_sql("GRANT SELECT ON ALL TABLES IN SCHEMA public TO guest")
    name = postgresql.replace("keeper:gehe%3Aim%40", "guest:offen")
    try:
        if may == "read":
            guest = open_registry(name)
            assert [one.unit for one in entries(guest)] == ["A"]
            with pytest.raises(RegistryError) as caught:
                add(guest, document("B", 1.0, VALUES, SIGMAS))
            guest.close()
        else:
            with pytest.raises(RegistryError) as caught:
                open_registry(name)
        assert str(caught.value).endswith("ask for the right to.")
        assert "\n" not in str(caught.value)
        assert "offen" not in str(caught.value)
    finally:
        with engine.begin() as connection:
            connection.exec_driver_sql("DROP OWNED BY guest")
            connection.exec_driver_sql("DROP ROLE guest")
            connection.exec_driver_sql("DROP SCHEMA public CASCADE")
            connection.exec_driver_sql("CREATE SCHEMA public")
        engine.dispose()


def test_an_earlier_version_s_documents_are_moved_whole(registry, address, document):
    """Tables as version 0001 had them, with documents among the columns."""
    made = [document(unit, year, VALUES + year, SIGMAS) for unit in "AB" for year in (1.0, 2.0)]
    for one in made:
        add(registry, one)
    with registry.writing() as connection:
        for line in (
            "DROP INDEX calibrations_by_time",
            "ALTER TABLE calibrations ADD COLUMN document TEXT NOT NULL DEFAULT ''",
            "UPDATE calibrations SET document = (SELECT document FROM documents WHERE calibration_id = id)",
            "DROP TABLE documents",
            "UPDATE alembic_version SET version_num = '0001'",
        ):
            connection.exec_driver_sql(line)
    again = open_registry(address)
    try:
        assert every_document(again) == made
        assert [one for _, one in documents(again)] == [made[1], made[3]]
        assert [name for name, _ in documents(again, most=1)] in (["A"], ["B"])
        assert add(again, made[0])[1] is False
    finally:
        again.close()

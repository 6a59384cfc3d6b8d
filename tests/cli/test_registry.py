"""A unit's way through a laboratory on the command line: calibrated into a registry, certified, due."""

import json
import sqlite3
from contextlib import closing

from tests.cli.program import RUN


def test_a_unit_goes_into_the_registry_and_gets_a_certificate(tumble, monkeypatch):
    call = "calibrate tumbled.csv --gravity 9.81 -o made --registry units.sqlite"
    tumble.refuses(call, "--imu-serial")
    tumble(
        *(call, "--imu-serial A-1 --note", ("operator=A. Smith",), "--note", ("Instrument=table <7>",)),
        *("--note", ("remarks=window open",)),
    )
    noted = tumble.json("made/calibration.json")
    assert noted["notes"] == {"operator": "A. Smith", "instrument": "table <7>", "remarks": "window open"}
    assert "table &lt;7&gt;" in tumble.text("made/report.html")
    monkeypatch.setenv("TUMBLE_REGISTRY", str(tumble.folder / "units.sqlite"))
    (entry,) = tumble("registry list --json").json
    assert (entry["unit"], entry["fit"]) == ("A-1", True)
    assert (entry["operator"], entry["remark"]) == ("A. Smith", "window open")
    assert "not fit" not in tumble("registry list").out
    tumble.put("tolerances.yaml", "limits: {accelerometer bias: 50 mg}")
    # Of a unit that was calibrated once nobody knows when it is due: it is not left out.
    due = tumble("registry list --due tolerances.yaml --before 2030-01-01", status=1)
    assert "A-1" in due.out
    assert "nothing is known of the drift" in due.out
    assert "no calibration of unit NOPE" in tumble.run("registry list --unit NOPE").out
    assert "--most -3: give one or more" in tumble.run("registry list --most -3").err
    assert "was there" in tumble.run("registry add made").out
    assert "Gyro" in tumble.run("registry history A-1 -o a.html").out
    assert len(tumble.text("a.html")) > 1_000_000
    assert tumble("registry show", entry["identity"], "--json").json["document"] == noted

    tumble.put("laboratory.yaml", "laboratory: {name: L}\nitem: {serial_number: B-2}\n")
    tumble.refuses("certificate made -o b.pdf --profile laboratory.yaml", "B-2", "A-1")
    for file, begins in (("a.pdf", b"%PDF"), ("a.xml", b"<?xml")):
        answer = tumble("certificate made --date 2026-11-22 --registry units.sqlite --number N-1 -o", file)
        assert "asks for more than the profile says" in answer.out
        assert (tumble.folder / file).read_bytes().startswith(begins)
    with closing(sqlite3.connect(tumble.folder / "units.sqlite")) as opened:
        assert opened.execute("SELECT number FROM certificates").fetchall() == [("N-1",)]


def test_without_its_library_a_registry_says_what_to_install_and_a_certificate_is_made(tumble):
    code = f"import sys; sys.modules['sqlalchemy'] = None; {RUN}"
    for call in ("registry list", "calibrate tumbled.csv --registry a.sqlite --imu-serial A"):
        answer = tumble.apart(call, code=code)
        assert (answer.returncode, answer.stdout) == (2, b"")
        assert b"A registry needs SQLAlchemy: pip install" in answer.stderr
    assert tumble.apart("certificate calibrated -o a.xml", code=code).returncode == 0


def add(tumble, unit, created, moved, bias=0.0):
    """Put a calibration of a unit into the registry, whose parameters moved by so many of their uncertainties."""
    made = tumble.json("calibrated/calibration.json")
    made["imu"]["serial_number"], made["created"], made["test_vectors"] = unit, created, []
    for parameter, by in zip(made["parameters"], moved, strict=False):
        parameter["value"] += parameter["standard_uncertainty"] * by
    for row in range(3):
        made["accelerometer"]["bias"][row] += bias * (row + 1)
    tumble.put("one.json", json.dumps(made))
    tumble("registry add one.json --registry units.sqlite")


def test_units_over_years_are_due_and_differ(tumble):
    for unit in range(6):
        for year in range(4):
            by = 3 * unit + (1 + unit % 2) * year
            created = f"{2022 + year}-0{unit + 1}-01T00:00:00+00:00"
            add(tumble, f"U{unit}", created, [float(by)] * 99, 0.01 * unit)
    tumble.put("tolerances.yaml", "limits: {gyro bias: 0.01 deg/s, accelerometer bias: 5 mg}\n")
    asked = "registry list --due tolerances.yaml --registry units.sqlite"
    due = tumble.run(asked, "--json").json
    assert {one["unit"] for one in due} == {f"U{k}" for k in range(6)}
    assert all(one["calibrations"] == 4 for one in due)
    tumble(asked, "--before 2999-01-01", status=1)
    assert "U0" not in tumble(asked, "--before 2001-01-01").out
    tumble.refuses(f"{asked} --unit U1", "leave --unit and --most out")
    tumble.refuses(f"{asked} --before soon", "--before soon: give a day")
    assert "6 units" in tumble("registry fleet --registry units.sqlite -o fleet.json").out
    another = "calibrate tumbled.csv --gravity 9.81 --procedure multi-position --imu-serial U9"
    answer = tumble.run(another, "--prior fleet.json -o next")
    assert answer.status in (0, 1), answer
    assert answer.err == ""
    tumble.refuses(f"{another} --prior one.json", "a prior must be of the same unit")


def test_a_check_unit_that_changed_is_seen(tumble):
    """Eight calibrations that agree; then one parameter jumps by ten of its uncertainties."""
    said = {}
    for number in range(12):
        quiet = (-1) ** number * 0.3 + 0.01 * number
        first = quiet + (10.0 if number >= 8 else 0.0)
        add(tumble, "CHECK-1", f"{2014 + number}-03-01T00:00:00+00:00", [first, *[quiet] * 99])
        if number in (4, 7, 11):
            call = "registry history CHECK-1 --registry units.sqlite --json"
            said[number] = tumble.run(call).json["signals"]
    assert said[4] is None
    assert said[7] == []
    name = tumble.json("calibrated/calibration.json")["parameters"][0]["name"]
    assert {one["parameter"] for one in said[11]} == {name}
    assert all(abs(one["ewma"]) > one["limit"] for one in said[11])
    history = tumble.run("registry history CHECK-1 --registry units.sqlite").out
    assert "has changed since the first 5" in history

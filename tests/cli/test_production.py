"""A unit's way through a laboratory on the command line: calibrated into a registry, certified, due."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

GRAVITY = 9.81


def test_a_unit_goes_into_the_registry_and_gets_a_certificate(
    tumble: Any, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    registry, made = tmp_path / "units.sqlite", tmp_path / "made"
    call = ("calibrate", recording, "--gravity", GRAVITY, "-o", made, "--registry", registry)
    tumble(*call).is_told(2, "--imu-serial")
    assert not made.exists()
    notes = ("--note", "operator=A. Smith", "--note", "Instrument=table <7>", "--note", "remarks=window open")
    assert tumble(*call, "--imu-serial", "A-1", *notes).status == 0
    noted = json.loads((made / "calibration.json").read_text(encoding="utf-8"))["notes"]
    assert noted == {"operator": "A. Smith", "instrument": "table <7>", "remarks": "window open"}
    assert "table &lt;7&gt;" in (made / "report.html").read_text(encoding="utf-8")
    monkeypatch.setenv("TUMBLE_REGISTRY", str(registry))
    (entry,) = json.loads(tumble("registry", "list", "--json").out)
    assert (entry["unit"], entry["fit"]) == ("A-1", True)
    assert (entry["operator"], entry["remark"]) == ("A. Smith", "window open")
    tolerances = tmp_path / "tolerances.yaml"
    tolerances.write_text("limits: {accelerometer bias: 50 mg}", encoding="utf-8")
    # Of a unit that was calibrated once nobody knows when it is due: it is not left out.
    due = tumble("registry", "list", "--due", tolerances, "--before", "2030-01-01")
    assert due.status == 1
    assert "A-1" in due.out
    assert "nothing is known of the drift" in due.out
    assert "no calibration of unit NOPE" in tumble("registry", "list", "--unit", "NOPE").out
    assert "--most -3: give one or more" in tumble("registry", "list", "--most", -3).err
    again = tumble("registry", "add", made)
    assert "was there" in again.out
    assert "Gyro" in tumble("registry", "history", "A-1", "-o", tmp_path / "a.html").out
    assert (tmp_path / "a.html").stat().st_size > 1_000_000
    shown = json.loads(tumble("registry", "show", entry["identity"], "--json").out)
    assert shown["document"] == json.loads((made / "calibration.json").read_text(encoding="utf-8"))

    profile = tmp_path / "laboratory.yaml"
    profile.write_text("laboratory: {name: L}\nitem: {serial_number: B-2}\n", encoding="utf-8")
    tumble("certificate", made, "-o", tmp_path / "b.pdf", "--profile", profile).is_told(2, "B-2", "A-1")
    assert not (tmp_path / "b.pdf").exists()
    pdf, xml = tmp_path / "a.pdf", tmp_path / "a.xml"
    certificate = ("certificate", made, "--date", "2026-11-22", "--registry", registry, "--number", "N-1")
    for file, begins in ((pdf, b"%PDF"), (xml, b"<?xml")):
        answer = tumble(*certificate, "-o", file)
        assert answer.status == 0
        assert "asks for more than the profile says" in answer.out
        assert file.read_bytes().startswith(begins)
    with closing(sqlite3.connect(registry)) as opened:
        assert opened.execute("SELECT number FROM certificates").fetchall() == [("N-1",)]


def test_wrong_calls_are_one_sentence(tumble: Any, calibrated: Path, tmp_path: Path) -> None:
    registry = tmp_path / "units.sqlite"
    for call in (
        ("registry", "list", "--registry", registry),
        ("registry", "add", calibrated, "--registry", registry),
        ("registry", "list", "--registry", "postgresql://me:secret@127.0.0.1:1/none"),
        ("registry", "list", "--registry", "mysql://me:secret@host/none"),
        ("registry", "list", "--due", tmp_path / "none.yaml", "--registry", registry),
        ("registry", "list", "--before", "2030-01-01", "--registry", registry),
        ("certificate",),
        ("certificate", calibrated, "--language", "xx", "-o", tmp_path / "a.pdf"),
        ("certificate", calibrated, "--date", "today", "-o", tmp_path / "a.pdf"),
        ("certificate", calibrated, "--profile", tmp_path / "none.yaml", "-o", tmp_path / "a.pdf"),
        ("certificate", calibrated, "--date", "today", "-o", tmp_path / "a.xml"),
    ):
        answer = tumble(*call)
        answer.is_told(2)
        assert "secret" not in answer.err + answer.out
    assert not (tmp_path / "a.pdf").exists()


def test_units_over_years_are_due_and_differ(
    tumble: Any, calibrated: Path, recording: Path, tmp_path: Path
) -> None:
    registry, document = tmp_path / "units.sqlite", json.loads((calibrated / "calibration.json").read_text())
    for unit in range(6):
        for year in range(4):
            made = json.loads(json.dumps(document))
            made["imu"]["serial_number"] = f"U{unit}"
            made["created"] = f"{2022 + year}-0{unit + 1}-01T00:00:00+00:00"
            for parameter in made["parameters"]:
                parameter["value"] += parameter["standard_uncertainty"] * (3 * unit + (1 + unit % 2) * year)
            for row in range(3):
                made["accelerometer"]["bias"][row] += 0.01 * unit * (row + 1)
            made["test_vectors"] = []
            (tmp_path / "one.json").write_text(json.dumps(made), encoding="utf-8")
            answer = tumble("registry", "add", tmp_path / "one.json", "--registry", registry)
            assert answer.status == 0, answer
    tolerances = tmp_path / "tolerances.yaml"
    tolerances.write_text("limits: {gyro bias: 0.01 deg/s, accelerometer bias: 5 mg}\n", encoding="utf-8")
    asked = ("registry", "list", "--due", tolerances, "--registry", registry)
    due = json.loads(tumble(*asked, "--json").out)
    assert {one["unit"] for one in due} == {f"U{k}" for k in range(6)}
    assert all(one["calibrations"] == 4 for one in due)
    assert tumble(*asked, "--before", "2999-01-01").status == 1
    nobody = tumble(*asked, "--before", "2001-01-01")
    assert nobody.status == 0
    assert "U0" not in nobody.out
    assert "leave --unit and --most out" in tumble(*asked, "--unit", "U1").err
    assert "--before soon: give a day" in tumble(*asked, "--before", "soon").err
    fleet = tumble("registry", "fleet", "--registry", registry, "-o", tmp_path / "fleet.json")
    assert fleet.status == 0, fleet
    assert "6 units" in fleet.out
    another = ("--gravity", "9.81", "--procedure", "multi-position", "--imu-serial", "U9")
    next_unit = tumble(
        "calibrate", recording, *another, "--prior", tmp_path / "fleet.json", "-o", tmp_path / "next"
    )
    assert next_unit.status in (0, 1), next_unit
    assert next_unit.err == ""
    said = tumble("calibrate", recording, *another, "--prior", tmp_path / "one.json")
    said.is_told(2, "a prior must be of the same unit")


def test_a_check_unit_that_changed_is_seen(tumble: Any, calibrated: Path, tmp_path: Path) -> None:
    """Eight calibrations that agree; then one parameter jumps by ten of its uncertainties."""
    registry, document = tmp_path / "units.sqlite", json.loads((calibrated / "calibration.json").read_text())
    said: dict[int, Any] = {}
    for number in range(12):
        made = json.loads(json.dumps(document))
        made["imu"]["serial_number"] = "CHECK-1"
        made["created"] = f"{2014 + number}-03-01T00:00:00+00:00"
        for at, parameter in enumerate(made["parameters"]):
            quiet = (-1) ** number * 0.3 + 0.01 * number + (10.0 if at == 0 and number >= 8 else 0.0)
            parameter["value"] += parameter["standard_uncertainty"] * quiet
        made["test_vectors"] = []
        (tmp_path / "one.json").write_text(json.dumps(made), encoding="utf-8")
        assert tumble("registry", "add", tmp_path / "one.json", "--registry", registry).status == 0
        if number in (4, 7, 11):
            said[number] = json.loads(
                tumble("registry", "history", "CHECK-1", "--registry", registry, "--json").out
            )["signals"]
    assert said[4] is None
    assert said[7] == []
    assert {one["parameter"] for one in said[11]} == {document["parameters"][0]["name"]}
    assert all(abs(one["ewma"]) > one["limit"] for one in said[11])
    assert (
        "has changed since the first 5"
        in tumble("registry", "history", "CHECK-1", "--registry", registry).out
    )

"""`tumble batch` on the command line: folder, manifest, bad units, resuming, killed and run again."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from tumble.earth import Site
from tumble.errors import UsageError
from tumble.workflows.batches.batch import run_batch
from tumble.workflows.request import CalibrateRequest

GRAVITY = 9.81
RUN = "import sys; from tumble.cli.main import main; sys.argv[0] = 'tumble'; main()"


@pytest.fixture(scope="module")
def lot(tmp_path_factory: pytest.TempPathFactory, sessions: Any, written: Any) -> Path:
    """Three good units, one with a dead gyro axis, one whose file is no recording."""
    folder = tmp_path_factory.mktemp("lot") / "units"
    folder.mkdir()
    for unit in range(3):
        written(folder / f"u{unit}.csv", sessions(40 + unit, unit_seed=unit, holds=18))
    dead: np.ndarray = sessions(50, unit_seed=9, holds=18)
    dead[:, 5] = 0.0
    written(folder / "dead.csv", dead)
    (folder / "rubbish.csv").write_text("this is\nno recording\n", encoding="utf-8")
    return folder


def table_of(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / "table.csv").open(encoding="utf-8", newline="") as file:
        return {row["unit"]: row for row in csv.DictReader(file)}


@pytest.fixture(scope="module")
def done(tumble: Any, lot: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    out = tmp_path_factory.mktemp("done") / "out"
    return out, tumble("batch", lot, "-o", out, "--gravity", GRAVITY, "--workers", 2)


def test_every_unit_has_a_row_and_what_is_wrong_with_it(done: tuple[Path, Any]) -> None:
    out, answer = done
    assert answer.status == 1
    assert answer.err == ""
    rows = table_of(out)
    assert list(next(iter(rows.values())))[:5] == ["unit", "files", "verdict", "limits", "reasons"]
    assert {unit: row["verdict"] for unit, row in rows.items() if unit.startswith("u")} == dict.fromkeys(
        ("u0", "u1", "u2"), "fit"
    )
    assert rows["rubbish"]["verdict"] == "error"
    assert rows["dead"]["verdict"] != "fit"
    assert rows["dead"]["reasons"]
    assert "3 of 5 units are accepted" in answer.out


def test_the_table_has_what_each_document_says(done: tuple[Path, Any]) -> None:
    out, _ = done
    document = json.loads((out / "units" / "u1" / "calibration.json").read_text(encoding="utf-8"))
    assert document["imu"]["serial_number"] == "u1"
    row = table_of(out)["u1"]
    frame = pl.read_parquet(out / "table.parquet")
    line = frame.filter(pl.col("unit") == "u1")
    for parameter in document["parameters"]:
        head = f"{parameter['name']} [{parameter['unit']}]"
        assert float(row[head]) == parameter["value"] == line[head][0]
        assert float(row[f"sigma of {head}"]) == parameter["standard_uncertainty"]


def test_reports_of_those_that_are_not_accepted_share_the_plotting_library(done: tuple[Path, Any]) -> None:
    out, _ = done
    assert not (out / "units" / "u0" / "report.html").exists()
    assert (out / "plotly.min.js").stat().st_size > 1_000_000
    assert (out / "table.html").stat().st_size < 500_000
    page = (out / "table.html").read_text(encoding="utf-8")
    assert '<script src="plotly.min.js">' in page
    for title in ("accelerometer bias / mg", "gyro bias / (°/s)", "gyro scale factor error / "):
        assert title in page


def test_a_second_run_does_nothing_anew_and_a_third_what_is_new(
    tumble: Any, lot: Path, tmp_path: Path, written: Any, sessions: Any
) -> None:
    units = tmp_path / "units"
    units.mkdir()
    for name in ("u0.csv", "u1.csv"):
        (units / name).write_bytes((lot / name).read_bytes())
    call = ("batch", units, "-o", tmp_path / "out", "--gravity", GRAVITY, "--workers", 1, "--reports", "none")
    first = tumble(*call, "--json")
    assert json.loads(first.out)["worked"] == 2
    stamps = {path: path.stat().st_mtime_ns for path in (tmp_path / "out" / "units").rglob("*.json")}
    table = (tmp_path / "out" / "table.csv").read_bytes()
    again = json.loads(tumble(*call, "--json").out)
    assert (again["worked"], again["kept"]) == (0, 2)
    assert stamps == {path: path.stat().st_mtime_ns for path in (tmp_path / "out" / "units").rglob("*.json")}
    assert (tmp_path / "out" / "table.csv").read_bytes() == table
    (units / "u1.csv").write_bytes((lot / "u2.csv").read_bytes())
    (tmp_path / "out" / "units" / "u0" / "calibration.json").write_text("{")
    third = json.loads(tumble(*call, "--json").out)
    assert (third["worked"], third["kept"]) == (2, 0)


def test_a_wrong_option_and_a_file_that_is_gone_leave_earlier_results(
    tumble: Any, lot: Path, tmp_path: Path
) -> None:
    units = tmp_path / "units"
    units.mkdir()
    (units / "u0.csv").write_bytes((lot / "u0.csv").read_bytes())
    (tmp_path / "lot.csv").write_text("unit,files\nu0,units/u0.csv\n", encoding="utf-8")
    call = ("batch", tmp_path / "lot.csv", "-o", tmp_path / "out", "--workers", 1, "--reports", "none")
    assert tumble(*call, "--gravity", GRAVITY).status == 0
    written = {path: path.read_bytes() for path in (tmp_path / "out").rglob("*.*")}
    for wrong in (("--gravity", 42), ("--procedure", "nope"), ("--protocol", "nope"), ("--units", "furlong")):
        tumble(*call, *(() if "--gravity" in wrong else ("--gravity", GRAVITY)), *wrong).is_told(2)
    assert written == {path: path.read_bytes() for path in (tmp_path / "out").rglob("*.*")}
    (units / "u0.csv").rename(units / "gone")
    answer = tumble(*call, "--gravity", GRAVITY)
    assert answer.status == 1
    assert "There is no file" in answer.out
    assert "The calibration of an earlier run is left as it is." in answer.out
    place = tmp_path / "out" / "units" / "u0" / "calibration.json"
    assert place.read_bytes() == written[place]
    (units / "gone").rename(units / "u0.csv")
    assert json.loads(tumble(*call, "--gravity", GRAVITY, "--json").out)["kept"] == 1


def test_a_manifest_with_a_missing_file_does_the_others(tumble: Any, lot: Path, tmp_path: Path) -> None:
    manifest = tmp_path / "lot.csv"
    lines = [
        f"A,{lot / 'u0.csv'},{GRAVITY},21.5,left,Eve",
        f"B,{tmp_path / 'gone.csv'},{GRAVITY},21.5,right,",
    ]
    manifest.write_text(
        "unit,files,gravity,temperature,table,operator\n" + "\n".join(lines) + "\n", encoding="utf-8"
    )
    answer = tumble(
        "batch", manifest, "-o", tmp_path / "out", "--workers", 1, "--reports", "all", "--note", "Place=hall"
    )
    assert answer.status == 1
    rows = table_of(tmp_path / "out")
    assert rows["A"]["verdict"] == "fit"
    assert (rows["A"]["temperature [degC]"], rows["A"]["table"]) == ("21.5", "left")
    assert (rows["A"]["operator"], rows["A"]["place"]) == ("Eve", "hall")
    made = (tmp_path / "out" / "units" / "A" / "calibration.json").read_text(encoding="utf-8")
    assert json.loads(made)["notes"] == {"place": "hall", "operator": "Eve"}
    assert rows["B"]["verdict"] == "error"
    assert "gone.csv" in rows["B"]["reasons"]
    page = (tmp_path / "out" / "units" / "A" / "report.html").read_text(encoding="utf-8")
    assert '<script src="../../plotly.min.js">' in page
    assert len(page) < 1_000_000


def test_unreadable_limits_and_a_wrong_source_are_one_sentence(
    tumble: Any, lot: Path, tmp_path: Path
) -> None:
    for extra in (("--limits", tmp_path / "none.yaml"), ("--reports", "some")):
        tumble("batch", lot, "-o", tmp_path / "out", *extra).is_told(2)
    assert tumble("batch", tmp_path / "nowhere", "-o", tmp_path / "out").status == 2
    stored = tumble("batch", "s3://me:secret@b/u.csv", "-o", tmp_path / "out")
    stored.is_told(2, "s3://***@b/u.csv: a batch is of files of this machine")
    with pytest.raises(UsageError, match="--output does not go with batches"):
        run_batch(str(lot), tmp_path / "out", CalibrateRequest(output="one"))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("later", [0.0, 0.5])
def test_ctrl_c_is_one_sentence_while_workers_start_and_while_they_work(
    lot: Path, tmp_path: Path, later: float
) -> None:
    program = "import sys; from tumble.cli.main import program; sys.argv[0] = 'tumble'; program()"
    call = [sys.executable, "-c", program, "batch", lot, "--gravity", str(GRAVITY), "-o", tmp_path / "out"]
    # A session of its own: a terminal sends Ctrl-C to the workers, too.
    running = subprocess.Popen(call, stderr=subprocess.PIPE, text=True, start_new_session=True)
    while not (tmp_path / "out" / "units").exists() and running.poll() is None:
        time.sleep(0.01)
    time.sleep(later)
    os.killpg(running.pid, signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 130
    assert said == "tumble: Stopped; the units that were done are kept, and the same call does the rest.\n"


@pytest.mark.slow
def test_killed_and_run_again_it_is_as_if_nothing_had_happened(
    tumble: Any, lot: Path, done: tuple[Path, Any], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    call = ["batch", str(lot), "-o", str(out), "--gravity", str(GRAVITY), "--workers", "2"]
    for seconds in (3.0, 5.0):
        running = subprocess.Popen([sys.executable, "-c", RUN, *call], stdout=subprocess.DEVNULL)
        time.sleep(seconds)
        os.kill(running.pid, signal.SIGKILL)
        running.wait()
    assert tumble(*call).status == 1
    assert table_of(out) == table_of(done[0])
    assert not list(out.rglob("*.part"))


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_in_the_middle_does_all_units(
    tumble: Any, lot: Path, done: tuple[Path, Any], tmp_path: Path
) -> None:
    """Two workers of Dask as processes of their own, of which one is killed when the first unit is there."""
    distributed = pytest.importorskip("distributed", reason="the extra fleet is not installed")

    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=str(tmp_path / "dask")
    ) as cluster:
        killed: list[int] = []

        def kill_once(words: str) -> None:
            if words.startswith("1 of") and not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        batch = run_batch(
            str(lot),
            tmp_path / "out",
            CalibrateRequest(site=Site.from_gravity(GRAVITY)),
            scheduler=cluster.scheduler_address,
            progress=kill_once,
        )
    assert len(killed) == 1
    assert batch.accepted == 3
    assert table_of(tmp_path / "out") == table_of(done[0])


@pytest.mark.slow
def test_nobody_who_answers_as_a_scheduler_is_one_sentence_without_the_password(
    tumble: Any, lot: Path, tmp_path: Path
) -> None:
    pytest.importorskip("distributed", reason="the extra fleet is not installed")
    for address in ("tcp://127.0.0.1:1", "tcp://me:secret@127.0.0.1:1"):
        answer = tumble("batch", lot, "-o", tmp_path / "out", "--scheduler", address)
        answer.is_told(2)
        assert "secret" not in answer.err

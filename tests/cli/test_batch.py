"""`tumble batch` on the command line: folder, manifest, bad units, resuming, killed and run again."""

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import polars as pl
import pytest
from tests.cli.program import GRAVITY, RUN, Answer, Bench, tumbled_rows

from tumble.earth import Site
from tumble.errors import UsageError
from tumble.workflows import CalibrateRequest, run_batch

BATCH = "batch units -o out --gravity 9.81"


@pytest.fixture(scope="module")
def lot(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """Three good units, one with a dead gyro axis, one whose file is no recording."""
    bench = Bench(tmp_path_factory.mktemp("lot"))
    (bench.folder / "units").mkdir()
    for unit in range(3):
        bench.write(f"units/u{unit}.csv", tumbled_rows(40 + unit, unit_seed=unit, holds=18))
    dead = tumbled_rows(50, unit_seed=9, holds=18)
    dead[:, 5] = 0.0
    bench.write("units/dead.csv", dead)
    bench.put("units/rubbish.csv", "this is\nno recording\n")
    return bench


@pytest.fixture(scope="module")
def done(lot: Bench) -> Answer:
    return lot(BATCH, "--workers", "2", status=1)


@pytest.fixture
def bench(lot: Bench, tmp_path: Path) -> Bench:
    """A lot of two of the good units."""
    (tmp_path / "units").mkdir()
    for name in ("u0.csv", "u1.csv"):
        (tmp_path / "units" / name).write_bytes((lot.folder / "units" / name).read_bytes())
    return Bench(tmp_path)


def table_of(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / "table.csv").open(encoding="utf-8", newline="") as file:
        return {row["unit"]: row for row in csv.DictReader(file)}


def test_every_unit_has_a_row_what_is_wrong_with_it_and_what_its_document_says(lot, done):
    out = lot.folder / "out"
    rows = table_of(out)
    assert list(next(iter(rows.values())))[:5] == ["unit", "files", "verdict", "limits", "reasons"]
    assert [rows[f"u{k}"]["verdict"] for k in range(3)] == ["fit"] * 3
    assert rows["rubbish"]["verdict"] == "error"
    assert rows["dead"]["verdict"] != "fit"
    assert rows["dead"]["reasons"]
    assert "3 of 5 units are accepted" in done.out
    document = lot.json("out/units/u1/calibration.json")
    assert document["imu"]["serial_number"] == "u1"
    line = pl.read_parquet(out / "table.parquet").filter(pl.col("unit") == "u1")
    for parameter in document["parameters"]:
        head = f"{parameter['name']} [{parameter['unit']}]"
        assert float(rows["u1"][head]) == parameter["value"] == line[head][0]
        assert float(rows["u1"][f"sigma of {head}"]) == parameter["standard_uncertainty"]


@pytest.mark.usefixtures("done")
def test_reports_of_those_that_are_not_accepted_share_the_plotting_library(lot: Bench) -> None:
    out = lot.folder / "out"
    assert not (out / "units" / "u0" / "report.html").exists()
    assert (out / "plotly.min.js").stat().st_size > 1_000_000
    page = lot.text("out/table.html")
    assert len(page) < 500_000
    assert '<script src="plotly.min.js">' in page
    for title in ("accelerometer bias / mg", "gyro bias / (°/s)", "gyro scale factor error / "):
        assert title in page


def test_a_second_run_does_nothing_anew_and_a_third_what_is_new(lot: Bench, bench: Bench) -> None:
    call = f"{BATCH} --workers 1 --reports none --json"
    assert bench(call).json["worked"] == 2
    units = bench.folder / "out" / "units"
    stamps = {path: path.stat().st_mtime_ns for path in units.rglob("*.json")}
    table = bench.text("out/table.csv")
    again = bench(call).json
    assert (again["worked"], again["kept"]) == (0, 2)
    assert stamps == {path: path.stat().st_mtime_ns for path in units.rglob("*.json")}
    assert bench.text("out/table.csv") == table
    bench.put("units/u1.csv", lot.text("units/u2.csv"))
    bench.put("out/units/u0/calibration.json", "{")
    third = bench(call).json
    assert (third["worked"], third["kept"]) == (2, 0)


def test_a_wrong_option_and_a_file_that_is_gone_leave_earlier_results(bench: Bench) -> None:
    bench.put("lot.csv", "unit,files\nu0,units/u0.csv\n")
    call = "batch lot.csv -o out --workers 1 --reports none"
    bench(call, "--gravity 9.81")
    for wrong, word in (
        ("--gravity 42", "42"),
        ("--gravity 9.81 --procedure nope", "nope"),
        ("--gravity 9.81 --protocol nope", "nope"),
        ("--gravity 9.81 --units furlong", "furlong"),
    ):
        bench.refuses(f"{call} {wrong}", word)
    made = bench.text("out/units/u0/calibration.json")
    (bench.folder / "units" / "u0.csv").rename(bench.folder / "gone")
    answer = bench(call, "--gravity 9.81", status=1)
    assert "There is no file" in answer.out
    assert "The calibration of an earlier run is left as it is." in answer.out
    assert bench.text("out/units/u0/calibration.json") == made
    (bench.folder / "gone").rename(bench.folder / "units" / "u0.csv")
    assert bench(call, "--gravity 9.81 --json").json["kept"] == 1
    with pytest.raises(UsageError, match="--output does not go with batches"):
        run_batch(str(bench.folder / "units"), bench.folder / "new", CalibrateRequest(output="one"))


def test_a_manifest_says_what_holds_for_each_unit_and_is_in_the_table(bench: Bench) -> None:
    bench.put(
        "lot.csv",
        "unit,files,gravity,temperature,table,operator\n"
        "A,units/u0.csv,9.81,21.5,left,Eve\nB,gone.csv,9.81,21.5,right,\n",
    )
    bench("batch lot.csv -o out --workers 1 --reports all --note Place=hall", status=1)
    rows = table_of(bench.folder / "out")
    told = [rows["A"][name] for name in ("verdict", "temperature [degC]", "table", "operator", "place")]
    assert told == ["fit", "21.5", "left", "Eve", "hall"]
    assert bench.json("out/units/A/calibration.json")["notes"] == {"place": "hall", "operator": "Eve"}
    assert rows["B"]["verdict"] == "error"
    assert "gone.csv" in rows["B"]["reasons"]
    page = bench.text("out/units/A/report.html")
    assert '<script src="../../plotly.min.js">' in page
    assert len(page) < 1_000_000


@pytest.mark.parametrize("later", [0.0, 0.5])
def test_ctrl_c_is_one_sentence_while_workers_start_and_while_they_work(bench: Bench, later: float) -> None:
    call = [sys.executable, "-c", RUN, *BATCH.split()]
    # A session of its own: a terminal sends Ctrl-C to the workers, too.
    running = subprocess.Popen(
        call, cwd=bench.folder, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    while not (bench.folder / "out" / "units").exists() and running.poll() is None:
        time.sleep(0.01)
    time.sleep(later)
    os.killpg(running.pid, signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 130
    assert said == "tumble: Stopped; the units that were done are kept, and the same call does the rest.\n"


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_in_the_middle_does_all_units(lot, done, tmp_path, monkeypatch):
    """Two workers of Dask as processes of their own, of which one is killed when the first unit is there."""
    distributed = pytest.importorskip("distributed", reason="the extra fleet is not installed")
    assert done.status == 1
    monkeypatch.chdir(lot.folder)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=str(tmp_path / "dask")
    ) as cluster:
        killed: list[int] = []

        def kill_once(words: str) -> None:
            if words.startswith("1 of") and not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        batch = run_batch(
            "units",
            tmp_path / "out",
            CalibrateRequest(site=Site.from_gravity(GRAVITY)),
            scheduler=cluster.scheduler_address,
            progress=kill_once,
        )
    assert len(killed) == 1
    assert batch.accepted == 3
    assert table_of(tmp_path / "out") == table_of(lot.folder / "out")


@pytest.mark.slow
@pytest.mark.parametrize("who", ["", "me:secret@"])
def test_nobody_who_answers_as_a_scheduler_is_one_sentence_without_the_password(bench, who):
    pytest.importorskip("distributed", reason="the extra fleet is not installed")
    bench.run(f"{BATCH} --scheduler tcp://{who}127.0.0.1:1").is_told(2, "127.0.0.1:1")

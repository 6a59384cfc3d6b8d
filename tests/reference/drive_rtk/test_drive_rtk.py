"""The cut of a real drive: files as a receiver and a logger wrote them, through the whole of `verify --gnss`."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from tumble.workflows.drive import verify_drive
from tumble.workflows.drive_verification import DriveVerification

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> DriveVerification:
    folder = tmp_path_factory.mktemp("drive")
    for name in ("imu.csv", "track.pos"):
        (folder / name).write_bytes(gzip.decompress((HERE / f"{name}.gz").read_bytes()))
    return verify_drive(
        HERE / "calibration.json",
        folder / "imu.csv",
        folder / "track.pos",
        units="g,deg/s,ms",
        durations=(2.0,),
        turn_on=(0.0, 0.0),
    )


def test_the_clocks_are_those_of_the_whole_drive(found: DriveVerification) -> None:
    # the whole drive gives -1436038199.812 s; two setups differ there by 42 ms already, and a fifth of it by twice that
    assert found.offset == pytest.approx(-1436038199.812, abs=0.1)


def test_a_calibration_of_the_minutes_before_halves_the_first_seconds_of_drift(
    found: DriveVerification,
) -> None:
    two = found.seconds.tolist().index(2.0)
    ratio = found.drift_ratio("all", two)
    assert ratio.value + 2.0 * ratio.sigma < 1.0


def test_an_outage_of_two_seconds_costs_decimetres(found: DriveVerification) -> None:
    """The filter's own estimates are as good as the calibration by then: 0.14 m on the whole drive."""
    rms, _ = found.outage_statistics("all", 2.0, "sliding")
    assert 0.02 < rms.value < 0.4
    assert found.accuracy("all")[2].startswith("low")

"""The cut of a real drive: files as a receiver and a logger wrote them, through the whole of `verify --gnss`."""

import gzip
from pathlib import Path

import pytest

from tumble.workflows import verify_drive

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    for name in ("imu.csv", "track.pos"):
        (folder / name).write_bytes(gzip.decompress((HERE / f"{name}.gz").read_bytes()))
    return folder


def judged(recording, track):
    document = HERE / "calibration.json"
    return verify_drive(document, recording, track, units="g,deg/s,ms", turn_on=(0.0, 0.0))


@pytest.fixture(scope="module")
def found(files):
    return judged(files / "imu.csv", files / "track.pos")


def after_two(found):
    return next(after for after in found.variant("all").drift if after.seconds == 2.0)


def test_the_clocks_are_those_of_the_whole_drive(found):
    # the whole drive gives -1436038199.812 s; two setups differ there by 42 ms already, and a fifth of it by twice that
    assert found.time_offset.value == pytest.approx(-1436038199.812, abs=0.1)


def test_a_calibration_of_the_minutes_before_halves_the_first_seconds_of_drift(found):
    ratio = after_two(found).ratio_to_uncalibrated
    assert ratio.value + 2.0 * ratio.standard_uncertainty < 1.0


def test_an_outage_of_two_seconds_costs_decimetres(found):
    """The filter's own estimates are as good as the calibration by then: 0.14 m on the whole drive."""
    whole = found.variant("all")
    assert 0.02 < whole.outages_sliding[0].horizontal_rms.value < 0.4
    assert whole.accuracy_class.startswith("low")


def test_innovations_smaller_than_expected_are_explained_by_the_drive(found):
    """Positions scatter less than RTKLIB states, which an independent look at the rests confirms."""
    assert found.variant("all").innovations < 0.7
    assert any("mm are stated" in reason for reason in found.reasons)


def test_missing_samples_do_not_change_what_is_said_of_the_calibration(found, files, tmp_path):
    """Ten seconds of turns left out: a lost filter would refuse positions and find biases off."""
    lines = (files / "imu.csv").read_text().splitlines()
    first = float(lines[1].rsplit(",", 1)[1])
    kept = [line for line in lines[1:] if not 60e3 < float(line.rsplit(",", 1)[1]) - first < 70e3]
    (tmp_path / "imu.csv").write_text("\n".join([lines[0], *kept]) + "\n")
    cut = judged(tmp_path / "imu.csv", files / "track.pos")
    assert cut.fit == found.fit
    assert cut.variant("all").positions_refused <= found.variant("all").positions_refused + 1
    assert any("starts anew" in remark for remark in cut.remarks)
    now, before = (after_two(one).horizontal_rms for one in (cut, found))
    both = now.standard_uncertainty**2 + before.standard_uncertainty**2
    assert abs(now.value - before.value) < 3.0 * both**0.5

"""`tumble noise` as a user meets it: what it prints and writes, whole or block by block, of recordings good and bad."""

import re
from typing import Any

import numpy as np
import polars as pl
import pytest
from tests.cli.program import Bench
from tests.unit.workflows.blocks import cut

from tumble.document import read_part
from tumble.noise import allan_deviation
from tumble.report import NoiseDocument

RATE = 100.0
GYRO = "t,gx,gy,gz"
WHOLE, BLOCKS = "whole", "block by block"


@pytest.fixture
def bench(tmp_path):
    """An empty folder."""
    return Bench(tmp_path)


@pytest.fixture(params=[WHOLE, BLOCKS])
def how(request, monkeypatch):
    """How a file is read, whatever its size."""
    monkeypatch.setattr("tumble.workflows.noise.STREAMED_ABOVE", 2**60 if request.param == WHOLE else -1)
    return str(request.param)


@pytest.fixture(scope="module")
def still():
    """200 s at rest: N is 3e-4 m/s²/√Hz and 1e-4 rad/s/√Hz."""
    rng = np.random.default_rng(8)
    count = 20_000
    force = 3e-4 * np.sqrt(RATE) * rng.standard_normal((count, 3)) + [0.05, -0.1, 9.81]
    turn = 1e-4 * np.sqrt(RATE) * rng.standard_normal((count, 3)) + [0.001, 0.002, -0.003]
    return np.column_stack([np.arange(count) / RATE, force, turn])


@pytest.fixture(scope="module")
def turning(still):
    """The gyros alone."""
    return still[:, [0, 4, 5, 6]]


def test_noise_prints_every_channel_and_writes_a_document_and_a_page(bench, still):
    bench.write("still.csv", still[:12_000])
    answer = bench("noise still.csv -o out")
    for word in ("ax ", "gz ", "velocity random walk", "angle random walk", "°/√h", "µg/√Hz", "IEEE Std 952"):
        assert word in answer.out
    assert set(bench.contents("out")) == {"noise.html", "noise.json"}
    document = bench.json("out/noise.json")
    assert (document["format"], document["version"]) == ("tumble noise", 1)
    for name, expected, unit in (("ay", 3e-4, "m/s²/√Hz"), ("gx", 1e-4, "rad/s/√Hz")):
        white = document["channels"][name]["terms"]["N"]
        # 12,000 samples know N to 0.7 %, four of these.
        assert white["value"] == pytest.approx(expected, rel=0.03)
        assert white["unit"] == unit
        assert document["channels"][name]["random_walk"]["value"] == white["value"]
    angle_walk = document["channels"]["gx"]["terms"]["N"]["practical"]
    assert angle_walk["unit"] == "°/√h"
    assert angle_walk["value"] == pytest.approx(np.degrees(1e-4) * 60.0, rel=0.03)
    curve = document["channels"]["gx"]["allan_deviation"]
    assert len(curve["tau_s"]) == len(curve["deviation"]) == len(curve["low"]) == len(curve["high"])
    page = bench.text("out/noise.html")
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert 'src="http' not in page
    for name in ("allan-g", "allan-a", "spectrum-g", "level-a"):
        assert f'id="{name}"' in page


def test_json_is_the_document_and_quiet_what_is_seen_and_no_more(bench, still):
    bench.write("still.csv", still[:2000])
    quiet = bench("noise still.csv -q")
    assert set(bench.contents()) == {"still.csv"}  # without a folder nothing is written
    assert "not seen" not in quiet.out
    assert "•" not in quiet.out
    assert len(re.findall("random walk", quiet.out)) == 6
    assert bench("noise still.csv --json -o out").json == bench.json("out/noise.json")
    bench.write("odd.csv", still[:1000], "time_s,ax_m/s2,ay_m/s2,az_m/s2,one,two,three")
    assert "There is no gyro: what was found is" in bench("noise odd.csv").out


def test_both_methods_estimate_a_simulated_unit_alike(bench, still):
    """From one recording: their difference is below the uncertainty of either."""
    bench.write("still.csv", still[:12_000])
    by = {m: bench(f"noise still.csv --fit {m} --json").json["channels"]["gx"] for m in ("curve", "moments")}
    assert "wavelet moments" in by["moments"]["fit"]["what"]
    one, other = (found["terms"]["N"] for found in by.values())
    assert one["value"] != other["value"]
    assert abs(one["value"] - other["value"]) < one["standard_uncertainty"]


# --- what a user's recording may have wrong with it: what is still possible is done


def moving(rows: np.ndarray) -> np.ndarray:
    return 0.9 * np.sin(np.outer(rows[:, 0], [2.0, 3.0, 5.0]))


def moved(rows: np.ndarray) -> None:
    rows[5000:6000, 1:] += moving(rows[:1000])


def dead(rows: np.ndarray) -> None:
    rows[:, 2] = 0.25


def reset(rows: np.ndarray) -> None:
    rows[12_000:, 0] -= 120.0


def switched_on(rows: np.ndarray) -> None:
    rows[9000:, 3] += 0.01


def holed(rows: np.ndarray) -> None:
    rows[4000:4900, 1] = np.nan


def doubled(rows: np.ndarray) -> None:
    """Every sample twice, with stamps of its own: a driver that is asked faster than the sensor gives."""
    rows[:, 1:] = np.repeat(rows[:10_000, 1:], 2, axis=0)


def stamped_twice(rows: np.ndarray) -> None:
    rows[701:] = rows[700:-1].copy()


@pytest.mark.parametrize(
    ("spoil", "said", "channels"),
    [
        (moved, "not at rest all the time (first at t = ", 3),
        (dead, "gy never changes (0.25 throughout)", 2),
        (doubled, "50 % of the rows repeat the row before", 3),
        (stamped_twice, "repeated stamp left out", 3),
        (reset, "the clock steps back at line 12002", 3),
        (switched_on, "gz steps by 0.01", 3),
        (holed, "900 row(s) without a finite number left out (first: line 4002, column 'gx')", 3),
    ],
)
def test_it_is_said_and_the_rest_is_analysed(bench, turning, how, spoil, said, channels):
    rows = turning.copy()
    spoil(rows)
    bench.write("spoiled.csv", rows, GYRO)
    assert said in bench("noise spoiled.csv -o out").out
    document = bench.json("out/noise.json")
    assert document["read"] == how
    assert len(document["channels"]) == channels
    for name, block in document["channels"].items():
        # The doubled file has its values at half of the rate.
        white = np.sqrt(2.0) * 1e-4 if spoil is doubled else 1e-4
        # 20,000 samples know N to 0.5 %, of which this is five; pieces left out cost less than a third of them.
        assert block["terms"]["N"]["value"] == pytest.approx(white, rel=0.03), name
    if spoil is reset:
        assert document["pieces"] == [[0, 12_000], [12_000, 20_000]]
    assert document["recorded_rate_hz"] == (pytest.approx(RATE) if spoil is doubled else None)


@pytest.mark.usefixtures("how")
def test_three_seconds_give_white_noise_and_say_what_they_do_not(bench, turning):
    bench.write("short.csv", turning[:300], GYRO)
    answer = bench("noise short.csv")
    assert "very short (3 s at rest)" in answer.out
    assert "for N to 2 % record 50 s" in answer.out
    assert "for K" not in answer.out  # of what is far from being seen, no length is advised


def never_still(rows: np.ndarray) -> np.ndarray:
    return rows[:6000] + np.column_stack([np.zeros(6000), moving(rows[:6000])])


def two_clocks(rows: np.ndarray) -> np.ndarray:
    time = rows[:6000, 0]
    return np.column_stack([np.where(time < 40.0, time, 3.0 * (time - 40.0)), rows[:6000, 1:]])


@pytest.mark.usefixtures("how")
@pytest.mark.parametrize(
    ("rows", "options", "said"),
    [
        (lambda rows: rows[:12], "", "No stretch at rest of 16 samples"),
        (lambda rows: rows[:100] * [1, 0, 0, 0], "", "all zeros"),
        (lambda rows: rows[:1000] * [1, 0, 0, 0] + [0, 0.1, 0.2, 0.3], "", "No channel ever changes (gx 0.1"),
        (never_still, "", "never rests"),
        (two_clocks, "", "time steps back"),
        (lambda rows: rows[:2000], "--skip 1e9", "leaves nothing"),
    ],
    ids=["twelve samples", "zeros", "dead", "never still", "two clocks", "all skipped"],
)
def test_nothing_is_left_and_nothing_is_written(bench, turning, rows, options, said):
    bench.write("bad.csv", rows(turning), GYRO)
    bench.refuses(f"noise bad.csv -o out {options}", said)


# --- block by block

NAMES = ["t", "gx", "gy", "gz", "temperature"]
FAST = 200.0


@pytest.fixture(scope="module")
def shaken():
    """150 s of a gyro with white noise, a random walk and a vibration at 31 Hz in gx, and a temperature."""
    rng = np.random.default_rng(12)
    count = 30_000
    time = np.arange(count) / FAST
    celsius = 25.0 + np.sin(time / 150.0)
    turn = 1e-3 * rng.standard_normal((count, 3)) + np.cumsum(2e-6 * rng.standard_normal((count, 3)), axis=0)
    turn[:, 0] += 4e-4 * np.sin(2.0 * np.pi * 31.0 * time)
    turn[:, 1] += 5e-4 * (celsius - 25.0)
    return np.column_stack([time, turn, celsius])


@pytest.fixture(scope="module")
def both(shaken, tmp_path_factory):
    """What is found in a file that is read whole and in blocks of 7001 rows; a question is asked once."""
    bench = Bench(tmp_path_factory.mktemp("formats"))
    frame = pl.DataFrame(shaken, schema=NAMES)
    frame.write_csv(bench.folder / "still.csv")
    frame.write_parquet(bench.folder / "still.parquet")
    np.save(bench.folder / "still.npy", shaken)
    keep = np.ones(len(shaken), dtype=bool)
    keep[[7001, 7002, 20_000]] = False
    # Rows before the second border of blocks and after it suffice.
    frame.filter(keep)[:25_000].write_parquet(bench.folder / "lost.parquet")
    found: dict[str, list[Any]] = {}
    with pytest.MonkeyPatch.context() as patch:
        cut(patch, "noise", 7001)

        def ask(call: str) -> list[Any]:
            for above in (2**60, -1) if call not in found else ():
                patch.setattr("tumble.workflows.noise.STREAMED_ABOVE", above)
                found.setdefault(call, []).append(bench("noise", call, "-o made --json").json)
            return found[call]

        yield ask


@pytest.mark.parametrize("call", ["still.csv", "still.parquet", "still.npy --remove-temperature --columns"])
def test_block_by_block_is_what_it_is_whole(both, call):
    whole, blocks = both(f"{call} {','.join(NAMES)}" if "--columns" in call else call)
    assert (whole["read"], blocks["read"]) == (WHOLE, BLOCKS)
    assert blocks["samples_at_rest"] == whole["samples_at_rest"] == 30_000
    assert blocks["recordings"] == whole["recordings"]
    assert blocks["rate_hz"] == pytest.approx(whole["rate_hz"], rel=1e-9)
    # Temperature is taken off by means over a second there, which differs in the fourth digit of the slope.
    tolerance = 1e-5 if "--remove-temperature" in call else 1e-9
    for name, expected in whole["channels"].items():
        found = blocks["channels"][name]
        for key in ("curve", "allan_deviation"):
            # Averaging times are taken to the next multiple, within 0.8 %.
            count = min(len(found[key]["tau_s"]), len(expected[key]["tau_s"]))
            tau = expected[key]["tau_s"][:count]
            assert found[key]["tau_s"][:count] == pytest.approx(tau, rel=0.008)
            short = np.flatnonzero(np.array(tau) * FAST <= 100.5)
            deviations = [np.array(one[key]["deviation"])[short] for one in (found, expected)]
            np.testing.assert_allclose(*deviations, rtol=tolerance)
        white = expected["terms"]["N"]
        allowed = 0.1 * white["standard_uncertainty"]
        assert found["terms"]["N"]["value"] == pytest.approx(white["value"], abs=allowed)


def test_the_line_is_found_with_its_frequency_and_amplitude(both):
    for found in both("still.parquet"):
        [line] = found["channels"]["gx"]["lines"]
        allowed = 5.0 * line["frequency_standard_uncertainty"] + 1e-4
        assert line["frequency_hz"] == pytest.approx(31.0, abs=allowed)
        assert line["amplitude"] == pytest.approx(4e-4, abs=5.0 * line["amplitude_standard_uncertainty"])


def test_lost_samples_at_the_border_of_blocks_are_filled_in_there_too(both):
    whole, blocks = both("lost.parquet")
    for found in (whole, blocks):
        assert any("3 lost sample(s) in 2 place(s) are filled in" in text for text in found["remarks"])
        assert found["pieces"] == [[0, 25_003]]
    deviations = [d["channels"]["gz"]["allan_deviation"]["deviation"][:7] for d in (whole, blocks)]
    assert deviations[1] == pytest.approx(deviations[0], rel=1e-9)


def test_every_number_has_letter_unit_and_definition_and_the_covariance_is_whole(both, shaken):
    found, _ = both("still.parquet")
    read_part(NoiseDocument, found)
    for name, channel in found["channels"].items():
        for letter, term in channel["terms"].items():
            assert term["letter"] == letter
            assert term["definition"]
            assert term["unit"]
        covariance = channel["fit"]["covariance"]
        assert covariance["terms"] == list(channel["terms"])
        sigma = np.sqrt(np.diag(np.array(covariance["matrix"])))
        stated = [term["standard_uncertainty"] for term in channel["terms"].values()]
        assert sigma.tolist() == pytest.approx(stated, rel=1e-9), name
    triad = found["triads"]["gyroscope"]["terms"]["N"]
    each = np.array([found["channels"][axis]["terms"]["N"]["value"] for axis in ("gx", "gy", "gz")])
    assert triad["mean_of_variances"] == pytest.approx(np.sqrt(np.mean(each**2)), rel=1e-12)
    assert triad["worst_axis"] == each.max()
    assert triad["worst_axis_name"] == ("gx", "gy", "gz")[int(np.argmax(each))]
    curve, base = found["channels"]["gz"]["curve"], allan_deviation(shaken[:, 3], FAST, taus="log")
    assert curve["kind"] == "overlapping"
    assert curve["tau_s"] == pytest.approx(base.tau.tolist(), rel=1e-12)
    assert curve["deviation"] == pytest.approx(base.deviation[:, 0].tolist(), rel=1e-9)

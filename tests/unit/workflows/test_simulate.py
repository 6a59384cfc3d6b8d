"""The workflow of simulation: what stands in the folder, and that it is true."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation
from tests.unit.given import given as known

from tumble.earth import EARTH_RATE, Site
from tumble.errors import UsageError
from tumble.protocol import PROTOCOLS, SEQUENCES, SpinStep, read_protocol, sequence_steps, write_protocol
from tumble.recording import read_recording
from tumble.simulation import FixtureErrors, SessionErrors, TableErrors, read_errors
from tumble.workflows.calibrate import calibrate
from tumble.workflows.simulate import case_columns, simulate

RATE = 20.0
PERFECT = SessionErrors().imperfections
SITE = Site.from_latitude(0.8)
QUIET = SessionErrors(noise=False)


def read(folder: Path) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
    """Stamps, raw numbers, truth."""
    table = pl.read_csv(folder / "recording.csv").to_numpy()
    return table[:, 0], table[:, 1:], json.loads((folder / "truth.json").read_text(encoding="utf-8"))


def raw_of(truth: dict[str, Any], force: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """The raw numbers of a true force and rate by the formula in the file, without tumble."""
    rows: list[np.ndarray] = []
    for name, true in (("accelerometer", force), ("gyroscope", rate)):
        block = truth[name]
        u = np.array(block["matrix"]) @ true
        row = u + np.array(block["bias"])
        if block["quadratic"] is not None:
            row = row + np.array(block["quadratic"]) * u**2
        if block["g_sensitivity"] is not None:
            row = row + np.array(block["g_sensitivity"]) @ force
        rows.append(row)
    return np.concatenate(rows)


# --- the files


@pytest.mark.parametrize(
    ("grade", "units", "errors"),
    [
        ("consumer-mems", "SI", QUIET),
        ("consumer-mems", "counts", QUIET),
        ("hg1900", "SI", SessionErrors(noise=False, nonlinear=True)),
        ("hg1700", "SI", SessionErrors(noise=False, axes="case", nonlinear=True)),
    ],
)
def test_the_holds_of_the_file_are_those_of_the_truth_by_its_own_formula(tmp_path, grade, units, errors):
    """Attitude, gravity, Earth rate, errors and columns, end to end, from the files alone."""
    latitude = np.radians(-35.0)
    site = Site.from_latitude(latitude, 700.0)
    given: dict[str, Any] = {"grade": grade, "units": units, "errors": errors}
    simulate("six-position", output=tmp_path, seed=5, site=site, rate=RATE, **given)
    time, raw, truth = read(tmp_path)
    if errors.axes == "case":
        # columns t,-az,ax,-ay: the file's first column is minus the case's z
        raw = raw[:, [1, 2, 0, 4, 5, 3]] * [1, -1, -1, 1, -1, -1]
    assert truth["site"]["gravity"] == site.gravity
    assert truth["raw_units"]["specific_force"] == ("counts" if units == "counts" else "m/s^2")
    earth_rate_n = EARTH_RATE * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    holds = [step for step in truth["steps"] if step["kind"] == "hold"]
    assert len(holds) == 6
    # arithmetic: rates are differences of attitudes, good to 1e-16 rad over a sample, times the scale
    scale = np.abs([np.linalg.norm(truth[n]["matrix"], 2) for n in ("accelerometer", "gyroscope")])
    atol = 1e-13 * np.repeat(scale, 3) * [10.0, 10.0, 10.0, RATE, RATE, RATE]
    for step in holds:
        C_bn = Rotation.from_quat(step["quaternion_nb"]).as_matrix().T
        np.testing.assert_allclose(step["up_b"], C_bn @ [0.0, 0.0, -1.0], atol=1e-15)
        expected = raw_of(truth, C_bn @ [0.0, 0.0, -site.gravity], C_bn @ earth_rate_n)
        inside = (time > step["start_s"] + 1.0 / RATE) & (time < step["stop_s"] - 1.0 / RATE)
        assert inside.sum() > 500
        assert np.all(np.abs(raw[inside] - expected) < atol)


@pytest.mark.parametrize("protocol", list(PROTOCOLS))
def test_every_named_protocol_is_played_and_its_file_reads_back_with_site_and_recording(tmp_path, protocol):
    site = Site.from_latitude(np.radians(20.0), 33.0)
    done = simulate(protocol, output=tmp_path, rate=5.0, site=site)
    written = read_protocol(tmp_path / "protocol.yaml")
    assert (written.name, written.recordings) == (protocol, ("recording.csv",))
    assert known(written.site).gravity == pytest.approx(site.gravity, rel=1e-12)
    assert [file.name for file in done.files] == ["recording.csv", "protocol.yaml", "truth.json"]
    spins = [step for step in done.truth["steps"] if step["kind"] == "spin"]
    assert all(abs(np.linalg.norm(step["axis_b"]) - 1.0) < 1e-12 for step in spins)
    assert len(done.truth["steps"]) == len(written.steps)


def test_the_truth_is_never_read(tmp_path: Path) -> None:
    simulate("six-position", output=tmp_path, seed=8, rate=RATE)
    first = calibrate(protocol=tmp_path / "protocol.yaml").calibration
    (tmp_path / "truth.json").write_text("not even JSON")
    assert calibrate(protocol=tmp_path / "protocol.yaml").calibration.accelerometer == first.accelerometer


def test_a_seed_is_a_session_and_a_unit_stays_the_same_in_another(tmp_path: Path) -> None:
    def play(name: str, seed: int, **more: Any) -> list[bytes]:
        done = simulate("six-position", output=tmp_path / name, seed=seed, rate=5.0, **more)
        return [file.read_bytes() for file in done.files]

    assert play("a", 1) == play("b", 1)
    assert play("a", 1)[0] != play("b", 2)[0]
    chain = replace(PERFECT, jitter=0.01, sampling_jitter=0.005, dropped=0.1, burst=3.0)
    errors = SessionErrors(imperfections=chain)
    assert play("a", 1, errors=errors) == play("b", 1, errors=errors)
    first = simulate("six-position", output=tmp_path / "c", seed=1, unit=9, rate=5.0).truth
    second = simulate("multi-position-9", output=tmp_path / "d", seed=2, unit=9, rate=5.0).truth
    # The unit's own bias is one; where it wandered to is the session's.
    sessions = [truth["gyroscope"].pop("session_bias") for truth in (first, second)]
    assert sessions[0] != sessions[1]
    assert first["gyroscope"] == second["gyroscope"]
    assert first["steps"][0]["quaternion_nb"] != second["steps"][0]["quaternion_nb"]
    other = simulate("six-position", output=tmp_path / "e", seed=1, rate=5.0).truth
    assert other["gyroscope"] != first["gyroscope"]


def test_the_truth_names_grade_source_noise_and_units_and_what_a_sheet_does_not_state(tmp_path: Path) -> None:
    wander = SessionErrors(nonlinear=True, wander=True)
    done = simulate("six-position", output=tmp_path, grade="hg1700", rate=5.0, errors=wander)
    truth = done.truth
    assert truth["imu"]["grade"] == "hg1700"
    assert "table 2.1" in truth["imu"]["source"]
    assert truth["imu"]["C_instrument_case"] == [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    noise = truth["noise"]["gyroscope"]
    assert noise["random_walk"]["value"] == pytest.approx(3.6361e-5, rel=2e-5)
    assert noise["random_walk"]["unit"] == "rad/s/sqrt(Hz)"
    # 1 deg/h after an hour
    assert noise["rate_random_walk"]["value"] * 60.0 == pytest.approx(np.radians(1.0) / 3600.0)
    assert any(step.get("gyroscope_wander", [0.0])[0] != 0.0 for step in truth["steps"])
    assert truth["frame"]["name"] == "fixture"
    assert "latitude 45°" in done.remarks[0]
    table = replace(wander, table=TableErrors(wobble=1e-5))
    said = " ".join(simulate("six-position", output=tmp_path, rate=5.0, errors=table).remarks)
    for words in ("states no linearity", "states no in-run stability", "has no spins"):
        assert words in said


def test_lost_samples_and_scattered_stamps_stand_in_the_file(tmp_path: Path) -> None:
    chain = SessionErrors(imperfections=replace(PERFECT, jitter=0.004, dropped=0.2, burst=4.0))
    simulate("six-position", output=tmp_path, rate=RATE, errors=chain)
    time, _, truth = read(tmp_path)
    whole = simulate("six-position", output=tmp_path / "whole", rate=RATE).truth["samples"]
    # a fifth of some 3900 samples in bursts of four: 1.6 % standard deviation
    assert len(time) / whole == pytest.approx(0.8, abs=0.07)
    assert truth["samples"] == len(time)
    assert np.all(np.diff(time) > 0.0)
    off = (time * RATE - 0.5) % 1.0
    assert np.std(np.where(off > 0.5, off - 1.0, off)) / RATE == pytest.approx(0.004, rel=0.1)


def test_the_session_s_bias_is_the_unit_s_and_its_wander_over_the_recording(tmp_path: Path) -> None:
    """What noise adds to the file in the mean, as well as white noise lets it be known: over holds alone 4.5 sigma."""
    for name, noise in (("quiet", False), ("session", True)):
        errors = SessionErrors(noise=noise)
        simulate("rate-table", output=tmp_path / name, seed=5, rate=20.0, grade="tactical", errors=errors)
    (_, with_noise, truth), (_, without, _) = (read(tmp_path / name) for name in ("session", "quiet"))
    added = with_noise - without
    blocks = [truth[name] for name in ("accelerometer", "gyroscope")]
    moved = np.concatenate([np.subtract(one["session_bias"], one["bias"]) for one in blocks])
    assert np.all(np.abs(added.mean(axis=0) - moved) < 3.0 * added.std(axis=0) / np.sqrt(len(added)))
    block = blocks[0]
    named = {row["name"]: row for row in truth["parameters"]}
    assert named["accelerometer bias y"]["session_value"] == block["session_bias"][1]
    assert truth["in_frame_accelerometer_x"]["accelerometer"]["session_bias"] == block["session_bias"]


@pytest.mark.parametrize(("protocol", "key"), [("six-position", "_in_fixture"), ("multi-position-10", "")])
def test_true_parameters_are_named_and_framed_as_the_calibration_s(protocol, key, tmp_path):
    truth = simulate(protocol, output=tmp_path, seed=4, units="counts").truth
    procedure = "improved-six-position" if key else None
    calibration = calibrate(protocol=tmp_path, procedure=procedure).calibration
    true = {row["name"]: row for row in truth[f"parameters{key}"]}
    compared = [p for p in calibration.parameters if "gyro" not in p.name and "rotation" not in p.name]
    assert len(compared) >= 9
    for parameter in compared:
        row = true[parameter.name]
        assert row["unit"] == parameter.unit
        # Ten sigma: flicker, which a hold's noise does not show, moves a bias by more than its sigma.
        off = abs(row.get("session_value", row["value"]) - parameter.value)
        assert off < 10.0 * parameter.standard_uncertainty, parameter.name


def test_asymmetry_is_drawn_last_and_named_in_the_truth(tmp_path: Path) -> None:
    given: dict[str, Any] = {"rate": 5.0, "seed": 4, "site": SITE}
    plain = simulate("six-position", output=tmp_path / "a", **given).truth
    bent = simulate(
        "six-position", output=tmp_path / "b", **given, errors=SessionErrors(asymmetry=1e-3)
    ).truth
    for triad in ("accelerometer", "gyroscope"):
        assert plain[triad]["asymmetry"] is None
        assert np.all(np.abs(bent[triad]["asymmetry"]) < 5e-3)
        assert plain[triad]["matrix"] == bent[triad]["matrix"]
    named = {p["name"]: p["value"] for p in bent["parameters"]}
    assert named["accelerometer asymmetry y"] == bent["accelerometer"]["asymmetry"][1]
    assert named["gyro asymmetry z"] == bent["gyroscope"]["asymmetry"][2]
    fixture = {p["name"]: p["value"] for p in bent["parameters_in_fixture"]}
    assert fixture["gyro asymmetry z"] == pytest.approx(bent["gyroscope"]["asymmetry"][2])


def test_columns_of_a_case_by_hand() -> None:
    """The unit's x axis is the case's y, its y axis against the case's z, its z axis against the case's x."""
    C_instrument_case = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    assert case_columns(C_instrument_case) == "t,ay,-az,-ax,gy,-gz,-gx"


def test_files_of_two_folders_may_share_a_name(tmp_path: Path) -> None:
    """Each step's own folder: the steps are told by their order, not by the last part of the path."""
    done = simulate("six-position", output=tmp_path, seed=3, rate=RATE)
    protocol = read_protocol(tmp_path / "protocol.yaml")
    rows, steps = pl.read_csv(tmp_path / "recording.csv"), list(protocol.steps)
    for number, step in enumerate(done.truth["steps"]):
        if step["kind"] == "hold":
            (tmp_path / f"{number}").mkdir()
            inside = pl.col("t").is_between(step["start_s"], step["stop_s"])
            rows.filter(inside).write_csv(tmp_path / f"{number}" / "imu.csv")
            steps[number] = replace(steps[number], file=f"{number}/imu.csv")
    write_protocol(replace(protocol, recordings=(), steps=tuple(steps)), tmp_path / "protocol.yaml")
    again = known(calibrate(protocol=tmp_path / "protocol.yaml").matching)
    assert not again.missing
    assert not again.extra


# --- tables and fixtures

REST = "  - hold: rest\n    up: z\n    uncertainty_deg: 1\n    seconds: {}\n"


def spin(axis: str, rate: int, seconds: int, angle: int) -> str:
    return f"  - spin:\n    axis: {axis}\n    rate_deg_per_s: {rate}\n    seconds: {seconds}\n    angle_deg: {angle}\n"


def protocol_of(folder: Path, procedure: str, *steps: str) -> Path:
    path = folder / "mine.yaml"
    head = f"format: tumble protocol\nprocedure: {procedure}\ngravity: 9.81\nsteps:\n"
    path.write_text(head + "".join(steps), encoding="utf-8")
    return path


def test_the_protocol_has_the_display_s_angles_and_the_truth_what_was_turned(tmp_path: Path) -> None:
    """Two rotations by a table about x, 13.3 turns a minute."""
    rest, other = REST.format(5), "  - turn:\n    seconds: 3\n  - hold: else\n    up: y\n    seconds: 5\n"
    turns = (rest, spin("x", 80, 16, 1440), rest, spin("x", -80, 16, -1440), rest, other)
    errors = SessionErrors(
        noise=False,
        table=TableErrors(angle_sigma=1e-3, wobble=1e-4, stops_early=((1, 0.4375),)),
        lever_arm_b=np.array([0.05, -0.02, 0.01]),
    )
    simulate(protocol_of(tmp_path, "turntable", *turns), rate=20.0, errors=errors, output=tmp_path / "out")
    protocol = read_protocol(tmp_path / "out" / "protocol.yaml")
    _, ccw, _, cw, stays, _, other = protocol.steps
    assert ccw.angle == pytest.approx(8.0 * np.pi, rel=1e-15)
    assert cw.angle == pytest.approx(-3.5 * np.pi, rel=1e-15)
    assert ccw.angle_sigma == cw.angle_sigma == 1e-3
    # 630° clockwise about x are 90° counter-clockwise, and bring y up.
    for hold in (stays, other):
        np.testing.assert_allclose(known(hold.pose).up_b, [0.0, 1.0, 0.0], atol=1e-12)
    assert (known(stays.pose).heading, known(stays.pose).sigma) == (None, pytest.approx(np.radians(1.0)))
    truth = json.loads((tmp_path / "out" / "truth.json").read_text("utf-8"))
    assert truth["table"]["wobble"] == 1e-4
    assert truth["lever_arm_b"] == [0.05, -0.02, 0.01]
    for step, made in zip(truth["steps"], protocol.steps, strict=True):
        if isinstance(made, SpinStep):
            assert step["shown_angle"] == pytest.approx(made.angle, rel=1e-15)
            assert 0.0 < abs(step["angle"] - step["shown_angle"]) < 6e-3
            assert step["ramps_s"] == [2.0, 2.0]


def test_a_file_of_rotations_about_the_vertical_alone_is_read(tmp_path: Path) -> None:
    """The gyro's levels differ in it and the accelerometer's do not: that is no exchange of the triads."""
    rest = REST.format(10)
    turns = (rest, spin("z", 20, 34, 720), rest, spin("z", -20, 34, -720), rest)
    mine = protocol_of(tmp_path, "laboratory", *turns)
    simulate(mine, grade="tactical", rate=50.0, output=tmp_path / "out")
    names = "t,ax,ay,az,gx,gy,gz"
    recording = read_recording(tmp_path / "out" / "recording.csv", columns=names, units="m/s^2,rad/s,s")
    assert np.median(known(recording.specific_force)[:, 2]) == pytest.approx(9.81, rel=0.01)


def test_a_fixture_is_drawn_from_its_quality_and_stands_in_the_truth_with_what_it_turned(tmp_path):
    quality = FixtureErrors(heading=1e-3, tilt=(1e-3, 1e-3), execution=1e-4, rate=1.5, pause=0.0)
    errors = SessionErrors(fixture=quality, fixture_azimuth=0.25)
    given: dict[str, Any] = {"rate": 20.0, "grade": "tactical", "site": SITE, "errors": errors}
    first, again, other = (
        simulate("strapdown-rotation", output=tmp_path / name, seed=seed, **given).truth
        for name, seed in (("a", 1), ("b", 1), ("c", 2))
    )
    assert first["fixture"] == again["fixture"]
    assert first["fixture"]["heading"] != other["fixture"]["heading"]
    assert 0.0 < abs(first["fixture"]["heading"]) < 5e-3
    assert first["fixture"]["rate"] == 1.5
    start, turn = first["steps"][:2]
    (rotation,) = turn["rotations"]
    assert rotation["fixture_axis"] == "outer"
    assert rotation["angle"] == pytest.approx(2.0 * np.pi, abs=1e-3)
    assert rotation["axis_b"] == pytest.approx([0.0, 1.0, 0.0], abs=1e-3)
    # y lies along the outer axis, which points 0.25 rad from north: five sigmas of the installation
    along_n = Rotation.from_quat(start["quaternion_nb"]).apply([0.0, 1.0, 0.0])
    assert along_n == pytest.approx([np.cos(0.25), np.sin(0.25), 0.0], abs=5e-3)
    protocol = read_protocol(tmp_path / "a" / "protocol.yaml")
    assert [s.name for s in sequence_steps(protocol)] == [s.name for s in SEQUENCES]
    hold = protocol.steps[0]
    # With z down and y along the outer axis x is a quarter of a turn before it; 1e-12: degrees in the file.
    assert known(hold.pose).heading == pytest.approx(0.25 - 0.5 * np.pi, abs=1e-12)


# --- what is refused


@pytest.mark.parametrize("name", ["recording.csv", "protocol.yaml"])
def test_what_was_not_simulated_is_never_written_over(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("precious")
    with pytest.raises(UsageError, match=f"holds a {name} that was not simulated"):
        simulate("six-position", output=tmp_path, rate=5.0)
    (tmp_path / "truth.json").write_text('{"format": "of another program"}')
    with pytest.raises(UsageError, match="is not of `tumble simulate`"):
        simulate("six-position", output=tmp_path, rate=5.0)
    assert (tmp_path / name).read_text() == "precious"
    assert {path.name for path in tmp_path.iterdir()} == {name, "truth.json"}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"grade": "hg1800"}, "no IMU grade 'hg1800'.*Did you mean hg1[79]00"),
        ({"rate": float("nan")}, "--sample-rate nan: the sampling rate is in Hz, from 1 to 20000"),
        ({"rate": 1e5}, "--sample-rate 100000"),
        (
            {"rate": 2e4, "protocol": "rate-table"},
            "at most 20,000,000 are simulated; give a lower --sample-rate",
        ),
        ({"seed": -1}, "--seed -1: a seed is a whole number from 0 on"),
        ({"unit": -2}, "--unit-seed -2"),
        ({"units": "g"}, "--output-units g: a simulated recording is in SI or counts"),
        ({"errors": SessionErrors(axes="case")}, "consumer-mems lie in its case; hg1700 and hg1900 do"),
    ],
)
def test_options_that_cannot_be_are_refused_in_a_sentence(tmp_path, options, words):
    given: dict[str, Any] = {"protocol": "six-position", "output": tmp_path / "new", **options}
    with pytest.raises(UsageError, match=words):
        simulate(**given)
    assert not (tmp_path / "new").exists()


def told(folder: Path, text: str) -> SessionErrors:
    path = folder / "errors.yaml"
    path.write_text(text, encoding="utf-8")
    return read_errors(path)


def test_every_key_of_the_file_of_errors_moves_something_and_stands_on_the_page(tmp_path: Path) -> None:
    special = {"axes": "case", "table_stops_percent": {2: 60}, "table_lever_arm_cm": [5, -2, 1]}
    plain = SessionErrors()
    with pytest.raises(UsageError, match="no key `!`; there are ") as refused:
        told(tmp_path, "'!': 1")
    keys = re.findall(r"\w+", str(refused.value).partition("there are ")[2])
    for key in keys:
        switch = key in ("placement", "noise", "nonlinear", "wander")
        value = special.get(key, not getattr(plain, key) if switch else 3)
        made = told(tmp_path, f"{key}: {value}")
        others = [k for k in SessionErrors.__dataclass_fields__ if k != "lever_arm_b"]
        changed = [k for k in others if getattr(made, k) != getattr(plain, k)]
        wanted = 2 if key == "fixture_azimuth_deg" else 1
        assert len(changed) == (0 if made.lever_arm_b is not None else wanted)
    page = Path(__file__).parents[3] / "docs" / "simulation.md"
    found = re.search(r"```yaml\n(# errors\.yaml\n.*?)```", page.read_text(encoding="utf-8"), re.S)
    told(tmp_path, known(found)[1])
    assert sorted(re.findall(r"^(\w+):", known(found)[1], re.M)) == sorted(keys)


def test_what_the_file_of_errors_says_is_in_its_units(tmp_path: Path) -> None:
    made = told(
        tmp_path,
        "{fixture_installation_mrad: 1, fixture_zero_mrad: 2, fixture_mounting_mrad: 3, fixture_azimuth_deg: -90,"
        " fixture_rate_deg_per_s: 90, fixture_pause_s: 0.25, asymmetry_ppm: 400, velocity_pulse_mm_per_s: 2,"
        " angle_pulse_arcsec: 0.5,"
        " magnetic_dip_deg: 60, field_change_ut: 2, field_change_at_s: 30, jitter_ms: 4, dropped_percent: 1.5}",
    )
    profile = {"rate": np.radians(90.0), "pause": 0.25}
    assert made.fixture == FixtureErrors(1e-3, (1e-3, 1e-3), 0.0, 2e-3, 2e-3, (3e-3,) * 3, **profile)
    assert made.asymmetry == pytest.approx(400e-6)
    assert made.fixture_azimuth == pytest.approx(-np.pi / 2.0)
    assert made.magnetic_field == pytest.approx((49e-6, np.pi / 3.0, np.radians(4.0)))
    assert made.field_change == pytest.approx((2e-6, 30.0))
    chain = made.imperfections
    assert chain.angle_increment == pytest.approx(np.radians(0.5 / 3600.0))
    chain = replace(chain, angle_increment=0.0)
    assert chain == replace(PERFECT, jitter=4e-3, dropped=0.015, velocity_increment=2e-3)
    arms = known(told(tmp_path, "table_lever_arm_cm: [1, 2, 3, 4, 5, 6, 7, 8, 9]").lever_arm_b)
    np.testing.assert_allclose(arms, np.arange(1.0, 10.0).reshape(3, 3) / 100.0)
    with pytest.raises(UsageError, match=r"dropped, 1.5 in SI: `dropped_percent` is .* 0 to 50\."):
        SessionErrors(imperfections=replace(PERFECT, dropped=1.5))  # the record has the limits of the file


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("dropped_percent: 80", "`dropped_percent: 80` is to be a number from 0 to 50"),
        ("burst_samples: 0", "from 1 to"),
        ("jitter_ms: -1", "`jitter_ms: -1` is to be a number from 0 to 1000"),
        ("sampling_jitter_ms: .nan", "from 0 to 1000"),
        ("jitter_ms: true", "is to be a number"),
        ("jitter: 1", "no key `jitter`; near it are jitter_ms"),
        ("furlongs: 1", "no key `furlongs`; there are placement, noise"),
        ("noise: 3", "true or false"),
        ("axes: north", "unit or case"),
        ("table_wobble_arcsec: [1]", "from 0 to 36000"),
        ("table_ripple_cycles: 1.5", "whole number from 1"),
        ("table_stops_percent: 2", "such as {2: 60}"),
        ("table_stops_percent: {0: 60}", "such as {2: 60}"),
        ("table_stops_percent: {2: 100}", "such as {2: 60}"),
        ("table_lever_arm_cm: [1, 2]", "three numbers in cm"),
        ("table_lever_arm_cm: [1, 2, nan]", "three numbers in cm"),
        ("- 1", "has no line such as"),
        ("a: 1\na: 1", "twice"),
    ],
)
def test_what_no_session_has_is_refused_with_its_key(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(UsageError, match=re.escape(words)):
        told(tmp_path, text)

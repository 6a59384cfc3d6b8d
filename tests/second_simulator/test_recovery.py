"""Every procedure, optional term and kind of session: the truth is within what is stated.

Each case draws units, places and motions anew, and calibrates what a file and a protocol tell. Parameters of one
recording are correlated, recordings are not: the errors by their own covariance, summed over all, are chi-square.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy import stats

import tumble
from second_simulator import GRADES, Grade, Simulation, rotations
from second_simulator.calibrating import calibrated, missed, played
from second_simulator.earth import normal_gravity
from second_simulator.motion import Path as Motion
from second_simulator.procedures import AXES, EDGES, posed
from second_simulator.recording import Place, record
from second_simulator.sensors import draw_unit
from tumble.document import Calibration
from tumble.errors import ObservabilityError

pytestmark = pytest.mark.slow
FALSE_ALARM = 1e-3
LAG = "lag of the accelerometer behind the gyro"
SENSITIVE = {"g_sensitivity"}
UNEVEN = {"accelerometer_asymmetry", "gyro_asymmetry"}


def in_counts(made: Simulation) -> Simulation:
    """As a 16-bit converter with its zero in the middle has it."""
    force, rate, zero = 414.0, 4780.0, np.array([33123.0, 32871.0, 32364.0])
    unit = made.truth.unit
    moved = replace(
        unit,
        accelerometer_bias=unit.accelerometer_bias + zero / force,
        gyro_bias=unit.gyro_bias + zero / rate,
    )
    return replace(
        made,
        force=force / made.truth.force_unit * made.force + zero,
        rate=rate / made.truth.rate_unit * made.rate + zero,
        units="counts,counts",
        truth=replace(made.truth, unit=moved, force_unit=force, rate_unit=rate),
    )


def unit_with(grade: str, **parts: Any) -> Callable[[int], Grade]:
    """A grade whose unit, another one each time, has these besides."""

    def drawn(run: int) -> Grade:
        kind = GRADES[grade]
        return replace(kind, unit=replace(draw_unit(kind, np.random.default_rng([7, run])), **parts))

    return drawn


@dataclass(frozen=True)
class Case:
    """A test and a kind of unit; the terms that it has are found, and no others but for false alarms."""

    procedure: str
    grade: str | Callable[[int], Grade]
    terms: set[str] = field(default_factory=set[str])
    options: dict[str, Any] = field(default_factory=dict[str, Any])
    told: bool = True
    change: Callable[[Simulation], Simulation] | None = None
    fault: str | None = None
    runs: int = 4

    def made(self, run: int) -> Simulation:
        grade = self.grade if isinstance(self.grade, str) else self.grade(run)
        made = played(self.procedure, grade, 500 + run, self.fault, **self.options)
        return self.change(made) if self.change else made


TABLE, QUICK = {"rates": (20.0, 80.0), "rate": 25.0}, {"seconds": 10.0, "rate": 25.0}
OF_FORCE, OF_RATE = np.array([1e-3, -2e-3, 1.5e-3]), np.array([2e-3, -1e-3, 1.5e-3])
BENT = {"accelerometer_quadratic": np.array([1.1e-4, -2.3e-4, 0.7e-4])}
CURVED = {"gyro_quadratic": np.array([4e-4, -3e-4, 2e-4])}
ODD = {"accelerometer_asymmetry": OF_FORCE, "gyro_asymmetry": OF_RATE}
CASES = {
    "by hand": Case("by-hand", "consumer", SENSITIVE, told=False),
    "by hand, in counts": Case("by-hand", "consumer", SENSITIVE, told=False, change=in_counts),
    "by hand, seeing the Earth": Case("by-hand", "tactical", told=False),
    "by hand, by a protocol": Case("by-hand", "robot", SENSITIVE),
    "by hand, with gaps": Case("by-hand", "hobby", SENSITIVE, told=False, fault="gaps"),
    "by hand, uneven": Case("by-hand", unit_with("tactical", **ODD), UNEVEN, told=False),
    "by hand, bent": Case("by-hand", unit_with("tactical", **BENT), {"quadratic"}, told=False),
    "many poses": Case("multi-position", "automotive", SENSITIVE, told=False),
    "six faces": Case("six-faces", "industrial", SENSITIVE),
    "a rate table": Case("rate-table", "tactical", options=TABLE, runs=3),
    "a rate table, bent": Case(
        "rate-table", unit_with("tactical", **CURVED), {"gyro_quadratic"}, TABLE, runs=2
    ),
    "poses and spins": Case("modified-multi-position", "industrial", SENSITIVE, {"rate": 25.0}, runs=2),
    "a turntable": Case("turntable", "industrial", SENSITIVE, QUICK, runs=3),
    "a laboratory": Case("laboratory", "robot", SENSITIVE, QUICK, runs=3),
    "a chamber": Case("thermal-soak", "robot", SENSITIVE, runs=2),
    "whole sequences": Case("strapdown-rotation", "tactical", UNEVEN, {"rate": 50.0}),
    "whole sequences, sensitive": Case(
        "strapdown-rotation", "automotive", UNEVEN | SENSITIVE, {"rate": 50.0}
    ),
}


def settled(made: Simulation, told: bool, **options: Any) -> Calibration:
    """By a clock that counts samples."""
    return calibrated(
        made, by_protocol=told, **{"rate": f"{made.path.rate}±{1e-6 * made.path.rate}", **options}
    )


@cache
def runs(name: str) -> list[tuple[Simulation, Calibration]]:
    case = CASES[name]
    every = [case.made(run) for run in range(case.runs)]
    return [(made, settled(made, case.told)) for made in every]


def kept(found: Calibration) -> set[str]:
    return {test.name for test in found.quality.optional_terms if test.kept}


def value(found: Calibration, name: str) -> tuple[float, float]:
    (one,) = [p for p in found.parameters if p.name == name]
    return one.value, one.standard_uncertainty


@pytest.mark.parametrize("name", CASES)
def test_the_truth_is_within_what_is_stated(name: str) -> None:
    every = [missed(found, made) for made, found in runs(name)]
    square, degrees = sum(one.square for one in every), sum(one.degrees for one in every)
    assert stats.chi2.ppf(0.5 * FALSE_ALARM, degrees) < square < stats.chi2.isf(0.5 * FALSE_ALARM, degrees)
    # A hundred beyond it are by chance one in 1,500.
    assert max(float(np.max(np.abs(one.z))) for one in every) < 4.5
    for _, found in runs(name):
        assert found.verdict.fit, found.verdict.reasons
        assert kept(found) >= CASES[name].terms


def test_intervals_cover_and_what_is_not_there_is_seldom_kept_nor_what_is_right_left_out() -> None:
    """Terms are kept wrongly in 2 % of recordings, and of three kinds of observation one is left out in 1 % each."""
    every = [(name, made, found) for name in CASES for made, found in runs(name)]
    wrong = sum(bool(kept(found) - CASES[name].terms) for name, _, found in every)
    assert wrong <= stats.binom.isf(FALSE_ALARM, len(every), 0.02)
    left = sum(bool(found.quality.left_out) for _, _, found in every)
    assert left <= stats.binom.isf(FALSE_ALARM, len(every), 0.03)
    shares = [missed(found, made).inside for _, made, found in every]
    limit = stats.t.isf(0.5 * FALSE_ALARM, len(every) - 1) * np.std(shares, ddof=1) / np.sqrt(len(every))
    assert limit < 0.03
    assert 0.95 - limit < np.mean(shares) < 0.98


@pytest.mark.parametrize("kind", ["hold", "turn"])
def test_what_a_knock_spoils_is_named_and_does_no_harm(kind: str) -> None:
    """Of one hold 0.15 m/s² along gravity, of one turn 2° across it."""
    made, _ = runs("by hand")[0]
    step = [one for one in made.path.steps if one.kind == kind][12]
    at = (made.time - 12.0 > step.start) & (made.time - 12.0 < step.stop)
    force, rate = made.force.copy(), made.rate.copy()
    if kind == "hold":
        force[at] *= 1.0 + 0.15 / 9.8
    else:
        middle = np.flatnonzero(at)[np.count_nonzero(at) // 2]
        across = np.cross(force[middle], np.eye(3)[np.argmin(np.abs(force[middle]))])
        rate[middle : middle + 20] += 2.0 / (20 / made.path.rate) * across / np.linalg.norm(across)
    spoiled = replace(made, force=force, rate=rate)
    found = settled(spoiled, told=False)
    named = {(left.kind, left.number) for left in found.quality.left_out}
    assert (kind, 13) in named
    # A neighbour may be blamed, too.
    assert len(named) <= 2
    assert np.max(np.abs(missed(found, made).z)) < 4.5


# A lag between the triads, and lever arms of the accelerometers ------------------------------------

# Counted from the point with each accelerometer's own coordinate; none like another.
ARMS = 1e-3 * np.array([[0.0, 12.0, -7.0], [5.0, 0.0, 9.0], [-14.0, 3.0, 0.0]])
LATE, ALL = 1, (*EDGES, (1, -1, 0), (1, 0, -1), (0, 1, -1))
PAIRS = [(i, j) for i in range(3) for j in range(3) if i != j]


@cache
def on_axes(axes: tuple[tuple[int, int, int], ...], late: int = 0, *, apart: bool = False) -> Calibration:
    """A unit on a table, its accelerometers read late by so many samples of 50 Hz and apart from one another."""
    grade = unit_with("tactical", late=late, arms=ARMS if apart else 0.0 * ARMS)(1)
    return settled(
        played("turntable", grade, 31, axes=axes, speed=40.0, steady=16.0, seconds=10.0, rate=50.0), told=True
    )


def test_lag_and_lever_arms_are_found_and_nothing_else() -> None:
    found = on_axes(ALL, LATE, apart=True)
    assert kept(found) == {"time_lag", "lever_arms"}
    lag, sigma = value(found, LAG)
    assert abs(lag - LATE / 50.0) < 4.5 * sigma < 1e-3
    for i, j in PAIRS:
        arm, sigma = value(found, f"accelerometer lever arm {'xyz'[i]}{'xyz'[j]}")
        assert abs(arm - ARMS[i, j]) < 4.5 * sigma < 5e-3
    said = " ".join(found.remarks)
    assert "20 ms" in said
    assert re.search(r"1[345] mm", said)


def test_where_there_is_none_none_is_kept_and_all_terms_share_two_per_cent() -> None:
    found = on_axes(ALL)
    assert not kept(found)
    assert {"time_lag", "lever_arms"} < {test.name for test in found.quality.optional_terms}
    assert sum(test.limit for test in found.quality.optional_terms) <= 0.02 + 1e-12
    assert not any("lag" in p.name or "lever" in p.name for p in found.parameters)


def test_an_edge_of_each_pair_tells_sums_of_lever_arms_and_faces_tell_none() -> None:
    """About x, y and z all that a lever arm does is across the axis, where the rotation's own takes it up."""
    found = on_axes((*AXES[:2], *EDGES), apart=True)
    assert kept(found) == {"lever_arms"}
    assert not any("lever arm " in p.name for p in found.parameters)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        name = f"accelerometer lever arms {'xyz'[i]}{'xyz'[j]}+{'xyz'[j]}{'xyz'[i]}"
        arms, sigma = value(found, name)
        assert abs(arms - ARMS[i, j] - ARMS[j, i]) < 4.5 * sigma < 1e-2
    faces = on_axes(AXES, LATE, apart=True)
    assert kept(faces) == {"time_lag"}


# Several turn-ons of one unit ----------------------------------------------------------------------

MOVES = np.array([0.03, -0.02, 0.015]), np.array([-2e-3, 1e-3, 3e-3])
HERE = Place(0.8, 300.0, normal_gravity(0.8, 300.0), 0.8, None, 2e-5)


@cache
def turn_on(number: int, procedure: str = "by-hand", gyro: float = 1.0) -> Simulation:
    """A unit for the first, second and third time; its gyro y may have changed."""
    unit = draw_unit(GRADES["consumer"], np.random.default_rng(77))
    times = number - 1.0
    moved = replace(
        unit,
        accelerometer_bias=unit.accelerometer_bias + times * MOVES[0],
        gyro_bias=unit.gyro_bias + times * MOVES[1],
        gyro_matrix=np.diag([1.0, gyro, 1.0]) @ unit.gyro_matrix,
    )
    options = {"poses": 14, "rate": 80.0 if number == 1 else 50.0} if procedure == "by-hand" else {}
    return played(procedure, replace(GRADES["consumer"], unit=moved), 20 + number, place=HERE, **options)


def together(folder: Path, *recordings: Simulation) -> Calibration:
    files = [folder / f"recording {k}.csv" for k in range(1, len(recordings) + 1)]
    for file, made in zip(files, recordings, strict=True):
        pl.DataFrame(made.columns()).write_csv(file)
    site = tumble.Site.from_latitude(HERE.latitude, HERE.height)
    return tumble.calibrate(files, turn_ons=True, site=site, rate="crystal").calibration


def stable(found: Calibration) -> np.ndarray:
    """Errors over sigmas of both matrices."""
    off = missed(found, turn_on(1))
    names = [
        n
        for n, s in zip(found.covariance_parameters, np.diag(np.array(found.covariance)), strict=True)
        if s > 0
    ]
    return off.z[["matrix" in name for name in names]]


@pytest.fixture(scope="module")
def of_three(tmp_path_factory: pytest.TempPathFactory) -> Calibration:
    return together(tmp_path_factory.mktemp("three"), *(turn_on(number) for number in range(3)))


def test_what_is_stable_is_within_its_uncertainty_and_better_known_than_from_one(of_three) -> None:
    """Three recordings alike: the root of three, within what their different poses make of it."""
    assert np.max(np.abs(stable(of_three))) < 4.5
    alone = settled(turn_on(0), told=False, rate="crystal")
    names = [p.name for p in alone.parameters if "scale" in p.name or "orthogonality" in p.name]
    gain = [value(alone, name)[1] / value(of_three, name)[1] for name in names]
    assert 1.3 < np.median(gain) < 2.4
    assert all(one.agrees for one in of_three.turn_ons.agreements)
    assert of_three.turn_ons.probability > 1e-3
    assert of_three.turn_ons.degrees == 2 * len(of_three.turn_ons.agreements)
    assert any("agree between the recordings" in said for said in of_three.remarks)


def test_each_recording_has_its_own_biases_and_they_are_seen_to_change(of_three: Calibration) -> None:
    """-1, 0 and 1 times the move: its standard deviation is the move itself, but for the wander of a recording."""
    units = np.repeat([1.0 / 9.80665, np.degrees(1.0)], 3)
    for scatter, move in zip(of_three.turn_ons.biases, units * np.concatenate(MOVES), strict=True):
        assert scatter.degrees == 2
        assert scatter.scatter == pytest.approx(abs(move), rel=0.15)
        assert scatter.scatter_sigma == pytest.approx(scatter.scatter / 2.0)
        assert scatter.next_sigma == pytest.approx(scatter.scatter * np.sqrt(4.0 / 3.0))
        assert scatter.coverage_factor == pytest.approx(4.303, abs=1e-3)  # Student's, two degrees of freedom
        mean, sigma = value(of_three, scatter.parameter)
        assert mean == pytest.approx(np.mean(np.array(scatter.values, dtype=float)))
        assert sigma == pytest.approx(scatter.next_sigma)


def test_a_scale_factor_that_changed_is_named_and_its_uncertainty_enlarged(tmp_path: Path) -> None:
    """By 0.15 %, some ten standard uncertainties of one recording, and below what says another unit."""
    found = together(tmp_path, turn_on(0), turn_on(1), turn_on(2, gyro=1.0015))
    (worst,) = [one for one in found.turn_ons.agreements if not one.agrees]
    assert worst.parameter == "gyro scale factor error y"
    assert worst.values[2] - worst.values[0] == pytest.approx(0.0015, rel=0.3)
    assert worst.enlarged > 3.0
    (said,) = [one for one in found.verdict.reasons if "is not stable" in one]
    assert "recording 3.csv" in said


def test_a_drift_in_one_recording_is_said_with_its_name_and_counted(tmp_path: Path) -> None:
    last = turn_on(2)
    fading = np.exp(-np.linspace(0.0, 5.0, len(last.time)))[:, None]
    drifting = replace(
        last, force=last.force + 3e-3 * fading * [1.0, -1.0, 1.0], rate=last.rate + np.degrees(3e-3) * fading
    )
    found = together(tmp_path, turn_on(0), turn_on(1), drifting)
    said = ["recording 3.csv: The biases of the gyros drift" in one for one in found.verdict.reasons]
    assert said.count(True) == 1
    assert np.max(np.abs(stable(found))) < 4.5


def test_a_recording_that_does_not_tell_the_unit_by_itself_takes_part_with_its_biases(tmp_path: Path) -> None:
    """Six faces and five turns: of what is stable it tells a part."""
    found = together(tmp_path, turn_on(0), turn_on(2, "six-faces"))
    assert any(one.degrees == 0 for one in found.turn_ons.agreements)
    assert all(one.agrees for one in found.turn_ons.agreements)
    assert np.max(np.abs(stable(found))) < 4.5


# Motions that tell too little ----------------------------------------------------------------------


def tumbled(attitudes: list[np.ndarray]) -> Simulation:
    """Holds of 4 s in these attitudes, turns of 2 s between them."""
    path = Motion(50.0, 4)
    for attitude in attitudes:
        path.reach(attitude, 2.0)
        path.hold(4.0)
    return record(
        path, GRADES["consumer"], HERE, "", np.random.default_rng(8), lever=np.array([0.01, 0.0, 0.02])
    )


LYING = [
    rotations.multiply(posed(np.eye(3)[0], 0.0), rotations.exponential([0, 0, 1.3 * k])) for k in range(12)
]


def test_turns_about_one_axis_leave_the_third_sensor_and_two_gyros_untold() -> None:
    made = tumbled(LYING)
    found = settled(made, told=False)
    assert np.max(np.abs(missed(found, made).z)) < 4.5
    told = {p.name for p in found.parameters}
    assert {"accelerometer scale factor error x", "gyro scale factor error z"} <= told
    assert not {"accelerometer scale factor error z", "gyro scale factor error x"} & told
    said = " ".join(found.not_determined)
    assert "scale factor of accelerometer z" in said
    assert re.search(r"a turn about ([xy]) while \1 lies level", said)


def test_one_pose_again_and_again_is_refused() -> None:
    with pytest.raises(ObservabilityError, match="determine nothing of the accelerometers"):
        settled(tumbled([LYING[0]] * 6), told=False)


def test_without_a_gyro_the_accelerometers_are_calibrated_and_the_gyros_named() -> None:
    made, _ = runs("by hand, seeing the Earth")[0]
    frame = pl.DataFrame(made.columns()).select(pl.exclude("^g[xyz].*$"))
    found = tumble.calibrate(frame, site=tumble.Site.from_gravity(made.place.gravity)).calibration
    assert np.max(np.abs(missed(found, made).z)) < 4.5
    assert found.gyroscope is None
    assert any("recording has none" in sentence for sentence in found.not_determined)
    with pytest.raises(ObservabilityError, match="no accelerometer"):
        tumble.calibrate(pl.DataFrame(made.columns()).select(pl.exclude("^a[xyz].*$")))


def test_a_saturated_turn_breaks_the_section_and_harms_nothing() -> None:
    made = played("by-hand", "tactical", 503, "clipped")
    found = settled(made, told=False)
    assert np.max(np.abs(missed(found, made).z)) < 4.5
    assert any("falls into" in remark for remark in [*found.remarks, *found.verdict.reasons])


def test_a_prior_of_another_unit_is_objected_to_and_the_units_own_is_not(tmp_path: Path) -> None:
    one, other = (tmp_path / name for name in ("one.json", "other.json"))
    runs("by hand")[0][1].write(one)
    runs("by hand")[1][1].write(other)
    made, _ = runs("by hand")[0]
    for prior, objected in ((one, False), (other, True)):
        reasons = settled(made, told=False, prior=prior).verdict.reasons
        assert any("contradicts" in reason for reason in reasons) == objected

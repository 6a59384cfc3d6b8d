"""What is stated is what the second simulator's units do, where little of a recording shows it."""

from dataclasses import replace

import numpy as np
import pytest

import tumble
from second_simulator import GRADES, Grade
from second_simulator.calibrating import calibrated, played, sigmas_off
from second_simulator.earth import normal_gravity
from second_simulator.recording import Place, Simulation
from second_simulator.sensors import flicker
from tumble.document import Calibration

STANDARD_GRAVITY = 9.80665
LATITUDE, HEIGHT = 0.65, 1600.0
STILL = "gyro bias, flicker floor of the Allan deviation, rad/s"


def of_parameters(found: Calibration, name: str) -> float:
    """The rms of the uncertainties that are stated of all parameters of a name."""
    stated = [p.standard_uncertainty for p in found.parameters if p.name.startswith(name)]
    assert len(stated) in (3, 9)
    return float(np.sqrt(np.mean(np.square(stated))))


@pytest.mark.slow
def test_six_faces_show_a_g_sensitivity_no_better_than_a_bias_keeps_from_face_to_face() -> None:
    """The rests of a face are near in time: half the difference of two faces is off by what the bias wanders between.

    Drawn anew, a sixth of the recording for each face, opposite faces half of it apart.
    """
    made = played("rate-table", "consumer", 7, rates=(20.0, 80.0), rate=25.0)
    found, seconds = calibrated(made, rate="25±0.001"), float(made.time[-1] - made.time[0])
    rng, halves = np.random.default_rng(1), list[np.ndarray]()
    for _ in range(300):
        drawn = flicker(6 * int(seconds / 6), 1.0, GRADES["consumer"].gyroscope.flicker, rng)
        faces = drawn.reshape(6, -1, 3).mean(axis=1)
        halves.append(0.5 * (faces[:3] - faces[3:]))
    # The unit of the file is °/s.
    wandered = np.degrees(np.sqrt(np.mean(np.square(halves)))) / 9.8
    assert 0.8 * wandered < of_parameters(found, "g-sensitivity") < 2.0 * wandered


def test_six_holds_state_a_bias_no_better_than_it_keeps_from_face_to_face() -> None:
    """Half the sum of two faces, against the mean over the recording; six holds for six unknowns show no scatter."""
    made = played("six-faces", "hobby", 5, rate=50.0)
    found = calibrated(made, rate="50±0.001")
    faces = [(int(10 * step.start), int(10 * step.stop)) for step in made.path.steps if step.kind == "hold"]
    rng, off = np.random.default_rng(1), list[np.ndarray]()
    for _ in range(200):
        drawn = flicker(int(10 * made.path.seconds), 10.0, GRADES["hobby"].accelerometer.flicker, rng)
        means = np.array([drawn[a:b].mean(axis=0) for a, b in faces]) - drawn.mean(axis=0)
        off.append(0.5 * (means[:3] + means[3:]))
    # The unit of the file is g.
    wandered = np.sqrt(np.mean(np.square(off))) / STANDARD_GRAVITY
    assert 0.85 * wandered < of_parameters(found, "accelerometer bias") < 2.0 * wandered


@pytest.mark.slow
@pytest.mark.parametrize("seed", [31007, 31002])
def test_soaks_too_short_to_be_left_out_one_by_one_are_not_fit(seed: int) -> None:
    """Most rests have not settled. A straight line was taken, and biases were off by up to 38 of their sigmas."""
    verdict = calibrated(played("thermal-soak", "tactical", seed, minutes=6.0), rate="10±0.0005").verdict
    assert not verdict.fit
    assert any("Without one soak the other rests do not determine" in said for said in verdict.reasons)


@pytest.mark.slow
def test_biases_that_look_still_by_chance_are_not_stated_as_still() -> None:
    """The likelihood of the wander is largest at none; gyro biases were off by 5.8 of the sigmas that follow."""
    found = calibrated(played("thermal-soak", "automotive", 31002), rate="10±0.0005")
    assert found.verdict.fit
    truth = GRADES["automotive"].gyroscope.flicker * np.sqrt(2 * np.log(2) / np.pi)
    assert 0.2 * truth < found.quality.variance_components[STILL] < 2.0 * truth


@pytest.mark.slow
def test_a_rest_that_is_knocked_askew_is_two_poses() -> None:
    """Both parts had one direction and were left out: nothing determined it, and the recording was refused."""
    found = calibrated(played("thermal-soak", "robot", 850008, "bumped"), rate="10±0.0005")
    assert found.verdict.fit
    assert not found.quality.left_out


def coarse(*, gyro: bool = True) -> Grade:
    """A board with a low-pass filter: steps of 0.1 °/s, nine times the gyros' noise, and of 4 mg."""
    grade = GRADES["consumer"]
    force, rate = grade.accelerometer, grade.gyroscope
    return replace(
        grade,
        accelerometer=replace(force, noise=0.1 * force.noise, step=0.004 * STANDARD_GRAVITY),
        gyroscope=replace(rate, noise=0.2 * rate.noise, step=np.radians(0.1)) if gyro else rate,
    )


@pytest.mark.slow
@pytest.mark.parametrize("procedure", ["by-hand", "multi-position", "six-faces"])
def test_what_rounding_hides_is_stated(procedure: str) -> None:
    """Biases were off by 8 to 500 of what was stated where rounding counted as noise.

    Of six right numbers one is beyond 4.5 in 25,000 runs, and their rms beyond 1.9 in a thousand.
    """
    z = list[float]()
    for seed in range(900, 902):
        made = played(procedure, coarse(), seed, rate=100.0)
        found = calibrated(made, by_protocol=procedure == "six-faces", rate="100±0.002")
        assert found.verdict.fit, found.verdict.reasons
        # The tremor of a hand dithers.
        said = any("The gyro's output goes in steps of 0.1 deg/s" in remark for remark in found.remarks)
        assert said or procedure == "by-hand"
        z += sigmas_off(found, made, "gyroscope.bias").tolist()
    assert np.max(np.abs(z)) < 4.5
    assert np.sqrt(np.mean(np.square(z))) < 1.9


@pytest.mark.slow
def test_a_face_that_a_table_turns_shows_the_same_rounding_all_the_time() -> None:
    """Windows of six rotations and the rests between them know no more than one: 6 sigmas before."""
    made = played("rate-table", coarse(gyro=False), 910, rate=25.0)
    found = calibrated(made, rate="25±0.0005")
    assert np.max(np.abs(sigmas_off(found, made, "accelerometer.bias"))) < 4.0


@pytest.mark.slow
def test_angles_from_stamps_that_jitter_are_stated_as_uncertain() -> None:
    """Quiet gyros, five turns: too few to show by themselves what 4 ms of jitter do to them (7 sigmas before)."""
    z = list[float]()
    for seed in range(3):
        rng = np.random.default_rng(500 + seed)
        made = played("six-faces", "tactical", 400 + seed, rate=50.0)
        late = np.abs(rng.normal(0.0, 0.004, made.time.size))
        made = replace(made, time=np.maximum.accumulate(made.time + late) + 1e-7 * np.arange(made.time.size))
        z += sigmas_off(calibrated(made, rate="crystal"), made, "gyroscope.matrix").tolist()
    assert np.max(np.abs(z)) < 4.0
    assert np.sqrt(np.mean(np.square(z))) < 1.3


def test_an_asymmetry_that_single_turns_show_is_tried_although_these_look_like_faults() -> None:
    """A file for each sequence: two turns showed it alone, were left out, and a gyro was 29 sigmas off and fit."""
    tactical = GRADES["tactical"]
    grade = replace(tactical, gyroscope=replace(tactical.gyroscope, asymmetry=3e-4))
    made = played("strapdown-rotation", grade, 4)
    kept = np.ones(len(made.time), dtype=bool)
    holds = [
        np.searchsorted(made.time - 12.0, [step.start, step.stop])
        for step in made.path.steps
        if step.kind == "hold" and step.name != "pause"
    ]
    assert len(holds) == 34
    for (_, end), (start, _) in zip(holds[1:-1:2], holds[2::2], strict=True):
        kept[end:start] = False
    columns = {name: getattr(made, name)[kept] for name in ("time", "force", "rate", "temperature")}
    found = calibrated(replace(made, **columns), rate="100±0.0001")
    assert not found.quality.left_out
    for term in ("gyroscope.asymmetry", "gyroscope.matrix"):
        assert np.max(np.abs(sigmas_off(found, made, term))) < 4.5


def test_a_fixture_twice_as_bad_as_stated_is_no_objection_where_no_number_stands_on_it() -> None:
    made = played("strapdown-rotation", "tactical", 31, error=1e-3, rate=50.0)
    stated = f"uncertainty_deg: {np.degrees(2e-3)}"
    assert stated in made.protocol
    less = made.protocol.replace(stated, f"uncertainty_deg: {np.degrees(4e-4)}")
    found = calibrated(replace(made, protocol=less), rate="50±0.00005")
    assert found.quality.variance_components["placement beyond what the protocol says, rad"] > 8e-4
    assert found.verdict.fit
    assert np.max(np.abs(sigmas_off(found, made, "accelerometer.bias"))) < 4.5


@pytest.fixture(scope="module")
def high() -> Simulation:
    """A tactical unit by hand at 1,600 m, gravity 80 mGal off; stamps jitter, and their resonator is 0.4 % slow."""
    place = Place(LATITUDE, HEIGHT, normal_gravity(LATITUDE, HEIGHT) + 8e-4, LATITUDE, None, 2e-5)
    made = played("by-hand", "tactical", 21, place=place, poses=16, rate=50.0)
    late = np.abs(np.random.default_rng(3).normal(0.0, 3e-4, made.time.size))
    return replace(made, time=(made.time + late) * (1.0 - 0.004))


def _worst(found: Calibration, made: Simulation) -> tuple[float, float]:
    """By how many of their sigmas scale factors of accelerometers and gyros are off the truth."""
    with np.errstate(invalid="ignore", divide="ignore"):
        off = [np.abs(sigmas_off(found, made, f"{t}.matrix"))[::4] for t in ("accelerometer", "gyroscope")]
    return float(np.max(off[0])), float(np.max(off[1]))


def test_with_a_latitude_alone_neither_height_nor_clock_misleads(high: Simulation) -> None:
    found = calibrated(high, by_protocol=False, site=tumble.Site.from_latitude(LATITUDE))
    assert max(_worst(found, high)) < 3.0
    assert found.verdict.fit
    assert found.site.height_m is None
    said = " ".join(found.verdict.reasons)
    assert "say --rate crystal where a crystal times the board" in said
    assert "give the height too, as --site LATITUDE,HEIGHT" in said


def test_what_is_said_is_believed(high: Simulation) -> None:
    """So the test above has power: with a crystal and the height of the sea the same numbers are off."""
    site = tumble.Site.from_latitude(LATITUDE, 0.0)
    assert min(_worst(calibrated(high, by_protocol=False, site=site, rate="crystal"), high)) > 8.0


@pytest.mark.parametrize("digits", [2, 3])
def test_gravity_with_few_digits_is_good_to_them(high: Simulation, digits: int) -> None:
    given = tumble.Site.from_gravity(round(high.place.gravity, digits))
    assert _worst(calibrated(high, by_protocol=False, site=given), high)[0] < 3.0

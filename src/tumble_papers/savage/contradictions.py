"""Where Savage (2018) has slips: each with the check that shows it, made when it is asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Series
from tumble.attitude import matrix_from_rotation_vector
from tumble.calibration.closed_forms.rotation_sequences import sequence_model
from tumble.calibration.closed_forms.sequence_inversion import invert_measurements
from tumble.calibration.closed_forms.sequence_measurements import window_weights
from tumble.protocol.strapdown_rotation import start_down
from tumble.reproduction.outcome import Outcome, Row, claim_row
from tumble.sensor.conventions.savage import GROUPS, NAMES, SavageErrors
from tumble.sensor.imu import ImuModel
from tumble.units import MICRO_G, STANDARD_GRAVITY
from tumble_papers.published import savage
from tumble_papers.savage.formulas import BY_NAME, COMPONENTS, simulated_coefficients
from tumble_papers.savage.section_9 import bias_errors, unit
from tumble_papers.savage.strapdown_simulation import (
    AS_PRINTED,
    UNITS_SI,
    VARIANTS,
    Setting,
    Variant,
    exact_unit,
    measure_run,
    run_study,
    simulate_run,
)

RUNS = 100
# Without noise and bias a second at rest determines as much as ten.
BRIEF = 1.0
TENTH_OF_A_DEGREE = np.radians(0.1)
SEQUENCE_ORDER = tuple(BY_NAME)


def reproduce_contradictions(repetitions: int, seed: int) -> Outcome:
    """Try each formula that has a slip, and each sentence that a simulation can try.

    Parameters
    ----------
    repetitions : not used: what needs runs makes its own number of them.
    seed : of all random numbers.
    """
    rng = np.random.Generator(np.random.SFC64([seed, 97]))
    formulas, vertical, second = rng.spawn(3)
    rows = [
        _start_of_row_6(),
        _vertical_unit(),
        _derivative(),
        *_seven(),
        *_twelve(),
        *_thirteen(),
        *_section_7(),
        _table_2(),
        _seventeen(),
        *_eighteen(formulas),
        *_twenty_two(),
        _averages(),
        _forty_seconds(),
        *_second_order(second),
        *_nominal_vertical(vertical),
    ]
    return Outcome(
        "savage-contradictions",
        "What the paper says, and what its formulas and a simulation say",
        "Savage 2018; the text at hand is a scan, and some slips may be its",
        ("said", "found"),
        rows,
        "inside: the check bears the paper out",
        notes=["Each formula by itself, with all signs: savage-12 and savage-9.4."],
        repetitions=1,
        seed=seed,
    )


def _start_of_row_6() -> Row:
    row = BY_NAME["6"]
    angles = [round(np.degrees(outer)) for _, outer in BY_NAME["4"].fixture_angles()]
    said = [0]
    for axis, angle in BY_NAME["4"].rotations:
        said.append(said[-1] + (0 if axis == 2 else round(np.degrees(angle))))
    assert row.outer < 0.0
    return claim_row(
        "table 1, sequence 4: the outer axis goes by the printed signs, °",
        "",
        ", ".join(str(value) for value in said),
        ", ".join(str(value) for value in angles),
        said == angles,
        "after half a turn about z the unit's y lies against the outer axis: +180 y is −180 of it; the same in "
        "5, 6, 13 and 14",
    )


def _vertical_unit() -> Row:
    """(1) takes g to each component of the force; an exact unit at rest on a level fixture reads zero down."""
    force = np.array([0.0, 0.0, -STANDARD_GRAVITY])
    printed = float(np.linalg.norm(force + STANDARD_GRAVITY)) / STANDARD_GRAVITY
    down = float(np.array([0.0, 0.0, 1.0]) @ force + STANDARD_GRAVITY)
    return claim_row(
        "(1): â + g as down, of an exact unit that lies level",
        "g",
        0.0,
        round(printed, 3),
        printed < 1e-9,
        f"û · â + g is {abs(down):g}, with û = Ĉ u_D: the dot product is missing, and û is written as an acceleration",
    )


def _derivative() -> Row:
    """(2): what its second formula is of a unit at rest without Earth rate: nothing, so it is no attitude."""
    C, rate = np.eye(3), np.zeros((3, 3))
    found = C @ rate - rate @ C
    return claim_row(
        "(2), second formula: Ĉ of a unit at rest, without Earth rate: its first element",
        "1",
        1.0,
        float(found[0, 0]),
        bool(found[0, 0] == C[0, 0]),
        "the left side is the derivative of Ĉ",
    )


def _seven() -> list[Row]:
    """(7) has λyy where λyyy is meant: then λyy is seen with both."""
    simulated, gravity = simulated_coefficients()
    at = SEQUENCE_ORDER.index("7"), COMPONENTS.index("down at the start"), NAMES.index("lambda yy")
    found = float(simulated[at]) / gravity
    # as printed: -g (λyy - λyy)
    return [
        claim_row(
            "(7): down at the start of 7, by λ yy, with λ yy in place of λ yyy",
            "g",
            0.0,
            round(found, 4),
            abs(found) < 1e-3,
            "(12) has −g, too; λ LinScal is missing in (7)",
        )
    ]


def _twelve() -> list[Row]:
    simulated, _ = simulated_coefficients()
    rows: list[Row] = []
    for words in ("down at the start", "down at the end"):
        entry = next(e for e in savage()["equation_12"] if (e["sequence"], e["component"]) == ("9", words))
        at = SEQUENCE_ORDER.index("9"), COMPONENTS.index(words), NAMES.index("lambda x")
        said, found = float(entry["terms"]["lambda x"]), round(float(simulated[at]), 4)
        rows.append(
            claim_row(
                f"(12): {words} of 9, by λ x",
                "1",
                said,
                found,
                said == found,
                "7 and 8 have it right",
            )
        )
    return rows


def _thirteen() -> list[Row]:
    """A unit with an accelerometer bias of 1 mg and nothing else, through (13) as printed and as it has to be."""
    values = np.zeros(24)
    values[GROUPS["lambda_bias"]] = 1000.0 * MICRO_G
    setting = Setting(exact_unit(), fixture=0.0, earth=False, seconds=1.0)
    recordings = simulate_run(setting, np.random.default_rng(0), truth=SavageErrors.from_vector(values))
    measured = measure_run(recordings, ImuModel.ideal(), AS_PRINTED)
    gravity = recordings.gravity
    right = 1e6 * invert_measurements(measured, gravity)[GROUPS["lambda_asym"]]
    downs = [measured[name] for name in ("9", "7", "8")]
    bias = values[GROUPS["lambda_bias"]]
    printed = [
        -1e6 * float(m[4] - m[3] - 2.0 * b) / (2.0 * gravity) for m, b in zip(downs, bias, strict=True)
    ]
    return [
        claim_row(
            f"(13): λ {'xyz'[k] * 3} of a unit with 1 mg of bias and no asymmetry",
            "ppm",
            0.0,
            round(printed[k], 1),
            abs(printed[k]) < 1.0,
            f"with + 2 λ it is {abs(float(right[k])):.1f}: −(end − start + 2 λ)/2g",
        )
        for k in range(3)
    ]


def _section_7() -> list[Row]:
    """By how much an error of υ and λ goes over into what section 7 says it does."""
    gravity = STANDARD_GRAVITY
    nothing = {name: np.zeros(5) for name in BY_NAME}
    off = {name: value.copy() for name, value in nothing.items()}
    # An orthogonality error of 1e-4 alone, as 4 measures it: what (13) takes from λ y for it.
    off["4"][1] = 4.0 * gravity * 1e-4
    taken = -float(invert_measurements(off, gravity)[NAMES.index("lambda y")]) / 1e-4 / gravity
    off = {name: value.copy() for name, value in nothing.items()}
    off["13"][1] = -2.0 * 1e-4
    from_bias = -float(invert_measurements(off, gravity)[NAMES.index("lambda yyy")]) / 1e-4 * gravity
    return [
        claim_row(
            "section 7: share of υ yz in the formula of λ y",
            "g",
            0.5,
            round(taken, 4),
            abs(taken - 0.5) < 1e-3,
            "(13) has g υ, not υ/2",
        ),
        claim_row(
            "section 7: share of λ y in the formula of λ yyy",
            "1/g",
            0.5,
            round(from_bias, 4),
            abs(from_bias - 0.5) < 1e-3,
            "(13) has λ/g, not λ/2",
        ),
    ]


def _table_2() -> Row:
    printed = savage()["tables"]["2"]["rows"][1]["H"]
    simulated, gravity = simulated_coefficients()
    found = float(simulated[SEQUENCE_ORDER.index("4"), COMPONENTS.index("y"), NAMES.index("upsilon yz")])
    return claim_row(
        "table 2: H of the gyros' orthogonality",
        "m/s²",
        printed,
        round(found, 2),
        abs(found - float(printed)) < 0.01,
        f"it is {found / gravity:.3f} g",
    )


def _seventeen() -> Row:
    """(17) has the angle on its left side: a gyro bias at rest then makes no more tilt with time."""
    row = BY_NAME["1"]
    rate, seconds = 1e-6, (10.0, 30.0)
    tilts = [
        float(
            np.max(
                np.abs(
                    sequence_model([], start_down(row), 1.0, seconds=s).bias_coefficients
                    @ (rate * np.ones(3))
                )
            )
        )
        for s in seconds
    ]
    return claim_row(
        "(17): tilt that a gyro bias makes at rest, 30 s over 10 s",
        "times",
        1.0,
        round(tilts[1] / tilts[0], 3),
        abs(tilts[1] / tilts[0] - 1.0) < 1e-3,
        "the left side is the derivative of φ",
    )


def _eighteen(rng: np.random.Generator) -> list[Row]:
    """Errors of the force at the start and at the end, of a fixture that is off by other angles at each."""
    errors = 1e-3 * rng.standard_normal((3, 3))
    at_start, at_end = 1e-3 * rng.standard_normal((2, 3))
    down = np.array([0.0, 0.0, 1.0])
    exact = _second_order_of_force(errors, at_start, down)
    by_start, by_end = (_by_eighteen(errors, alpha, down) for alpha in (at_start, at_end))
    size = float(np.linalg.norm(exact))
    return [
        claim_row(
            "(18), first line: the error at the start by α at the end, share that is left over",
            "%",
            "less than 1",
            round(100.0 * float(np.linalg.norm(exact - by_end)) / size, 1),
            float(np.linalg.norm(exact - by_end)) < 0.01 * size,
            f"by α at the start {100.0 * float(np.linalg.norm(exact - by_start)) / size:.2f} % are left; the second "
            "line is the error at the end",
        )
    ]


def _second_order_of_force(errors: AnyArray, alpha: Series, down: Series) -> Series:
    """What a tilted start adds to the accelerometers' error: exactly."""
    tilted = matrix_from_rotation_vector(-alpha) @ down
    return np.asarray(-STANDARD_GRAVITY * (errors @ tilted - errors @ down), dtype=np.float64)


def _by_eighteen(errors: AnyArray, alpha: Series, down: Series) -> Series:
    return np.asarray(STANDARD_GRAVITY * errors @ np.cross(alpha, down), dtype=np.float64)


def _twenty_two() -> list[Row]:
    setting = Setting(unit(), fixture=0.0, earth=False)
    rows: list[Row] = []
    for entry in savage()["equation_22"]:
        printed, _, simulated = bias_errors(entry, setting)
        axis = int(np.argmax(np.abs(printed - simulated)))
        if np.allclose(printed, simulated, atol=0.01):
            continue
        rows.append(
            claim_row(
                f"(22): {entry['of']} by κ {'xyz'[axis]}",
                "s",
                round(float(printed[axis]), 3),
                round(float(simulated[axis]), 3),
                abs(printed[axis] - simulated[axis]) < 0.01,
                _sign_words(entry["words"], printed, simulated),
            )
        )
    return rows


def _sign_words(words: str, printed: Series, simulated: Series) -> str:
    all_of_it = np.allclose(printed, -simulated, atol=0.01)
    what = (
        "the magnitude is right, the sign is the other" if all_of_it else "the sign of one term is the other"
    )
    return what + (": not similar" if words == "similarly" else "")


def _averages() -> Row:
    weights = window_weights(1000, "average-of-averages")
    found = float(np.sqrt(1000.0 * np.sum(weights**2)))
    return claim_row(
        "9.2: random noise of an average of averages, over that of a plain average",
        "times",
        1.0,
        round(found, 3),
        abs(found - 1.0) < 0.01,
        "its weights are a triangle: √(4/3)",
    )


def _forty_seconds() -> Row:
    """How long a tilt's rate counts with F of a half, with the 20 s of rotation that the section takes."""
    said = savage()["section_9"]["earth"]["seconds"]
    F = savage()["section_9"]["gyro_bias"]["F"]
    found = 20.0 + 2.0 * 10.0 * F
    longest = max(sequence_model(list(row.rotations), start_down(row), 1.0).angle for row in BY_NAME.values())
    return claim_row(
        "9.1, 9.3: time that counts, with F of 9.4",
        "s",
        float(said),
        found,
        found == said,
        f"the longest sequence of table 1 turns for {longest:.1f} s at 1 rad/s",
    )


def _second_order(rng: np.random.Generator) -> list[Row]:
    """9: errors of 1 mrad make some 1 µg of second order; iterating makes it negligible."""
    setting = Setting(exact_unit(), earth=False, seconds=BRIEF)
    norm = replace(VARIANTS[0], norm=True)
    errors = run_study(setting, (norm,), RUNS, rng, iterations=3)[0] / UNITS_SI
    sizes = np.sqrt(np.mean(errors[:, :, GROUPS["lambda_bias"]] ** 2, axis=(0, 2)))
    said = savage()["section_9"]["second_order_ug"]
    return [
        claim_row(
            "9: second order of errors of 1 mrad, in the accelerometer biases (they are 2 g of table 2)",
            "µg",
            f"{said / 2.0:g}",
            float(f"{sizes[0]:.2g}"),
            bool(sizes[0] < said),
            "root mean square of the first pass, no noise, no Earth rate",
        ),
        claim_row(
            "8: the same after one iteration, and after two",
            "µg",
            "negligible",
            f"{sizes[1]:.2g}, {sizes[2]:.1g}",
            bool(sizes[1] < 0.2),
            "" if sizes[1] < 0.2 else "not negligible",
        ),
    ]


def _nominal_vertical(rng: np.random.Generator) -> list[Row]:
    """The error that the projection on the nominal vertical leaves in the scale factors, and no iteration removes."""
    rows: list[Row] = []
    for words, fixture in (("1 mrad", 1e-3), ("0.1°", TENTH_OF_A_DEGREE)):
        setting = Setting(unit(), fixture=float(fixture), earth=False, seconds=BRIEF)
        ways: tuple[Variant, ...] = (AS_PRINTED, replace(AS_PRINTED, norm=True))
        errors = run_study(setting, ways, RUNS, rng.spawn(1)[0], iterations=3)[:, :, 2] / UNITS_SI
        sizes = np.sqrt(np.mean(errors[:, :, GROUPS["lambda_lin"]] ** 2, axis=(1, 2)))
        rows.append(
            claim_row(
                f"8: accelerometer scale after two iterations, fixture of {words}, unit without errors",
                "ppm",
                "negligible",
                float(f"{sizes[0]:.2g}"),
                bool(sizes[0] < 0.5),
                f"down projected on the nominal vertical is short by α²/2; with the norm it is {sizes[1]:.1g}",
            )
        )
    return rows

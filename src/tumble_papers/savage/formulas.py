"""Savage's tables 1 and 2 and his measurements (12), beside the general model (3) to (5) and the simulation."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from tumble.arrays import AnyArray
from tumble.protocol.strapdown_rotation import (
    AXES,
    SEQUENCES,
    RotationSequence,
    fixture_rotation,
    start_down,
)
from tumble.reproduction.outcome import INSIDE, OUTSIDE, UNJUDGED, Outcome, Row
from tumble.sensor.conventions.savage import NAMES, SavageErrors
from tumble.sensor.imu import ImuModel
from tumble.units import STANDARD_GRAVITY
from tumble_papers.published import savage
from tumble_papers.savage.sequences import sequence_model
from tumble_papers.savage.strapdown_simulation import (
    AS_PRINTED,
    Setting,
    exact_unit,
    measure_run,
    simulate_run,
)

SOURCE = "Savage 2018"
COMPONENTS = ("x", "y", "z", "down at the start", "down at the end")
BY_NAME = {row.name: row for row in SEQUENCES}
# One error at a time, so small that its square is nothing, so large that round-off is nothing.
PROBE = 1e-4
# What second order and round-off leave of a coefficient, in g or without a unit.
SAME = 1e-4


def evaluated(expression: str, gravity: float = STANDARD_GRAVITY) -> float:
    """Return the number that a printed coefficient such as "-2 π g" is.

    Parameters
    ----------
    expression : factors between spaces.
    gravity : of the g, m/s².
    """
    value = 1.0
    for factor in expression.split():
        if factor in ("-", "π", "-π"):
            value *= {"-": -1.0, "π": np.pi, "-π": -np.pi}[factor]
        else:
            value *= gravity if factor == "g" else float(factor)
    return value


def _model_coefficients(gravity: float = STANDARD_GRAVITY) -> AnyArray:
    """Return (17, 5, 24) of (3) to (5): every measurement of every sequence by every error."""
    return np.stack(
        [sequence_model(list(row.rotations), start_down(row), gravity).coefficients for row in SEQUENCES]
    )


@cache
def _simulated() -> tuple[AnyArray, float]:
    setting = Setting(exact_unit(), fixture=0.0, earth=False, seconds=1.0)
    found = np.empty((len(SEQUENCES), 5, 24))
    gravity = STANDARD_GRAVITY
    for number in range(24):
        both: list[AnyArray] = []
        for sign in (1.0, -1.0):
            values = np.zeros(24)
            values[number] = sign * PROBE
            # The same seed is the same place, whose gravity stays.
            recordings = simulate_run(
                setting, np.random.default_rng(0), truth=SavageErrors.from_vector(values)
            )
            gravity = recordings.gravity
            both.append(np.stack(list(measure_run(recordings, ImuModel.ideal(), AS_PRINTED).values())))
        found[:, :, number] = (both[0] - both[1]) / (2.0 * PROBE)
    return found, gravity


def simulated_coefficients() -> tuple[AnyArray, float]:
    """Return (17, 5, 24) by simulation of one error at a time, ±1e-4, without noise or Earth rate, and its gravity.

    Both signs of each error are played through all sequences sample by sample on an exact fixture; what is
    halved is the difference of the measurements.
    """
    found, gravity = _simulated()
    return found.copy(), gravity


def _components(entry: dict[str, Any]) -> tuple[int, int]:
    return [row.name for row in SEQUENCES].index(entry["sequence"]), COMPONENTS.index(entry["component"])


def _measurement_name(entry: dict[str, Any]) -> str:
    """Return how a measurement of (12) is called, such as "Δa y 13"."""
    component = entry["component"]
    if component.startswith("down"):
        return f"{component.replace(' at the', ',')}, {entry['sequence']}"
    return f"Δa {component} {entry['sequence']}"


def reproduce_equation_12(repetitions: int, seed: int) -> Outcome:
    """Try every coefficient of (12): as printed, by (3) to (5), and by simulation of one error at a time.

    Parameters
    ----------
    repetitions, seed : not used: there is no chance in it.
    """
    simulated, gravity = simulated_coefficients()
    model = _model_coefficients(gravity)
    left = simulated.copy()
    rows: list[Row] = []
    for entry in savage()["equation_12"]:
        sequence, component = _components(entry)
        for name, printed in entry["terms"].items():
            at = NAMES.index(name)
            unit = 1.0 if name in ("lambda x", "lambda y", "lambda z") else gravity
            said = evaluated(printed, gravity) / unit
            by_model, found = model[sequence, component, at] / unit, simulated[sequence, component, at] / unit
            left[sequence, component, at] = 0.0
            agrees = abs(said - found) < SAME and abs(by_model - found) < SAME
            reason = "" if agrees else f"the sign is the other: {entry['corrected'][name]}"
            cells = (_shown(printed), float(said), _rounded(by_model), _rounded(found))
            label = f"{_measurement_name(entry)}: {_greek(name)}"
            rows.append(Row(label, "" if unit == 1.0 else "g", cells, INSIDE if agrees else OUTSIDE, reason))
    printed = [_components(entry) for entry in savage()["equation_12"]]
    others = max(float(np.max(np.abs(left[s, c]))) / gravity for s, c in printed)
    apart = float(np.max(np.abs(simulated - model))) / gravity
    rows.append(
        Row(
            "largest coefficient of another error in these",
            "g",
            ("0", 0.0, None, float(f"{others:.1e}")),
            INSIDE if others < SAME else OUTSIDE,
            "" if others < SAME else "an error that (12) does not have",
        )
    )
    rows.append(
        Row(
            "all 17 sequences, 5 measurements, 24 errors: largest difference of (3) to (5) from the simulation",
            "g",
            ("", None, None, float(f"{apart:.1e}")),
            INSIDE if apart < SAME else OUTSIDE,
            "" if apart < SAME else "the model is not of the first order",
        )
    )
    return Outcome(
        "savage-12",
        "(12): what each error does to each measurement",
        f"{SOURCE}, section 6",
        ("printed", "paper", "by (3) to (5)", "simulated"),
        rows,
        f"inside: printed, general model and simulation agree within {SAME:g}; one error of ±{PROBE:g} at a time, no "
        "noise, no Earth rate, an exact fixture",
        notes=[
            "The last block of (12) is taken; the three lines with Δa x8 before it are debris of the scan.",
            *_OTHER_SLIPS,
        ],
        seed=seed,
    )


_OTHER_SLIPS = (
    (
        "Table 1: in 4, 5, 6, 13 and 14 the unit's axis lies against the outer axis, and +180 y is −180 of it. (1), "
        "â + g as down: û · â + g. (2), second formula: its left side is the derivative of Ĉ. (7): λ LinScal is "
        "missing, and λ yyy is meant in λ Asym."
    ),
    (
        "(13), λ iii: −(end − start + 2 λ i) / 2g. Section 7: g υ and λ/g go over into λ x, λ y and λ iii, not the "
        "halves of υ and λ. (17): its left side is the derivative of φ. (18), first line: α at the start; the second "
        "line is the error at the end."
    ),
)


def _rounded(value: float) -> float:
    return float(round(value, 6)) + 0.0


def _shown(expression: str) -> str:
    return expression.replace("-1 ", "−").replace("-", "−").removeprefix("1 ") or "1"


def _greek(name: str) -> str:
    for word, letter in (("kappa", "κ"), ("upsilon", "υ"), ("lambda", "λ"), ("mu", "μ")):
        name = name.replace(word, letter)
    return name


def _start_axes(row: RotationSequence) -> tuple[str, str]:
    """Return the unit's axes that point down and along the outer axis at a sequence's start."""
    to_unit = fixture_rotation(row.inner, row.outer).inv()
    return _axis(to_unit.apply([0.0, 0.0, 1.0])), _axis(to_unit.apply([0.0, 1.0, 0.0]))


def _axis(direction: AnyArray) -> str:
    at = int(np.argmax(np.abs(direction)))
    exact = abs(abs(direction[at]) - 1.0) < 1e-9
    return ("" if direction[at] > 0.0 else "−") + AXES[at] if exact else "between axes"


def reproduce_table_1(repetitions: int, seed: int) -> Outcome:
    """Make table 1 anew: where each sequence starts by the fixture's angles, how these go, what it is made for.

    Parameters
    ----------
    repetitions, seed : not used: there is no chance in it.
    """
    table = savage()["tables"]["1"]
    made_for: dict[str, list[str]] = {}
    for entry in savage()["equation_12"]:
        words = " + ".join(
            f"{_shown(printed)} {_greek(name)}".replace("1 λ", "λ")
            for name, printed in (entry.get("corrected") or entry["terms"]).items()
        )
        made_for.setdefault(entry["sequence"], []).append(
            f"{_measurement_name(entry)}: {words.replace('+ −', '− ')}"
        )
    rows: list[Row] = []
    for printed in table["rows"]:
        row = BY_NAME[printed["name"]]
        down, along = _start_axes(row)
        degrees = [(round(np.degrees(i)), round(np.degrees(o))) for i, o in row.fixture_angles()]
        turned = [f"{np.degrees(angle):+.0f} {AXES[axis]}" for axis, angle in row.rotations]
        verdict, reason = UNJUDGED, "the start is not legible in the text at hand"
        if printed["down"] is not None:
            same = (down, along, ", ".join(turned)) == (
                printed["down"],
                printed["along_outer"],
                printed["rotations"],
            )
            verdict, reason = (INSIDE, "") if same else (OUTSIDE, "the angles lead to another start")
        others = _against(row)
        if others:
            reason = f"{reason}; {others}" if reason else others
        cells = (
            f"{printed['down'] or '?'}, {printed['along_outer']}",
            f"{down}, {along}",
            f"{printed['inner']:+d}, {printed['outer']:+d}",
            printed["rotations"],
            ", ".join(str(i) for i, _ in degrees),
            ", ".join(str(o) for _, o in degrees),
            "; ".join(made_for[row.name]),
        )
        rows.append(Row(f"sequence {row.name}", "", cells, verdict, reason))
    return Outcome(
        "savage-1",
        f"Table 1: {table['title']}",
        f"{SOURCE}, section 3",
        (
            "paper: down, along outer",
            "found",
            "paper: inner, outer",
            "paper: rotations",
            "inner goes, °",
            "outer goes, °",
            "made for",
        ),
        rows,
        "inside: from the printed inner and outer angles the printed axes point down and along the outer axis",
        notes=[_ANGLES],
        simulated=False,
    )


_ANGLES = (
    "Angles are right-handed about the unit's z and y as they lie with both at zero. The last column is (12), "
    "corrected."
)


def _against(row: RotationSequence) -> str:
    """In words, which rotations turn the outer axis against the sign of the unit's."""
    angles = row.fixture_angles()
    against = [
        number + 1
        for number, (axis, angle) in enumerate(row.rotations)
        if axis != 2 and (angles[number + 1][1] - angles[number][1]) * angle < 0.0
    ]
    if not against:
        return ""
    which = ("rotations " if len(against) > 1 else "rotation ") + " and ".join(str(n) for n in against)
    return f"{which}: the unit's axis lies against the outer axis, which turns the other way"


def reproduce_table_2(repetitions: int, seed: int) -> Outcome:
    """Make table 2 anew: H of each group, printed, by (12) and by simulation.

    Parameters
    ----------
    repetitions, seed : not used: there is no chance in it.
    """
    table = savage()["tables"]["2"]
    simulated, gravity = simulated_coefficients()
    groups = {
        "gyro scale factor": (["1", "2", "3", "1a", "2a", "3a"], "kappa", "2 π g"),
        "gyro orthogonality": (["4", "5", "6"], "upsilon", "4 g"),
        "accelerometer misalignment and bias": (["7", "8", "9", "10", "11", "12", "13", "14"], "mu", "2 g"),
    }
    rows: list[Row] = []
    for printed in table["rows"]:
        sequences, first, formula = groups[printed["group"]]
        values: list[float] = []
        for entry in savage()["equation_12"]:
            if entry["sequence"] not in sequences or entry["component"].startswith("down"):
                continue
            name = next(iter(entry["terms"]))
            s, c = _components(entry)
            # a bias counts in g: λ/g has the coefficient of λ times g
            unit = gravity if name.startswith(first) else 1.0
            values.append(abs(float(simulated[s, c, NAMES.index(name)])) / unit)
        low, high = min(values), max(values)
        said = printed["H"]
        meant = evaluated(formula, 1.0)
        close = abs(low - meant) < SAME and abs(high - meant) < SAME
        cells = (said, formula, _rounded(low), _rounded(high))
        if said is None:
            rows.append(Row(printed["group"], "g", cells, UNJUDGED, "not in the text at hand"))
            continue
        agrees = close and said == formula
        rows.append(
            Row(
                printed["group"],
                "g",
                cells,
                INSIDE if agrees else OUTSIDE,
                "" if agrees else f"{said} is {formula}: {meant * gravity:.1f} m/s²",
            )
        )
    return Outcome(
        "savage-2",
        f"Table 2: {table['title']}",
        f"{SOURCE}, section 9",
        ("paper", "by (12)", "simulated: smallest", "simulated: largest"),
        rows,
        "inside: the printed H is that of (12), and so are all that are simulated",
        seed=seed,
    )

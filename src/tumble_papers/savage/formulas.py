"""Savage's tables 1 and 2 and his measurements (12), beside the general model (3) to (5) and the simulation."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from tumble.arrays import AnyArray
from tumble.protocol import AXES, SEQUENCES, RotationSequence, fixture_rotation, start_down
from tumble.reproduction import Row
from tumble.sensor import NAMES, ImuModel, SavageErrors
from tumble.units import STANDARD_GRAVITY
from tumble_papers.savage.sequences import sequence_model
from tumble_papers.savage.strapdown_simulation import AS_PRINTED, EXACT, Setting, measure_run, simulate_run
from tumble_papers.study import Found, Study, judge, savage

COMPONENTS = ("x", "y", "z", "down at the start", "down at the end")
BY_NAME = {row.name: row for row in SEQUENCES}
# One error at a time, so small that its square is nothing, so large that round-off is nothing.
PROBE = 1e-4
# What second order and round-off leave of a coefficient, in g or without a unit.
SAME = 1e-4


def evaluated(expression: str, gravity: float = STANDARD_GRAVITY, **names: float) -> float:
    """Return the number that a printed coefficient such as "-2 π g" or "-1/rate - T/2π" is.

    Parameters
    ----------
    expression : terms, each of factors between spaces or with one of them over another.
    gravity : of the g, m/s².
    names : what else stands in it.
    """
    names |= {"g": gravity, "π": np.pi, "2π": 2.0 * np.pi}

    def size(word: str) -> float:
        over, *under = (names[one] if one in names else float(one) for one in word.split("/"))
        return over / float(np.prod(under))

    terms = [term.split() for term in expression.replace("-", "+ -1 ").split("+")]
    return float(sum(np.prod([size(word) for word in term]) for term in terms if term))


def _model_coefficients(gravity: float = STANDARD_GRAVITY) -> AnyArray:
    """Return (17, 5, 24) of (3) to (5): every measurement of every sequence by every error."""
    return np.stack(
        [sequence_model(list(row.rotations), start_down(row), gravity).coefficients for row in SEQUENCES]
    )


@cache
def simulated_coefficients() -> tuple[AnyArray, float]:
    """Return (17, 5, 24) by simulation of one error at a time, ±1e-4, without noise or Earth rate, and its gravity.

    Both signs of each error are played through all sequences sample by sample on an exact fixture; what is
    halved is the difference of the measurements.
    """
    setting = Setting(EXACT, fixture=0.0, earth=False, seconds=1.0)
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


def _components(entry: dict[str, Any]) -> tuple[int, int]:
    return [row.name for row in SEQUENCES].index(entry["sequence"]), COMPONENTS.index(entry["component"])


def _measurement_name(entry: dict[str, Any]) -> str:
    """Return how a measurement of (12) is called, such as "Δa y 13"."""
    component = entry["component"]
    if component.startswith("down"):
        return f"{component.replace(' at the', ',')}, {entry['sequence']}"
    return f"Δa {component} {entry['sequence']}"


def _equation_12(repetitions: int, seed: int) -> Found:
    """Try every coefficient of (12): as printed, by (3) to (5), and by simulation of one error at a time."""
    simulated, gravity = simulated_coefficients()
    model = _model_coefficients(gravity)
    left = simulated.copy()
    rows: list[Row] = []
    for entry in savage()["equation_12"]:
        at = _components(entry)
        for name, printed in entry["terms"].items():
            unit = 1.0 if name in ("lambda x", "lambda y", "lambda z") else gravity
            said = evaluated(printed, gravity) / unit
            by_model, found = (of[*at, NAMES.index(name)] / unit for of in (model, simulated))
            left[*at, NAMES.index(name)] = 0.0
            agrees = abs(said - found) < SAME and abs(by_model - found) < SAME
            verdict = judge(agrees, f"the sign is the other: {entry.get('corrected', {}).get(name)}")
            cells = (_shown(printed), float(said), _rounded(by_model), _rounded(found))
            label = f"{_measurement_name(entry)}: {_greek(name)}"
            rows.append(Row(label, "" if unit == 1.0 else "g", cells, *verdict))
    printed = [_components(entry) for entry in savage()["equation_12"]]
    others = max(float(np.max(np.abs(left[at]))) / gravity for at in printed)
    apart = float(np.max(np.abs(simulated - model))) / gravity
    all_of_it = (
        "all 17 sequences, 5 measurements, 24 errors: largest difference of (3) to (5) from the simulation"
    )
    another = "largest coefficient of another error in these"
    for label, head, value, why in (
        (another, ("0", 0.0), others, "an error that (12) does not have"),
        (all_of_it, ("", None), apart, "the model is not of the first order"),
    ):
        rows.append(Row(label, "g", (*head, None, float(f"{value:.1e}")), *judge(value < SAME, why)))
    return Found(rows, said={"same": SAME, "probe": PROBE})


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


def _table_1(repetitions: int, seed: int) -> Found:
    """Make table 1 anew: where each sequence starts by the fixture's angles, how these go, what it is made for."""
    made_for: dict[str, list[str]] = {}
    for entry in savage()["equation_12"]:
        words = " + ".join(
            f"{_shown(printed)} {_greek(name)}".replace("1 λ", "λ")
            for name, printed in (entry.get("corrected") or entry["terms"]).items()
        )
        words = f"{_measurement_name(entry)}: {words.replace('+ −', '− ')}"
        made_for.setdefault(entry["sequence"], []).append(words)
    rows: list[Row] = []
    for printed in savage()["tables"]["1"]["rows"]:
        row = BY_NAME[printed["name"]]
        down, along = _start_axes(row)
        inner, outer = (
            ", ".join(str(round(np.degrees(angle))) for angle in angles)
            for angles in zip(*row.fixture_angles(), strict=True)
        )
        turned = ", ".join(f"{np.degrees(angle):+.0f} {AXES[axis]}" for axis, angle in row.rotations)
        same = (down, along, turned) == tuple(printed[of] for of in ("down", "along_outer", "rotations"))
        illegible = None if printed["down"] is not None else "the start is not legible in the text at hand"
        verdict, reason = judge(same, "the angles lead to another start", illegible)
        cells = (
            f"{printed['down'] or '?'}, {printed['along_outer']}", f"{down}, {along}",
            f"{printed['inner']:+d}, {printed['outer']:+d}", printed["rotations"], inner, outer,
            "; ".join(made_for[row.name]),
        )  # fmt: skip
        reason = "; ".join(words for words in (reason, _against(row)) if words)
        rows.append(Row(f"sequence {row.name}", "", cells, verdict, reason))
    return Found(rows)


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


_GROUPS = {
    "gyro scale factor": ("kappa", ["1", "2", "3", "1a", "2a", "3a"], "2 π g"),
    "gyro orthogonality": ("upsilon", ["4", "5", "6"], "4 g"),
    "accelerometer misalignment and bias": ("mu", ["7", "8", "9", "10", "11", "12", "13", "14"], "2 g"),
}


def _table_2(repetitions: int, seed: int) -> Found:
    """Make table 2 anew: H of each group, printed, by (12) and by simulation."""
    simulated, gravity = simulated_coefficients()
    rows: list[Row] = []
    for printed in savage()["tables"]["2"]["rows"]:
        first, sequences, formula = _GROUPS[printed["group"]]
        values: list[float] = []
        for entry in savage()["equation_12"]:
            if entry["sequence"] not in sequences or entry["component"].startswith("down"):
                continue
            name = next(iter(entry["terms"]))
            # a bias counts in g: λ/g has the coefficient of λ times g
            unit = gravity if name.startswith(first) else 1.0
            values.append(abs(float(simulated[*_components(entry), NAMES.index(name)])) / unit)
        said, meant = printed["H"], evaluated(formula, 1.0)
        close = all(abs(value - meant) < SAME for value in values)
        verdict = judge(
            close and said == formula,
            f"{said} is {formula}: {meant * gravity:.1f} m/s²",
            "not in the text at hand" if said is None else None,
        )
        cells = (said, formula, _rounded(min(values)), _rounded(max(values)))
        rows.append(Row(printed["group"], "g", cells, *verdict))
    return Found(rows)


FORMULAS = (Study("savage-1", _table_1), Study("savage-2", _table_2), Study("savage-12", _equation_12))
"""Tables 1 and 2, and (12)."""

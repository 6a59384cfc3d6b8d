"""Does every procedure say the truth of recordings that another hand simulated?

    python benchmarks/second_hand.py --procedure by-hand --grade consumer --runs 100
    python benchmarks/second_hand.py --procedure turntable --grade tactical --runs 20 --estimator joint
    python benchmarks/second_hand.py --procedure by-hand --grade consumer --runs 30 --fault bumped clipped
    python benchmarks/second_hand.py --procedure six-faces --seed 1007 --runs 1 --verbose --keep trial

The simulator is `tests/second_simulator`, which shares no code with the package. Every run draws a unit, a place and a
motion, and calibrates the recording as a user does: a data frame and a protocol file, public functions alone. Run
number k of ``--seed S`` is run 0 of ``--seed S+k``, so that each failure can be repeated by itself.

The stamps of a recording without a fault are exact and perfectly regular, so that they are taken as nominal: all gyro
scale factors are uncertain by 0.58 % alike, and their z is near zero. With ``--rate-ppm 1`` the user says the rate
(``--rate``), and the gyro scale factors are judged by what the recording tells.

Printed for recordings without a fault: the share that settles (no refusal) and is FIT, root mean square of error over
stated sigma (z) and share inside the stated 95 % interval by group, with intervals (95 %) of a bootstrap over runs; the
normalised estimation error squared over its degrees of freedom (NEES); terms that were kept though the unit has none,
and missed though it has them; the largest |z| of results that are FIT. Of every run that says FIT with |z| > 5 the seed
is named. The truth of a wandering bias is its mean over the recording.

For faults: how many are refused, unfit, or FIT with the fault named in a remark; how many are FIT with all numbers
inside five sigmas, and FIT with one beyond, of these without a word. A bias that was somewhere within five sigmas of
the stated value while recording is not counted as wrong.

A long study is left running with ``--store DIR``: each run's outcome is a file there, a run that has one is not made
again, and what is printed is of all that are there. ``--shard 0/2`` and ``--shard 1/2`` share the runs of one command.
``--table`` then prints a line of each test, grades together, of what is there and makes nothing.
"""

from __future__ import annotations

import os

from tumble.document import plain

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import re
import sys
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import tumble
from second_simulator import (
    GRADES,
    OWN_FAULTS,
    PROCEDURES,
    RECORD_FAULTS,
    STATED_FAULTS,
    Grade,
    Simulation,
    named,
)

WITHOUT_PROTOCOL = {"by-hand": "hand-held", "multi-position": "multi-position"}
"""Tests that nobody writes a protocol for, and what the user calls them."""

TERMS = (
    "accelerometer.matrix", "accelerometer.bias", "accelerometer.asymmetry", "accelerometer.quadratic",
    "gyroscope.matrix", "gyroscope.bias", "gyroscope.asymmetry", "gyroscope.quadratic", "gyroscope.g_sensitivity",
)  # fmt: skip
OPTIONAL = TERMS[2:4] + TERMS[6:]
COUNTED = (
    "accelerometer bias", "accelerometer scale", "accelerometer non-orthogonality", "gyroscope bias",
    "gyroscope scale", "gyroscope non-orthogonality", "between triads",
)  # fmt: skip
"""Groups that enter the NEES."""

WORDS = {
    "bumped": r"left out|sways|jump|contradict|placed to|times what|creep|moved",
    "loose": r"left out|sways|jump|contradict|placed to|times what|creep|moved|slip|lean",
    "clipped": r"limit|clip|saturat|full scale",
    "dropped": r"missing|lost|gap|jump",
    "gaps": r"missing|lost|gap",
    "doubled": r"twice|double|repeat|duplicate|same stamp",
    "lag": r"instants|late|lag|clocks",
    "clock-0.5": r"clock|stamps|rate of the samples|sampling",
    "clock-1": r"clock|stamps|rate of the samples|sampling",
    "other-units": r"unit|scale factor",
    "two-units": r"unit",
    "warm-up": r"drift|warm|wander|jump|times what",
    "gyro-ramp": r"drift|warm|wander|jump|times what",
    "wrong-latitude": r"latitude|Earth rate",
    "wrong-gravity": r"gravity .*(wrong|normal|than)",
    "reversed-gyro": r"revers|sign", "reversed-accelerometer": r"revers|sign",
    "swapped-gyro": r"swap|axes", "swapped-both": r"swap",
    "dead-gyro": r"constant|dead|never changes|stuck", "dead-accelerometer": r"constant|dead|never changes|stuck",
    "one-rate": r"left out|contradict|rates? .*(off|wrong)|times what",
    "all-rates": r"stand or fall|rates? .*(off|wrong) by",
    "misread": r"misread|left out|angle .*(off|differ)",
    "missing-turn": r"left out|missing|not found|no part",
    "pose-off": r"left out|contradict|placed to|off by",
    "four-poses-off": r"left out|contradict|placed to|off by",
    "plate-leans": r"lean|contradict|placed to|plumb|differ by",
}  # fmt: skip
"""What a remark has to say for a fault to count as named."""

RANDOM = "random"
"""A grade that is drawn anew for each recording."""

USUAL = (
    r"cannot be seen|nothing would show it|"
    r"What misplacement does|What the table does|A table whose rates|agrees with how|wrong by 100 ppm"
    r"|which no residual shows|nothing checks them|^Procedure |DataFrame|^The residuals are|readings at rest disagree"
)
"""Remarks that every recording gets, which name nothing."""


@dataclass
class Outcome:
    """What became of one recording; arrays by group: error, standard uncertainty, and half of the 95 % interval.

    `seconds` are the processor's.
    """

    seed: int
    seconds: float
    error: str = ""
    fit: bool = False
    words: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    groups: dict[str, np.ndarray] = field(default_factory=dict)
    nees: float = np.nan
    freedom: int = 0
    indefinite: bool = False
    extra: list[str] = field(default_factory=list)
    missed: list[str] = field(default_factory=list)
    has: list[str] = field(default_factory=list)
    excused: np.ndarray | None = None

    def save(self, file: Path) -> None:
        """Write a file that `load` reads; it is there whole or not at all."""
        part = file.with_suffix(".part")
        part.write_text(json.dumps(asdict(self), default=np.ndarray.tolist), encoding="utf-8")
        part.replace(file)

    @classmethod
    def load(cls, file: Path) -> Outcome:
        """Return what was saved."""
        made = cls(**json.loads(file.read_text(encoding="utf-8")))
        made.groups = {name: np.array(rows, float) for name, rows in made.groups.items()}
        made.excused = None if made.excused is None else np.array(made.excused, float)
        return made

    @property
    def largest(self) -> tuple[float, str]:
        """The largest |z| and its group; biases that were there at some time do not count."""
        best = (0.0, "")
        for name, rows in self.groups.items():
            size = float(np.abs(rows[0] / rows[1]).max())
            best = max(best, (size, name))
        return best


def calibrated(
    made: Simulation, procedure: str, estimator: str, folder: Path, rate_ppm: float | None = None
) -> dict[str, Any]:
    """Calibrate as a user does, and return the document.

    Parameters
    ----------
    made : the recording.
    procedure, estimator : the test, and ``default``, ``own`` (the test's procedure by name), or any procedure's name.
    folder : for the protocol's file.
    rate_ppm : how well the user says to know the sample rate; None says nothing, and the stamps are nominal ones.
    """
    frames = [pl.DataFrame(one.columns()) for one in (made, made.other) if one is not None]
    options: dict[str, Any] = {}
    if procedure in WITHOUT_PROTOCOL:
        place = made.place
        site = tumble.Site.from_latitude(place.stated_latitude, place.height)
        if place.stated_gravity is not None:
            site = replace(
                site, gravity=place.stated_gravity, gravity_sigma=place.stated_sigma, source="survey"
            )
        options = {"site": site}
    else:
        file = folder / "protocol.yaml"
        file.write_text(made.protocol, encoding="utf-8")
        options = {"protocol": file}
    if estimator == "own":
        stated = re.search(r"^procedure: *(\S+)", made.protocol, re.MULTILINE)
        options["procedure"] = stated[1] if stated else WITHOUT_PROTOCOL[procedure]
    elif estimator != "default":
        options["procedure"] = estimator
    if rate_ppm is not None:
        options["rate"] = f"{made.path.rate}±{made.path.rate * rate_ppm * 1e-6}"
    return plain(tumble.calibrate(frames if len(frames) > 1 else frames[0], **options).calibration)


def terms_of(document: dict[str, Any]) -> dict[str, np.ndarray]:
    """Return the terms that a document has.

    Parameters
    ----------
    document : calibration.json.
    """
    found: dict[str, np.ndarray] = {}
    for name in TERMS:
        triad, term = name.split(".")
        block = document.get(triad)
        if block is not None and block.get(term) is not None:
            found[name] = np.array(block[term], float)
    return found


def _index(name: str) -> tuple[str, tuple[int, ...]]:
    term, _, rest = name.partition("[")
    return term, tuple(int(k) for k in rest[:-1].split(","))


def told(document: dict[str, Any]) -> dict[str, np.ndarray]:
    """Return for each group which of its three (or nine) numbers the document states, by its parameters' names.

    Parameters
    ----------
    document : calibration.json.
    """
    names = [p["name"] for p in document["parameters"]]

    def axes(start: str) -> np.ndarray:
        return np.array([any(n == f"{start} {axis}" for n in names) for axis in "xyz"])

    def any_of(start: str, size: int = 3) -> np.ndarray:
        return np.full(size, any(n.startswith(start) for n in names))

    fixture = document["frame"]["name"] == "fixture"
    found = {}
    for triad, short in (("accelerometer", "accelerometer"), ("gyroscope", "gyro")):
        found[f"{triad} bias"] = axes(f"{short} bias")
        found[f"{triad} scale"] = axes(f"{short} scale factor error")
        leaning = any_of(f"{short} misalignment")
        # Of x and y, x and z, y and z: Shin's names of the angles, or in the frame mean-gyro Savage's.
        pairs = ("xy", "zx", "yz") if document["frame"]["name"] == "mean-gyro" else ("yz", "zy", "zx")
        square = np.array([f"{short} non-orthogonality {pair}" in names for pair in pairs])
        found[f"{triad} non-orthogonality"] = square | leaning
        found[f"{triad} alignment"] = leaning & fixture
        found[f"{triad} asymmetry"] = axes(f"{short} asymmetry")
        found[f"{triad} quadratic"] = axes(f"{short} quadratic")
    both = any_of("accelerometer misalignment") & (
        any_of("gyro misalignment") | any_of("gyro non-orthogonality")
    )
    found["between triads"] = axes("rotation between the triads") | both
    found["g-sensitivity"] = any_of("g-sensitivity", 9)
    return found


def _leave_half_told(
    stated: dict[str, np.ndarray], estimate: dict[str, np.ndarray], known: set[tuple[str, tuple[int, ...]]]
) -> None:
    """Compare nothing of a gyro's matrix that rests on entries whose covariance the document leaves out."""
    if "gyroscope.matrix" not in estimate:
        return
    missing = np.array([[("gyroscope.matrix", (i, j)) not in known for j in range(3)] for i in range(3)])
    rows = missing.any(axis=1)
    stated["gyroscope scale"] = stated["gyroscope scale"] & ~rows
    pairs = np.array([rows[0] | rows[1], rows[0] | rows[2], rows[1] | rows[2]])
    stated["gyroscope non-orthogonality"] = stated["gyroscope non-orthogonality"] & ~pairs
    stated["between triads"] = stated["between triads"] & ~rows.any()
    stated["gyroscope alignment"] = stated["gyroscope alignment"] & ~rows.any()


def _factors(document: dict[str, Any], group: str, size: int) -> np.ndarray:
    """Return coverage factors: each parameter's own where it is stated, else the document's."""
    common = document["quality"]["coverage_factor"] or 1.96
    short = group.replace("gyroscope", "gyro").replace("between triads", "rotation between")
    short = short.replace(" scale", " scale factor error").replace("alignment", "misalignment")
    own = [p.get("coverage_factor") or common for p in document["parameters"] if p["name"].startswith(short)]
    return np.array(own[:size]) if len(own) >= size else np.full(size, np.median(own) if own else common)


def compared(document: dict[str, Any], made: Simulation, outcome: Outcome) -> None:
    """Compare a document with the truth.

    Parameters
    ----------
    document, made : calibration.json, and the recording with its truth.
    outcome : is told.
    """
    estimate = terms_of(document)
    truth = made.truth.terms(document["frame"]["name"])
    if made.truth.thermal is not None:
        _at_reference(truth, made, document)
    for name in OPTIONAL:
        present = bool(np.any(truth[name]))
        if present:
            outcome.has.append(name)
        if name in estimate and not present:
            outcome.extra.append(name)
        if present and name not in estimate:
            outcome.missed.append(name)
    stated = told(document)
    flat = not stated["accelerometer non-orthogonality"].any() and document["procedure"] == "six-position"
    true_named = named({k: truth[k] for k in estimate}, diagonal=flat)
    # The covariance of what is named, by central differences of its own formulas.
    names = [_index(n) for n in document["covariance_parameters"]]
    covariance = np.array(document["covariance"], float)
    here = named(estimate, diagonal=flat)
    spread = np.sqrt(np.maximum(np.diag(covariance), 0))
    columns = {group: np.zeros((len(value), len(names))) for group, value in here.items()}
    for k, (term, index) in enumerate(names):
        if term not in estimate or spread[k] == 0:
            continue
        step = spread[k] * 1e-2
        sides = []
        for sign in (1, -1):
            moved = {t: v.copy() for t, v in estimate.items()}
            moved[term][index] += sign * step
            sides.append(named(moved, diagonal=flat))
        for group in columns:
            columns[group][:, k] = (sides[0][group] - sides[1][group]) / (2 * step)
    _leave_half_told(stated, estimate, {(term, index) for term, index in names})
    jacobians, errors = [], []
    for group, value in here.items():
        which = stated.get(group)
        if which is None or not which.any():
            continue
        sigma = np.sqrt(np.einsum("ik,kl,il->i", columns[group], covariance, columns[group]))
        which = which & (sigma > 0)
        if not which.any():
            continue
        error = value - true_named[group]
        factors = _factors(document, group, len(value))
        outcome.groups[group] = np.stack((error, sigma, factors * sigma))[:, which]
        if group in COUNTED:
            jacobians.append(columns[group][which])
            errors.append(error[which])
    if jacobians:
        _nees(np.vstack(jacobians), np.concatenate(errors), covariance, outcome)
    if made.truth.thermal is not None and document["thermal"] is not None:
        _thermal_changes(document, made, outcome)
    _excuse_biases(document, made, outcome)


def _nees(jacobian: np.ndarray, error: np.ndarray, covariance: np.ndarray, outcome: Outcome) -> None:
    spread = jacobian @ covariance @ jacobian.T
    size = np.sqrt(np.diag(spread))
    values, vectors = np.linalg.eigh(spread / np.outer(size, size))
    outcome.indefinite = bool(values[0] < 1e-9)
    if not outcome.indefinite:
        outcome.nees = float(np.sum((vectors.T @ (error / size)) ** 2 / values))
        outcome.freedom = len(error)


def _excuse_biases(document: dict[str, Any], made: Simulation, outcome: Outcome) -> None:
    """A drifting bias that was within five sigmas of the stated one at some time is not called wrong."""
    low, high = made.truth.bias_range
    if made.truth.thermal is not None:
        return
    for triad, part in (("accelerometer", slice(0, 3)), ("gyroscope", slice(3, 6))):
        rows = outcome.groups.get(f"{triad} bias")
        if rows is None or rows.shape[1] != 3:
            continue
        value = np.array(document[triad]["bias"], float)
        outside = np.maximum(np.maximum(low[part] - value, value - high[part]), 0)
        # Kept for the count of wrong numbers under drift alone; z stays what it is.
        extra = np.abs(outside / rows[1])
        outcome.excused = extra if outcome.excused is None else np.concatenate((outcome.excused, extra))


def _at_reference(truth: dict[str, np.ndarray], made: Simulation, document: dict[str, Any]) -> None:
    """Bring the truth to the document's reference temperature."""
    thermal = made.truth.thermal
    assert thermal is not None
    celsius = document["temperature_celsius"]
    change = thermal.bias_change(celsius)
    growth = 1 + (celsius - thermal.reference) * thermal.scale
    for k, triad in enumerate(("accelerometer", "gyroscope")):
        part = slice(3 * k, 3 * k + 3)
        truth[f"{triad}.bias"] = truth[f"{triad}.bias"] + change[part]
        truth[f"{triad}.matrix"] = truth[f"{triad}.matrix"] * growth[part][:, None]
    truth["gyroscope.g_sensitivity"] = truth["gyroscope.g_sensitivity"] * growth[3:][:, None]


def _basis(document: dict[str, Any], celsius: float) -> np.ndarray:
    """Return the functions of temperature as the page of temperature has them."""
    basis = document["thermal"]["basis"]
    reference, nodes = basis["reference_celsius"], np.array(basis["nodes_celsius"], float)
    if basis["kind"] == "polynomial":
        return (celsius - reference) ** np.arange(1, basis["order"] + 1)
    keep = np.arange(len(nodes)) != int(np.argmin(np.abs(nodes - reference)))
    if basis["kind"] == "linear":
        hats = np.array([np.interp([celsius, reference], nodes, row) for row in np.eye(len(nodes))])
    else:
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(nodes, np.eye(len(nodes)), bc_type="natural")
        hats = np.stack((spline(celsius), spline(reference)), axis=1)
    return (hats[:, 0] - hats[:, 1])[keep]


def _thermal_changes(document: dict[str, Any], made: Simulation, outcome: Outcome) -> None:
    """Compare how biases change from the reference with the truth, at temperatures within the span."""
    thermal, block = made.truth.thermal, document["thermal"]
    assert thermal is not None
    names = [_index(n) for n in block["covariance_parameters"]]
    covariance = np.array(block["covariance"], float)
    low, high = block["span_celsius"]
    reference = block["basis"]["reference_celsius"]
    for k, triad in enumerate(("accelerometer", "gyroscope")):
        coefficients = block["coefficients"][f"{triad}_bias"]
        if coefficients is None:
            continue
        errors, sigmas = [], []
        for celsius in np.linspace(low + 3, high - 3, 5):
            functions = _basis(document, celsius)
            change = functions @ np.array(coefficients, float)
            true = thermal.bias_change(celsius) - thermal.bias_change(reference)
            for axis in range(3):
                row = np.array(
                    [
                        functions[i[0]] if term == f"{triad}.bias.temperature" and i[1] == axis else 0.0
                        for term, i in names
                    ]
                )
                errors.append(change[axis] - true[3 * k + axis])
                sigmas.append(np.sqrt(row @ covariance @ row))
        error, sigma = np.array(errors), np.array(sigmas)
        factor = document["quality"]["coverage_factor"] or 1.96
        outcome.groups[f"{triad} bias, change with temperature"] = np.stack((error, sigma, factor * sigma))


def random_grade(seed: int) -> Grade:
    """Return a grade whose every figure is up to four times another one's, and its steps up to thirty times.

    Parameters
    ----------
    seed : of what is drawn.
    """
    rng = np.random.default_rng([seed, 5])
    kind = GRADES[str(rng.choice(sorted(GRADES)))]
    drawn = ("noise", "flicker", "walk", "bias", "scale", "axes", "asymmetry", "warm_up")
    sheets = [
        replace(
            sheet,
            step=sheet.step * np.exp(rng.uniform(-1.5, 3.5)),
            **{name: getattr(sheet, name) * np.exp(rng.uniform(-1.4, 1.4)) for name in drawn},
        )
        for sheet in (kind.accelerometer, kind.gyroscope)
    ]
    return replace(kind, accelerometer=sheets[0], gyroscope=sheets[1])


def one(procedure: str, grade: str, estimator: str, fault: str | None, seed: int, arguments: Any) -> Outcome:
    """Simulate and calibrate one recording, and compare.

    Parameters
    ----------
    procedure, grade, estimator, fault, seed : what is done.
    arguments : of the command line.
    """
    options = json.loads(arguments.options) if arguments.options else {}
    kind = random_grade(seed) if grade == RANDOM else GRADES[grade]
    if arguments.white:
        still = [replace(sheet, flicker=0.0, walk=0.0) for sheet in (kind.accelerometer, kind.gyroscope)]
        kind = replace(kind, accelerometer=still[0], gyroscope=still[1])
    made = PROCEDURES[procedure](kind, np.random.default_rng(seed), fault, **options)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(arguments.keep or name)
        folder.mkdir(parents=True, exist_ok=True)
        if arguments.keep:
            _keep(made, folder)
        start = time.process_time()
        outcome = Outcome(seed, 0.0)
        try:
            document = calibrated(made, procedure, estimator, folder, arguments.rate_ppm)
        except tumble.TumbleError as error:
            outcome.error = f"{type(error).__name__}: {error}"
        except Exception as error:  # noqa: BLE001
            # A traceback is a finding of its own, and the study goes on.
            outcome.error = f"TRACEBACK {type(error).__name__}: {error} ({traceback.format_exc(limit=-2)})"
        else:
            outcome.fit = document["verdict"]["fit"]
            outcome.words = [
                *document["verdict"]["reasons"],
                *document["remarks"],
                *document["not_determined"],
            ]
            outcome.left_out = [str(x["reason"]) for x in document["quality"]["left_out"]]
            compared(document, made, outcome)
            if arguments.verbose:
                _tell(document, outcome)
        outcome.seconds = time.process_time() - start
    if arguments.verbose and outcome.error:
        print(outcome.error)
    return outcome


def _keep(made: Simulation, folder: Path) -> None:
    """Write the recording, its protocol and its truth, for the command line."""
    pl.DataFrame(made.columns()).write_csv(folder / "recording.csv")
    truth = {k: v.tolist() for k, v in made.truth.terms("accelerometer-x").items()}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1), encoding="utf-8")
    (folder / "protocol.yaml").write_text(made.protocol, encoding="utf-8")
    if made.other is not None:
        pl.DataFrame(made.other.columns()).write_csv(folder / "other.csv")


def _tell(document: dict[str, Any], outcome: Outcome) -> None:
    print(
        f"seed {outcome.seed}: {document['procedure']}, fit {outcome.fit}, frame {document['frame']['name']}"
    )
    for group, rows in outcome.groups.items():
        shown = ", ".join(f"{e:+.3g} ± {s:.2g} (z {e / s:+.1f})" for e, s in rows[:2].T)
        print(f"  {group}: {shown}")
    print(
        "  terms:", {t["name"]: (t["kept"], t["probability"]) for t in document["quality"]["optional_terms"]}
    )
    print(
        "  components:", document["quality"]["variance_components"], "sigma0", document["quality"]["sigma0"]
    )
    print(
        "  extra", outcome.extra, "missed", outcome.missed, "NEES/dof", outcome.nees / max(outcome.freedom, 1)
    )
    for word in [*outcome.words, *[f"left out: {x}" for x in outcome.left_out]]:
        print("  -", word)


def bootstrap(values: list[np.ndarray], statistic: Any, rng: np.random.Generator) -> tuple[float, float]:
    """Return the 95 % interval of a statistic of all runs' values, runs drawn with repetition.

    Parameters
    ----------
    values : of each run.
    statistic : of all values together.
    rng : chance.
    """
    if len(values) < 2:
        return (np.nan, np.nan)
    drawn = [
        statistic(np.concatenate([values[k] for k in rng.integers(0, len(values), len(values))]))
        for _ in range(400)
    ]
    low, high = np.percentile(drawn, [2.5, 97.5])
    return float(low), float(high)


def _share(count: int, total: int) -> str:
    """Return a share with its Wilson interval (95 %)."""
    if not total:
        return "-"
    p, z = count / total, 1.96
    centre = (p + z * z / (2 * total)) / (1 + z * z / total)
    half = z * np.sqrt(p * (1 - p) / total + z * z / (4 * total * total)) / (1 + z * z / total)
    low, high = 100 * max(centre - half, 0), 100 * min(centre + half, 1)
    return f"{count} of {total} = {100 * p:.1f} % [{low:.1f}, {high:.1f}]"


def report(title: str, outcomes: list[Outcome]) -> None:
    """Print what recordings without a fault show.

    Parameters
    ----------
    title, outcomes : of the study.
    """
    rng = np.random.default_rng(0)
    done = [o for o in outcomes if not o.error]
    fit = [o for o in done if o.fit]
    print(f"\n{title}: {np.mean([o.seconds for o in outcomes]):.2f} s of processor time a run")
    print(f"  settled {_share(len(done), len(outcomes))}; FIT {_share(len(fit), len(outcomes))}")
    for words, count in Counter(
        re.sub(r"[-\d.]+", "#", o.error)[:150] for o in outcomes if o.error
    ).most_common(4):
        print(f"  refused {count}: {words}; seeds {[o.seed for o in outcomes if o.error][:6]}")
    groups = list(dict.fromkeys(g for o in done for g in o.groups))
    print(f"  {'group':44} {'rms z':>6} {'[95 %]':>14} {'inside 95 %':>12} {'[95 %]':>14} {'max |z|':>8}")
    for group in groups:
        z = [o.groups[group][0] / o.groups[group][1] for o in done if group in o.groups]
        inside = [np.abs(o.groups[group][0]) <= o.groups[group][2] for o in done if group in o.groups]
        rms = lambda v: float(np.sqrt(np.mean(v**2)))  # noqa: E731
        low, high = bootstrap(z, rms, rng)
        below, above = bootstrap(inside, lambda v: 100 * float(np.mean(v)), rng)
        every = np.concatenate(z)
        print(
            f"  {group:44} {rms(every):6.2f} [{low:5.2f}, {high:5.2f}] {100 * np.concatenate(inside).mean():10.1f} % "
            f"[{below:5.1f}, {above:5.1f}] {np.abs(every).max():8.1f}"
        )
    ratio = [np.array([o.nees / o.freedom]) for o in done if o.freedom]
    if ratio:
        low, high = bootstrap(ratio, lambda v: float(np.mean(v)), rng)
        print(f"  NEES / freedom {np.mean(ratio):.2f} [{low:.2f}, {high:.2f}], median {np.median(ratio):.2f}")
    for label, pick in (("kept for nothing", "extra"), ("missed", "missed")):
        counts = Counter(name for o in done for name in getattr(o, pick))
        if counts:
            print(f"  {label}: " + "; ".join(f"{k} {_share(v, len(done))}" for k, v in counts.items()))
    singular = [o.seed for o in done if o.indefinite]
    if singular:
        print(f"  covariance not positive definite: seeds {singular}")
    wrong = sorted(((o.largest, o.seed) for o in fit if o.largest[0] > 5), reverse=True)
    worst = max((o.largest for o in fit), default=(np.nan, ""))
    print(
        f"  largest |z| with FIT {worst[0]:.1f} ({worst[1]}); FIT with |z| > 5: {_share(len(wrong), len(outcomes))}"
    )
    for (size, group), seed in wrong[:12]:
        print(f"    --seed {seed}: {size:.1f} ({group})")
    for o in [o for o in done if not o.fit][:4]:
        print(f"    not fit --seed {o.seed}: {o.words[0][:160]}")


def table(procedures: list[str], grades: list[str], store: Path) -> None:
    """Print a line of each test of all its stored runs without a fault, and what went wrong in them.

    Parameters
    ----------
    procedures, grades, store : what is printed, and where it is stored.
    """
    rng = np.random.default_rng(0)
    print(
        "| test | runs | settled | fit | numbers inside 95 % | rms z | NEES | largest abs. z | for nothing |"
    )
    print("|---|---:|---:|---:|---:|---:|---:|---:|---:|")
    for procedure in procedures:
        files = [
            f for grade in grades for f in sorted(store.glob(f"{procedure}, {grade}, default [0-9]*.json"))
        ]
        every = [Outcome.load(file) for file in files]
        done = [o for o in every if not o.error]
        if not done:
            continue
        # Recordings of one seed are alike in all grades: they are drawn together.
        alike = [[o for o in done if o.seed == seed] for seed in sorted({o.seed for o in done})]
        rows = [np.concatenate([row for o in some for row in o.groups.values()], axis=1) for some in alike]
        inside = [np.abs(row[0]) <= row[2] for row in rows]
        z = [row[0] / row[1] for row in rows]
        nees = [np.array([o.nees / o.freedom for o in some if o.freedom]) for some in alike]
        cells = [
            _bracketed(inside, lambda v: 100 * float(np.mean(v)), rng, 1),
            _bracketed(z, lambda v: float(np.sqrt(np.mean(v**2))), rng, 2),
            _bracketed(nees, lambda v: float(np.mean(v)), rng, 2),
        ]
        fit = [o for o in done if o.fit]
        largest = max((o.largest[0] for o in fit), default=np.nan)
        print(
            f"| {procedure} | {len(every)} | {len(done)} | {len(fit)} | {' | '.join(cells)} | {largest:.1f} | "
            f"{sum(bool(o.extra) for o in done)} |"
        )


def _bracketed(values: list[np.ndarray], statistic: Any, rng: np.random.Generator, digits: int) -> str:
    low, high = bootstrap(values, statistic, rng)
    return f"{statistic(np.concatenate(values)):.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def is_named(outcome: Outcome, fault: str) -> bool:
    """Say whether a remark names the fault.

    Parameters
    ----------
    outcome, fault : of one run.
    """
    if outcome.left_out and fault in (
        "bumped",
        "loose",
        "one-rate",
        "misread",
        "missing-turn",
        "pose-off",
        "clipped",
    ):
        return True
    told_of = [w for w in outcome.words if not re.search(USUAL, w)]
    return any(re.search(WORDS[fault], w) for w in told_of)


def report_fault(title: str, fault: str, outcomes: list[Outcome]) -> None:
    """Print what recordings with a fault show, in one line and the worst seeds.

    Parameters
    ----------
    title, fault, outcomes : of the study.
    """
    count = len(outcomes)
    refused = [o for o in outcomes if o.error]
    unfit = [o for o in outcomes if not o.error and not o.fit]
    fit = [o for o in outcomes if o.fit]
    beyond = [o for o in fit if _wrong(o, fault)]
    said = [o for o in fit if is_named(o, fault)]
    silent = [o for o in beyond if o not in said]
    found = len(refused) + len(unfit) + len(said)
    print(
        f"{title:58} n {count:3d} | refused {len(refused):3d} unfit {len(unfit):3d} named {len(said):3d} | "
        f"detected {100 * found / count:5.1f} % | FIT and right {len(fit) - len(beyond):3d} | "
        f"FIT and wrong {len(beyond):3d}, silent {len(silent):3d} | {np.mean([o.seconds for o in outcomes]):.1f} s",
        flush=True,
    )
    for o in sorted(beyond, key=lambda o: o.largest, reverse=True)[:3]:
        print(f"    wrong: --seed {o.seed}, {o.largest[0]:.0f} sigmas ({o.largest[1]})", flush=True)
    crashed = [o for o in refused if o.error.startswith("TRACEBACK")]
    if crashed:
        print(f"    traceback: --seed {crashed[0].seed}: {crashed[0].error}", flush=True)


def _wrong(outcome: Outcome, fault: str) -> bool:
    if fault not in ("warm-up", "gyro-ramp") or outcome.excused is None:
        return outcome.largest[0] > 5
    others = [
        float(np.abs(rows[0] / rows[1]).max())
        for group, rows in outcome.groups.items()
        if group not in ("accelerometer bias", "gyroscope bias")
    ]
    return max([*others, float(outcome.excused.max())]) > 5


def main() -> None:
    """Read the command line and run the studies."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--procedure", nargs="+", default=["by-hand"], choices=[*PROCEDURES, "all"])
    parser.add_argument("--grade", nargs="+", default=["industrial"], choices=[*GRADES, RANDOM, "all"])
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument(
        "--estimator", nargs="+", default=["default"], help="default, own, or the name of a procedure"
    )
    parser.add_argument("--fault", nargs="+", default=[], help="names, or all")
    parser.add_argument(
        "--options", help="JSON for the simulator's function, such as '{\"placement\": 0.0087}'"
    )
    parser.add_argument(
        "--keep", help="folder for recording.csv, protocol.yaml and truth.json of the last run"
    )
    parser.add_argument(
        "--rate-ppm", type=float, default=None, help="the sample rate is stated with so many ppm, and true"
    )
    parser.add_argument("--white", action="store_true", help="biases do not wander")
    parser.add_argument(
        "--store", type=Path, help="folder that keeps each run's outcome; those there are not made again"
    )
    parser.add_argument(
        "--shard", default="0/1", help="of the runs of this command those that are this one's, as 1/4"
    )
    parser.add_argument(
        "--table", action="store_true", help="with --store: a line of each test, of all grades"
    )
    parser.add_argument("--verbose", action="store_true")
    arguments = parser.parse_args()
    if arguments.store is not None:
        arguments.store.mkdir(parents=True, exist_ok=True)
    procedures = list(PROCEDURES) if "all" in arguments.procedure else arguments.procedure
    grades = list(GRADES) if "all" in arguments.grade else arguments.grade
    if arguments.table:
        table(procedures, grades, arguments.store)
        return
    for procedure in procedures:
        faults: list[str | None] = list(arguments.fault) or [None]
        if "all" in arguments.fault:
            common = [
                f for f in (*RECORD_FAULTS, *STATED_FAULTS) if f not in ("two-units", "warm-up", "gyro-ramp")
            ]
            if procedure in ("by-hand", "multi-position"):
                common += ["warm-up", "gyro-ramp"]
            faults = [*OWN_FAULTS[procedure], *common]
        for grade in grades:
            for estimator in arguments.estimator:
                if procedure == "thermal-soak" and estimator == "joint":
                    continue
                for fault in faults:
                    if fault not in (None, *OWN_FAULTS[procedure], *RECORD_FAULTS, *STATED_FAULTS):
                        print(f"{procedure} has no fault {fault}", flush=True)
                        continue
                    study(procedure, grade, estimator, fault, arguments)


def study(procedure: str, grade: str, estimator: str, fault: str | None, arguments: Any) -> None:
    """Run one study and print it; a stop from the keyboard prints what there is, and goes on to the next.

    Parameters
    ----------
    procedure, grade, estimator, fault : what is studied.
    arguments : of the command line.
    """
    title = f"{procedure}, {grade}, {estimator}" + (f", {fault}" if fault else "")
    title += ", white" if arguments.white else ""
    title += f", {re.sub('[^a-z0-9.,:]', '', arguments.options)}" if arguments.options else ""
    shard, shards = (int(number) for number in arguments.shard.split("/"))
    outcomes: list[Outcome] = []
    stopped = False
    try:
        for k in range(arguments.runs):
            seed = arguments.seed + k
            file = None if arguments.store is None else arguments.store / f"{title} {seed}.json"
            if file is not None and file.exists():
                outcomes.append(Outcome.load(file))
            elif k % shards == shard:
                outcomes.append(one(procedure, grade, estimator, fault, seed, arguments))
                if file is not None:
                    outcomes[-1].save(file)
            if sys.stderr.isatty():
                print(f"\r{title}: {k + 1} of {arguments.runs}", end="", file=sys.stderr)
    except KeyboardInterrupt:
        stopped = True
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
    if outcomes:
        if fault:
            report_fault(title, fault, outcomes)
        else:
            report(title, outcomes)
    if stopped:
        print(f"Stopped after {len(outcomes)} of {arguments.runs}.")
        raise SystemExit(130)
    sys.stdout.flush()


if __name__ == "__main__":
    main()

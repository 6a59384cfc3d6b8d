"""What a thermal calibration says in words, and its parameters by name."""

from __future__ import annotations

import numpy as np

from tumble.calibration.estimate import NamedValue
from tumble.calibration.thermal.coverage import Coverage
from tumble.calibration.thermal.doubt import LOOP_KELVINS, PULL_FACTOR, RATE_SECONDS, Doubts
from tumble.calibration.thermal.evidence import ThermalCurves
from tumble.calibration.thermal.fit import ThermalFit
from tumble.calibration.thermal.layout import Layout, ThermalTerms
from tumble.calibration.thermal.model import ThermalSolution
from tumble.calibration.thermal.turns import TurnedMatrix
from tumble.recording.recording import Recording
from tumble.units import angular_rate_factor, specific_force_factor


def thermal_parameters(
    solution: ThermalSolution, terms: ThermalTerms, recording: Recording, evidence: ThermalCurves
) -> list[NamedValue]:
    """Return the thermal coefficients with their standard uncertainties and units.

    Parameters
    ----------
    solution, terms : the model, and what was estimated.
    recording : for its units.
    evidence : for lag and width.
    """
    sigmas = np.sqrt(np.maximum(np.diag(solution.covariance), 0.0))
    found: list[NamedValue] = []
    for name, value, sigma in zip(solution.names, solution.model.vector(), sigmas, strict=True):
        if sigma > 0.0:
            words, unit = _words(name, terms, recording)
            found.append(NamedValue(words, float(value), float(sigma), unit))
    if np.isfinite(evidence.lag_sigma):
        found.append(
            NamedValue(
                "thermal lag of the sensors behind the thermometer", evidence.lag, evidence.lag_sigma, "s"
            )
        )
    if np.isfinite(evidence.width_sigma):
        found.append(NamedValue("thermal width of the hysteresis", evidence.width, evidence.width_sigma, "K"))
    return found


def _words(name: str, terms: ThermalTerms, recording: Recording) -> tuple[str, str]:
    """Return a coefficient's name in words, and its unit."""
    head, _, place = name.partition("[")
    at = [int(part) for part in place.rstrip("]").split(",")]
    triad = "accelerometer" if head.startswith("accelerometer") else "gyro"
    raw = recording.specific_force_unit if triad == "accelerometer" else recording.angular_rate_unit
    what = head.rpartition(".")[2]
    if what == "rate":
        return f"thermal {triad} bias by rate {'xyz'[at[0]]}", f"{raw}/(K/s)"
    if what == "hysteresis":
        return f"thermal {triad} bias hysteresis {'xyz'[at[0]]}", raw
    label, per = terms.basis.labels[at[0]], terms.basis.units[at[0]]
    divided = f"/{per}" if per else ""
    by = f"by {label}" if per else f"at {label}"
    if ".matrix." in head:
        true = "m/s^2" if triad == "accelerometer" else "rad/s"
        return f"thermal {triad} matrix {by} {'xyz'[at[1]]}{'xyz'[at[2]]}", f"{raw}/({true}){divided}"
    return f"thermal {triad} bias {by} {'xyz'[at[1]]}", f"{raw}{divided}"


def _rests(evidence: ThermalCurves) -> str:
    """Return how many stretches of rest there were, and in how many poses."""
    poses = "one pose" if evidence.poses == 1 else f"{evidence.poses} poses"
    return f"{evidence.celsius.size} stretches of rest, each within a kelvin or so, in {poses}"


def _orders(terms: ThermalTerms, order: int) -> str:
    return "as the biases do" if terms.basis.kind != "polynomial" else f"to the order {order}"


def not_determined_words(
    terms: ThermalTerms,
    layout: Layout,
    coverage: Coverage,
    recording: Recording,
    turned: TurnedMatrix | None,
    doubts: Doubts,
) -> list[str]:
    """Return what rests at these temperatures cannot tell, a sentence each."""
    words = [_untold_of_matrix(terms)] if layout.has_force else []
    if recording.angular_rate is not None:
        words += [_about_pull(doubts, recording)] if terms.poses == 0 else []
        words.append(_untold_of_gyros(turned))
    if not coverage.both_branches:
        words.append(_about_loop(doubts, recording))
    words += _untold_of_path(terms, coverage, doubts)
    return [text for text in words if text]


def _untold_of_matrix(terms: ThermalTerms) -> str:
    if terms.poses == 0:
        return (
            "The accelerometers' biases, scale factors and non-orthogonalities at the reference "
            "temperature, and how scale factors and non-orthogonalities change with temperature. "
            "From so few poses they cannot be separated from a bias, because gravity on an axis that "
            "does not move is a constant. The stated change of a bias with temperature is what that "
            "axis shows in the pose of the test. It includes the change of its scale factor times "
            "its share of gravity. Hold nine poses or more at several temperatures (thermal-soak), "
            "or tumble the unit during the sweep."
        )
    if terms.poses == 6:
        return (
            "The accelerometers' non-orthogonalities: faces alone do not determine them, and they "
            "have their nominal values. Hold edges, too."
        )
    if not terms.matrix_functions:
        return (
            "The accelerometers' scale factors and non-orthogonalities are one for all temperatures: a change of "
            "theirs did not predict what was left out any better."
        )
    return ""


def _untold_of_gyros(turned: TurnedMatrix | None) -> str:
    if turned is not None and turned.changes.size:
        return ""
    if turned is not None:
        return (
            "How the gyros' scale factors and misalignments change with temperature: there are too few turns for it; "
            "the matrix is one for all temperatures."
        )
    return (
        "The gyros' scale factors, misalignments and their change with temperature: rests show "
        "the Earth's rotation only. Nine turns by hand or more between poses at each of several "
        "temperatures determine them, recorded with 20 samples a turn or more. The matrix is the "
        "nominal one, without a stated uncertainty."
    )


def _untold_of_path(terms: ThermalTerms, coverage: Coverage, doubts: Doubts) -> list[str]:
    """Of the lag and of what goes with the temperature's rate."""
    words: list[str] = []
    if doubts.rate:
        words.append(
            "Lag between the sensors and the thermometer, and the biases' dependence on the rate of "
            "temperature: while the temperature goes one way they look like a dependence on it. A "
            f"lag of 30 s is taken, and what {RATE_SECONDS:.0f} s of lag or the like would do is in "
            "the standard uncertainties. Sweep there and back (thermal-ramp) to determine them."
        )
    elif coverage.kind == "soak":
        words.append(
            "Lag between the sensors and the thermometer, and the biases' dependence on the rate of "
            "temperature: only settled temperatures were used. A sweep (thermal-ramp) determines them."
        )
    elif not terms.rate:
        words.append(
            "A dependence of the biases on the rate of temperature beside the lag: the recording "
            "does not determine it."
        )
    if coverage.kind == "ramp" and not doubts.rate and not terms.lag:
        words.append(
            "Lag between the sensors and the thermometer: the sweep does not separate it from what "
            "else it does, and none is in the model."
        )
    return words


def _about_loop(doubts: Doubts, recording: Recording) -> str:
    """Return what one branch leaves open, with what was added for it."""
    parts: list[str] = []
    if doubts.loops is not None:
        if recording.specific_force is not None:
            factor = specific_force_factor(recording.specific_force_unit)
            parts.append("" if factor is None else f"± {1e3 * doubts.loops[0]:.2g} mm/s²")
        if recording.angular_rate is not None:
            factor = angular_rate_factor(recording.angular_rate_unit)
            parts.append("" if factor is None else f"± {np.degrees(doubts.loops[1]):.2g} °/s")
    added = " and ".join(part for part in parts if part) or "as much"
    return (
        "Hysteresis: the temperatures were come to from one side only, and a single branch cannot show it. "
        f"{added[0].upper() + added[1:]} (what {LOOP_KELVINS:g} K of temperature do in this unit) was believed of half "
        "the loop, and is in the standard uncertainties of the biases."
    )


def _about_pull(doubts: Doubts, recording: Recording) -> str:
    """Return what poses too few to tell a g-sensitivity leave in the gyros' biases."""
    in_si = angular_rate_factor(recording.angular_rate_unit) is not None
    size = (
        f"± {np.degrees(doubts.pull):.2g} °/s"
        if in_si
        else f"± {doubts.pull:.2g} {recording.angular_rate_unit}"
    )
    earth = (
        f"the part of the Earth rate across the vertical, whose heading is not known (± {np.degrees(doubts.earth):.2g} "
        "°/s)"
        if doubts.earth > 0.0
        else "the Earth rate, which cannot be taken off numbers in counts (up to 0.0042 °/s)"
    )
    return (
        "The gyros' biases apart from what the pose of the test adds to them: a g-sensitivity, believed to be "
        f"{PULL_FACTOR:g} times what they are unsteady by ({size}), and {earth}. Both are in the standard "
        "uncertainties of the biases, and not in those of their changes with temperature."
    )


def thermal_remarks(
    fit: ThermalFit,
    solution: ThermalSolution,
    coverage: Coverage,
    evidence: ThermalCurves,
    turned: TurnedMatrix | None,
) -> list[str]:
    """Return how the model was made, a sentence each."""
    low, high = coverage.span
    terms = fit.layout.terms
    what = "soaks" if coverage.kind == "soak" else "a sweep"
    remarks = [
        f"Biases are a {evidence.basis} in the sensors' temperature about {terms.basis.reference_celsius:g} °C, from "
        f"{what} between {low:.1f} and {high:.1f} °C ({_rests(evidence)})."
        if evidence.basis.startswith(("polynomial", "natural"))
        else f"Biases are interpolated linearly between {terms.basis.nodes.size} temperatures, from {what} between "
        f"{low:.1f} and {high:.1f} °C ({_rests(evidence)})."
    ]
    if evidence.candidates:
        left = "soaks" if coverage.kind == "soak" else "bands of temperature"
        remarks.append(
            f"The functions were chosen among {len(evidence.candidates)} by what each predicts of {left} that were "
            "left out; of those that predict alike the one with the fewest unknowns."
        )
    if terms.poses and terms.matrix_functions:
        orders = _orders(terms, terms.matrix_functions)
        remarks.append(f"The accelerometers' matrix changes with temperature {orders}.")
    if turned is not None:
        orders = "one for all temperatures"
        if turned.changes.size:
            orders = f"changing with temperature {_orders(terms, len(turned.changes))}"
        remarks.append(
            f"The gyros' matrix is from {turned.turns} turns between the rests, {orders}: their scale factors, "
            "non-orthogonalities and the rotation between the triads."
        )
    if np.isfinite(solution.lag_sigma):
        remarks.append(
            f"The sensors are {solution.model.lag:.0f} ± {solution.lag_sigma:.0f} s behind the thermometer (before the "
            "recording 60 ± 60 s were believed)."
        )
    ratios = [float(np.mean(s.joint_sigma / s.sigma)) for s in evidence.separate]
    if ratios:
        remarks.append(
            f"The standard uncertainty of the accelerometers' biases is {np.mean(ratios):.2f} times what each of the "
            f"{len(ratios)} soaks alone gives: one adjustment of all temperatures."
        )
    for name, kind, unit in (("accelerometers", "force", "m/s²"), ("gyros", "rate", "rad/s")):
        if (flicker := fit.levels.flicker[kind]) > 0.0:
            remarks.append(
                f"The biases of the {name} wander beside what temperature does. A flicker floor of "
                f"the Allan deviation of {np.sqrt(flicker):.2g} {unit} was found from the rests. "
                "Neighbours were taken to have it in common."
            )
    return remarks

"""The adjustment of several recordings as one estimate, what it says of each turn-on, and in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Table, inverted
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.estimate import Described, Estimate, Figures, LeftOut, coverage_factor
from tumble.calibration.evidence import (
    FALSE_ALARM,
    Agreement,
    BiasScatter,
    Holds,
    RecordingOfUnit,
    Spins,
    TurnOns,
    Turns,
    agreement_of,
    bias_scatter,
)
from tumble.calibration.optional_terms import untried_words
from tumble.calibration.outcome.description import describe, named_function
from tumble.calibration.outcome.estimate import joint_estimate
from tumble.calibration.outcome.settled import JointOutcome, outcome_influences, recording_influences
from tumble.calibration.terms import lever_arms_of
from tumble.calibration.turn_ons.adjustment import (
    SeveralOutcome,
    TurnOn,
    UnitAdjustment,
    disagreement,
    settled_outcome,
    tells,
)
from tumble.calibration.verdict import WORST_FORCE_BIAS_SIGMA
from tumble.earth import Site
from tumble.parameters import FAMILIES, amount, parameter_of, two_digits
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.sensor import jacobian
from tumble.units import specific_force_factor

FRAME = "accelerometer-x"
BIASES = {"accelerometer": "force.bias", "gyro": "gyro.bias"}


@dataclass
class SeveralEstimate:
    """What several recordings make of one unit.

    Attributes
    ----------
    estimate : with the biases' mean, and residuals of all recordings one after the other.
    parts : of each recording, with its own biases and all that is common.
    turn_ons : what changes from one to the next.
    coverage_factors : of each parameter of the estimate: a bias's scatter is known as well as there are recordings.
    """

    estimate: Estimate
    parts: list[Estimate]
    turn_ons: TurnOns
    coverage_factors: list[float]


@dataclass(frozen=True)
class _Named:
    """The parameters by name, and their derivatives by all unknowns."""

    labels: list[tuple[str, str]]
    values: Series
    slope: Table

    @property
    def stable_rows(self) -> list[int]:
        return [i for i, (name, _) in enumerate(self.labels) if parameter_of(name).family.kind != "bias"]


def several_estimate(outcome: SeveralOutcome, alone: Sequence[Estimate], site: Site) -> SeveralEstimate:
    """Return the outcome as an estimate.

    Parameters
    ----------
    outcome : settled.
    alone : what each recording made by itself: what is said of it holds here too.
    site : how well gravity is known, which is the same error in all recordings.
    """
    unit = outcome.solution
    settled = [settled_outcome(outcome, k) for k in range(len(unit.parts))]
    parts = [joint_estimate(one) for one in settled]
    values, effect = _common(unit)
    named, weight = _named(outcome, values), unit.settled.unit_weight
    covariance = weight * (effect @ (unit.settled.cofactor + cofactor_of_courses(unit, settled)) @ effect.T)
    biases = _biases(unit, dict(named.labels))
    turn_ons = TurnOns(
        [_recording_of(part, own) for part, own in zip(unit.parts, parts, strict=True)],
        [*biases.values()],
        _agreements(outcome, named, covariance),
        *disagreement(outcome.own, [told.precision for told in unit.told], unit.values, weight),
    )
    for place, scatter in biases.items():
        covariance[place, place] = max(scatter.next_sigma**2, covariance[place, place])
    covariance += _enlargement(unit, named, turn_ons.agreements)
    described = describe(
        *(values, covariance, site, _units_of(unit)), terms=outcome.kept, gyro=_gyro(unit), all_told=True
    )
    arms = lever_arms_of(values[LAYOUT["lever_arms"]], outcome.kept, np.eye(3))
    estimate = _joined(outcome, parts, described, arms)
    estimate.say("remark", *turn_on_sentences(turn_ons), *_said(outcome, [own.remarks for own in alone]))
    estimate.say("caution", *turn_on_cautions(turn_ons), *_said(outcome, [own.cautions for own in parts]))
    objections = [list(dict.fromkeys([*a.objections, *b.jumps])) for a, b in zip(alone, settled, strict=True)]
    estimate.say("objection", *_said(outcome, objections))
    untold, untried = _in_all([own.not_determined for own in parts]), outcome.untried
    estimate.say("not determined", *untold, *untried_words(untried, settled[0].task))
    estimate.show(turn_ons)
    factors = {b.parameter: b.coverage_factor for b in turn_ons.biases}
    each = [factors.get(p.name, estimate.coverage_factor) for p in estimate.parameters]
    return SeveralEstimate(estimate, parts, turn_ons, each)


def cofactor_of_courses(unit: UnitAdjustment, settled: Sequence[JointOutcome]) -> Square:
    """Return what the unit's cofactor gains where biases jump or drift in a recording: by how far all is moved.

    Parameters
    ----------
    unit, settled : of all, and each recording's outcome there with the courses of its biases.
    """
    whole = unit.settled.cofactor
    total = np.zeros(whole.shape)
    for one, place in zip(settled, unit.places, strict=True):
        if one.courses:
            more = outcome_influences(one).covariance - recording_influences(one.task).covariance
            moved = whole[:, place] @ inverted(whole[np.ix_(place, place)])
            total += moved @ more @ moved.T
    return total


def _own(unit: UnitAdjustment, unknown: int) -> tuple[list[int], Series, list[int]]:
    """Which recordings have an unknown of their own, its values, and where it stands among the unit's."""
    at = [k for k, part in enumerate(unit.parts) if unknown in part.own]
    places = [int(unit.places[k][np.searchsorted(unit.parts[k].free, unknown)]) for k in at]
    return at, unit.unknowns.values[places], places


def _common(unit: UnitAdjustment) -> tuple[Series, Table]:
    """All unknowns of the unit, biases as the recordings' mean, and their derivatives by what was adjusted."""
    values, effect = np.zeros(LAYOUT.size), np.zeros((LAYOUT.size, unit.unknowns.values.size))
    values[unit.stable] = unit.values
    effect[unit.stable, np.arange(unit.stable.size)] = 1.0
    for unknown in LAYOUT.indices(*BIASES.values()).tolist():
        at, seen, places = _own(unit, unknown)
        if at:
            effect[unknown, places] = 1.0 / len(at)
            values[unknown] = np.mean(seen)
    return values, effect


def _gyro(unit: UnitAdjustment) -> str:
    return "full" if any(part.outcome.has_gyro for part in unit.parts) else "none"


def _units_of(unit: UnitAdjustment) -> Recording:
    """A recording whose units are those of all: one with gyros, if there is one."""
    return min(unit.parts, key=lambda part: not part.outcome.has_gyro).outcome.recording


def _named(outcome: SeveralOutcome, values: Series) -> _Named:
    recording = _units_of(outcome.solution)
    units = recording.specific_force_unit, recording.angular_rate_unit
    labels, function = named_function(outcome.kept, _gyro(outcome.solution), FRAME, units)
    return _Named(labels, np.real(function(values.astype(complex))), jacobian(function, values))


def _recording_of(part: TurnOn, own: Estimate) -> RecordingOfUnit:
    held, recording = own.holds.norms.size, part.outcome.recording
    counts = held, own.turns.found.size, own.spins.rates.size
    noise = own.sigma0_final, own.variance_components
    return RecordingOfUnit(part.name, *counts, *noise, recording.duration, recording.rate)


def _biases(unit: UnitAdjustment, units: dict[str, str]) -> dict[int, BiasScatter]:
    """Each bias from turn-on to turn-on; of one that only one recording has there is nothing to say."""
    made: dict[int, BiasScatter] = {}
    for kind, block in BIASES.items():
        for axis, unknown in zip("xyz", LAYOUT.indices(block).tolist(), strict=True):
            at, seen, places = _own(unit, unknown)
            if len(at) >= 2:
                name = FAMILIES[f"{kind} bias"].named(axis)
                spread = unit.settled.unit_weight * unit.settled.cofactor[np.ix_(places, places)]
                made[unknown] = bias_scatter(
                    name, units[name], seen, spread, recordings=len(unit.parts), at=at
                )
    return made


def _agreements(outcome: SeveralOutcome, named: _Named, covariance: Square) -> list[Agreement]:
    """Each stable parameter as each recording determines it by itself."""
    unit, rows = outcome.solution, named.stable_rows
    slope = named.slope[rows][:, unit.stable]
    whole = covariance[np.ix_(unit.stable, unit.stable)]
    sigma = np.sqrt(np.einsum("pi,ij,pj->p", slope, whole, slope))
    values = np.full((len(rows), len(unit.parts)), np.nan)
    sigmas = values.copy()
    for k, (part, (own, spread)) in enumerate(zip(unit.parts, outcome.own, strict=True)):
        known = tells(spread, part, unit.stable)
        told = np.array([bool(np.all(known[np.abs(row) > 1e-3 * np.max(np.abs(row))])) for row in slope])
        moved = named.values[rows] + slope @ (own - unit.values)
        apart = np.sqrt(unit.settled.unit_weight * np.einsum("pi,ij,pj->p", slope, spread, slope))
        values[told, k], sigmas[told, k] = moved[told], apart[told]
    together = [(float(named.values[row]), float(one)) for row, one in zip(rows, sigma, strict=True)]
    return [
        agreement_of(*named.labels[row], values[i], sigmas[i], together[i], FALSE_ALARM / len(rows))
        for i, row in enumerate(rows)
    ]


def _enlargement(unit: UnitAdjustment, named: _Named, agreements: Sequence[Agreement]) -> Square:
    """What the unknowns' covariance gains where recordings contradict each other."""
    slope = named.slope[named.stable_rows][:, unit.stable]
    more = np.array([(a.enlarged**2 - 1.0) * a.sigma**2 for a in agreements])
    scale = np.max(np.abs(slope), axis=0)
    back: Table = np.asarray(np.linalg.pinv(slope / scale), dtype=np.float64) / scale[:, None]
    made = np.zeros((LAYOUT.size, LAYOUT.size))
    made[np.ix_(unit.stable, unit.stable)] = (back * more) @ back.T
    return made


def _joined(
    outcome: SeveralOutcome, parts: Sequence[Estimate], described: Described, arms: Matrix | None
) -> Estimate:
    """One estimate with the residuals of all recordings, one after the other."""
    settled, names = outcome.solution.settled, [part.name for part in outcome.solution.parts]
    degrees = [own.degrees_of_freedom for own in parts]
    at_rest = sum(own.sigma0**2 * left for own, left in zip(parts, degrees, strict=True))

    def every(kind: str, name: str) -> AnyArray:
        return np.concatenate([getattr(getattr(own, kind), name) for own in parts])

    named = list(zip(names, parts, strict=True))
    figures = Figures(
        float(np.sqrt(at_rest / sum(degrees))),
        settled.sigma0,
        settled.redundancy,
        coverage_factor(settled.redundancy),
        max(own.largest_normalised for own in parts),
        {f"{of} ({name})": size for name, own in named for of, size in own.variance_components.items()},
    )
    spins = tuple(f"{name}, {of}" for name, own in named for of in own.spins.names)
    return Estimate(
        "joint",
        *described,
        *figures,
        left_out=_left_out(outcome, parts),
        terms=[*outcome.terms],
        evidence=[
            Holds(every("holds", "norms"), every("holds", "sigmas")),
            Turns(every("turns", "angles"), every("turns", "sigmas"), every("turns", "sizes")),
            Spins(every("spins", "rates"), every("spins", "residuals"), every("spins", "sigmas"), spins),
        ],
        frame=FRAME,
        lever_arms=arms,
    )


def _said(outcome: SeveralOutcome, sentences: Sequence[Sequence[str]]) -> list[str]:
    """What is said of each recording, with its name; what is said of all of them once."""
    common = _in_all(sentences)
    named = [
        f"{part.name}: {sentence}"
        for part, own in zip(outcome.solution.parts, sentences, strict=True)
        for sentence in own
        if sentence not in common
    ]
    return [*named, *common]


def _in_all(sentences: Sequence[Sequence[str]]) -> list[str]:
    return [said for said in dict.fromkeys(sentences[0]) if all(said in own for own in sentences[1:])]


def _left_out(outcome: SeveralOutcome, parts: Sequence[Estimate]) -> list[LeftOut]:
    before = {"hold": 0, "turn": 0, "spin": 0}
    made: list[LeftOut] = []
    for part, own in zip(outcome.solution.parts, parts, strict=True):
        for left in own.left_out:
            said = f"{part.name}, its {left.kind} {left.index + 1}: {left.reason}"
            made.append(replace(left, index=left.index + before[left.kind], reason=said))
        before["hold"] += own.holds.norms.size
        before["turn"] += own.turns.angles.size
        before["spin"] += own.holds.norms.size
    return made


# More parameters than this that change are counted.
MOST_NAMED = 4


def turn_on_sentences(told: TurnOns) -> list[str]:
    """Return what was found: how biases scatter, what to use, what is stable.

    Parameters
    ----------
    told : of several recordings.
    """
    count = len(told.recordings)
    first = (
        f"{count} recordings of one unit in one adjustment: scale factors, angles and optional terms are common, "
        "biases are each recording's own."
    )
    said = [first]
    for kind in ("accelerometer", "gyro"):
        biases = [b for b in told.biases if parameter_of(b.parameter).family.triad == kind]
        if biases:
            said.append(_of_biases(kind, biases))
    if told.biases:
        said.append(
            "The bias in the file is the mean of the recordings, and its standard uncertainty that "
            f"of the next turn-on. It follows from {count} recordings, with a factor of "
            f"{told.biases[0].coverage_factor:.2f} for 95 %."
        )
    said.append(_of_stable(told))
    optional = [agreement.parameter for agreement in told.changing if agreement.is_optional]
    if optional:
        it = "It" if len(told.changing) == 1 else "Among them"
        more = f" and {len(optional) - 1} like it" if len(optional) > 1 else ""
        said.append(
            f"{it} is {optional[0]}{more}: a gyro bias that drifted in step with the poses of one recording looks like "
            "it, too."
        )
    return said


def turn_on_cautions(told: TurnOns) -> list[str]:
    """Return what stands first in the verdict: what is not stable, and biases that have to be found anew.

    Parameters
    ----------
    told : of several recordings.
    """
    plain = [agreement for agreement in told.changing if not agreement.is_optional]
    said = [_changes(told, agreement) for agreement in plain[:MOST_NAMED]]
    if len(plain) > MOST_NAMED:
        said.append(f"{len(plain) - MOST_NAMED} more parameters differ between the recordings beyond chance.")
    for bias in told.biases:
        factor = (
            specific_force_factor(bias.unit)
            if parameter_of(bias.parameter).family.triad == "accelerometer"
            else None
        )
        if factor is not None and factor * bias.next_sigma > WORST_FORCE_BIAS_SIGMA:
            said.append(
                f"The bias of accelerometer {bias.parameter[-1]} moves by {amount(bias.scatter, bias.unit)} from "
                "turn-on to turn-on, as much as an uncalibrated unit's may be: find it anew each time; the rest holds."
            )
    return said


def _of_biases(kind: str, biases: Sequence[BiasScatter]) -> str:
    unit, degrees = biases[0].unit, biases[0].degrees
    scatters = [amount(b.scatter, unit) for b in biases]
    expected = amount(float(np.sqrt(np.mean([b.measurement**2 for b in biases]))), unit)
    poorly = f"± {two_digits(100.0 / float(np.sqrt(2.0 * degrees)))} %, from {degrees + 1} turn-ons"
    listed = ", ".join(scatters[:-1]) + f" and {scatters[-1]}"
    told = f"From turn-on to turn-on the {kind} biases x, y and z scatter by {listed} (standard deviations, {poorly})"
    moved = [b.parameter[-1] for b in biases if b.changes]
    if not moved:
        return f"{told}: no more than the {expected} that the recordings' own uncertainties explain."
    every = len(moved) == len(biases)
    which = "each" if every else " and ".join(moved)
    do = "do" if len(moved) > 1 and not every else "does"
    return f"{told}; the recordings' own uncertainties explain {expected}, so that {which} {do} change."


def _of_stable(told: TurnOns) -> str:
    count = len(told.agreements)
    freedom = f"{told.degrees} degrees of freedom, probability {_p(told.probability)}"
    chance = f"chi-square {told.chi_square:.1f} of {freedom}"
    if not told.changing:
        return (
            f"The {count} parameters that should be stable agree between the recordings, each by itself; all together "
            f"{chance}."
        )
    do = "does" if len(told.changing) == 1 else "do"
    return (
        f"{len(told.changing)} of the {count} parameters that should be stable {do} not agree between the recordings; "
        f"all together {chance}. Standard uncertainties of these are enlarged to what the recordings show."
    )


def _changes(told: TurnOns, agreement: Agreement) -> str:
    values = np.where(np.isfinite(agreement.values), agreement.values, np.nan)
    low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
    names = [recording.name for recording in told.recordings]
    named = f"{agreement.parameter[0].upper()}{agreement.parameter[1:]}"
    return (
        f"{named} is not stable: {names[low]} and {names[high]} differ "
        f"by {amount(agreement.largest, agreement.unit)} (probability {_p(agreement.probability)}). Was one of them at "
        "another temperature, was the unit dropped or mounted anew, or is it another unit?"
    )


def _p(probability: float) -> str:
    return "below 1e-12" if probability < 1e-12 else f"{probability:.2g}"

"""The adjustment of several recordings as one estimate, and what it says of each turn-on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tumble.arrays import AnyArray, Series, Square, Table
from tumble.calibration.equations.imu_unknowns import LAYOUT
from tumble.calibration.estimate import (
    Described,
    Estimate,
    Figures,
    LeftOut,
    coverage_factor,
    estimate_of,
    said_of,
)
from tumble.calibration.evidence import Holds, Spins, Turns
from tumble.calibration.outcome.description import describe, named_function
from tumble.calibration.outcome.estimate import joint_estimate
from tumble.calibration.terms.lever_arms import lever_arms_of
from tumble.calibration.turn_ons.biases import (
    FALSE_ALARM,
    Agreement,
    BiasScatter,
    RecordingOfUnit,
    TurnOns,
    agreement_of,
    bias_scatter,
)
from tumble.calibration.turn_ons.outcome import SeveralOutcome, settled_outcome, tells, whole_disagreement
from tumble.calibration.turn_ons.words import turn_on_cautions, turn_on_sentences
from tumble.earth import Site
from tumble.recording.recording import Recording
from tumble.records import dataclass
from tumble.sensor.propagation import jacobian
from tumble.units import angular_rate_factor, specific_force_factor

FRAME = "accelerometer-x"
BIASES = (("accelerometer", LAYOUT["force.bias"]), ("gyro", LAYOUT["gyro.bias"]))


@dataclass(slots=True)
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


@dataclass(frozen=True, slots=True)
class _Named:
    """The parameters by name, and their derivatives by all unknowns."""

    labels: list[tuple[str, str]]
    values: Series
    slope: Table

    def rows(self, *, biases: bool) -> list[int]:
        return [i for i, (name, _) in enumerate(self.labels) if (" bias " in name) == biases]


def several_estimate(outcome: SeveralOutcome, alone: Sequence[Estimate], site: Site) -> SeveralEstimate:
    """Return the outcome as an estimate.

    Parameters
    ----------
    outcome : settled.
    alone : what each recording made by itself: what is said of it holds here too.
    site : how well gravity is known, which is the same error in all recordings.
    """
    parts = [joint_estimate(settled_outcome(outcome, k)) for k in range(len(outcome.solution.parts))]
    values, effect = _common(outcome)
    named = _named(outcome, values)
    scale = _scale(outcome)
    covariance = scale * (effect @ outcome.solution.covariance @ effect.T)
    turn_ons = _turn_ons(outcome, parts, named, covariance)
    for scatter, place in zip(turn_ons.biases, _bias_places(turn_ons.biases), strict=True):
        covariance[place, place] = max(scatter.next_sigma**2, covariance[place, place])
    covariance += _enlargement(outcome, named, turn_ons.agreements)
    described = describe(
        *(values, covariance, site, _units_of(outcome)),
        terms=outcome.kept,
        gyro=_gyro(outcome),
        frame=FRAME,
        all_told=True,
    )
    estimate = _joined(outcome, alone, parts, described)
    own = said_of(remarks=turn_on_sentences(turn_ons), cautions=turn_on_cautions(turn_ons))
    estimate.said = [*own, *estimate.said]
    estimate.show(turn_ons)
    factors = {b.parameter: b.coverage_factor for b in turn_ons.biases}
    each = [factors.get(p.name, estimate.coverage_factor) for p in estimate.parameters]
    return SeveralEstimate(estimate, parts, turn_ons, each)


def _common(outcome: SeveralOutcome) -> tuple[Series, Table]:
    """All unknowns of the unit, biases as the recordings' mean, and their derivatives by what was adjusted."""
    solution = outcome.solution
    values, effect = np.zeros(LAYOUT.size), np.zeros((LAYOUT.size, len(solution.covariance)))
    values[solution.stable] = solution.values
    effect[solution.stable, np.arange(solution.stable.size)] = 1.0
    for _, place in BIASES:
        for unknown in range(place.start, place.stop):
            at, own = _having(outcome, unknown)
            if at:
                effect[unknown, own] = 1.0 / len(at)
                values[unknown] = np.mean(_of_parts(outcome, unknown, at))
    return values, effect


def _having(outcome: SeveralOutcome, unknown: int) -> tuple[list[int], list[int]]:
    """Which recordings have an unknown of their own, and where it stands in the covariance."""
    solution = outcome.solution
    at = [k for k, part in enumerate(solution.parts) if unknown in part.own]
    places = [int(solution.own_places(k)[np.searchsorted(solution.parts[k].own, unknown)]) for k in at]
    return at, places


def _of_parts(outcome: SeveralOutcome, unknown: int, at: Sequence[int]) -> Series:
    return np.array([outcome.solution.parts[k].values[unknown] for k in at])


def _scale(outcome: SeveralOutcome) -> float:
    sigma0 = outcome.solution.sigma0
    return max(1.0, sigma0) ** 2 if np.isfinite(sigma0) else 1.0


def _gyro(outcome: SeveralOutcome) -> str:
    return "full" if any(part.outcome.has_gyro for part in outcome.solution.parts) else "none"


def _units_of(outcome: SeveralOutcome) -> Recording:
    """A recording whose units are those of all: one with gyros, if there is one."""
    parts = sorted(outcome.solution.parts, key=lambda part: not part.outcome.has_gyro)
    return parts[0].outcome.recording


def _named(outcome: SeveralOutcome, values: Series) -> _Named:
    recording = _units_of(outcome)
    units = recording.specific_force_unit, recording.angular_rate_unit
    factors = specific_force_factor(units[0]), angular_rate_factor(units[1])
    labels, function = named_function(outcome.kept, _gyro(outcome), FRAME, units, factors)
    return _Named(labels, np.real(function(values.astype(complex))), jacobian(function, values))


def _turn_ons(
    outcome: SeveralOutcome, parts: Sequence[Estimate], named: _Named, covariance: Square
) -> TurnOns:
    told = TurnOns(
        [
            _recording_of(part.name, part.outcome.recording, own)
            for part, own in zip(outcome.solution.parts, parts, strict=True)
        ]
    )
    told.biases = _biases(outcome, named)
    told.agreements = _agreements(outcome, named, covariance)
    told.chi_square, told.degrees, told.probability = whole_disagreement(outcome)
    return told


def _recording_of(name: str, recording: Recording, own: Estimate) -> RecordingOfUnit:
    return RecordingOfUnit(
        name,
        own.holds.norms.size,
        own.turns.found.size,
        own.spins.rates.size,
        own.sigma0_final,
        own.variance_components,
        recording.duration,
        recording.rate,
    )


def _biases(outcome: SeveralOutcome, named: _Named) -> list[BiasScatter]:
    """Each bias from turn-on to turn-on; of one that only one recording has there is nothing to say."""
    made: list[BiasScatter] = []
    units = dict(named.labels)
    for kind, place in BIASES:
        for i, unknown in enumerate(range(place.start, place.stop)):
            at, own = _having(outcome, unknown)
            if len(at) < 2:
                continue
            name = f"{kind} bias {'xyz'[i]}"
            covariance = _scale(outcome) * outcome.solution.covariance[np.ix_(own, own)]
            every = len(outcome.solution.parts)
            made.append(
                bias_scatter(
                    name, units[name], _of_parts(outcome, unknown, at), covariance, recordings=every, at=at
                )
            )
    return made


def _bias_places(biases: Sequence[BiasScatter]) -> list[int]:
    places = dict(BIASES)
    return [places[b.parameter.split()[0]].start + "xyz".index(b.parameter[-1]) for b in biases]


def _agreements(outcome: SeveralOutcome, named: _Named, covariance: Square) -> list[Agreement]:
    """Each stable parameter as each recording determines it by itself."""
    solution = outcome.solution
    rows = named.rows(biases=False)
    slope = named.slope[rows][:, solution.stable]
    whole = covariance[np.ix_(solution.stable, solution.stable)]
    sigma = np.sqrt(np.einsum("pi,ij,pj->p", slope, whole, slope))
    values = np.full((len(rows), len(solution.parts)), np.nan)
    sigmas = values.copy()
    for k, (part, (own, spread)) in enumerate(zip(solution.parts, outcome.own, strict=True)):
        known = tells(spread, part, solution.stable)
        told = np.array([bool(np.all(known[np.abs(row) > 1e-3 * np.max(np.abs(row))])) for row in slope])
        moved = named.values[rows] + slope @ (own - solution.values)
        apart = np.sqrt(_scale(outcome) * np.einsum("pi,ij,pj->p", slope, spread, slope))
        values[:, k], sigmas[:, k] = np.where(told, moved, np.nan), np.where(told, apart, np.nan)
    return [
        agreement_of(
            *named.labels[row],
            values[i],
            sigmas[i],
            (float(named.values[row]), float(sigma[i])),
            FALSE_ALARM / len(rows),
        )
        for i, row in enumerate(rows)
    ]


def _enlargement(outcome: SeveralOutcome, named: _Named, agreements: Sequence[Agreement]) -> Square:
    """What the unknowns' covariance gains where recordings contradict each other."""
    stable = outcome.solution.stable
    slope = named.slope[named.rows(biases=False)][:, stable]
    more = np.array([(a.enlarged**2 - 1.0) * a.sigma**2 for a in agreements])
    scale = np.max(np.abs(slope), axis=0)
    back: Table = np.asarray(np.linalg.pinv(slope / scale), dtype=np.float64) / scale[:, None]
    made = np.zeros((LAYOUT.size, LAYOUT.size))
    made[np.ix_(stable, stable)] = (back * more) @ back.T
    return made


def _joined(
    outcome: SeveralOutcome, alone: Sequence[Estimate], parts: Sequence[Estimate], described: Described
) -> Estimate:
    """One estimate with the residuals of all recordings, one after the other."""
    solution = outcome.solution
    degrees = solution.redundancy
    at_rest = sum(own.sigma0**2 * own.degrees_of_freedom for own in parts)

    def every(kind: str, name: str) -> AnyArray:
        return np.concatenate([getattr(getattr(own, kind), name) for own in parts])

    figures = Figures(
        float(np.sqrt(at_rest / sum(own.degrees_of_freedom for own in parts))),
        solution.sigma0,
        degrees,
        coverage_factor(degrees),
        max(own.largest_normalised for own in parts),
        {
            f"{name} ({part.name})": value
            for part, own in zip(solution.parts, parts, strict=True)
            for name, value in own.variance_components.items()
        },
    )
    return estimate_of(
        "joint",
        described,
        figures,
        left_out=_left_out(outcome, parts),
        terms=outcome.terms,
        said=said_of(
            remarks=_said(outcome, [own.remarks for own in alone]),
            objections=_said(outcome, [own.objections for own in alone]),
            not_determined=_in_all([own.not_determined for own in alone]),
        ),
        evidence=[
            Holds(every("holds", "norms"), every("holds", "sigmas")),
            Turns(every("turns", "angles"), every("turns", "sigmas"), every("turns", "sizes")),
            Spins(
                every("spins", "rates"),
                every("spins", "residuals"),
                every("spins", "sigmas"),
                tuple(
                    f"{part.name}, {name}"
                    for part, own in zip(solution.parts, parts, strict=True)
                    for name in own.spins.names
                ),
            ),
        ],
        frame=FRAME,
        lever_arms=lever_arms_of(_common(outcome)[0][LAYOUT["lever_arms"]], outcome.kept, np.eye(3)),
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

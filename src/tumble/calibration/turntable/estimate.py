"""The turntable's solution as an estimate: parameters, covariance, budget, residuals, and words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Square, Table, Vector, inverted
from tumble.attitude import skew
from tumble.calibration.canonical import describe_unknowns
from tumble.calibration.checks.scores import left_out_holds
from tumble.calibration.closed_forms.separate_norms import bias_from_static_pairs, ellipsoid_from_norms
from tumble.calibration.equations.triad_unknowns import triad_from_unknowns
from tumble.calibration.equations.turn import FORCE, G_SENSITIVITY, GYRO_MATRIX, TOTAL
from tumble.calibration.estimate import Estimate, Figures, coverage_factor, estimate_of, said_of
from tumble.calibration.evidence import Budget, Holds, RotationFit, Rotations
from tumble.calibration.procedures.multi_position import ROTATION_SIGMA
from tumble.calibration.turntable.solution import (
    BIAS,
    GROUPS,
    MATRIX,
)
from tumble.calibration.turntable.task import (
    TurntableOutcome,
    TurntableTask,
    sees_earth,
    spins_evidence,
    turned_angles,
)
from tumble.calibration.verdict import two_digits
from tumble.errors import ObservabilityError
from tumble.sensor.conventions.shin import shin_from_matrix
from tumble.units import ARCSECOND

# Residuals so many times their noise are no noise.
LARGEST_FACTOR = 20.0
# Residuals of a table's angle beyond this many times those of the other axes, or of the noise, are no bias.
MISREAD = 5.5
# The same of half of all axes, and as a share of the angle, is none either: wander is in the noise.
UNSTEADY, LEAST_UNSTEADY = 2.5, 5e-4
NOT_ESTIMATED = (
    "Nonlinear terms of the sensors are not estimated. A g-sensitivity does not reach the gyros' "
    "matrix. Its constant part goes out of the difference of the two ways round. What goes round "
    "with the unit averages out over whole revolutions."
)
"""What the turntable procedure by itself leaves out; the joint estimator tries it."""


def not_determined(solution: TurntableOutcome) -> list[str]:
    """Return sentences on what these rotations do not tell."""
    sentences = [NOT_ESTIMATED]
    if solution.system.gain is None:
        sentences.insert(
            0,
            "The rotation between the triads is not determined: it is taken as zero, with a prior standard "
            f"uncertainty of {1e3 * ROTATION_SIGMA:g} mrad about each axis.",
        )
    return sentences


def objections(task: TurntableTask, solution: TurntableOutcome) -> list[str]:
    """Return sentences on what makes the result unfit."""
    against = [
        f"{name[0].upper()}{name[1:]} disagree by {factor:.2g} times what the noise and the stated table explain: that "
        "is no noise. Check the angles and axes in the protocol, and whether the unit sat firmly on the table."
        for name, factor in solution.scaled.items()
        if factor > LARGEST_FACTOR
    ]
    if solution.system.gain is None:
        reasons = " ".join(plane.why for plane in task.planes if plane.why)
        against.append(
            "The rotations do not determine how the gyros stand against the accelerometers: two axes "
            f"across one another that are not vertical are needed. {reasons} Tilt the table's axis by "
            "30° or more, best to the horizontal. On a table whose axis has to stay vertical, use "
            "the modified-multi-position procedure."
        )
    return against


def misread_words(fits: list[RotationFit]) -> list[str]:
    """Return sentences on axes whose two ways round disagree as no noise of the others does.

    A bias of that hour does the same, and does it to all axes, by no more than the noise leaves open; one angle that
    was misread does it to one, and samples that are missing do more of it to all.

    Parameters
    ----------
    fits : of all axes.
    """
    odd = [
        max((abs(turned.residual) / turned.sigma for turned in fit.angles if turned.sigma > 0.0), default=0.0)
        for fit in fits
    ]
    usual = max(float(np.median(odd)), 1.0) if odd else 1.0
    share = [max((abs(t.residual / t.angle) for t in fit.angles), default=0.0) for fit in fits]
    if usual > UNSTEADY and float(np.median(share)) > LEAST_UNSTEADY:
        said = (
            f"About most axes the two ways round differ from the table's display by {usual:.1f} times their noise. "
            "Samples are missing that left no trace in the stamps, or the gyros' biases jump. Record the stamps of a "
            "clock, or count the samples against one."
        )
        return [said]
    return [
        f"About {fit.name} the gyros turned {max(abs(t.residual) for t in fit.angles) / ARCSECOND:.0f}″ "
        f"more one way and less the other than the table's display says, {value:.1f} times their "
        "noise. No other axis shows the like. Either an angle was misread or mistyped (`angle_deg`), "
        "or the unit slipped on the table."
        for fit, value in zip(fits, odd, strict=True)
        if value > MISREAD * usual
    ]


def remarks(task: TurntableTask, solution: TurntableOutcome) -> list[str]:
    """Return sentences on how the result was made, and on what the table does to it."""
    words = [f"A rotation took no part: {lonely}." for lonely in task.lonely]
    words += [plane.why for plane in task.planes if plane.why and solution.system.gain is not None]
    rough = [r for pair in task.pairs for r in pair.rotations if not r.is_from_rest]
    if rough:
        words.append(
            f"{len(rough)} of {sum(len(p.rotations) for p in task.pairs)} rotations were taken at their constant rate, "
            f"and the protocol's rate was believed ({rough[0].why}). Write the angle that the display turned from rest "
            "to rest into the protocol (`angle_deg`), and the ramps do not matter."
        )
    words.append(_against_closed_form(task))
    words.append(_about_bias(task, solution))
    words.append(_about_table(task))
    words += [
        f"{name[0].upper()}{name[1:]} disagree by {factor:.2g} times what the noise and the stated table explain: the "
        "uncertainties that rest on them are raised by that."
        for name, factor in solution.scaled.items()
        if factor <= LARGEST_FACTOR
    ]
    return words


def _against_closed_form(task: TurntableTask) -> str:
    """Return how Zhang's closed form compares with the adjustment."""
    means, force = task.means, task.force
    assert means.specific_force is not None
    assert means.specific_force_covariance is not None
    inverse = inverted(triad_from_unknowns(force.unknowns).matrix)
    variance = np.einsum("ij,kjl,il->k", inverse, means.specific_force_covariance, inverse)[task.rests]
    try:
        matrix, bias = ellipsoid_from_norms(
            means.specific_force[task.rests], task.site.gravity, 1.0 / (variance + force.extra)
        )
    except ObservabilityError:
        return "Without the prior the accelerometers' closed form (12) to (14) has no solution in these attitudes."
    scale, angles = shin_from_matrix(matrix)
    closed = np.concatenate([bias, np.real(scale), np.real(angles)])
    sigma = np.sqrt(np.diag(force.covariance)[:9])
    off = float(np.max(np.abs(closed - force.unknowns[:9]) / sigma))
    return (
        "The closed form without start values (Zhang et al. 2010, 12 to 14) gives the accelerometers' nine parameters "
        f"to {two_digits(off)} of their standard uncertainties as they are stated here."
    )


def _about_bias(task: TurntableTask, solution: TurntableOutcome) -> str:
    """Return where the gyros' biases come from, and what the other way gives."""
    inputs, system = solution.system.inputs, solution.system
    matrix, bias = solution.unknowns[MATRIX].reshape(3, 3), solution.unknowns[BIAS]
    if system.by_pairs:
        return (
            "No latitude was given: the gyros' biases are from the norms of their readings at rest, which are the "
            "Earth rate in every attitude (24, 25). With --site LATITUDE they come out several times better."
        )
    if task.site.latitude is None:
        return (
            "No latitude was given, and the gyros do not see the Earth rate in a hold: it counts as noise of their "
            "biases (4.2e-5 rad/s a hold). Give --site LATITUDE."
        )
    told = "The gyros' biases are from the Earth rate's part along the vertical in every hold"
    if not sees_earth(matrix, inputs.rest_covariance):
        return told + "."
    weights = 1.0 / np.einsum("ij,kjl,il->k", inverted(matrix), inputs.rest_covariance, inverted(matrix))
    try:
        other = bias_from_static_pairs(matrix, inputs.rest, weights)
    except ObservabilityError:
        return told + "."
    off = np.linalg.solve(matrix, other - bias)
    return (
        f"{told}; by the norms of static pairs (24, 25), which need no latitude, they differ by at most "
        f"{two_digits(float(np.max(np.abs(off))) / np.radians(1.0) * 3600.0)} °/h."
    )


def _about_table(task: TurntableTask) -> str:
    """Return what the table's errors do to each kind of parameter, in numbers for these rotations."""
    angle = float(np.median([pair.angle for pair in task.pairs]))
    stated = float(np.median([pair.angle_sigma for pair in task.pairs]))
    share = 1e6 * ARCSECOND / angle
    said = f"{stated / ARCSECOND:.2g}″ of the difference of two rotations" if stated > 0.0 else "exact angles"
    return (
        f"What errors of the table do (the protocol states {said}): 1″ more in that difference is "
        f"{share:.2g} ppm less gyro scale factor and as many µrad of a misalignment. A wrong angle "
        "that both ways share goes out only if it has the same sign in both. An axis that leans "
        "moves nothing, because both triads see it. One that wobbles moves the rotation between the "
        "triads by up to as much. Attitudes of holds need not be known at all."
    )


def turntable_estimate(task: TurntableTask, solution: TurntableOutcome) -> Estimate:
    """Return the outcome as an estimate.

    Parameters
    ----------
    task, solution : what was to be done, and the solution.
    """
    shares = solution.system.covariance()[1]
    unknown_rotation = _rotation_share(solution)
    # GROUPS: the gyros at rest are the second.
    shares[1] = shares[1].copy()
    shares[1][BIAS, BIAS] += solution.unseen
    values, _ = _in_full(solution.unknowns, shares[0])
    everything = sum((_in_full(solution.unknowns, share)[1] for share in shares), unknown_rotation)
    described = describe_unknowns(
        values, np.asarray(everything), task.site, task.recording, terms=solution.terms, gyro="full"
    )
    budget = {
        name: _sigmas(task, solution, values, _in_full(solution.unknowns, share)[1])
        for name, share in zip(GROUPS, shares, strict=True)
    }
    means, adjustment = task.means, task.force.adjustment
    assert means.specific_force is not None
    corrected = triad_from_unknowns(task.force.unknowns).correct(means.specific_force)
    variance = np.diagonal(adjustment.linearisation.covariance, axis1=1, axis2=2)[:, 0]
    tests = solution.tests
    square = adjustment.square_sum + tests.angles[0] + tests.axes[0] + tests.rests[0]
    degrees = adjustment.redundancy + tests.angles[1] + tests.axes[1] + tests.rests[1]
    norms = np.linalg.norm(corrected, axis=1) - task.site.gravity
    fits = _rotation_fits(task, solution)
    figures = Figures.of(
        adjustment,
        float(np.sqrt(square / degrees)) if degrees > 0 else float("nan"),
        {
            "accelerometer bias from hold to hold, m/s²": float(np.sqrt(task.force.extra)),
            **{f"factor on the noise of {name}": factor for name, factor in solution.scaled.items()},
        },
        tested=[slice(0, 1)],
    )
    matrix = solution.unknowns[MATRIX].reshape(3, 3)
    return estimate_of(
        "turntable",
        described,
        replace(figures, degrees_of_freedom=degrees, coverage_factor=coverage_factor(degrees)),
        left_out=left_out_holds(task.force.outliers, norms),
        terms=[] if solution.term is None else [solution.term],
        said=said_of(
            remarks=remarks(task, solution),
            objections=[*objections(task, solution), *misread_words(fits)],
            not_determined=not_determined(solution),
        ),
        evidence=[
            Holds(norms, np.sqrt(variance)),
            spins_evidence(task.pairs, _about_axis(task, solution), matrix, solution.parts),
            Rotations(tuple(fits)),
            Budget(budget),
        ],
    )


def _in_full(unknowns: Series, covariance: Table) -> tuple[Series, Square]:
    """Return the 36 unknowns of `turn_conditions` and their covariance."""
    values, full = np.zeros(TOTAL), np.zeros((TOTAL, TOTAL))
    at = [*range(FORCE.start, FORCE.start + 9), *range(GYRO_MATRIX.start, G_SENSITIVITY.stop)]
    values[at] = unknowns
    full[np.ix_(at, at)] = covariance
    return values, full


def _rotation_share(solution: TurntableOutcome) -> Square:
    """Return (36, 36): what the rotation between the triads adds where no axes tell it."""
    full = np.zeros((TOTAL, TOTAL))
    if solution.system.gain is None:
        matrix = solution.unknowns[MATRIX].reshape(3, 3)
        moves = np.stack([(matrix @ skew(axis)).ravel() for axis in np.eye(3)], axis=1)
        full[GYRO_MATRIX, GYRO_MATRIX] = ROTATION_SIGMA**2 * (moves @ moves.T)
    return full


def _sigmas(task: TurntableTask, solution: TurntableOutcome, values: Series, covariance: Square) -> Series:
    """Return standard uncertainties of the named parameters for one share of the covariance; gravity exact."""
    site = replace(task.site, gravity_sigma=0.0)
    described = describe_unknowns(values, covariance, site, task.recording, terms=solution.terms, gyro="full")
    return np.array([value.standard_uncertainty for value in described.parameters])


def _about_axis(task: TurntableTask, solution: TurntableOutcome) -> list[Vector]:
    """The axis of each pair in b, as the calibrated gyros show it."""
    matrix = solution.unknowns[MATRIX].reshape(3, 3)
    turned = solution.system.inputs.rotation @ inverted(matrix).T
    return list(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def _rotation_fits(task: TurntableTask, solution: TurntableOutcome) -> list[RotationFit]:
    inputs = solution.system.inputs
    missed = {}
    if solution.system.gain is not None:
        off, sigma = solution.system.axes_residuals(inputs.unchanged)
        missed = {int(k): (float(o), float(s)) for k, o, s in zip(inputs.plane, off, sigma, strict=True)}
    matrix = solution.unknowns[MATRIX].reshape(3, 3)
    fits: list[RotationFit] = []
    for k, (pair, plane, axis) in enumerate(
        zip(task.pairs, task.planes, _about_axis(task, solution), strict=True)
    ):
        off, off_sigma = missed.get(k, (float("nan"), float("nan")))
        fits.append(
            RotationFit(
                pair.name,
                axis,
                float(np.arcsin(min(plane.sine, 1.0))),
                off,
                off_sigma,
                plane.residual,
                turned_angles(pair, axis, matrix, solution.parts),
                plane.why or ("" if k in missed else "too few other axes determine the inter-triad angles"),
            )
        )
    return fits

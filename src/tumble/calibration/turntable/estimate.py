"""The turntable's solution as an estimate: parameters, covariance, budget, residuals of every rotation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Series, Square, Table, Vector, inverted
from tumble.attitude import skew
from tumble.calibration.canonical import describe_unknowns
from tumble.calibration.checks.scores import left_out_holds
from tumble.calibration.equations.triad_unknowns import triad_from_unknowns
from tumble.calibration.equations.turn import FORCE, G_SENSITIVITY, GYRO_MATRIX, TOTAL
from tumble.calibration.estimate import Estimate, Figures, coverage_factor, estimate_of, said_of
from tumble.calibration.evidence import Budget, Holds, RotationFit, Rotations
from tumble.calibration.procedures.multi_position import ROTATION_SIGMA
from tumble.calibration.turntable.rotations import spins_evidence, turned_angles
from tumble.calibration.turntable.solution import (
    BIAS,
    GROUPS,
    MATRIX,
)
from tumble.calibration.turntable.task import TurntableOutcome, TurntableTask
from tumble.calibration.turntable.words import misread_words, not_determined, objections, remarks


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

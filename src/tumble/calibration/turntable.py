"""Calibration on a turntable that needs no alignment (Zhang et al. 2010).

The accelerometers are calibrated on the norm of gravity in attitudes that nobody needs to know, the gyros
on the angles that the table's display tells, whatever the axis. Both saw the same axes: that tells the
rotation between them, if the axes are not vertical.

Where the paper leaves a choice or gives something away:

- The accelerometers' closed form (12) to (14) is the start and the check; the Gauss-Helmert adjustment
  of the same norms weighs holds by their noise and finds gross errors.
- Inter-triad angles: all axes, each weighed by what it really tells. Two axes, z and then y as in the
  paper, let the accelerometers' misalignments in: five times worse.
- Biases of the gyros: from the Earth rate's part along the vertical, which the accelerometers show, where a
  latitude is given; from the norms of static pairs (24), (25) otherwise.
- Ramps, and a table that stops early, leave bias and Earth rate in the difference of two rotations: they
  are taken out (`rotation_pairs`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Vector, inverted
from tumble.attitude import skew
from tumble.calibration.accelerometers import fit_accelerometers
from tumble.calibration.canonical import describe_unknowns
from tumble.calibration.estimate import (
    Estimate,
    LeftOut,
    RotationFit,
    TermTest,
    TurnedAngle,
    coverage_factor,
)
from tumble.calibration.handedness import refuse_contradicting_axes
from tumble.calibration.inter_triad import wahba_rotation
from tumble.calibration.multi_position import ROTATION_SIGMA, TriadFit
from tumble.calibration.placement import is_excessive
from tumble.calibration.prior import StableKnowledge
from tumble.calibration.rest_rates import SENSITIVITY as REST_SENSITIVITY
from tumble.calibration.rotation_pairs import EarthParts, RotationPair, pair_rotations
from tumble.calibration.rotation_planes import SMALLEST_SINE, RotationPlane, normal_in_raw, observe_plane
from tumble.calibration.separate_norms import bias_from_static_pairs, ellipsoid_from_norms
from tumble.calibration.spin_groups import REVERSED
from tumble.calibration.term_tests import wald_test
from tumble.calibration.triad_unknowns import triad_from_unknowns
from tumble.calibration.turn_conditions import FORCE, G_SENSITIVITY, GYRO_MATRIX, TOTAL
from tumble.calibration.turntable_solution import (
    BIAS,
    GROUPS,
    MATRIX,
    TurntableInputs,
    TurntableSystem,
)
from tumble.calibration.verdict import two_digits
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError
from tumble.estimation import snoop_groups
from tumble.protocol import Protocol
from tumble.recording.recording import Recording
from tumble.segmentation import HoldMeans, Timeline
from tumble.segmentation.matching import Matching
from tumble.segmentation.rotations import Rotation
from tumble.sensor.conventions.shin import shin_from_matrix

# The Earth rate is seen in a hold if its mean is known to a fifth of it.
SEEN = 0.2
# Axes of both triads that differ by more after the best rotation belong to no rotation.
LARGEST_MISFIT = 0.2
PASSES = 4
# Chance of keeping a g-sensitivity that is not there, and the rests that twelve unknowns ask for.
G_SENSITIVITY_FALSE_ALARM, FEWEST_RESTS = 0.01, 9
_ARCSEC = np.pi / 648000.0


@dataclass(slots=True)
class _Task:
    """What the steps of the procedure share."""

    recording: Recording
    means: HoldMeans
    site: Site
    force: TriadFit
    pairs: list[RotationPair]
    planes: list[RotationPlane]
    rests: np.ndarray
    lonely: list[str]


@dataclass(slots=True)
class _Tests:
    """Square sums and degrees of freedom of what the separate steps leave."""

    angles: tuple[float, int]
    axes: tuple[float, int]
    rests: tuple[float, int]


@dataclass(slots=True)
class _Solution:
    system: TurntableSystem
    unknowns: Series
    parts: dict[int, Vector]
    tests: _Tests
    scaled: dict[str, float]
    term: TermTest | None

    @property
    def terms(self) -> frozenset[str]:
        """Optional terms that were estimated."""
        return frozenset({"g_sensitivity"}) if self.system.with_sensitivity else frozenset[str]()


def calibrate_turntable(
    recording: Recording,
    timeline: Timeline,
    means: HoldMeans,
    rotations: list[Rotation],
    matching: Matching,
    protocol: Protocol,
    site: Site,
    *,
    prior: StableKnowledge | None = None,
) -> Estimate:
    """Calibrate both triads and the rotation between them from holds and from a table's rotations.

    Parameters
    ----------
    recording : samples; those of the rotations show the axes to the accelerometers.
    timeline : its noise at rest.
    means : of all holds: each serves the accelerometers.
    rotations : in the order of `matching.spins`.
    matching, protocol : which rotation is about which axis.
    site : gravity; with a latitude the vertical Earth rate tells the gyros' biases.
    prior : non-orthogonalities of the accelerometers from an earlier calibration.

    Returns
    -------
    estimate : in the frame ``accelerometer-x``, with the gyro's whole matrix, the fits of the axes and the
        uncertainty budget.

    Raises
    ------
    ObservabilityError
        If poses or axes are too few or too alike, or a way round is missing.
    ConvergenceError
        If the accelerometers' adjustment fails.
    RecordingError
        If the axes that both triads saw show columns that are swapped or reversed.
    """
    if means.angular_rate is None or means.angular_rate_covariance is None:
        raise ObservabilityError(
            "The recording has no gyro: a turntable's rotations have nothing to calibrate."
        )
    force = fit_accelerometers(recording, means, site, prior)
    pairs, lonely = pair_rotations(rotations, matching, protocol)
    triad = triad_from_unknowns(force.unknowns)
    noise = timeline.noise_floor.specific_force
    planes = [observe_plane(recording, pair, triad, site.gravity, noise) for pair in pairs]
    bad = {outlier.group for outlier in force.outliers}
    rests = np.array([k for k in range(len(means)) if k not in bad])
    task = _Task(recording, means, site, force, pairs, planes, rests, lonely)
    solution = _solve(task)
    refuse_contradicting_axes(recording, inverted(solution.unknowns[MATRIX].reshape(3, 3)))
    return _estimate(task, solution)


def _solve(task: _Task) -> _Solution:
    """Solve, with the bias and the Earth rate taken out better every time; then weigh by what the tests say."""
    matrix: Matrix | None = None
    bias: Vector | None = None
    parts: dict[int, Vector] = {}
    system: TurntableSystem | None = None
    values = np.zeros(0)
    for _ in range(PASSES):
        parts = EarthParts(task.pairs, task.means, matrix, bias, parts or None).parts()
        system = TurntableSystem.of(_inputs(task, parts, matrix))
        if matrix is None:
            _refuse_reversed(task, system)
        values = system.solve(system.inputs.unchanged)
        matrix, bias = values[MATRIX].reshape(3, 3), values[BIAS]
    assert system is not None
    term = _test_sensitivity(system, values)
    if term is not None and term.kept:
        system = TurntableSystem.of(system.inputs, with_sensitivity=True)
        values = system.solve(system.inputs.unchanged)
    tests = _tests(task, system, values)
    inputs, scaled = _scaled(system.inputs, tests)
    if scaled:
        system = TurntableSystem.of(inputs, with_sensitivity=system.with_sensitivity)
        values = system.solve(inputs.unchanged)
    return _Solution(system, values, parts, tests, scaled, term)


def _test_sensitivity(system: TurntableSystem, values: Series) -> TermTest | None:
    """Test whether the gyros at rest show a g-sensitivity; without a latitude and with the Earth seen they cannot."""
    if system.by_pairs or len(system.inputs.rest) < FEWEST_RESTS:
        return None
    told = system.rests(values[MATRIX].reshape(3, 3), values[:9], system.inputs.rest, with_sensitivity=True)
    noise = max(1.0, told.square_sum / told.degrees)
    spread = noise * told.covariance[REST_SENSITIVITY, REST_SENSITIVITY]
    return wald_test(
        "g_sensitivity", told.sensitivity.ravel(), spread, told.degrees, G_SENSITIVITY_FALSE_ALARM
    )


def _inputs(task: _Task, parts: dict[int, Vector], matrix: Matrix | None) -> TurntableInputs:
    means, pairs = task.means, task.pairs
    assert means.angular_rate is not None
    assert means.angular_rate_covariance is not None
    assert means.specific_force is not None
    told = [k for k, plane in enumerate(task.planes) if not plane.why]
    if len(told) < 2 or not _are_apart([task.planes[k].normal for k in told]):
        told = []
    force_matrix = triad_from_unknowns(task.force.unknowns).matrix
    normals = [normal_in_raw(task.planes[k].normal, force_matrix) for k in told]
    tangents = [[normal_in_raw(tangent, force_matrix) for tangent in task.planes[k].tangents] for k in told]
    covariance = means.angular_rate_covariance[task.rests]
    vertical: float | None = None
    horizontal = 0.0
    if task.site.latitude is not None:
        vertical = EARTH_RATE * float(np.sin(task.site.latitude))
        horizontal = EARTH_RATE * float(np.cos(task.site.latitude))
    elif matrix is not None and not _sees_earth(matrix, covariance):
        # Neither latitude nor gyros that see it: the Earth rate is noise.
        vertical = 0.0
        covariance = covariance + EARTH_RATE**2 / 3.0 * (matrix @ matrix.T)
    return TurntableInputs(
        force=task.force.unknowns[:9].copy(),
        force_covariance=task.force.covariance[:9, :9],
        rotation=np.array([pair.difference(parts) for pair in pairs]),
        rotation_covariance=np.array([pair.covariance for pair in pairs]),
        angle=np.array([pair.angle for pair in pairs]),
        angle_sigma=np.array([pair.angle_sigma for pair in pairs]),
        plane=np.array(told, dtype=int),
        normal=np.array(normals).reshape(-1, 3),
        tangent=np.array(tangents).reshape(-1, 2, 3),
        normal_covariance=np.array([task.planes[k].covariance for k in told]).reshape(-1, 2, 2),
        rest=means.angular_rate[task.rests],
        rest_covariance=covariance,
        rest_force=means.specific_force[task.rests],
        vertical_rate=vertical,
        horizontal_rate=horizontal,
    )


def _are_apart(axes: list[Vector]) -> bool:
    """Whether two of the axes enclose an angle worth the name."""
    spread = np.linalg.svd(np.array(axes), compute_uv=False)
    return bool(spread[1] > SMALLEST_SINE * spread[0])


def _sees_earth(matrix: Matrix, covariance: AnyArray) -> bool:
    inverse = inverted(matrix)
    variance = np.einsum("ij,kjl,il->k", inverse, covariance, inverse) / 3.0
    return bool(np.sqrt(np.median(variance)) < SEEN * EARTH_RATE)


def _refuse_reversed(task: _Task, system: TurntableSystem) -> None:
    """Refuse axes of the two triads that no rotation joins."""
    if not len(system.inputs.plane):
        return
    axes_o, axes_p = system.axes(system.inputs.unchanged)
    if _misfit(axes_o, axes_p) < LARGEST_MISFIT:
        return
    if _misfit(-axes_o, axes_p) < LARGEST_MISFIT:
        raise ObservabilityError(REVERSED)
    raise ObservabilityError(
        "The axes that the gyros and the accelerometers saw in the table's rotations belong to no rotation between "
        "them: a gyro axis is reversed or two are swapped (--columns), or the protocol has the axis or the way round "
        "of a turn wrong. " + _worst_axis(task, axes_o, axes_p)
    )


def _misfit(axes_o: AnyArray, axes_p: AnyArray) -> float:
    rotation = wahba_rotation(axes_o, axes_p)
    return float(np.max(np.linalg.norm(axes_o - axes_p @ rotation.T, axis=1)))


def _worst_axis(task: _Task, axes_o: AnyArray, axes_p: AnyArray) -> str:
    away = np.linalg.norm(axes_o - axes_p @ wahba_rotation(axes_o, axes_p).T, axis=1)
    told = [pair for pair, plane in zip(task.pairs, task.planes, strict=True) if not plane.why]
    return f"The worst is the axis {told[int(np.argmax(away))].name}."


def _tests(task: _Task, system: TurntableSystem, values: Series) -> _Tests:
    inputs = system.inputs
    matrix = values[MATRIX].reshape(3, 3)
    inverse = inverted(matrix)
    turned = inputs.rotation @ inverse.T
    length = np.linalg.norm(turned, axis=1)
    along = (turned / length[:, None]) @ inverse
    variance = np.einsum("ki,kij,kj->k", along, inputs.rotation_covariance, along) + inputs.angle_sigma**2
    angles = float(np.sum((length - inputs.angle) ** 2 / variance)), len(length) - 6
    axes = (0.0, 0)
    if system.gain is not None:
        axes = system.axes_test(inputs.unchanged)
    rests = (0.0, 0)
    if not system.by_pairs:
        told = system.rests(matrix, values[:9], inputs.rest, with_sensitivity=system.with_sensitivity)
        rests = told.square_sum, told.degrees
    return _Tests(angles, axes, rests)


def _scaled(inputs: TurntableInputs, tests: _Tests) -> tuple[TurntableInputs, dict[str, float]]:
    """Raise the covariances of what contradicts itself by more than its noise explains."""
    scaled: dict[str, float] = {}
    if is_excessive(*tests.angles):
        factor = tests.angles[0] / tests.angles[1]
        scaled["the table's angles against one another"] = float(np.sqrt(factor))
        inputs = replace(
            inputs,
            rotation_covariance=factor * inputs.rotation_covariance,
            angle_sigma=np.sqrt(factor) * inputs.angle_sigma,
        )
    if is_excessive(*tests.axes):
        factor = tests.axes[0] / tests.axes[1]
        scaled["the axes that both triads saw"] = float(np.sqrt(factor))
        inputs = replace(inputs, normal_covariance=factor * inputs.normal_covariance)
    if is_excessive(*tests.rests):
        factor = tests.rests[0] / tests.rests[1]
        scaled["the gyros at rest"] = float(np.sqrt(factor))
        inputs = replace(inputs, rest_covariance=factor * inputs.rest_covariance)
    return inputs, scaled


def _estimate(task: _Task, solution: _Solution) -> Estimate:
    shares = solution.system.covariance()[1]
    unknown_rotation = _rotation_share(solution)
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
    nothing = np.full(len(means), np.nan)
    tests = solution.tests
    square = adjustment.square_sum + tests.angles[0] + tests.axes[0] + tests.rests[0]
    degrees = adjustment.redundancy + tests.angles[1] + tests.axes[1] + tests.rests[1]
    norms = np.linalg.norm(corrected, axis=1) - task.site.gravity
    rates, residuals, sigmas, names = _spins(task, solution)
    return Estimate(
        procedure="turntable",
        model=described.model,
        names=described.names,
        covariance=described.covariance,
        parameters=described.parameters,
        correlations=described.correlations,
        sigma0=float(np.sqrt(square / degrees)) if degrees > 0 else float("nan"),
        sigma0_final=adjustment.sigma0,
        degrees_of_freedom=degrees,
        coverage_factor=coverage_factor(degrees),
        largest_normalised=max(
            (test.normalised for test in snoop_groups(adjustment, slice(0, 1)) if test.degrees), default=0.0
        ),
        hold_norms=norms,
        hold_sigmas=np.sqrt(variance),
        turn_angles=nothing,
        turn_sigmas=nothing.copy(),
        turn_sizes=nothing.copy(),
        variance_components={
            "accelerometer bias from hold to hold, m/s²": float(np.sqrt(task.force.extra)),
            **{f"factor on the noise of {name}": factor for name, factor in solution.scaled.items()},
        },
        left_out=[
            LeftOut(
                "hold",
                o.group,
                f"its specific force is off gravity by {1e3 * norms[o.group]:+.1f} mm/s², "
                f"{o.normalised:.1f} times what the others show",
            )
            for o in task.force.outliers
        ],
        terms=[] if solution.term is None else [solution.term],
        not_determined=_not_determined(task, solution),
        remarks=_remarks(task, solution),
        objections=_objections(task, solution),
        spin_rates=rates,
        spin_residuals=residuals,
        spin_sigmas=sigmas,
        spin_names=names,
        rotations=_rotation_fits(task, solution),
        budget=budget,
    )


def _in_full(unknowns: Series, covariance: Square) -> tuple[Series, Square]:
    """Return the 36 unknowns of `turn_conditions` and their covariance."""
    values, full = np.zeros(TOTAL), np.zeros((TOTAL, TOTAL))
    at = [*range(FORCE.start, FORCE.start + 9), *range(GYRO_MATRIX.start, G_SENSITIVITY.stop)]
    values[at] = unknowns
    full[np.ix_(at, at)] = covariance
    return values, full


def _rotation_share(solution: _Solution) -> Square:
    """Return (36, 36): what the rotation between the triads adds where no axes tell it."""
    full = np.zeros((TOTAL, TOTAL))
    if solution.system.gain is None:
        matrix = solution.unknowns[MATRIX].reshape(3, 3)
        moves = np.stack([(matrix @ skew(axis)).ravel() for axis in np.eye(3)], axis=1)
        full[GYRO_MATRIX, GYRO_MATRIX] = ROTATION_SIGMA**2 * (moves @ moves.T)
    return full


def _sigmas(task: _Task, solution: _Solution, values: Series, covariance: Square) -> Series:
    """Return standard uncertainties of the named parameters for one share of the covariance; gravity exact."""
    site = replace(task.site, gravity_sigma=0.0)
    described = describe_unknowns(values, covariance, site, task.recording, terms=solution.terms, gyro="full")
    return np.array([value.standard_uncertainty for value in described.parameters])


def _about_axis(task: _Task, solution: _Solution) -> list[Vector]:
    """The axis of each pair in b, as the calibrated gyros show it."""
    matrix = solution.unknowns[MATRIX].reshape(3, 3)
    turned = solution.system.inputs.rotation @ inverted(matrix).T
    return list(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def _spins(task: _Task, solution: _Solution) -> tuple[Series, AnyArray, AnyArray, list[str]]:
    """Return rates, residuals, sigmas and names of all spins, found in a pair or not."""
    count = 1 + max(r.row for pair in task.pairs for r in pair.rotations)
    matrix = solution.unknowns[MATRIX].reshape(3, 3)
    inverse = inverted(matrix)
    rates = np.zeros(count)
    residuals, sigmas = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    names = ["a rotation without its counterpart"] * count
    for pair, axis in zip(task.pairs, _about_axis(task, solution), strict=True):
        for side, sign in ((pair.forward, 1.0), (pair.backward, -1.0)):
            for r in side:
                rates[r.row] = sign * abs(r.angle) / r.seconds
                turned = inverse @ (r.integral - solution.parts[r.row])
                residuals[r.row] = (turned - sign * abs(r.angle) * axis) / r.seconds
                spread = inverse @ r.covariance @ inverse.T + r.angle_sigma**2 * np.outer(axis, axis)
                sigmas[r.row] = np.sqrt(np.diag(spread)) / r.seconds
                way = "counter-clockwise" if sign > 0 else "clockwise"
                names[r.row] = f"{pair.name}, {way}"
    return rates, residuals, sigmas, names


def _rotation_fits(task: _Task, solution: _Solution) -> list[RotationFit]:
    inputs = solution.system.inputs
    missed = {}
    if solution.system.gain is not None:
        off, sigma = solution.system.axes_residuals(inputs.unchanged)
        missed = {int(k): (float(o), float(s)) for k, o, s in zip(inputs.plane, off, sigma, strict=True)}
    inverse = inverted(solution.unknowns[MATRIX].reshape(3, 3))
    fits: list[RotationFit] = []
    for k, (pair, plane, axis) in enumerate(
        zip(task.pairs, task.planes, _about_axis(task, solution), strict=True)
    ):
        angles: list[TurnedAngle] = []
        for r in pair.rotations:
            sign = 1.0 if r in pair.forward else -1.0
            turned = float(axis @ (inverse @ (r.integral - solution.parts[r.row]))) * sign
            weight = axis @ inverse
            sigma = float(np.sqrt(weight @ r.covariance @ weight + r.angle_sigma**2))
            angles.append(
                TurnedAngle(
                    r.row, sign * abs(r.angle), turned - abs(r.angle), sigma, r.seconds, r.is_from_rest
                )
            )
        off, off_sigma = missed.get(k, (float("nan"), float("nan")))
        fits.append(
            RotationFit(
                pair.name,
                axis,
                float(np.arcsin(min(plane.sine, 1.0))),
                off,
                off_sigma,
                plane.residual,
                tuple(angles),
                plane.why or ("" if k in missed else "too few other axes tell the inter-triad angles"),
            )
        )
    return fits


def _not_determined(task: _Task, solution: _Solution) -> list[str]:
    terms = (
        "Nonlinear terms of the sensors are not estimated. A g-sensitivity does not reach the gyros' matrix: its "
        "constant part goes out of the difference of the two ways round, and what goes round with the unit averages "
        "out over whole revolutions."
    )
    sentences = [terms]
    if solution.system.gain is None:
        sentences.insert(
            0,
            "The rotation between the triads is not determined: it is taken as zero, with a prior standard "
            f"uncertainty of {1e3 * ROTATION_SIGMA:g} mrad about each axis.",
        )
    return sentences


def _objections(task: _Task, solution: _Solution) -> list[str]:
    if solution.system.gain is not None:
        return []
    reasons = " ".join(plane.why for plane in task.planes if plane.why)
    sentence = (
        "The rotations do not tell how the gyros stand against the accelerometers: two axes across one another that "
        f"are not vertical are needed. {reasons} Tilt the table's axis by 30° or more, best to the horizontal; on a "
        "table whose axis has to stay vertical use the modified-multi-position procedure."
    )
    return [sentence]


def _remarks(task: _Task, solution: _Solution) -> list[str]:
    remarks = [f"A rotation took no part: {words}." for words in task.lonely]
    remarks += [plane.why for plane in task.planes if plane.why and solution.system.gain is not None]
    rough = [r for pair in task.pairs for r in pair.rotations if not r.is_from_rest]
    if rough:
        remarks.append(
            f"{len(rough)} of {sum(len(p.rotations) for p in task.pairs)} rotations were taken at their constant rate, "
            f"and the protocol's rate was believed ({rough[0].why}). Write the angle that the display turned from rest "
            "to rest into the protocol (`angle_deg`), and the ramps do not matter."
        )
    remarks.append(_against_closed_form(task))
    remarks.append(_about_bias(task, solution))
    remarks.append(_about_table(task))
    remarks += [
        f"{name[0].upper()}{name[1:]} disagree by {factor:.2g} times what the noise and the stated table explain: the "
        "uncertainties that rest on them are raised by that."
        for name, factor in solution.scaled.items()
    ]
    return remarks


def _against_closed_form(task: _Task) -> str:
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


def _about_bias(task: _Task, solution: _Solution) -> str:
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
    if not _sees_earth(matrix, inputs.rest_covariance):
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


def _about_table(task: _Task) -> str:
    """Return what the table's errors do to each kind of parameter, in numbers for these rotations."""
    angle = float(np.median([pair.angle for pair in task.pairs]))
    stated = float(np.median([pair.angle_sigma for pair in task.pairs]))
    share = 1e6 * _ARCSEC / angle
    said = f"{stated / _ARCSEC:.2g}″ of the difference of two rotations" if stated > 0.0 else "exact angles"
    return (
        f"What the table does (the protocol states {said}): 1″ more in that difference is {share:.2g} ppm less gyro "
        "scale factor and as many µrad of a misalignment; a wrong angle that both ways share goes out only if it has "
        "the same sign in both. An axis that wobbles or leans moves neither; what the two triads see of it is the "
        "same axis. Attitudes of holds need not be known at all."
    )

"""The calibration methods of Hayal's thesis (2010, 2.4 and 3), each from a recording to an estimate.

Static and rate tests believe the poses. With K the vector that the unit is shown, gravity, the Earth's rate or a
table's, a sensor shows it up and down, or turned one way and the other,

    Y_up = b + (1 + S) K,  Y_down = b - (1 + S) K                                             (2.3, 2.4)
    b = (Y_up + Y_down) / 2,  1 + S = (Y_up - Y_down) / (2 K)                                 (2.5, 2.6)

and all readings together, across too, give the whole matrix: ``Y = M a + b``, X = [M b], A = [a; 1],

    X = Y A' (A A')^-1                                                                        (2.11)

which of one sensor's readings up and down is (2.5, 2.6). Multi-position methods believe norms alone (`norm`).

Stated is the noise of the means, propagated; of an adjustment its cofactor times the variance of unit weight (3.36).
What biases do from hold to hold, what a misplacement does, and terms beyond matrix and bias are in none of them.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Square, Vector, Vectors
from tumble.calibration import (
    ANGLE,
    BIAS,
    SCALE,
    Described,
    Estimate,
    Estimator,
    Figures,
    NamedValue,
    Said,
    Session,
    correlation_matrix,
    coverage_factor,
    match_faces,
    rough_triad,
)
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ConvergenceError, ObservabilityError
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, TurnStep
from tumble.records import dataclass
from tumble.sensor import ImuModel, Triad, matrix_from_shin, propagate, shin_from_matrix
from tumble.units import angular_rate_factor, specific_force_factor
from tumble_papers.hayal.norm import adjust_norm

Complex = npt.NDArray[Any]


@dataclass(frozen=True)
class FoundTriad:
    """What a method finds of one triad.

    Attributes
    ----------
    matrix, bias : (3, 3) raw per SI unit, (3,) raw.
    covariance : (12, 12) of the matrix, by rows, and the bias; zero of what is not estimated.
    estimated : (3, 3) of bool, the elements of the matrix that are.
    sigma0, redundancy : of an adjustment (3.37); a closed form has none.
    """

    matrix: Matrix
    bias: Vector
    covariance: Square
    estimated: np.ndarray
    sigma0: float = float("nan")
    redundancy: int = 0


def estimate_of_triads(
    method: str,
    units: tuple[str, str],
    frame: str,
    accelerometer: FoundTriad | None,
    gyro: FoundTriad | None,
    not_determined: list[str],
) -> Estimate:
    """Return the estimate of a method.

    Parameters
    ----------
    method : its name.
    units : raw units of specific force and angular rate.
    frame : ``fixture``, or ``accelerometer-x`` where each triad has a lower-triangular matrix of its own.
    accelerometer, gyro : what was found; at least one of them.
    not_determined : sentences.
    """
    from scipy.linalg import block_diag

    factors = specific_force_factor(units[0]), angular_rate_factor(units[1])
    kinds = ("accelerometer", accelerometer), ("gyroscope", gyro)
    told = [
        _tell(kind, found, unit, factor, frame)
        for (kind, found), unit, factor in zip(kinds, units, factors, strict=True)
        if found is not None
    ]
    described = Described(
        ImuModel(_triad(accelerometer), _triad(gyro)),
        [name for names, *_ in told for name in names],
        block_diag(*(covariance for _, covariance, _, _ in told)),
        [value for _, _, values, _ in told for value in values],
        correlation_matrix(block_diag(*(spread for *_, spread in told))),
    )
    first = accelerometer or gyro
    assert first is not None
    factor = coverage_factor(first.redundancy) if first.redundancy else 1.96
    figures = Figures(first.sigma0, first.sigma0, first.redundancy, factor, 0.0, {})
    said = [Said("not determined", text) for text in not_determined]
    return Estimate(method, *described, *figures, said=said, frame=frame)


def _triad(found: FoundTriad | None) -> Triad | None:
    return None if found is None else Triad(found.matrix, found.bias)


def _tell(
    kind: str, found: FoundTriad, unit: str, factor: float | None, frame: str
) -> tuple[list[str], Square, list[NamedValue], Square]:
    """Name what was estimated: biases, scale factors, and how the axes lean against the frame or one another.

    Canonical names with their covariance, and named values with theirs.
    """
    short, si = ("gyro", "rad/s") if kind == "gyroscope" else (kind, "m/s²")
    known, off = found.estimated, ~np.eye(3, dtype=bool)
    names = [f"{kind}.matrix[{i},{j}]" for i in range(3) for j in range(3)]
    names += [f"{kind}.bias[{i}]" for i in range(3)]
    canonical = np.flatnonzero([*known.ravel(), True, True, True])
    scale, per = ("scale factor error", "1") if factor else ("scale factor", f"{unit}/({si})")
    labels = [(f"{short} bias {axis}", unit) for axis in "xyz"]
    labels += [(f"{short} {scale} {axis}", per) for axis in "xyz"]
    if frame == "fixture":
        labels += [(f"{short} misalignment {a}{b}", "rad") for a in "xyz" for b in "xyz" if a != b]
        leaning = known[off]
    else:
        labels += [(f"{short} non-orthogonality {angle}", "rad") for angle in ("yz", "zx", "zy")]
        leaning = known[[1, 2, 2], [0, 1, 0]]

    def evaluate(x: Complex) -> Complex:
        matrix = x[:9].reshape(3, 3)
        if frame == "fixture":
            size = np.sign(np.real(np.diag(matrix))) * np.sqrt(np.sum(matrix * matrix, axis=1))
            angles = np.arcsin((matrix / size[:, None])[off])
        else:
            size, angles = shin_from_matrix(matrix)
        return np.concatenate([x[9:], size * factor - 1.0 if factor else size, angles])

    numbers, spread = propagate(
        evaluate, np.concatenate([found.matrix.ravel(), found.bias]), found.covariance
    )
    rows = np.flatnonzero([True, True, True, *np.diag(known), *leaning])
    sigmas = np.sqrt(np.maximum(np.diag(spread), 0.0))
    values = [NamedValue(labels[i][0], float(numbers[i]), float(sigmas[i]), labels[i][1]) for i in rows]
    of_canonical = found.covariance[np.ix_(canonical, canonical)]
    return [names[i] for i in canonical], of_canonical, values, spread[np.ix_(rows, rows)]


# A pose within half a degree of a face is one by intention.
FACE = float(np.cos(np.radians(0.5)))
# Gyros see the Earth's rotation if its share of a bias and of a scale factor is known to a tenth.
SEEN = 0.1
# Of the matrix by rows, then the bias, among the three rows of X = [M b].
_MATRIX_FIRST = np.array([0, 1, 2, 4, 5, 6, 8, 9, 10, 3, 7, 11])
_ESTIMATED = {9: np.tri(3, dtype=bool), 6: np.eye(3, dtype=bool), 3: np.zeros((3, 3), dtype=bool)}
_NO_GYRO = "The recording has no gyro."
_NO_LATITUDE = "No latitude was given: the Earth's rotation about the table's axis is left in the gyros' "


def estimate_six_position(session: Session, *, whole: bool) -> Estimate:
    """Calibrate on the faces up and down: accelerometers on gravity, gyros on the Earth's rotation if they see it.

    Parameters
    ----------
    session : without a protocol, each hold is taken for the face that is nearest to up.
    whole : the improved test: the whole matrix from the readings across, too, in all poses that are known.

    Raises
    ------
    ObservabilityError
        If there is no accelerometer, or a face is missing.
    """
    shown, covariance = _forces(session)
    protocol, matching = session.protocol, session.matching
    if protocol is None or matching is None:
        protocol, matching = match_faces(session.means, session.site)
    steps = [(matched.hold, protocol.steps[matched.step]) for matched in matching.holds]
    poses = [
        (hold, step.pose) for hold, step in steps if isinstance(step, HoldStep) and step.pose is not None
    ]
    holds = [hold for hold, _ in poses]
    up_b = np.array([pose.up_b / np.linalg.norm(pose.up_b) for _, pose in poses]).reshape(-1, 3)
    faces = np.abs(up_b.T) > FACE
    _require_both_ways(up_b, faces, ("hold with {} up", "hold with {} down"))
    true = session.site.gravity * up_b  # 2.9
    force = _solve(shown[holds], covariance[holds], true, None if whole else faces)
    gyro, missing = _gyro_in_poses(session, poses, up_b, faces, whole=whole)
    missing += [] if whole else ["The misalignments: the sensing axes are taken as the fixture's."]
    name = "improved-six-position" if whole else "six-position"
    return estimate_of_triads(name, _units(session), "fixture", force, gyro, missing)


def estimate_rate_test(session: Session) -> Estimate:
    """Calibrate the gyros on a table's rates, both ways about each of their axes (2.4.1.2).

    The Earth's rotation about the table's axis is added to its rate, which the thesis leaves out: 4.7e-5 rad/s of
    bias at 40°. Where the protocol names the axes, the whole matrix is estimated; where they are the faces that the
    accelerometers show up, scale factors and biases.

    Parameters
    ----------
    session : with a protocol that says the rates.

    Raises
    ------
    UsageError
        If there is no protocol.
    ObservabilityError
        If there is no gyro, an axis is not known, or was not spun about both ways.
    """
    shown, covariance = _rates_of_spins(session)
    rates = np.array([step.rate for step in _spin_steps(session)])
    axes, upward, named = _axes_of_spins(session)
    true = (rates + _vertical_earth_rate(session.site) * upward)[:, None] * axes
    along = np.abs(axes.T) > (0.5 if named else FACE)
    ways = "spin about {} counter-clockwise", "spin about {} clockwise"
    _require_both_ways(np.sign(rates)[:, None] * axes, along, ways)
    gyro = _solve(shown, covariance, true, None if named else along)
    missing = ["The accelerometers: a rate table does not show them."]
    missing += [] if named else ["The misalignments: the sensing axes are taken as those spun about."]
    missing += [_NO_LATITUDE + "biases."] if session.site.latitude is None else []
    return estimate_of_triads("rate-test", _units(session), "fixture", None, gyro, missing)


def estimate_modified_multi_position(session: Session) -> Estimate:
    """Calibrate on a single-axis table in poses that are not known (Syed et al. 2007; 2.4.2.2).

    The accelerometers' norm is that of gravity at rest; the gyros' is the table's rate and the Earth's about its
    vertical axis, instead of the Earth's alone. Both begin at the rough values of (2.5, 2.6).

    Parameters
    ----------
    session : with a protocol that says the rates.

    Raises
    ------
    UsageError
        If there is no protocol.
    ObservabilityError
        If a triad is missing, poses are too few or too alike, or the table turned one way only: what the gyros show
        beside its rate then looks like a scale factor, and no residual shows it.
    ConvergenceError
        If an adjustment does not settle.
    """
    force = _solve_norm(*_forces(session), session.site.gravity, 9)
    shown, covariance = _rates_of_spins(session)
    rates = _rates_about_up(session, force)
    if not (np.any(rates > 0.0) and np.any(rates < 0.0)):
        raise ObservabilityError(
            "The table turned one way only: the Earth's rotation and the gyros' g-sensitivity would look like scale "
            "factors. Spin both ways in every pose."
        )
    gyro = _solve_norm(shown, covariance, np.abs(rates + _vertical_earth_rate(session.site)), 9)
    missing = ["The rotation between the triads: norms do not show it, and each is given in its own axes."]
    missing += [_NO_LATITUDE + "scale factors."] if session.site.latitude is None else []
    name = "modified-multi-position"
    return estimate_of_triads(name, _units(session), "accelerometer-x", force, gyro, missing)


def estimate_multi_position(session: Session, *, unknowns: int) -> Estimate:
    """Calibrate on the norms of gravity and, if the gyros see it, the Earth's rotation (Shin and El-Sheimy; 3).

    Parameters
    ----------
    session : of holds in poses that nobody has to know.
    unknowns : of a triad: 9 (bias, scale factor, non-orthogonality), 6 (bias, scale factor) or 3 (bias).

    Raises
    ------
    ObservabilityError
        If there is no accelerometer, there are no more attitudes than unknowns or they do not tell them apart, or
        three unknowns go with raw counts, whose scale factors nobody has said.
    ConvergenceError
        If the adjustment does not settle.
    """
    units = _units(session)
    gravity = session.site.gravity
    force = _solve_norm(*_forces(session), gravity, unknowns, specific_force_factor(units[0]))
    rate, covariance = session.means.angular_rate, session.means.angular_rate_covariance
    gyro, missing = None, [_NO_GYRO]
    if rate is not None and covariance is not None:
        missing = ["The gyros: they do not see the Earth's rotation well enough in these holds."]
        try:
            found = _solve_norm(rate, covariance, EARTH_RATE, unknowns, angular_rate_factor(units[1]))
        except (ConvergenceError, ObservabilityError):
            found = None
        if found is not None and _is_seen(found, EARTH_RATE):
            gyro = found
            missing = ["The rotation between the triads: norms do not show it."]
    if unknowns < 9:
        kept = "non-orthogonalities" if unknowns == 6 else "scale factors and non-orthogonalities"
        missing.append(f"The {kept}: they are taken as nominal.")
    name = f"multi-position-{unknowns}"
    return estimate_of_triads(name, units, "accelerometer-x", force, gyro, missing)


def _solve(shown: Vectors, covariance: Matrices, true: Vectors, own: np.ndarray | None) -> FoundTriad:
    """Solve (2.11); with `own` (3, readings) for each sensor from the readings along it alone (2.5, 2.6)."""
    design = np.column_stack([true, np.ones(len(true))])
    size = np.append(np.full(3, np.max(np.abs(true))), 1.0)
    weights = np.zeros((3, 4, len(true)))
    for axis in range(3):
        rows = np.arange(len(true)) if own is None else np.flatnonzero(own[axis])
        columns = np.array([0, 1, 2, 3] if own is None else [axis, 3])
        taken = design[np.ix_(rows, columns)]
        if np.linalg.matrix_rank(taken / size[columns], tol=1e-3) < columns.size:
            raise ObservabilityError(
                "The readings do not separate matrix and bias: show each axis both ways, and the three axes apart."
            )
        weights[axis][np.ix_(columns, rows)] = np.linalg.pinv(taken)
    values = np.einsum("apk,ka->ap", weights, shown)
    spread = np.einsum("apk,kab,bqk->apbq", weights, covariance, weights).reshape(12, 12)
    estimated = np.ones((3, 3), dtype=bool) if own is None else np.eye(3, dtype=bool)
    return FoundTriad(
        values[:, :3].copy(), values[:, 3].copy(), spread[np.ix_(_MATRIX_FIRST, _MATRIX_FIRST)], estimated
    )


def _solve_norm(
    shown: Vectors,
    covariance: Matrices,
    reference: float | Series,
    unknowns: int,
    factor: float | None = None,
) -> FoundTriad:
    """Adjust the norms from the rough values of (2.5, 2.6); the nominal scale factor where none is estimated."""
    norm = float(np.median(reference))
    start = rough_triad(shown * np.reshape(norm / reference, (-1, 1)), norm)
    if unknowns == 3:
        if factor is None:
            raise ObservabilityError(
                "Biases alone are not determined in raw counts, whose scale factors are unknown."
            )
        start[SCALE] = 1.0 / factor
    found, adjustment = adjust_norm(shown, covariance, reference, start, unknowns)
    spread = np.zeros((9, 9))
    spread[:unknowns, :unknowns] = adjustment.sigma0**2 * adjustment.cofactor  # 3.36

    def entries(x: Complex) -> Complex:
        return np.concatenate([matrix_from_shin(x[SCALE], x[ANGLE]).ravel(), x[BIAS]])  # 3.13

    values, carried = propagate(entries, found[:9], spread)
    return FoundTriad(
        values[:9].reshape(3, 3),
        values[9:],
        carried,
        _ESTIMATED[unknowns],
        adjustment.sigma0,
        adjustment.redundancy,
    )


def _gyro_in_poses(
    session: Session, poses: list[tuple[int, Pose]], up_b: Vectors, faces: np.ndarray, *, whole: bool
) -> tuple[FoundTriad | None, list[str]]:
    """Return the gyros on the Earth's rotation, or the bias alone if they do not see it; and what is not determined."""
    rate, covariance, site = session.means.angular_rate, session.means.angular_rate_covariance, session.site
    if rate is None or covariance is None:
        return None, [_NO_GYRO]
    holds = [hold for hold, _ in poses]
    rate, covariance = rate[holds], covariance[holds]
    vertical = _vertical_earth_rate(site)
    if whole and site.latitude is not None and all(pose.heading is not None for _, pose in poses):
        true = np.array([pose.C_nb().T @ site.earth_rate_n for _, pose in poses])
        gyro = _solve(rate, covariance, true, None)
        if _is_seen(gyro, EARTH_RATE):
            return gyro, []
    elif vertical != 0.0:
        gyro = _solve(rate, covariance, vertical * up_b, faces)
        if _is_seen(gyro, abs(vertical)):
            unknown = ["The gyros' misalignments: the headings are not known."] if whole else []
            return gyro, unknown
    # Whatever goes up and down with the pose, (2.5) has no part of it.
    bias = _solve(rate, covariance, up_b, faces)
    spread = np.zeros((12, 12))
    spread[9:, 9:] = bias.covariance[9:, 9:]
    nominal = np.eye(3) / (angular_rate_factor(session.recording.angular_rate_unit) or 1.0)
    missing = "The gyros' scale factors: the Earth's rotation is not seen well enough; they are nominal."
    return FoundTriad(nominal, bias.bias, spread, _ESTIMATED[3]), [missing]


def _is_seen(found: FoundTriad, reference: float) -> bool:
    sigma, size = np.sqrt(np.diag(found.covariance)), np.diag(found.matrix)
    return bool(np.all(sigma[9:] < SEEN * reference * size) and np.all(sigma[[0, 4, 8]] < SEEN * size))


def _axes_of_spins(session: Session) -> tuple[Vectors, Series, bool]:
    """Return each spin's axis in b, how much of it points up, and whether the protocol names them all."""
    protocol, matching = session.matched
    factor = specific_force_factor(session.recording.specific_force_unit)
    force, gravity = session.spins.specific_force, session.site.gravity
    axes, upward, named = list[AnyArray](), list[float](), True
    for k, (matched, step) in enumerate(zip(matching.spins, _spin_steps(session), strict=True)):
        pose = _pose_before(protocol, matched.step)
        up = None if pose is None else pose.up_b / np.linalg.norm(pose.up_b)
        if up is None and force is not None and np.linalg.norm(force[k]) * (factor or 0.0) > 0.5 * gravity:
            up = force[k] / np.linalg.norm(force[k])
        axis = step.axis_b
        if axis is None and pose is not None:
            axis = up
        elif axis is None and up is not None and np.max(np.abs(up)) > 0.9:
            axis, named = np.round(up), False
        if axis is None:
            raise ObservabilityError(
                f"The axis of spin {k + 1} is not known: give it one in the protocol, or the hold before it a pose."
            )
        axes.append(axis / np.linalg.norm(axis))
        upward.append(0.0 if up is None else float(axes[-1] @ up))
    return np.array(axes), np.array(upward), named


def _rates_about_up(session: Session, force: FoundTriad) -> Series:
    """Return each spin's rate about the vertical, up: an axis in b may point down, as the accelerometers show."""
    seen, to_si = session.spins.specific_force, np.linalg.inv(force.matrix)
    steps = _spin_steps(session)
    rates = np.array([step.rate for step in steps])
    for k, step in enumerate(steps):
        if step.axis_b is not None and seen is not None:
            rates[k] *= np.sign(step.axis_b @ to_si @ (seen[k] - force.bias))
    return rates


def _spin_steps(session: Session) -> list[SpinStep]:
    protocol, matching = session.matched
    steps = [protocol.steps[matched.step] for matched in matching.spins]
    return [step for step in steps if isinstance(step, SpinStep)]


def _pose_before(protocol: Protocol, at: int) -> Pose | None:
    """Return the pose of the placement that a spin is in."""
    for step in reversed(protocol.steps[:at]):
        if isinstance(step, TurnStep):
            return None
        if isinstance(step, HoldStep) and step.pose is not None:
            return step.pose
    return None


def _vertical_earth_rate(site: Site) -> float:
    return 0.0 if site.latitude is None else float(EARTH_RATE * np.sin(site.latitude))


def _forces(session: Session) -> tuple[Vectors, Matrices]:
    means = session.means
    if means.specific_force is None or means.specific_force_covariance is None:
        raise ObservabilityError("The recording has no accelerometer: this method needs one.")
    return means.specific_force, means.specific_force_covariance


def _rates_of_spins(session: Session) -> tuple[Vectors, Matrices]:
    if session.recording.angular_rate is None or not session.matched[1].spins:
        raise ObservabilityError("No spins with a gyro's readings were found: this method needs them.")
    shown, covariance = session.spins.angular_rate, session.spins.angular_rate_covariance
    assert shown is not None
    assert covariance is not None
    return shown, covariance


def _units(session: Session) -> tuple[str, str]:
    return session.recording.specific_force_unit, session.recording.angular_rate_unit


def _require_both_ways(shown: Vectors, along: np.ndarray, words: tuple[str, str]) -> None:
    """Refuse readings that lack an axis, or one way of it, by name; `along` (3, readings) are those of each axis."""
    missing = [
        word.format("xyz"[axis])
        for axis in range(3)
        for word, way in zip(words, (1.0, -1.0), strict=True)
        if not np.any(along[axis] & (way * shown[:, axis] > 0.0))
    ]
    if missing:
        raise ObservabilityError(f"No {', no '.join(missing)} was found: record what is missing.")


_METHODS = (
    ("six-position", "biases and scale factors from each axis up and down", "(2.5) and (2.6)",
     partial(estimate_six_position, whole=False), False),
    ("improved-six-position", "the whole matrix from all axes in each pose", "(2.7) to (2.12)",
     partial(estimate_six_position, whole=True), False),
    ("rate-test", "gyros on a table's rates both ways", "2.4.1.2 with (2.5), (2.6) and (2.11)",
     estimate_rate_test, True),
    ("modified-multi-position", "norms of gravity and of a table's rate in unknown poses",
     "2.4.2.2, after Syed et al. 2007", estimate_modified_multi_position, True),
    *(
        (f"multi-position-{unknowns}", f"norms of gravity and the Earth's rotation, {words}",
         f"(3.16) to (3.57), {unknowns} unknowns a triad", partial(estimate_multi_position, unknowns=unknowns), False)
        for unknowns, words in (
            (9, "bias, scale factor and non-orthogonality"), (6, "bias and scale factor"), (3, "bias alone")
        )
    ),
)  # fmt: skip
ESTIMATORS: dict[str, Estimator] = {
    name: Estimator(name, title, f"Hayal 2010, {equations}", method, needs_protocol=needs_protocol)
    for name, title, equations, method, needs_protocol in _METHODS
}
"""Every method by name: the entry point `tumble.estimators`."""

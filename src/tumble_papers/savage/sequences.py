"""What sensor errors do to the acceleration over a sequence of rotations (Savage 2018, (3) to (5), (20), (21)).

A unit that rests, is turned about its own axes and rests again has computed its attitude with its own gyros.
What their errors have made of it tilts the computed frame, so that gravity seems to have a horizontal
part at the end; the accelerometers' errors add theirs at the start and at the end. To first order all of
it is linear in the errors: one matrix for any sequence, of which table 1's are seventeen.

The measurements are accelerations in the frame of the start ((1), (2)). From those of all sequences to the errors lead
(13) and (14), and least squares for any set of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Table, Vector, Vectors
from tumble.attitude import left_jacobian, matrix_from_rotation_vector, skew
from tumble.errors import ObservabilityError
from tumble.records import dataclass
from tumble.sensor import GROUPS, OFF_DIAGONAL, PAIRS

COMPONENTS = ("Δa x", "Δa y", "Δa z", "down at the start", "down at the end")
"""The five measurements of a sequence, in m/s², in the frame of its start."""


@dataclass(frozen=True)
class SequenceModel:
    """The first-order error model of a sequence.

    Attributes
    ----------
    coefficients : (5, 24) of the measurements (`COMPONENTS`) by Savage's errors, as `savage.NAMES`.
    bias_coefficients : (5, 3) by a gyro bias, m/s² per rad/s.
    down_start, down_end : (3,) unit vectors down in the body frame at the start and at the end.
    C_start_end : (3, 3) nominal, from the body frame at the end to that at the start.
    angle : rad, all rotations together, without sign.
    """

    coefficients: Table
    bias_coefficients: Table
    down_start: Vector
    down_end: Vector
    C_start_end: Matrix
    angle: float


def sequence_model(
    rotations: Sequence[tuple[int, float]],
    down_start: Vector,
    gravity: float,
    *,
    rate: float = 1.0,
    seconds: float = 10.0,
    share: float = 0.5,
) -> SequenceModel:
    """Return the error model of a sequence of rotations about the unit's own axes.

    Parameters
    ----------
    rotations : (axis 0 to 2, angle in rad) one after another.
    down_start : (3,) unit vector down in the body frame at the start.
    gravity : m/s².
    rate : rad/s of the rotations: how long a gyro bias adds up.
    seconds : s of each of the two measurements (T_Meas).
    share : of a measurement's time that its average lags behind its end (F_Meas): a half for plain means.

    Notes
    -----
    Savage 2018, (3) to (5). In (5) the signs of the asymmetry are those of the specific force, which is up: a
    sensor that points down at the start reads -g, and its error is +g λiii. (20) and (21) for the bias.
    """
    C_start = np.eye(3)
    tilt = np.zeros((3, 24))
    bias = np.zeros((3, 3))
    for axis, angle in rotations:
        unit = np.eye(3)[axis]
        tilt += C_start @ _rotation_errors(axis, angle)
        # The mean of the attitude over one rotation: (20) divided by its time.
        bias += C_start @ left_jacobian(angle * unit) * (abs(angle) / rate)
        C_start = C_start @ matrix_from_rotation_vector(angle * unit)
    down_end = C_start.T @ down_start
    horizontal = np.eye(3) - np.outer(down_start, down_start)
    start, end = _force_errors(down_start, gravity), _force_errors(down_end, gravity)
    towards = gravity * skew(down_start)
    coefficients = np.zeros((5, 24))
    coefficients[:3] = towards @ tilt + horizontal @ (C_start @ end - start)
    coefficients[3], coefficients[4] = down_start @ start, down_end @ end
    measured = seconds * (np.eye(3) + share * (C_start - np.eye(3)))
    bias_coefficients = np.zeros((5, 3))
    bias_coefficients[:3] = towards @ (bias + measured)
    return SequenceModel(
        coefficients,
        bias_coefficients,
        np.asarray(down_start, dtype=np.float64),
        np.asarray(down_end, dtype=np.float64),
        C_start,
        float(sum(abs(angle) for _, angle in rotations)),
    )


def _rotation_errors(axis: int, angle: float) -> Table:
    """(3, 24): the attitude error that one rotation adds, in the frame of its beginning (3)."""
    unit = np.eye(3)[axis]
    found = np.zeros((3, 24))
    found[:, GROUPS["kappa_lin"].start + axis] = unit * angle
    found[:, GROUPS["kappa_asym"].start + axis] = unit * abs(angle)
    across = np.sin(angle) * np.eye(3) + (1.0 - np.cos(angle)) * skew(unit)
    for number, (i, j) in enumerate(PAIRS):
        # κ_mis u is the column of the axis: κij = κji = υij / 2
        column = 0.5 * (np.eye(3)[i] * unit[j] + np.eye(3)[j] * unit[i])
        found[:, GROUPS["upsilon"].start + number] = across @ column
    return found


def _force_errors(down: Vector, gravity: float) -> Table:
    """(3, 24): the accelerometers' errors at rest, in the body frame (4)."""
    found = np.zeros((3, 24))
    force = -gravity * down
    found[:, GROUPS["lambda_bias"]] = np.eye(3)
    found[:, GROUPS["lambda_lin"]] = np.diag(force)
    found[:, GROUPS["lambda_asym"]] = np.diag(np.abs(force))
    for number, (i, j) in enumerate(OFF_DIAGONAL):
        found[i, GROUPS["mu"].start + number] = force[j]
    return found


def across_down(down: Vector) -> AnyArray:
    """Return (2, 3) unit vectors across a direction, along body axes where it is along one itself.

    Parameters
    ----------
    down : (3,) unit vector.
    """
    main = int(np.argmax(np.abs(down)))
    first = np.eye(3)[(main + 1) % 3]
    first = first - down * float(first @ down)
    first /= np.linalg.norm(first)
    return np.asarray(np.array([first, np.cross(down, first)]), dtype=np.float64)


AVERAGING = ("plain", "average-of-averages")


@dataclass(frozen=True)
class SequenceMeasurement:
    """What a sequence measured.

    Attributes
    ----------
    horizontal : (3,) m/s², end minus start, in the frame of the start, without its part along down.
    down_start, down_end : m/s², what the accelerometers showed of gravity too little.
    C_start_end : (3, 3) attitude at the end as computed.
    gyro_bias : (3,) rad/s, what the gyros showed before the rotations beyond the Earth rate.
    """

    horizontal: Vector
    down_start: float
    down_end: float
    C_start_end: Matrix
    gyro_bias: Vector

    @property
    def vector(self) -> Series:
        """(5,) in the order of `COMPONENTS`."""
        return np.array([*self.horizontal, self.down_start, self.down_end])


def window_weights(count: int, averaging: str) -> Series:
    """Return the weights of an average over `count` samples.

    Parameters
    ----------
    count : samples.
    averaging : one of `AVERAGING`. An average of averages is the mean over a window of the means over as long a
        window up to each of its samples: half the samples each, a triangle, which a pulse at the edges moves less.

    Raises
    ------
    ValueError
        If there is no such average.
    """
    if averaging not in AVERAGING:
        raise ValueError(f"{averaging!r} is none of {', '.join(AVERAGING)}")
    if averaging == "plain":
        return np.full(count, 1.0 / count)
    half = max((count + 1) // 2, 1)
    weights = np.convolve(np.full(half, 1.0 / half), np.full(count - half + 1, 1.0 / (count - half + 1)))
    return np.ascontiguousarray(weights)


def measure_sequence(
    rate: Vectors,
    force: Vectors,
    step: float,
    earth_rate_start: Vector,
    start: tuple[int, int],
    end: tuple[int, int],
    gravity: float,
    down_start: Vector,
    *,
    start_bias: bool = True,
    norm: bool = True,
    averaging: str = "plain",
    weights: Series | None = None,
) -> SequenceMeasurement:
    """Compute the attitude from the start of a sequence, and what gravity looks like in it before and after.

    Parameters
    ----------
    rate : (samples, 3) rad/s, compensated, the mean over each interval: a sample of the gyros' increments.
    force : (samples, 3) m/s², compensated.
    step : s between samples.
    earth_rate_start : (3,) rad/s, the Earth rate in the body frame of the start.
    start, end : half-open ranges of samples at rest.
    gravity : m/s².
    down_start : (3,) nominal unit vector down in the body frame of the start.
    start_bias : take the gyros' mean over `start`, less the Earth rate, as their bias (section 9.4).
    norm : take down as gravity less the length of the acceleration, instead of its projection on the nominal
        down, which a fixture that is off by an angle makes too short by half its square.
    averaging : see `window_weights`.
    weights : of the average at the start instead; that at the end has them the other way round.

    Raises
    ------
    ValueError
        If a range is empty or leaves the samples, or the two overlap.
    """
    from tumble.attitude import transform_sequence

    for first, last in (start, end):
        if not 0 <= first < last <= len(rate):
            raise ValueError(f"samples {first} to {last} are no range of {len(rate)} samples")
    if end[0] < start[1]:
        raise ValueError("the measurement at the end begins before that at the start is over")
    bias = np.asarray(np.mean(rate[start[0] : start[1]], axis=0) - earth_rate_start, dtype=np.float64)
    averages, C = np.zeros((2, 3)), np.zeros((3, 3))
    transform_sequence(
        np.ascontiguousarray(rate - bias if start_bias else rate),
        np.ascontiguousarray(force),
        step,
        np.ascontiguousarray(earth_rate_start),
        window_weights(start[1] - start[0], averaging) if weights is None else weights,
        start[0],
        window_weights(end[1] - end[0], averaging)
        if weights is None
        else np.ascontiguousarray(weights[::-1]),
        end[0],
        averages,
        C,
    )
    change = averages[1] - averages[0]
    lengths = np.linalg.norm(averages, axis=1)
    downs = gravity - lengths if norm else averages @ down_start + gravity
    return SequenceMeasurement(
        np.asarray(change - down_start * float(down_start @ change), dtype=np.float64),
        float(downs[0]),
        float(downs[1]),
        C,
        bias,
    )


X, Y, Z, START, END = range(5)
WITHOUT_ASYMMETRY = ("1a", "2a", "3a")


def invert_measurements(
    measurements: Mapping[str, Series], gravity: float, *, asymmetry: bool = True
) -> Series:
    """Return Savage's 24 errors from the measurements of table 1: each from the sequences made for it.

    Parameters
    ----------
    measurements : by sequence "1" to "14" and "1a" to "3a", (5,) each, m/s².
    gravity : m/s².
    asymmetry : use 1a to 3a (13); without them the gyros' asymmetry is taken as none (14).

    Raises
    ------
    ObservabilityError
        If a sequence is missing.

    Notes
    -----
    Savage 2018, (13), but for three signs: λiii = -(end - start + 2 λi) / 2g. With the printed sign the
    asymmetry is off by twice the bias over g in the first pass.
    """
    wanted = [str(k) for k in range(1, 15)] + (list(WITHOUT_ASYMMETRY) if asymmetry else [])
    missing = [name for name in wanted if name not in measurements]
    if missing:
        raise ObservabilityError(
            f"The formulas (13) need all sequences, and {', '.join(missing)} are missing."
        )
    m, g = measurements, gravity
    full = 4.0 * np.pi * g
    pairs = [
        (s * m[k][c], s * m[f"{k}a"][c] if asymmetry else -s * m[k][c])
        for k, c, s in (("2", Y, 1.0), ("1", X, -1.0), ("3", Y, -1.0))
    ]
    kappa = np.array([(one - other) / full for one, other in pairs])
    kappa_asymmetry = np.array([(one + other) / full for one, other in pairs])
    yz, zx, xy = m["4"][Y] / (4 * g), m["5"][X] / (4 * g), m["6"][Y] / (4 * g)
    bias = np.array(
        [
            -0.5 * m["14"][X] - g * zx,
            -0.5 * m["13"][Y] - g * yz,
            -0.5 * (m["7"][Z] + np.pi * g * (kappa[0] + kappa_asymmetry[0])),
        ]
    )
    mu = [
        (m["7"][X] - g * xy) / (2 * g),
        (m["8"][X] - g * zx) / (2 * g),
        (m["12"][Y] - g * xy) / (2 * g),
        (m["11"][Y] - g * yz) / (2 * g),
        (m["9"][Z] - g * zx) / (2 * g),
        (m["10"][Z] - g * yz) / (2 * g),
    ]
    downs = [m["9"], m["7"], m["8"]]
    scale = [-(d[END] + d[START]) / (2 * g) for d in downs]
    scale_asymmetry = [-(d[END] - d[START] + 2 * b) / (2 * g) for d, b in zip(downs, bias, strict=True)]
    return np.concatenate([kappa, kappa_asymmetry, [yz, zx, xy], bias, scale, scale_asymmetry, mu])


def solve_measurements(
    models: Sequence[SequenceModel],
    measurements: Sequence[Series],
    covariances: Sequence[Square],
    *,
    asymmetry: bool = True,
) -> Series:
    """Return (24,) the errors by least squares over all components of all sequences, each weighed by its noise.

    Parameters
    ----------
    models, measurements, covariances : of each sequence: its model, (5,) and (5, 5).
    asymmetry : estimate the gyros' asymmetry; without, it is none.

    Notes
    -----
    The paper takes from each sequence the one component that it was made for; here the others count too.
    """
    free = np.ones(24, dtype=bool)
    free[GROUPS["kappa_asym"]] = asymmetry
    rows: list[Table] = []
    told: list[Series] = []
    for model, measured, covariance in zip(models, measurements, covariances, strict=True):
        take = np.zeros((4, 5))
        take[:2, :3] = across_down(model.down_start)
        take[2, START] = take[3, END] = 1.0
        take = np.linalg.solve(np.linalg.cholesky(take @ covariance @ take.T), take)
        rows.append(take @ model.coefficients[:, free])
        told.append(take @ measured)
    design = np.concatenate(rows)
    size = np.linalg.norm(design, axis=0)
    errors = np.zeros(24)
    errors[free] = np.linalg.lstsq(design / size, np.concatenate(told))[0] / size
    return errors

"""What gravity tells of a recording: the gyro's scale, signs and axes, and a range that is off by two.

While the unit turns, the specific force of gravity turns in body axes by df/dt = -omega x f. Over
windows of a third of a second in which the norm of f stays near gravity, the change of f is regressed on
the integrals of f omega^T for the 3x3 matrix A in omega_true = A omega_raw. No unit of the
accelerometer is needed (both sides scale with it), only its offset must be small or be told by the
poses. What this cannot see: a reversed sign of all accelerometer axes together (f -> -f solves the
same equation), and anything if the unit does not turn about level axes.

A factor of two between a recording and what is believed of its scale: another range, or another sample rate.

Ranges of sensors are steps of two (±250, ±500, ±1000 °/s; ±2, ±4, ±8 g), and so are most sample rates. A calibration of
counts made at one range is wrong by two or four at the next, and gravity shows both: by its size at rest, and by how
fast it turns in the unit against what the gyros say.
"""

from __future__ import annotations

import itertools

import numpy as np

from tumble.arrays import AnyArray, Matrix, Table, Vector, Vectors, extremes
from tumble.errors import RecordingError
from tumble.recording.columns import renamed
from tumble.recording.recording import Recording
from tumble.recording.rest import find_quiet_stretches, fit_sphere, sample_pieces
from tumble.records import dataclass
from tumble.units import STANDARD_GRAVITY, angular_rate_factor

STEPS = (0.25, 0.5, 2.0, 4.0)
_NEAR = 0.15  # of a logarithm: how well a few turns show a scale, and how far a unit's own may be off
_WORDS = {0.25: "a quarter of", 0.5: "half", 2.0: "twice", 4.0: "four times"}


def step_of_two(ratio: float) -> float | None:
    """Return the step of two (1/4, 1/2, 2, 4) that a ratio is near, None if it is near none.

    Parameters
    ----------
    ratio : positive.

    Examples
    --------
    >>> step_of_two(2.1), step_of_two(1.1)
    (2.0, None)
    """
    near = (step for step in STEPS if ratio > 0.0 and abs(np.log(ratio / step)) < _NEAR)
    return next(near, None)


def gyro_step_words(ratio: float, rate: float) -> str | None:
    """Return which range or sample rate would explain that gravity turns so many times as fast as the gyros say.

    Parameters
    ----------
    ratio : of the turning that gravity shows to that which the gyros show.
    rate : Hz, that the gyros were added up at.
    """
    step = step_of_two(ratio)
    if step is None:
        return None
    factor = "two" if max(step, 1.0 / step) == 2.0 else "four"
    return (
        f"a factor of {factor} is another range of the gyro (as ±500 instead of ±250 °/s) or another sample rate "
        f"({rate / step:.4g} Hz instead of {rate:.4g} Hz: --rate)"
    )


def find_steps_of_two(corrected: Recording) -> list[str]:
    """Return sentences on triads of a corrected recording that are off by a step of two; none if neither is.

    Parameters
    ----------
    corrected : in m/s² and rad/s, as a calibration makes it.
    """
    if corrected.specific_force is None:
        return []
    said: list[str] = []
    quiet = find_quiet_stretches(corrected.specific_force, corrected.rate).at_least(0.5 * corrected.rate)
    norm = float(np.median(np.linalg.norm(quiet.means, axis=1))) if len(quiet) else np.nan
    step = step_of_two(norm / STANDARD_GRAVITY) if np.isfinite(norm) else None
    if step is not None:
        said.append(
            f"The corrected specific force at rest is {_WORDS[step]} gravity: such a factor is another range of the "
            "accelerometer (as ±4 instead of ±2 g) than the calibration's."
        )
    if corrected.angular_rate is None:
        return said
    scale = gyro_scale_from_gravity(corrected)
    words = gyro_step_words(scale.scale, corrected.rate) if scale is not None and scale.determined else None
    if scale is not None and words is not None:
        step = step_of_two(scale.scale)
        said.append(
            f"Gravity turns {_WORDS[step or 1.0]} as fast as the corrected gyro says: {words} than the calibration's."
        )
    return said


_WINDOW_SECONDS = 0.3
_NORM_TOLERANCE = 0.15
_LEAST_WINDOWS = 20
_LEAST_EXPLAINED = 0.7
_LEAST_TURN = 0.05  # change of the direction of gravity over a window, rad, that counts as turning
_COLUMN_NAMES = ("gx", "gy", "gz")

# e[i, l, j]: the permutation symbol.
_E = np.zeros((3, 3, 3))
for _i, _l, _j in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _E[_i, _l, _j], _E[_i, _j, _l] = 1.0, -1.0


@dataclass(frozen=True)
class AxisAgreement:
    """How the gyro's axes agree with gravity as the accelerometers see it turn.

    Attributes
    ----------
    matrix : 3x3, rad/s per raw unit: true rate = matrix @ raw rate, in the accelerometers' axes.
    standard_uncertainty : 3x3, of the matrix's elements, same unit.
    scale : rad/s per raw unit, the size of the matrix (geometric mean of its singular values).
    explained : share of the change of gravity that the gyro explains, 0 to 1.
    windows : number of windows used.
    """

    matrix: Matrix
    standard_uncertainty: Matrix
    scale: float
    explained: float
    windows: int

    @property
    def determined(self) -> bool:
        """Whether all three axes turned enough for the scale to be trusted."""
        return self._is_known_to(0.1)

    @property
    def shows_axes(self) -> bool:
        """Whether order and signs of the axes can be trusted: a wrong one is off by its whole scale, four sigmas."""
        return self._is_known_to(0.25)

    def _is_known_to(self, share: float) -> bool:
        return bool(
            self.windows >= _LEAST_WINDOWS
            and self.explained > _LEAST_EXPLAINED
            and np.max(self.standard_uncertainty) < share * abs(self.scale)
        )


@dataclass(frozen=True)
class GyroScale:
    """Scale of the gyro in rad/s per raw unit, and whether gravity determines it."""

    scale: float
    determined: bool


@dataclass(frozen=True)
class _Windows:
    change: Vectors  # of f over each window
    products: Table  # (windows, 9): integrals of f_l omega_k
    norm: float


def _collect(recording: Recording) -> _Windows | None:
    """Cut a recording, of a long one a dozen pieces, into windows in which it turns and its force is near gravity."""
    if recording.specific_force is None or recording.angular_rate is None:
        raise RecordingError("Gravity checks the gyro only if the recording has both triads.")
    signals = (recording.specific_force, recording.angular_rate, recording.time)
    cuts, rate = sample_pieces(len(recording)), recording.rate
    force, rate_raw, time = (np.concatenate([signal[c] for c in cuts]) for signal in signals)
    level = _levels(force, rate_raw, rate)
    if level is None:
        return None
    offset, norm, bias = level
    f, w = force - offset, rate_raw - bias
    size = max(3, round(_WINDOW_SECONDS * rate))
    half = max(1, size // 6)
    count = (f.shape[0] - 2 * half) // size
    if count < _LEAST_WINDOWS:
        return None
    edges = half + size * np.arange(count + 1, dtype=np.intp)
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(f, axis=0)])
    at_edges = (sums[edges + half] - sums[edges - half]) / (2 * half)
    inner = slice(half, half + size * count)
    products = np.einsum("bsl,bsk->blk", f[inner].reshape(count, size, 3), w[inner].reshape(count, size, 3))
    products = products.reshape(count, 9) / rate
    change = np.diff(at_edges, axis=0)
    near = np.abs(np.linalg.norm(at_edges, axis=1) / norm - 1.0) < _NORM_TOLERANCE
    whole = np.diff(time[edges]) < 1.5 * size / rate
    turned = np.linalg.norm(change, axis=1) > _LEAST_TURN * norm
    use = near[:-1] & near[1:] & whole & turned
    return _Windows(change[use], products[use], norm) if int(use.sum()) >= _LEAST_WINDOWS else None


def _levels(force: Vectors, rate_raw: Vectors, rate: float) -> tuple[Vector, float, Vector] | None:
    """Return the accelerometers' offset, the norm of gravity and the gyro's bias, raw units."""
    quiet = find_quiet_stretches(np.hstack([force, rate_raw]), rate).at_least(0.5 * rate)
    if not len(quiet):
        norms = np.linalg.norm(force, axis=1)
        return np.zeros(3), float(np.median(norms)), np.zeros(3)
    means = quiet.means[:, :3]
    bias = np.median(quiet.means[:, 3:], axis=0)
    norms = np.linalg.norm(means, axis=1)
    spread = float(norms.max() - norms.min()) / float(np.median(norms) or 1.0)
    if spread < 0.25 and not _has_offset(force):
        return np.zeros(3), float(np.median(norms)), bias
    sphere = fit_sphere(means)
    return None if sphere is None else (sphere[0], sphere[1], bias)


def _has_offset(force: Vectors) -> bool:
    """Offset-binary counts: every axis stays on one side of zero, far from it."""
    low, high = extremes(force)
    return bool(np.all((low * high > 0.0) & (high - low < 4.0 * np.abs(low))) and np.all(np.abs(low) > 500.0))


def _design(products: Table) -> AnyArray:
    """Rows of change_i = sum e_ilj A_jk K_lk for the nine elements of A."""
    k = products.reshape(-1, 3, 3)
    return np.einsum("ilj,wlk->wijk", _E, k).reshape(-1, 9)


def _solve(design: AnyArray, values: AnyArray, weights: AnyArray) -> AnyArray:
    """Weighted normal equations: the columns are of one size, and a few per cent are enough here."""
    weighted = design * weights[:, None]
    return np.asarray(np.linalg.pinv(weighted.T @ design) @ (weighted.T @ values), dtype=np.float64)


def _solve_robustly(design: AnyArray, values: AnyArray) -> tuple[AnyArray, AnyArray, float]:
    """Least squares with Huber's weights; returns solution, covariance and the share explained."""
    weights = np.ones(values.size)
    solution = _solve(design, values, weights)
    for _ in range(8):
        solution = _solve(design, values, weights)
        residual = values - design @ solution
        sigma = 1.4826 * float(np.median(np.abs(residual))) + 1e-300
        weights = np.minimum(1.0, 1.5 * sigma / (np.abs(residual) + 1e-300))
    residual = values - design @ solution
    explained = 1.0 - float(weights @ residual**2) / float(weights @ values**2 + 1e-300)
    variance = float(weights @ residual**2) / max(float(weights.sum()) - design.shape[1], 1.0)
    # Neighbouring windows share an edge, whose error enters both: the factor 2 allows for it.
    covariance = 2.0 * variance * np.linalg.pinv(design.T @ (design * weights[:, None]))
    return solution, covariance, explained


def axis_agreement(recording: Recording) -> AxisAgreement | None:
    """Estimate the matrix from the gyro's raw numbers to the true rate in the accelerometers' axes.

    Where the recording's gyro is in rad/s and its axes are right, the matrix is near the identity.
    The accuracy is a few per cent: enough for signs, order and unit, not for a calibration.

    Returns
    -------
    AxisAgreement, or None if the unit does not turn enough against gravity.

    Raises
    ------
    RecordingError
        If the recording lacks one of the triads.
    """
    windows = _collect(recording)
    return None if windows is None else _agreement(windows)


def _agreement(windows: _Windows) -> AxisAgreement:
    # Scaled to unit size, so that counts and rad/s are conditioned alike.
    size = float(np.sqrt(np.mean(windows.products**2))) or 1.0
    design = _design(windows.products / size)
    values = windows.change.ravel()
    solution, covariance, explained = _solve_robustly(design, values)
    matrix = solution.reshape(3, 3) / size
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(3, 3) / size
    singular = np.linalg.svd(matrix, compute_uv=False)
    scale = float(np.exp(np.mean(np.log(np.maximum(singular, 1e-300)))))
    return AxisAgreement(matrix, sigma, scale, explained, windows.change.shape[0])


def gyro_scale_from_gravity(recording: Recording) -> GyroScale | None:
    """Estimate the gyro's scale in rad/s per raw unit from how gravity turns in body axes.

    With all three axes turned it is the size of the full matrix (so that swapped axes do not matter),
    otherwise that of a single factor, which takes the axes as they are.

    Returns
    -------
    GyroScale, or None if the unit does not turn enough against gravity.

    Raises
    ------
    RecordingError
        If the recording lacks one of the triads.
    """
    windows = _collect(recording)
    if windows is None:
        return None
    agreement = _agreement(windows)
    if agreement.determined:
        return GyroScale(agreement.scale, True)
    single = _single_factor(windows)
    return GyroScale(abs(single.scale), single.determined)


def _single_factor(windows: _Windows) -> GyroScale:
    """One factor for all axes as they are, with its sign."""
    single = _design(windows.products) @ np.eye(3).ravel()
    solution, covariance, explained = _solve_robustly(single[:, None], windows.change.ravel())
    sigma = float(np.sqrt(covariance[0, 0]))
    scale = float(solution[0])
    determined = explained > _LEAST_EXPLAINED and sigma < 0.1 * abs(scale)
    return GyroScale(scale, bool(determined))


def find_axis_contradiction(recording: Recording) -> str | None:
    """Return a sentence if gravity says that gyro axes are swapped or reversed, otherwise None.

    The matrix of `axis_agreement` is compared with the 48 signed permutations; where the unit did not
    turn about all axes, one factor for all of them still shows rates that go the wrong way round. Whether
    the gyro's or the accelerometers' columns are the wrong ones, gravity alone does not tell: the
    sentence names the gyro's.

    Raises
    ------
    RecordingError
        If the recording lacks one of the triads.
    """
    windows = _collect(recording)
    if windows is None:
        return None
    agreement = _agreement(windows)
    if agreement.shows_axes:
        return describe_axis_contradiction(agreement.matrix, recording.columns)
    single = _single_factor(windows)
    reversed_ = single.determined and single.scale < 0.0
    return _axis_sentence(-np.eye(3), recording.columns) if reversed_ else None


def describe_axis_contradiction(matrix: Matrix, columns: str | None = None) -> str | None:
    """Return a sentence if a matrix from raw rates to rates in b is near another signed permutation.

    Parameters
    ----------
    matrix : rough, rad/s per raw unit; its columns may differ in size by a few tens of per cent.
    columns : of the recording, as it has them.
    """
    lengths = np.linalg.norm(matrix, axis=0)
    if not np.all(lengths > 0.0):  # a dead channel, which is said elsewhere
        return None
    direction = matrix / lengths
    permutation = nearest_signed_permutation(direction)
    far = float(np.max(np.abs(direction - permutation)))
    if far > 0.4 or np.array_equal(permutation, np.eye(3)):
        return None
    return _axis_sentence(permutation, columns)


def signed_permutations() -> list[Matrix]:
    """Return the 48 signed permutation matrices."""
    signs = list(itertools.product((1.0, -1.0), repeat=3))
    return [np.diag(s) @ np.eye(3)[list(order)] for order in itertools.permutations(range(3)) for s in signs]


def nearest_signed_permutation(matrix: Matrix) -> Matrix:
    """Return the signed permutation matrix nearest to a matrix."""
    return max(signed_permutations(), key=lambda one: float((one * matrix).sum()))


def axis_words(permutation: Matrix, letter: str) -> list[str]:
    """Return what to call three columns that a signed permutation puts in order, as "-gy"."""
    columns = np.argmax(np.abs(permutation), axis=0)
    return [f"{'-' * bool(permutation[row, i] < 0)}{letter}{'xyz'[row]}" for i, row in enumerate(columns)]


def _axis_sentence(permutation: Matrix, columns: str | None) -> str:
    """Say which gyro column seems to be which axis, and the option that puts it right."""
    parts: list[str] = []
    words = axis_words(permutation, "g")
    for axis in range(3):
        column = int(np.argmax(np.abs(permutation[axis])))
        sign = permutation[axis, column]
        if column != axis or sign < 0:
            reversed_ = " with its sign reversed" if sign < 0 else ""
            parts.append(f"the rate about {'xyz'[axis]} seems to stand in {_COLUMN_NAMES[column]}{reversed_}")
    listed = ", ".join(words)
    option = renamed(columns, dict(zip(_COLUMN_NAMES, words, strict=True)))
    if np.array_equal(permutation, -np.eye(3)):
        parts = ["the gyro turns the other way round, all its signs seem to be reversed"]
    return (
        f"The gyro's axes contradict the way gravity turns in the accelerometers: {'; '.join(parts)}. Name the "
        f"gyro's columns {listed} with --columns{option}, if the accelerometer's are right. A reversed accelerometer "
        "axis, or two swapped ones, looks the same: compare both triads with the data sheet."
    )


_SCALE_TOLERANCE = 0.15


def unit_of_scale(scale: float) -> str | None:
    """Return the unit of angular rate that a scale in rad/s per raw unit belongs to, or None."""
    for unit in ("rad/s", "deg/s", "mdeg/s"):
        factor = angular_rate_factor(unit)
        if factor is not None and abs(np.log(scale / factor)) < _SCALE_TOLERANCE:
            return unit
    return None

"""The separate calibration as one function of what was observed, so that its covariance follows from theirs.

Each triad is solved by itself in closed form, then the rotation between them, then the gyros' biases
(Zhang et al. 2010, sections 3.1 and 4). Every result is an explicit function of the observations: its
derivatives by all of them, by central differences, carry their covariance over. The observations are in
groups by what they come from, and the groups' shares are the uncertainty budget.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from tumble.arrays import AnyArray, Matrix, Series, Square, Table, Vector, Vectors, inverted
from tumble.attitude import skew
from tumble.attitude.rotations import matrices_from_rotation_vectors
from tumble.calibration.closed_forms.inter_triad import wahba_rotation
from tumble.calibration.closed_forms.rest_rates import RestSolution, solve_rests
from tumble.calibration.closed_forms.rotation_planes import axis_from_rotation
from tumble.calibration.closed_forms.separate_norms import bias_from_static_pairs, matrix_from_rotations
from tumble.records import dataclass
from tumble.sensor.conventions.shin import matrix_from_shin

# Where each unknown stands in the solution: accelerometers as Shin has them; of the gyros the
# whole matrix, biases and g-sensitivity.
FORCE, MATRIX, BIAS, SENSITIVITY = slice(0, 9), slice(9, 18), slice(18, 21), slice(21, 30)
# Of a central difference, in standard deviations: the solution is smooth over far more than that.
STEP = 0.1

GROUPS = (
    "holds, accelerometers",
    "holds, gyros",
    "rotations, gyros",
    "rotations, accelerometers",
    "table's angles",
)
"""What the observations come from, in the order of the inputs."""


@dataclass(frozen=True, slots=True)
class TurntableInputs:
    """What the solution is made from, in raw units, with covariances.

    Attributes
    ----------
    force : (9,) of the accelerometers, as Shin has them.
    force_covariance : (9, 9).
    rotation : (pairs, 3) raw·s, without bias and Earth rate.
    rotation_covariance : (pairs, 3, 3).
    angle, angle_sigma : (pairs,) rad.
    plane : (planes,) which pair each plane belongs to.
    normal : (planes, 3) in the space of raw accelerometer readings.
    tangent : (planes, 2, 3) the same of the two directions that the normal can move in.
    normal_covariance : (planes, 2, 2).
    rest : (rests, 3) raw gyro means at rest.
    rest_covariance : (rests, 3, 3).
    rest_force : (rests, 3) raw accelerometer means of the same rests.
    vertical_rate, horizontal_rate : rad/s, the Earth rate's parts upwards and across; None where the gyros see it
        and no latitude is known.
    """

    force: Series
    force_covariance: Square
    rotation: Vectors
    rotation_covariance: AnyArray
    angle: Series
    angle_sigma: Series
    plane: np.ndarray
    normal: Vectors
    tangent: AnyArray
    normal_covariance: AnyArray
    rest: Vectors
    rest_covariance: AnyArray
    rest_force: Vectors
    vertical_rate: float | None
    horizontal_rate: float

    @property
    def moves(self) -> list[slice]:
        """Where each of `GROUPS` stands in the vector of all inputs' changes."""
        sizes = [9, self.rest.size, self.rotation.size, 2 * len(self.plane), len(self.angle)]
        ends = np.cumsum([0, *sizes])
        return [slice(a, b) for a, b in pairwise(ends.tolist())]

    @property
    def unchanged(self) -> Series:
        """A vector of changes that are all zero."""
        return np.zeros(9 + self.rest.size + self.rotation.size + 2 * len(self.plane) + len(self.angle))

    def covariance(self) -> Square:
        """Return the covariance of all inputs, in the order of `GROUPS`."""
        held, rest, turned, planes, angles = self.moves
        full = np.zeros((angles.stop, angles.stop))
        full[held, held] = self.force_covariance
        for blocks, start in (
            (self.rest_covariance, rest.start),
            (self.rotation_covariance, turned.start),
            (self.normal_covariance, planes.start),
        ):
            size = blocks.shape[-1] if len(blocks) else 0
            for k, block in enumerate(blocks):
                at = slice(start + k * size, start + (k + 1) * size)
                full[at, at] = block
        full[angles, angles] = np.diag(self.angle_sigma**2)
        return full


@dataclass(slots=True)
class TurntableSystem:
    """The solution as a function of changes of the inputs.

    Attributes
    ----------
    inputs : the observations.
    weights : (pairs,) of the squared norms.
    rotation_ob : (3, 3) R_p^o about which the inter-triad angles are linear.
    gain : (3, 2 planes) from what the axes miss to the change of R; None where axes do not tell it.
    by_pairs : biases by the norms of static pairs (24), (25), instead of by the vertical Earth rate.
    with_sensitivity : estimate the g-sensitivity with the biases.
    """

    inputs: TurntableInputs
    weights: Series
    rotation_ob: Matrix
    gain: Table | None
    by_pairs: bool
    with_sensitivity: bool

    @staticmethod
    def of(inputs: TurntableInputs, *, with_sensitivity: bool = False) -> TurntableSystem:
        """Weigh the pairs and the axes by how well they are known.

        Parameters
        ----------
        inputs : the observations.
        with_sensitivity : estimate the g-sensitivity with the biases, where these are not by pairs.

        Raises
        ------
        ObservabilityError
            If the rotation axes do not tell the gyros' six parameters.
        """
        weights = _pair_weights(inputs)
        by_pairs = inputs.vertical_rate is None
        system = TurntableSystem(
            inputs, weights, np.eye(3), None, by_pairs, with_sensitivity and not by_pairs
        )
        if len(inputs.plane):
            axes_o, axes_p = system.axes(inputs.unchanged)
            system.rotation_ob = wahba_rotation(axes_o, axes_p)
            system.gain = system.best_gain()
        return system

    def axes(self, change: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Return (..., planes, 3) unit axes as the gyros and as the accelerometers see them, in o and in p.

        Parameters
        ----------
        change : (..., inputs) of all inputs; as of all functions here, of many cases at once.
        """
        i = self.inputs
        held, _, turned, planes, _ = i.moves
        rotation = i.rotation + _rows(change[..., turned], 3)
        axes_o = axis_from_rotation(self.gyro_factor(change)[..., None, :, :], rotation[..., i.plane, :])
        normal = i.normal + np.einsum("...kj,kji->...ki", _rows(change[..., planes], 2), i.tangent)
        axes_p = normal @ _force_matrix(i.force + change[..., held])
        return axes_o, axes_p / np.linalg.norm(axes_p, axis=-1, keepdims=True)

    def gyro_factor(self, change: AnyArray) -> AnyArray:
        """Return the gyros' (..., 3, 3) lower-triangular matrix in o, raw per rad/s.

        Parameters
        ----------
        change : (..., inputs) of all inputs.
        """
        i = self.inputs
        _, _, turned, _, angles = i.moves
        rotation = i.rotation + _rows(change[..., turned], 3)
        return matrix_from_rotations(rotation, i.angle + change[..., angles], self.weights)

    def missed(self, change: AnyArray) -> AnyArray:
        """Return (..., 2 planes) what the two axes of each plane miss one another by, across the axis, rad.

        Parameters
        ----------
        change : (..., inputs) of all inputs.
        """
        axes_o, axes_p = self.axes(change)
        expected = axes_p @ self.rotation_ob.T
        off = np.einsum("kij,...kj->...ki", self._across(), axes_o - expected)
        return off.reshape(*off.shape[:-2], -1)

    def _across(self) -> AnyArray:
        """(planes, 2, 3) unit vectors in o across each axis, the same for all changes."""
        raw = self.inputs.normal @ _force_matrix(self.inputs.force)
        return np.array([_two_across(self.rotation_ob @ axis) for axis in raw])

    def best_gain(self) -> Table:
        """Return the gain that weighs what the axes miss by its covariance: the least variance that axes allow.

        An axis along x is not moved by the accelerometers' misalignments, one along z by two of them: their
        share in the covariance is what makes the choice of axes that the paper leaves to the user.
        """
        slope = self._slope()
        precision = np.linalg.pinv(self.missed_covariance(), hermitian=True)
        normal = slope.T @ precision @ slope
        return np.asarray(np.linalg.solve(normal, slope.T @ precision), dtype=np.float64)

    def _slope(self) -> Table:
        """(2 planes, 3) of what is missed by a turn of R."""
        across = self._across()
        raw = self.inputs.normal @ _force_matrix(self.inputs.force)
        raw /= np.linalg.norm(raw, axis=1, keepdims=True)
        # R = exp([δ×]) R0 moves the expected axis by δ × axis, and what is missed by minus that
        rows = [t @ skew(self.rotation_ob @ axis) for t, axis in zip(across, raw, strict=True)]
        return np.concatenate(rows)

    def missed_covariance(self) -> Square:
        """Return (2 planes, 2 planes) of `missed`."""
        covariance = self.inputs.covariance()
        derivatives = _derivatives(self.missed, np.sqrt(np.diag(covariance)))
        return derivatives @ covariance @ derivatives.T

    def axes_residuals(self, change: Series) -> tuple[Series, Series]:
        """Return (planes,) angles between the axes of both triads after the fit, and the sigma of a component, rad.

        Parameters
        ----------
        change : of all inputs.
        """
        left = self._left(change).reshape(-1, 2)
        sigma = np.sqrt(np.diag(self.missed_covariance()).reshape(-1, 2).mean(axis=1))
        return np.linalg.norm(left, axis=1), sigma

    def axes_test(self, change: Series) -> tuple[float, int]:
        """Return the square sum of what the axes leave by its covariance, and its degrees of freedom.

        Parameters
        ----------
        change : of all inputs.
        """
        left = self._left(change)
        precision = np.linalg.pinv(self.missed_covariance(), hermitian=True)
        return float(left @ precision @ left), left.size - 3

    def _left(self, change: Series) -> Series:
        missed = self.missed(change)
        return missed if self.gain is None else missed - self._slope() @ (self.gain @ missed)

    def solve(self, change: AnyArray) -> AnyArray:
        """Return the (..., 30) unknowns for inputs changed by `change`.

        Parameters
        ----------
        change : (..., inputs) of all inputs.
        """
        held, rests, *_ = self.inputs.moves
        force, factor, cases = (
            self.inputs.force + change[..., held],
            self.gyro_factor(change),
            change.shape[:-1],
        )
        C_ob = self.rotation_ob
        if self.gain is not None:
            turned = -(self.missed(change) @ self.gain.T)
            C_ob = matrices_from_rotation_vectors(turned.reshape(-1, 3)).reshape(factor.shape) @ C_ob
        matrix = factor @ C_ob
        rest = self.inputs.rest + _rows(change[..., rests], 3)
        made = np.zeros((*cases, SENSITIVITY.stop))
        made[..., FORCE], made[..., MATRIX] = force, matrix.reshape(*cases, 9)
        if self.by_pairs:
            weights = _rest_weights(matrix, self.inputs.rest_covariance)
            made[..., BIAS] = bias_from_static_pairs(matrix, rest, weights)
            return made
        for at in np.ndindex(*cases):
            told = self.rests(matrix[at], force[at], rest[at], with_sensitivity=self.with_sensitivity)
            made[at][BIAS], made[at][SENSITIVITY] = told.bias, told.sensitivity.ravel()
        return made

    def rests(self, matrix: Matrix, force: Series, rest: Vectors, *, with_sensitivity: bool) -> RestSolution:
        """Return what the gyros show at rest.

        Parameters
        ----------
        matrix : (3, 3) of the gyros.
        force : (9,) of the accelerometers.
        rest : (rests, 3) raw gyro means.
        with_sensitivity : estimate the g-sensitivity too.
        """
        i = self.inputs
        assert i.vertical_rate is not None
        return solve_rests(
            matrix,
            rest,
            i.rest_covariance,
            _corrected(force, i.rest_force),
            i.vertical_rate,
            i.horizontal_rate,
            with_sensitivity=with_sensitivity,
        )

    def covariance(self) -> tuple[Square, list[Square]]:
        """Return the covariance (30, 30) of the unknowns, and the share of each of `GROUPS` in it."""
        inputs = self.inputs.covariance()
        derivatives = _derivatives(self.solve, np.sqrt(np.diag(inputs)))
        shares = [derivatives[:, at] @ inputs[at, at] @ derivatives[:, at].T for at in self.inputs.moves]
        return np.asarray(sum(shares), dtype=np.float64), shares


def _corrected(force: Series, raw: Vectors) -> Vectors:
    return (raw - force[:3]) @ inverted(_force_matrix(force)).T


def _force_matrix(force: AnyArray) -> AnyArray:
    """The accelerometers' (..., 3, 3) matrix of (..., 9) unknowns."""
    made = matrix_from_shin(np.moveaxis(force[..., 3:6], -1, 0), np.moveaxis(force[..., 6:9], -1, 0))
    return np.moveaxis(np.asarray(made, dtype=np.float64), (0, 1), (-2, -1))


def _rows(values: AnyArray, size: int) -> AnyArray:
    """(..., rows, size) of (..., rows times size) values."""
    return values.reshape(*values.shape[:-1], -1, size)


def _pair_weights(inputs: TurntableInputs) -> Series:
    """One over the relative variance of each pair's squared norm, roughly: a table that stopped early weighs less."""
    length = np.linalg.norm(inputs.rotation, axis=1)
    along = inputs.rotation / length[:, None]
    noise = np.einsum("ki,kij,kj->k", along, inputs.rotation_covariance, along) / length**2
    return 1.0 / np.maximum(noise + (inputs.angle_sigma / inputs.angle) ** 2, 1e-24)


def _rest_weights(matrix: AnyArray, covariance: AnyArray) -> AnyArray:
    inverse = inverted(matrix)
    return 1.0 / np.einsum("...ij,kjl,...il->...k", inverse, covariance, inverse)


def _two_across(axis: Vector) -> Table:
    """Two unit vectors across an axis and across one another."""
    unit = axis / np.linalg.norm(axis)
    other = np.eye(3)[int(np.argmin(np.abs(unit)))]
    first = np.cross(unit, other)
    first /= np.linalg.norm(first)
    return np.asarray(np.array([first, np.cross(unit, first)]), dtype=np.float64)


def _derivatives(function: Callable[[AnyArray], AnyArray], sigma: Series) -> Table:
    """Central differences over a tenth of a standard deviation either way."""
    step = STEP * sigma
    either = function(np.concatenate([np.diag(step), np.diag(-step)]))
    forward, backward = either[: sigma.size], either[sigma.size :]
    # What has no noise moves nothing.
    return ((forward - backward) / (2.0 * np.where(step > 0.0, step, 1.0))[:, None]).T

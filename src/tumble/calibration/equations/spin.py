"""The conditions of a gyro on a rate table whose rates are known: one group for each placement.

In a spin s of placement c the gyro shows, averaged over whole revolutions,

    raw_s = u + asymmetry * |u| + quadratic * u² + bias_c,   u = matrix @ r_s,   r_s = rate_s * axis_c,

with the rate against the Earth. `bias_c` is the placement's own: in it are the bias, what the gyro sees
of the Earth's rotation about the table's axis, and its g-sensitivity to gravity along that axis. At
rest on the table r is zero, and the horizontal Earth rate, of unknown heading, is added to the noise.
Rests between the spins follow a bias that wanders: rows of a placement are correlated as a walk's.

A placement that is off by theta turns the rate vectors of all its spins alike, by ``-theta x r_s``: the
spins of a group are correlated, and a misalignment is told by placements, however many spins each has.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Matrices, Matrix, Series, Square, Table, Vectors, inverted
from tumble.estimation import Linearisation
from tumble.records import dataclass
from tumble.segmentation import SpinMeans
from tumble.sensor import Triad

# Share of its rate within which the mean rate of the best tables repeats.
STEADIEST = 1e-7
MATRIX, ASYMMETRY, QUADRATIC, BIASES = slice(0, 9), slice(9, 12), slice(12, 15), 15


@dataclass(frozen=True, slots=True)
class SpinReadings:
    """Mean raw rates on the table, padded to (placements, rows) in order of time; each rest is a row too.

    Attributes
    ----------
    observed, covariance : (placements, rows, 3), (placements, rows, 3, 3) raw.
    rate : (placements, rows, 3) rad/s, rate against the Earth times axis; zero at rest.
    share : (placements, rows) standard uncertainty of the rate as a share of it.
    unseen : (placements, 3, 3) (rad/s)², covariance of the horizontal Earth rate, which is seen at rest.
    time : (placements, rows) s, the middle of each row.
    spin : (placements, rows) index of the spin, -1 at rest, -2 for padding.
    sigma : (placements,) rad, of the placement about each axis.
    """

    observed: AnyArray
    covariance: AnyArray
    rate: AnyArray
    share: AnyArray
    unseen: AnyArray
    time: AnyArray
    spin: np.ndarray
    sigma: Series

    @property
    def placements(self) -> int:
        """Number of placements."""
        return int(self.sigma.size)

    @property
    def active(self) -> np.ndarray:
        """(placements, rows) of bool, False for padding."""
        return self.spin > -2

    def inner_square_sum(self, matrix: Matrix, terms: int, wander: float) -> tuple[float, int]:
        """Return how the rows of each placement contradict one another, and how many checks that is.

        Each sensor of each placement is given a straight line of its own over the rates, with `terms`
        (0 to 2: the size of the rate, and its square) more; axis and bias of the placement do not matter.

        Parameters
        ----------
        matrix : rough, raw per rad/s.
        wander : rad/s, as for `SpinConditions`.
        """
        total, checks = 0.0, 0
        for c in range(self.placements):
            use = self.active[c]
            axis = self.rate[c, np.argmax(np.linalg.norm(self.rate[c], axis=1))]
            along = self.rate[c, use] @ axis / (axis @ axis)
            columns = [np.ones_like(along), along, np.abs(along), along**2]
            design = np.kron(np.column_stack(columns[: 2 + terms]), np.eye(3))
            # The table's rate is wrong for all three sensors alike: they are looked at together.
            raw = np.swapaxes(self.row_covariance(c, matrix, wander)[use][:, use], 1, 2)
            factor: Square = np.asarray(
                np.linalg.cholesky(raw.reshape(2 * (design.shape[0],))), dtype=np.float64
            )
            whiten = inverted(factor)
            # Projected on what the columns leave: the rows' own basis, without solving for a line.
            basis, size, _ = np.linalg.svd(whiten @ design, full_matrices=False)
            basis = basis[:, size > 1e-9 * size[0]]
            # Less their mean first, which a basis of raw counts would only tell to round-off.
            seen: AnyArray = self.observed[c, use]
            shown: AnyArray = whiten @ (seen - seen.mean(axis=0)).ravel()
            off: AnyArray = shown - basis @ (basis.T @ shown)
            total += float(off @ off)
            checks += design.shape[0] - int(basis.shape[1])
        return total, checks

    def row_covariance(self, c: int, matrix: Matrix, wander: float) -> AnyArray:
        """Return (rows, rows, 3, 3) raw: all that is not the placement's of placement `c`."""
        rate, rows = self.rate[c], self.spin.shape[1]
        own = np.einsum("r,ri,rj->rij", self.share[c] ** 2, rate, rate)
        rest = (self.spin[c] == -1).astype(float)
        # The table may stop at the same heading each time, or not: both are allowed for.
        seen = np.outer(rest, rest) + np.diag(rest)
        si = seen[:, :, None, None] * self.unseen[c] + self._wandering(c, wander)[:, :, None, None] * np.eye(
            3
        )
        for row in range(rows):
            si[row, row] += own[row]
        raw = matrix @ si @ matrix.T
        for row in range(rows):
            raw[row, row] += self.covariance[c, row]
        return raw

    def _wandering(self, c: int, wander: float) -> Table:
        """Return (rows, rows) (rad/s)²: a bias that wanders, half from row to row, half as a random walk.

        Flicker lies between the two. The walk begins with the placement, whose bias is its own.
        """
        time = self.time[c] - self.time[c, 0]
        spacing = max(float(np.max(time[self.active[c]])) / max(int(self.active[c].sum()) - 1, 1), 1e-9)
        walk: Table = np.minimum.outer(time, time) / spacing
        return 0.5 * wander**2 * (np.eye(time.size) + np.maximum(walk, 0.0))


class SpinConditions:
    """Conditions for the adjustment: matrix (9), asymmetry, quadratic, then each placement's bias.

    Parameters
    ----------
    readings : see there.
    values : (15 + 3 placements,) those not in `free` stay. The covariance and the own input of asymmetry
        and quadratic term are seen through their matrix and stay as the unknowns move: conditions
        without a kink, adjusted two or three times.
    free : indices of the unknowns to adjust.
    placement : rad, joined to the readings' placement sigmas.
    wander : rad/s, of the bias from row to row beyond the noise.
    """

    def __init__(
        self, readings: SpinReadings, values: Series, free: np.ndarray, placement: float, wander: float
    ) -> None:
        self.readings, self.values, self.free = readings, values.astype(float), free
        self.sigma = np.hypot(readings.sigma, placement)
        self.wander = wander

    def full(self, parameters: Series) -> Series:
        """Return all unknowns with the free ones replaced."""
        values = self.values.copy()
        values[self.free] = parameters
        return values

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise at `parameters` (the free unknowns)."""
        readings, full = self.readings, self.full(parameters)
        groups, rows = readings.spin.shape
        matrix = full[MATRIX].reshape(3, 3)
        before = self.values[MATRIX].reshape(3, 3)
        # What each sensor was shown, the tilt of its placement with it: no nominal axis has that.
        shown = (readings.observed - self.values[BIASES:].reshape(groups, 1, 3)).reshape(-1, 3)
        sensors = Triad(before, np.zeros(3), self.values[ASYMMETRY], self.values[QUADRATIC])
        u = sensors.own_input(shown).reshape(groups, rows, 3)
        biases = full[BIASES:].reshape(groups, 1, 3)
        terms = full[ASYMMETRY] * np.abs(u) + full[QUADRATIC] * u**2
        misclosure = readings.rate @ matrix.T + terms + biases - readings.observed
        design = np.zeros((groups, rows, 3, full.size))
        for i in range(3):
            design[:, :, i, 3 * i : 3 * i + 3] = readings.rate
            design[:, :, i, ASYMMETRY.start + i] = np.abs(u[:, :, i])
            design[:, :, i, QUADRATIC.start + i] = u[:, :, i] ** 2
            for c in range(groups):
                design[c, :, i, BIASES + 3 * c + i] = 1.0
        return Linearisation.masked(
            misclosure.reshape(groups, -1),
            design.reshape(groups, 3 * rows, -1)[:, :, self.free],
            self._covariance(before),
            np.repeat(readings.active, 3, axis=1),
        )

    def adjust_observations(self, multipliers: AnyArray) -> None:
        """Do nothing: the conditions are linear in the observations."""

    def _covariance(self, matrix: Matrix) -> AnyArray:
        """Return (groups, 3 rows, 3 rows) raw: noise of each row, and the placement common to them."""
        readings = self.readings
        groups, rows = readings.spin.shape
        r, variance = readings.rate, self.sigma[:, None, None, None, None] ** 2
        along = np.einsum("gsi,gtj->gstij", r, r)
        across = np.einsum("gsi,gti->gst", r, r)[..., None, None] * np.eye(3) - np.swapaxes(along, 3, 4)
        # Along the axis of second order only; 2: see `placement`.
        shown = variance * across + 2.0 * variance**2 * along
        raw = matrix @ shown @ matrix.T
        for c in range(groups):
            raw[c] += readings.row_covariance(c, matrix, self.wander)
        return np.swapaxes(raw, 2, 3).reshape(groups, 3 * rows, 3 * rows)

    def mean_shift(self, full: Series) -> AnyArray:
        """Return (groups, 3 rows) raw: what tilts of second order take off on average."""
        groups, rows = self.readings.spin.shape
        matrix = full[MATRIX].reshape(3, 3)
        shift = -(self.sigma**2)[:, None, None] * (self.readings.rate @ matrix.T)
        return shift.reshape(groups, 3 * rows)


def spin_covariance(spins: SpinMeans) -> Matrices:
    """Return the covariance of the spins' mean rates, raw, with what no table is steadier than.

    Without noise at all (a simulation's) an adjustment has nothing to weigh by.

    Raises
    ------
    ValueError
        If the spins have no rates.
    """
    if spins.angular_rate is None or spins.angular_rate_covariance is None:
        raise ValueError("the spins have no angular rate")
    size = 0.5 * float(np.max(np.ptp(spins.angular_rate, axis=0)))
    return spins.angular_rate_covariance + (STEADIEST * size) ** 2 * np.eye(3)


def padded(items: list[list[AnyArray]], rows: int) -> AnyArray:
    """Return lists of equally shaped arrays as one array, short lists filled with zeros."""
    shape = items[0][0].shape
    array = np.zeros((len(items), rows, *shape))
    for at, item in enumerate(items):
        for row, value in enumerate(item):
            array[at, row] = value
    return array


def combined_mean(observed: Vectors, covariance: Matrices) -> tuple[AnyArray, AnyArray]:
    """Return the weighted mean of several means of the same, and its covariance."""
    weights: AnyArray = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    spread = inverted(weights.sum(axis=0))
    return spread @ np.einsum("kij,kj->i", weights, observed), spread

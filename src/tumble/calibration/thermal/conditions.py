"""The equations of a thermal test: what both triads show at rest, at many temperatures, in one adjustment.

A point is a short rest at the sensor's temperature T, with dT/dt and the state s of the hysteresis. With
``M(T) = M0 + sum_k M_k f_k(T)`` and ``b(T) = b0 + sum_k b_k f_k(T) + r dT/dt + h s``:

- alone in its pose: the corrected specific force has the norm of gravity (the multi-position test);
- one of several in one pose: ``raw = M(T) f + b(T)`` with the same specific force f for all, whose direction is
  unknown; f has the norm of gravity, or where no pose tells scale factors from biases, no norm at all;
- the gyros: ``raw = b(T) + nominal (Earth rate) + G f``. The Earth rate's vertical part is known with the
  latitude; its horizontal part is unknown in each placement, with the size that it has.

All raw numbers are divided by one nominal scale factor beforehand, so that they are near SI.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray, Series, Table, Vectors
from tumble.calibration.thermal.layout import ENTRIES, Layout, ThermalTerms
from tumble.calibration.thermal.points import ThermalPoints
from tumble.estimation import Linearisation, Prior

# What is known of the lag before: sensors inside a case are some tens of seconds behind a thermometer beside them.
LAG_PRIOR, LAG_SIGMA = 60.0, 60.0  # s
WIDTH_PRIOR, WIDTH_SIGMA = 5.0, 3.0  # K
LEAST_WIDTH = 0.5
HELD = 1e-3  # s, K: of lag and width where they are not to move
# One sigma of an element of the g-sensitivity of consumer units, 0.1 °/s in 1 g.
G_SENSITIVITY = 1.8e-4  # (rad/s)/(m/s²)
SAME_POSE = np.radians(10.0)
# Steps of the numerical derivatives by lag and width: small against what they are known to.
LAG_STEP, WIDTH_STEP = 10.0, 0.5


class ThermalConditions:
    """`Conditions` for the adjustment: six rows a point, three of each triad, in near SI.

    Parameters
    ----------
    points : raw numbers divided by the nominal scale factors.
    terms : the unknowns.
    gravity : m/s².
    earth : rad/s, the Earth rate's vertical part, one sigma of each component across it, and one sigma of
        each component besides, where no latitude is known.
    lag, width : s and K, where they are not unknown.
    start : values to begin from, as `Layout` has them.
    """

    def __init__(
        self,
        points: ThermalPoints,
        terms: ThermalTerms,
        gravity: float,
        earth: tuple[float, float, float],
        lag: float,
        width: float,
    ) -> None:
        self.points, self.terms, self.gravity, self.earth = points, terms, gravity, earth
        self.lag, self.width = lag, width
        placement, counts = np.unique(points.placement, return_counts=True)
        # Which placement has unknowns of its own: those with several points.
        several = placement[counts > 1]
        self.own = np.searchsorted(several, points.placement)
        self.own = np.where(np.isin(points.placement, several), self.own, -1)
        self.layout = Layout(terms, points.force is not None, points.rate is not None, several.size)
        self.extra = {"force": 0.0, "rate": 0.0}
        self.active = self.rows()
        # Base directions of the placements with several points, and the force there where it is free.
        self.directions = np.zeros((several.size, 3))
        self.tangents = np.zeros((several.size, 3, 2))
        # How a point's noise enters its three force equations: (points, 3 equations, 3 axes).
        self.force_noise = np.repeat(np.eye(3)[None], len(points), axis=0)
        self.middle: Table | None = None
        self.slopes: dict[str, Table] = {}
        if points.force is not None:
            for k in range(several.size):
                mean = points.force[self.own == k].mean(axis=0)
                self._point_along(k, mean / np.linalg.norm(mean))
        # The pose that most points have, where one has several.
        self.main: Series | None = None
        if points.force is not None and several.size:
            self.main = self.directions[int(np.argmax(np.bincount(self.own[self.own >= 0])))]

    def _point_along(self, k: int, direction: Series) -> None:
        self.directions[k] = direction
        helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
        first = np.cross(direction, helper)
        first /= np.linalg.norm(first)
        self.tangents[k] = np.column_stack([first, np.cross(direction, first)])

    def rows(self) -> np.ndarray:
        """Return (points, 6) of bool: which equations there are."""
        active = np.zeros((len(self.points), 6), dtype=bool)
        if self.points.force is not None:
            active[:, 0] = (self.own >= 0) | (self.terms.poses > 0)
            active[:, 1] = active[:, 2] = self.own >= 0
        if self.points.rate is not None:
            active[:, 3:] = True
        return active

    def start(self) -> Series:
        """Return start values: nominal, with the mean rate as the gyros' bias."""
        layout, values = self.layout, np.zeros(self.layout.size)
        if self.points.force is not None and self.terms.poses:
            values[layout.places["M0"]][:3] = 1.0
        if self.points.rate is not None:
            values[layout.places["gb0"]] = self.points.rate.mean(axis=0)
        if self.terms.lag:
            values[layout.places["lag"]] = self.lag
        if self.terms.width:
            values[layout.places["width"]] = self.width
        if self.points.force is not None and not self.terms.poses:
            place = layout.places["directions"]
            means = [self.points.force[self.own == k].mean(axis=0) for k in range(self.directions.shape[0])]
            values[place] = np.array(means).ravel()
        return values

    def prior(self, *, held: bool = False) -> Prior:
        """Return what is known beforehand: of the lag, of the loop's width, of the Earth rate's size.

        Parameters
        ----------
        held : hold lag and width where they are.
        """
        layout = self.layout
        mean, precision = np.zeros(layout.size), np.zeros(layout.size)
        if self.terms.lag:
            mean[layout.places["lag"]], precision[layout.places["lag"]] = LAG_PRIOR, LAG_SIGMA**-2
        if self.terms.width:
            mean[layout.places["width"]], precision[layout.places["width"]] = WIDTH_PRIOR, WIDTH_SIGMA**-2
        for name, at in (("lag", self.lag), ("width", self.width)):
            if held:
                mean[layout.places[name]], precision[layout.places[name]] = at, HELD**-2
        if self.terms.doubt is not None:
            for name, sigma in zip(("r", "gr"), self.terms.doubt, strict=True):
                if name in layout.places:
                    precision[layout.places[name]] = max(sigma, 1e-12) ** -2
        if self.points.rate is not None:
            precision[layout.places["earth"]] = np.repeat(self._offsets(), 3) ** -2.0
        return Prior(mean, np.diag(precision))

    def _offsets(self) -> Series:
        """Return one sigma of what each placement adds to the gyros' biases: the Earth rate, and g-sensitivity."""
        pulled = self._pulled(self.directions)
        offsets: Series = np.sqrt(max(self.earth[1], 1e-9) ** 2 + pulled**2)
        return offsets

    def _pulled(self, directions: Vectors) -> Series:
        """Return one sigma of what a g-sensitivity that poses do not tell adds in these, beside that of the main one.

        Biases are then those of the pose that most points have, g-sensitivity included.
        """
        if self.terms.poses == 9 or self.main is None:
            return np.zeros(len(directions))
        # In counts nobody knows what a g-sensitivity comes to: a pose then determines nothing of another's.
        usual = G_SENSITIVITY * self.gravity if self.earth[1] > 0.0 else 1e6
        apart = np.linalg.norm(directions - self.main, axis=1)
        pulled: Series = usual * np.where(apart > SAME_POSE, apart, 0.0)
        return pulled

    def functions(self, values: Series) -> Table:
        """Return (points, functions + 2): the line in lag and width about where they were last centred."""
        lag, width = self._path(values)
        functions = self._at_centre()
        for name, moved in (("lag", lag - self.lag), ("width", width - self.width)):
            if name in self.slopes:
                functions = functions + moved * self.slopes[name]
        return functions

    def centre(self, values: Series) -> float:
        """Begin the lines in lag and width anew at `values`; return how far they have moved, in steps."""
        lag, width = self.lag_and_width(values)
        moved = max(abs(lag - self.lag) / LAG_STEP, abs(width - self.width) / WIDTH_STEP)
        self.lag, self.width = lag, width
        self.slopes = self._slopes()
        return moved

    def lag_and_width(self, values: Series) -> tuple[float, float]:
        """Return lag (s) and width (K), which are not below what they can be."""
        lag, width = self._path(values)
        return max(lag, 0.0), max(width, LEAST_WIDTH)

    def _path(self, values: Series) -> tuple[float, float]:
        """Return lag and width as they are among the unknowns."""
        lag = float(values[self.layout.places["lag"]][0]) if self.terms.lag else self.lag
        width = float(values[self.layout.places["width"]][0]) if self.terms.width else self.width
        return lag, width

    def _at_centre(self) -> Table:
        if self.middle is None:
            self.middle = self.points.functions(self.terms.basis, self.lag, self.width)
        return self.middle

    def _slopes(self) -> dict[str, Table]:
        """Return how the functions change with lag and width: (points, functions + 2) each.

        Over steps that the thermometer's noise and the dead band of the hysteresis do not make rough.
        """
        basis, points = self.terms.basis, self.points
        self.middle = points.functions(basis, self.lag, self.width)
        slopes: dict[str, Table] = {}
        if self.terms.lag:
            low = max(self.lag - LAG_STEP, 0.0)
            above, below = (points.functions(basis, lag, self.width) for lag in (self.lag + LAG_STEP, low))
            slopes["lag"] = (above - below) / (self.lag + LAG_STEP - low)
        if self.terms.width:
            low = max(self.width - WIDTH_STEP, LEAST_WIDTH)
            above, below = (
                points.functions(basis, self.lag, width) for width in (self.width + WIDTH_STEP, low)
            )
            slopes["width"] = (above - below) / (self.width + WIDTH_STEP - low)
        return slopes

    def matrices(self, values: Series, functions: Table) -> AnyArray:
        """Return (points, 3, 3) of the accelerometers' matrix."""
        layout = self.layout
        matrix = np.repeat(np.eye(3)[None], len(functions), axis=0)
        count = layout.entries
        if count:
            own = np.repeat(values[layout.places["M0"]][None], len(functions), axis=0)
            used = self.terms.matrix_functions
            if used:
                own = own + functions[:, :used] @ values[layout.places["M"]].reshape(used, count)
            for k, (i, j) in enumerate(ENTRIES[:count]):
                matrix[:, i, j] = own[:, k]
        return matrix

    def biases(self, values: Series, functions: Table, triad: str) -> Vectors:
        """Return (points, 3) of the biases of "force" or "rate"."""
        layout, mark = self.layout, "" if triad == "force" else "g"
        size = self.terms.basis.size
        bias = functions[:, :size] @ values[layout.places[f"{mark}b"]].reshape(size, 3)
        place = layout.places[f"{mark}b0"]
        if place.stop > place.start:
            bias = bias + values[place]
        if self.terms.has_rates:
            bias = bias + functions[:, size, None] * values[layout.places[f"{mark}r"]]
        if self.terms.hysteresis:
            bias = bias + functions[:, size + 1, None] * values[layout.places[f"{mark}h"]]
        return bias

    def forces(self, values: Series, matrices: AnyArray, biases: Vectors) -> Vectors:
        """Return (points, 3) the true specific force: that of the placement, or what the means say."""
        assert self.points.force is not None
        own = np.linalg.solve(matrices, (self.points.force - biases)[:, :, None])[:, :, 0]
        for k in range(self.directions.shape[0]):
            own[self.own == k] = self.placement_force(values, k)
        return np.asarray(own, dtype=np.float64)

    def placement_force(self, values: Series, k: int) -> Series:
        """Return the specific force of a placement with several points."""
        place = self.layout.places["directions"]
        if not self.terms.poses:
            return values[place][3 * k : 3 * k + 3]
        moved = self.directions[k] + self.tangents[k] @ values[place][2 * k : 2 * k + 2]
        return self.gravity * moved / np.linalg.norm(moved)

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise at `parameters`."""
        points = self.points
        functions = self.functions(parameters)
        rows = len(points)
        misclosure, design = np.zeros((rows, 6)), np.zeros((rows, 6, self.layout.size))
        covariance = np.repeat(np.eye(6)[None], rows, axis=0)
        shift = self.slopes
        forces = None
        if points.force is not None:
            forces = self._force_rows(parameters, functions, shift, misclosure, design, covariance)
        if points.rate is not None:
            self._rate_rows(parameters, functions, shift, forces, misclosure, design, covariance)
        return Linearisation.masked(misclosure, design, covariance, self.active)

    def adjust_observations(self, multipliers: AnyArray) -> None:
        """Means are known so well that a second order in their noise is nothing."""

    def _force_rows(
        self,
        values: Series,
        functions: Table,
        shift: dict[str, Table],
        misclosure: Table,
        design: AnyArray,
        covariance: AnyArray,
    ) -> Vectors:
        points, layout = self.points, self.layout
        assert points.force is not None
        assert points.force_covariance is not None
        matrices = self.matrices(values, functions)
        biases = self.biases(values, functions, "force")
        forces = self.forces(values, matrices, biases)
        # d raw by the unknowns, and raw minus what is expected, as three equations.
        moved = np.zeros((len(points), 3, layout.size))
        self._bias_columns(moved, functions, "force")
        count, used = layout.entries, self.terms.matrix_functions
        for k, (i, j) in enumerate(ENTRIES[:count]):
            moved[:, i, layout.places["M0"].start + k] = forces[:, j]
            for f in range(used):
                moved[:, i, layout.places["M"].start + f * count + k] = functions[:, f] * forces[:, j]
        for name, change in shift.items():
            bent = self.biases(values, change, "force")
            if layout.places["b0"].stop > layout.places["b0"].start:
                bent = bent - values[layout.places["b0"]]
            if used:
                terms = values[layout.places["M"]].reshape(used, count)
                turned = np.zeros((len(points), 3, 3))
                for k, (i, j) in enumerate(ENTRIES[:count]):
                    turned[:, i, j] = change[:, :used] @ terms[:, k]
                bent = bent + np.einsum("nij,nj->ni", turned, forces)
            moved[:, :, layout.places[name].start] = bent
        alone = self.own < 0
        inside = np.where(
            alone[:, None], 0.0, points.force - np.einsum("nij,nj->ni", matrices, forces) - biases
        )
        misclosure[:, :3] = inside
        design[:, :3] = -moved
        extra = self.extra["force"] * np.eye(3)
        covariance[:, :3, :3] = points.force_covariance + extra
        self._direction_columns(values, matrices, design)
        if np.any(alone) and self.terms.poses:
            inverse = np.linalg.inv(matrices[alone])
            towards = np.einsum("na,nab->nb", forces[alone], inverse) / self.gravity
            misclosure[alone, 0] = 0.5 * (np.sum(forces[alone] ** 2, axis=1) / self.gravity - self.gravity)
            design[alone, 0] = -np.einsum("nb,nbp->np", towards, moved[alone])
            spread = points.force_covariance[alone] + extra
            self.force_noise[alone] = 0.0
            self.force_noise[alone, 0] = towards
            covariance[alone, :3, :3] = np.eye(3)
            covariance[alone, 0, 0] = np.einsum("na,nab,nb->n", towards, spread, towards)
        return forces

    def _direction_columns(self, values: Series, matrices: AnyArray, design: AnyArray) -> None:
        place = self.layout.places["directions"]
        for k in range(self.directions.shape[0]):
            here = self.own == k
            if not self.terms.poses:
                design[here, :3, place.start + 3 * k : place.start + 3 * k + 3] = -matrices[here]
                continue
            force = self.placement_force(values, k)
            moved = self.directions[k] + self.tangents[k] @ values[place][2 * k : 2 * k + 2]
            length = np.linalg.norm(moved)
            unit = force / self.gravity
            by = self.gravity / length * (np.eye(3) - np.outer(unit, unit)) @ self.tangents[k]
            design[here, :3, place.start + 2 * k : place.start + 2 * k + 2] = -matrices[here] @ by

    def _bias_columns(self, moved: AnyArray, functions: Table, triad: str) -> None:
        layout, mark, size = self.layout, "" if triad == "force" else "g", self.terms.basis.size
        for axis in range(3):
            place = layout.places[f"{mark}b0"]
            if place.stop > place.start:
                moved[:, axis, place.start + axis] = 1.0
            for k in range(size):
                moved[:, axis, layout.places[f"{mark}b"].start + 3 * k + axis] = functions[:, k]
            if self.terms.has_rates:
                moved[:, axis, layout.places[f"{mark}r"].start + axis] = functions[:, size]
            if self.terms.hysteresis:
                moved[:, axis, layout.places[f"{mark}h"].start + axis] = functions[:, size + 1]

    def _rate_rows(
        self,
        values: Series,
        functions: Table,
        shift: dict[str, Table],
        forces: Vectors | None,
        misclosure: Table,
        design: AnyArray,
        covariance: AnyArray,
    ) -> None:
        points, layout = self.points, self.layout
        assert points.rate is not None
        assert points.rate_covariance is not None
        expected = self.biases(values, functions, "rate")
        moved = np.zeros((len(points), 3, layout.size))
        self._bias_columns(moved, functions, "rate")
        vertical, across, rest = self.earth
        up = None
        if forces is not None:
            up = forces / np.linalg.norm(forces, axis=1, keepdims=True)
            expected = expected + vertical * up
        if self.terms.g_sensitivity and forces is not None:
            place = layout.places["G"]
            expected = expected + forces @ values[place].reshape(3, 3).T
            for i in range(3):
                moved[:, i, place.start + 3 * i : place.start + 3 * i + 3] = forces
        for name, change in shift.items():
            moved[:, :, layout.places[name].start] = (
                self.biases(values, change, "rate") - values[layout.places["gb0"]]
            )
        # Of one placement the Earth rate across the vertical is the same; of a pose alone it is noise.
        place = layout.places["earth"]
        for k in range(self.directions.shape[0]):
            here = self.own == k
            expected[here] += values[place][3 * k : 3 * k + 3]
            moved[np.ix_(here, range(3), range(place.start + 3 * k, place.start + 3 * k + 3))] = np.eye(3)
        misclosure[:, 3:] = points.rate - expected
        design[:, 3:] = -moved
        spread = points.rate_covariance + self.extra["rate"] * np.eye(3)
        alone = self.own < 0
        spread[alone] += rest**2 * np.eye(3)
        level = np.repeat(np.eye(3)[None], len(points), axis=0)
        if up is not None:
            level = level - np.einsum("ni,nj->nij", up, up)
        spread[alone] += across**2 * level[alone]
        if up is not None:
            spread[alone] += self._pulled(up[alone])[:, None, None] ** 2 * np.eye(3)
        covariance[:, 3:, 3:] = spread

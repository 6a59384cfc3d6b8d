"""The equations of a thermal test: what both triads show at rest, at many temperatures, in one adjustment.

A point is a short rest at the sensor's temperature T, with dT/dt and the state s of the hysteresis. With
``M(T) = M0 + sum_k M_k f_k(T)`` and ``b(T) = b0 + sum_k b_k f_k(T) + r dT/dt + h s``:

- alone in its pose: the corrected specific force has the norm of gravity (the multi-position test);
- one of several in one pose: ``raw = M(T) f + b(T)`` with the same specific force f for all, whose direction is
  unknown; f has the norm of gravity, or where no pose tells scale factors from biases, no norm at all;
- the gyros: ``raw = b(T) + nominal (Earth rate) + G f``. The Earth rate's vertical part is known with the
  latitude; its horizontal part is unknown in each placement, with the size that it has.

All raw numbers are divided by one nominal scale factor beforehand, so that they are near SI.

Which unknowns there are, and where each stands in the vector, follows from the model's terms.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Series, Table, Vectors
from tumble.calibration.equations.holds_and_turns import tangent_bases
from tumble.calibration.thermal.points import ThermalPoints
from tumble.estimation import Block, Conditions, Layout, Linearisation, Prior
from tumble.records import dataclass
from tumble.sensor import TemperatureBasis

Complex = npt.NDArray[Any]
# Entries of a lower triangular matrix, scale factors first, and each as a matrix.
_ENTRIES = ((0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1))
_SHAPES = np.array([np.outer(np.eye(3)[i], np.eye(3)[j]) for i, j in _ENTRIES])
_NO_FORCE: Vectors = np.zeros((1, 3))


@dataclass(frozen=True)
class ThermalTerms:
    """Which unknowns a thermal model has.

    Attributes
    ----------
    basis : the functions of temperature, `basis.size` of them for the biases.
    poses : what the poses tell of the accelerometers: 9, 6 (no non-orthogonality) or 0 (changes of bias alone).
    matrix_functions : how many of the functions the accelerometers' matrix has.
    rate, hysteresis : of the biases.
    lag, width : are estimated, not fixed.
    g_sensitivity : of the gyros.
    doubt : (m/s², rad/s) per K/s, one sigma of a dependence on the rate that the recording does not tell, such as
        in soaks that have all but settled; it is in the uncertainties and not in the model. None for none.
    """

    basis: TemperatureBasis
    poses: int
    matrix_functions: int = 0
    rate: bool = False
    hysteresis: bool = False
    lag: bool = False
    width: bool = False
    g_sensitivity: bool = False
    doubt: tuple[float, float] | None = None

    @property
    def entries(self) -> int:
        """How many entries of the accelerometers' matrix are unknown."""
        return {9: 6, 6: 3, 0: 0}[self.poses]


@dataclass(frozen=True)
class ThermalLayout:
    """Where each kind of unknown is: biases b0, b, r, h (of the gyros with a g), matrices M0, M and N0, N, the others.

    What a triad shows is linear in them: one, the functions of temperature, its rate and the hysteresis, in this order
    (points, functions + 3), times biases and matrices.
    """

    terms: ThermalTerms
    has_force: bool
    has_rate: bool
    blocks: Layout

    @staticmethod
    def of(
        terms: ThermalTerms, has_force: bool, has_rate: bool, placements: int = 0, turned: int = 0
    ) -> ThermalLayout:
        """Return the layout for placements with unknowns of their own, and so many matrices from turns."""
        sizes: dict[str, int] = {}
        for mark, there, reference in (("", has_force, terms.poses > 0), ("g", has_rate, True)):
            counts = (reference, terms.basis.size, terms.rate or terms.doubt is not None, terms.hysteresis)
            sizes |= {
                mark + name: 3 * there * n for name, n in zip(("b0", "b", "r", "h"), counts, strict=True)
            }
        entries = has_force * terms.entries
        sizes |= {
            "M0": entries,
            "M": entries * terms.matrix_functions,
            "G": 9 * has_rate * terms.g_sensitivity,
        }
        sizes |= {"lag": terms.lag, "width": terms.width, "N0": 9 * (turned > 0), "N": 9 * max(turned - 1, 0)}
        sizes |= {
            "directions": (2 if terms.poses else 3) * has_force * placements,
            "earth": 3 * has_rate * placements,
        }
        nameless = {name: ("",) * int(size) for name, size in sizes.items()}
        return ThermalLayout(
            terms, has_force, has_rate, Layout(tuple(Block(name, of, of) for name, of in nameless.items()))
        )

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.blocks.size

    @property
    def shared(self) -> int:
        """Number of unknowns that are no placement's own."""
        return self["directions"].start

    def __getitem__(self, name: str) -> slice:
        """Return where a kind of unknown is."""
        return self.blocks[name]

    def has(self, name: str) -> bool:
        """Whether there is any of a kind."""
        return self[name].stop > self[name].start

    def columns(self, mark: str, functions: Table, force: Vectors = _NO_FORCE) -> AnyArray:
        """Return (points, 3, unknowns): what multiplies each in a triad's raw output, "" or "g", beside the nominal."""
        terms, count = self.terms, len(functions)
        size, force = terms.basis.size, np.broadcast_to(force, (count, 3))
        bias, entries = np.broadcast_to(np.eye(3), (count, 3, 3)), _SHAPES[: terms.entries]
        kinds = {f"{mark}b0": (0, 1, bias), f"{mark}b": (1, size + 1, bias)}
        kinds |= {f"{mark}r": (size + 1, size + 2, bias), f"{mark}h": (size + 2, size + 3, bias)}
        if mark:
            kinds["G"] = (0, 1, (np.eye(3)[:, :, None] * force[:, None, None, :]).reshape(count, 3, 9))
        else:
            shown = np.einsum("nj,cij->nic", force, entries)
            kinds |= {"M0": (0, 1, shown), "M": (1, terms.matrix_functions + 1, shown)}
        made = np.zeros((count, 3, self.size))
        for name, (first, last, each) in kinds.items():
            if self.has(name):
                weighted = functions[:, None, first:last, None] * each[:, :, None, :]
                made[:, :, self[name]] = weighted.reshape(count, 3, -1)
        return made

    def matrices(self, values: Complex, functions: Table) -> Complex:
        """Return (points, 3, 3) of the accelerometers' matrix, nominal where the poses do not tell it."""
        if not self.terms.entries:
            return np.broadcast_to(np.eye(3), (len(functions), 3, 3))
        changes = self.matrix_changes(values)
        at_reference = np.einsum("c,cij->ij", values[self["M0"]], _SHAPES[: self.terms.entries])
        return at_reference + np.einsum("nk,kij->nij", functions[:, 1 : len(changes) + 1], changes)

    def matrix_changes(self, values: Complex) -> Complex:
        """Return (matrix functions, 3, 3) of the accelerometers' matrix, by the functions of temperature."""
        count = self.terms.entries
        own = values[self["M"]].reshape(self.terms.matrix_functions, count)
        return np.einsum("kc,cij->kij", own, _SHAPES[:count])

    def at_temperature(
        self, celsius: AnyArray, rate: AnyArray | float = 0.0, state: AnyArray | float = 0.0
    ) -> Table:
        """Return (points, functions + 3): one, the functions of temperature, its rate (K/s) and the hysteresis."""
        made = np.ones((celsius.size, self.terms.basis.size + 3))
        made[:, 1:-2], made[:, -2], made[:, -1] = self.terms.basis.values(celsius), rate, state
        return made


# What is known of the lag before: sensors inside a case are some tens of seconds behind a thermometer beside them.
LAG_PRIOR, LAG_SIGMA = 60.0, 60.0  # s
WIDTH_PRIOR, WIDTH_SIGMA = 5.0, 3.0  # K
LEAST_WIDTH = 0.5
HELD = 1e-3  # s, K: of lag and width where they are not to move
# One sigma of an element of the g-sensitivity of consumer units, 0.1 °/s in 1 g.
G_SENSITIVITY = 1.8e-4  # (rad/s)/(m/s²)
SAME_POSE = np.radians(10.0)
# Steps of the numerical derivatives by lag and width: small against what they are known to, and so large that the
# thermometer's noise and the dead band of the hysteresis do not make them rough.
LAG_STEP, WIDTH_STEP = 10.0, 0.5


@dataclass(frozen=True)
class ThermalTest:
    """What is adjusted, and what is known beside it.

    Attributes
    ----------
    points : raw numbers divided by the nominal scale factors.
    gravity : m/s².
    earth : rad/s, the Earth rate's vertical part, one sigma of each component across it, and one sigma of
        each component besides, where no latitude is known.
    lag, width : s and K, where they are not unknown, and where they begin.
    soaks : °C of the soaks; None for a sweep.
    """

    points: ThermalPoints
    gravity: float
    earth: tuple[float, float, float]
    lag: float
    width: float
    soaks: Series | None = None


class ThermalConditions(Conditions):
    """`Conditions` for the adjustment: six rows a point, three of each triad, in near SI."""

    def __init__(self, test: ThermalTest, terms: ThermalTerms) -> None:
        self.test, self.points, self.terms, self.gravity = test, test.points, terms, test.gravity
        points = self.points
        placement, counts = np.unique(points.placement, return_counts=True)
        # Which placement has unknowns of its own: those with several points.
        self.several = placement[counts > 1]
        self.own = self.own_of(points.placement)
        self.layout = ThermalLayout.of(
            terms, points.force is not None, points.rate is not None, self.several.size
        )
        self.extra = {"force": 0.0, "rate": 0.0}
        self.active = self.rows()
        # How a point's noise enters its three force equations: (points, 3 equations, 3 axes).
        self.force_noise = np.repeat(np.eye(3)[None], len(points), axis=0)
        # Base directions of the placements with several points, and two directions across each.
        self.directions, self.tangents = np.zeros((self.several.size, 3)), np.zeros((self.several.size, 3, 2))
        # The pose that most points have, where one has several.
        self.main: Series | None = None
        if points.force is not None and self.several.size:
            means = self._placement_means()
            self.directions = means / np.linalg.norm(means, axis=1, keepdims=True)
            self.tangents = tangent_bases(self.directions)
            self.main = self.directions[int(np.argmax(np.bincount(self.own[self.own >= 0])))]
        self._draw_lines(test.lag, test.width)

    def own_of(self, placement: np.ndarray) -> np.ndarray:
        """Return which of the placements with unknowns of their own points belong to; -1 for none."""
        return np.where(np.isin(placement, self.several), np.searchsorted(self.several, placement), -1)

    def _placement_means(self) -> Vectors:
        force = self.points.force
        assert force is not None
        return np.array([force[self.own == k].mean(axis=0) for k in range(self.several.size)]).reshape(-1, 3)

    def rows(self) -> np.ndarray:
        """Return (points, 6) of bool: which equations there are."""
        active = np.zeros((len(self.points), 6), dtype=bool)
        if self.points.force is not None:
            active[:, 0] = (self.own >= 0) | (self.terms.poses > 0)
            active[:, 1] = active[:, 2] = self.own >= 0
        active[:, 3:] = self.points.rate is not None
        return active

    def start(self) -> Series:
        """Return start values: nominal, with the mean rate as the gyros' bias."""
        layout, values = self.layout, np.zeros(self.layout.size)
        values[layout["M0"]][:3] = 1.0
        values[layout["lag"]], values[layout["width"]] = self.test.lag, self.test.width
        if self.points.rate is not None:
            values[layout["gb0"]] = self.points.rate.mean(axis=0)
        if self.points.force is not None and not self.terms.poses:
            values[layout["directions"]] = self._placement_means().ravel()
        return values

    def prior(self, *, held: bool = False) -> Prior:
        """Return what is known beforehand: of the lag, of the loop's width, of the Earth rate's size.

        Parameters
        ----------
        held : hold lag and width where they are.
        """
        values, (lag, width) = np.zeros(self.layout.size), (self.test.lag, self.test.width)
        values[self.layout["lag"]] = lag if held else LAG_PRIOR
        values[self.layout["width"]] = width if held else WIDTH_PRIOR
        sigmas: dict[str, float | Series] = {
            "lag": HELD if held else LAG_SIGMA,
            "width": HELD if held else WIDTH_SIGMA,
        }
        for name, sigma in zip(("r", "gr"), self.terms.doubt or (), strict=False):
            sigmas[name] = max(sigma, 1e-12)
        if self.points.rate is not None:
            pulled = self._pulled(self.directions)
            sigmas["earth"] = np.repeat(np.sqrt(max(self.test.earth[1], 1e-9) ** 2 + pulled**2), 3)
        return self.layout.blocks.sparse_prior(values, sigmas)

    def _pulled(self, directions: Vectors) -> Series:
        """Return one sigma of what a g-sensitivity that poses do not tell adds in these, beside that of the main one.

        Biases are then those of the pose that most points have, g-sensitivity included.
        """
        if self.terms.poses == 9 or self.main is None:
            return np.zeros(len(directions))
        # In counts nobody knows what a g-sensitivity comes to: a pose then determines nothing of another's.
        usual = G_SENSITIVITY * self.gravity if self.test.earth[1] > 0.0 else 1e6
        apart = np.linalg.norm(directions - self.main, axis=1)
        pulled: Series = usual * np.where(apart > SAME_POSE, apart, 0.0)
        return pulled

    def functions(self, values: Series) -> Table:
        """Return (points, functions + 3): the line in lag and width about where they were last centred."""
        now, functions = self._path(values), self.middle
        for name, slope in self.slopes.items():
            functions = functions + (now[name] - self.centred[name]) * slope
        return functions

    def centre(self, values: Series) -> None:
        """Begin the lines in lag and width anew at `values`."""
        self._draw_lines(*self.lag_and_width(values))

    def lag_and_width(self, values: Series) -> tuple[float, float]:
        """Return lag (s) and width (K), which are not below what they can be."""
        now = self._path(values)
        return max(now["lag"], 0.0), max(now["width"], LEAST_WIDTH)

    def _path(self, values: Series) -> dict[str, float]:
        """Return lag and width as they are among the unknowns."""
        layout, known = self.layout, self.centred
        return {name: float(values[layout[name]][0]) if layout.has(name) else known[name] for name in known}

    def _draw_lines(self, lag: float, width: float) -> None:
        """Find the functions at this lag and width, and how they change with what is unknown of these."""
        basis, self.centred = self.terms.basis, {"lag": lag, "width": width}
        self.middle = self.points.functions(basis, lag, width)
        self.slopes: dict[str, Table] = {}
        for name, step, least in (("lag", LAG_STEP, 0.0), ("width", WIDTH_STEP, LEAST_WIDTH)):
            if self.layout.has(name):
                high, low = self.centred[name] + step, max(self.centred[name] - step, least)
                above, below = (
                    self.points.functions(basis, **{**self.centred, name: at}) for at in (high, low)
                )
                self.slopes[name] = (above - below) / (high - low)

    def biases(self, values: Series, functions: Table, mark: str) -> Vectors:
        """Return (points, 3) of the biases of the accelerometers, "", or the gyros, "g"."""
        return self.layout.columns(mark, functions) @ values

    def placement_forces(self, values: Series) -> tuple[Vectors, AnyArray]:
        """Return the specific force of each placement with several points, and its derivatives by its own unknowns."""
        free = values[self.layout["directions"]].reshape(len(self.directions), 2 if self.terms.poses else 3)
        if not self.terms.poses:
            return free, np.broadcast_to(np.eye(3), (len(free), 3, 3))
        moved = self.directions + np.einsum("kab,kb->ka", self.tangents, free)
        length = np.linalg.norm(moved, axis=1)[:, None]
        unit = moved / length
        across = np.eye(3) - unit[:, :, None] * unit[:, None, :]
        return self.gravity * unit, self.gravity / length[:, :, None] * across @ self.tangents

    def linearise(self, parameters: Series) -> Linearisation:
        """Linearise at `parameters`."""
        rows, functions = len(self.points), self.functions(parameters)
        misclosure, design = np.zeros((rows, 6)), np.zeros((rows, 6, self.layout.size))
        covariance = np.repeat(np.eye(6)[None], rows, axis=0)
        forces = None
        if self.points.force is not None:
            forces, misclosure[:, :3], design[:, :3], covariance[:, :3, :3] = self._force_rows(
                parameters, functions
            )
        if self.points.rate is not None:
            misclosure[:, 3:], design[:, 3:], covariance[:, 3:, 3:] = self._rate_rows(
                parameters, functions, forces
            )
        return Linearisation.masked(misclosure, design, covariance, self.active)

    def _columns(self, mark: str, values: Series, functions: Table, forces: Vectors) -> AnyArray:
        """Return (points, 3, unknowns): derivatives of a triad's raw output by what placements share."""
        made = self.layout.columns(mark, functions, forces)
        for name, change in self.slopes.items():
            made[:, :, self.layout[name]] = (self.layout.columns(mark, change, forces) @ values)[:, :, None]
        return made

    def _force_rows(self, values: Series, functions: Table) -> tuple[Vectors, Vectors, AnyArray, AnyArray]:
        """Return the true specific force of each point, and misclosure, design and covariance of three equations."""
        force, spread = self.points.force, self.points.force_covariance
        assert force is not None
        assert spread is not None
        spread = spread + self.extra["force"] * np.eye(3)
        matrices, biases = self.layout.matrices(values, functions), self.biases(values, functions, "")
        true = np.asarray(np.linalg.solve(matrices, (force - biases)[:, :, None]), dtype=np.float64)[:, :, 0]
        placed, by_own = self.placement_forces(values)
        several, alone = self.own >= 0, self.own < 0
        true[several] = placed[self.own[several]]
        moved = self._columns("", values, functions, true)
        misclosure = np.where(several[:, None], force - np.einsum("nij,nj->ni", matrices, true) - biases, 0.0)
        design, covariance = -moved, spread.copy()
        first = self.layout["directions"].start
        for k, by in enumerate(by_own):
            here, at = self.own == k, first + k * by.shape[1]
            design[here, :, at : at + by.shape[1]] = -matrices[here] @ by
        if np.any(alone) and self.terms.poses:
            towards = np.einsum("na,nab->nb", true[alone], np.linalg.inv(matrices[alone])) / self.gravity
            misclosure[alone, 0] = 0.5 * (np.sum(true[alone] ** 2, axis=1) / self.gravity - self.gravity)
            design[alone, 0] = -np.einsum("nb,nbp->np", towards, moved[alone])
            self.force_noise[alone] = 0.0
            self.force_noise[alone, 0] = towards
            covariance[alone] = np.eye(3)
            covariance[alone, 0, 0] = np.einsum("na,nab,nb->n", towards, spread[alone], towards)
        return true, misclosure, design, covariance

    def _rate_rows(
        self, values: Series, functions: Table, forces: Vectors | None
    ) -> tuple[Vectors, AnyArray, AnyArray]:
        """Return misclosure, design and covariance of the gyros' three equations a point."""
        rate, spread = self.points.rate, self.points.rate_covariance
        assert rate is not None
        assert spread is not None
        vertical, across, rest = self.test.earth
        alone = self.own < 0
        moved = self._columns("g", values, functions, np.zeros((1, 3)) if forces is None else forces)
        # Of one placement the Earth rate across the vertical is the same; of a pose alone it is noise.
        first = self.layout["earth"].start
        for k in range(self.several.size):
            moved[self.own == k, :, first + 3 * k : first + 3 * k + 3] = np.eye(3)
        path = [self.layout[name].start for name in self.slopes]
        expected = np.delete(moved, path, axis=2) @ np.delete(values, path)
        spread = spread + self.extra["rate"] * np.eye(3)
        spread[alone] += rest**2 * np.eye(3)
        level = np.repeat(np.eye(3)[None], len(rate), axis=0)
        if forces is not None:
            up = forces / np.linalg.norm(forces, axis=1, keepdims=True)
            expected = expected + vertical * up
            level = level - np.einsum("ni,nj->nij", up, up)
            spread[alone] += self._pulled(up[alone])[:, None, None] ** 2 * np.eye(3)
        spread[alone] += across**2 * level[alone]
        return rate - expected, -moved, spread

"""Which unknowns a thermal model has, where each stands in the vector, and what a sensor shows of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tumble.arrays import AnyArray, Table, Vectors
from tumble.estimation.unknowns import Block, Layout
from tumble.records import dataclass
from tumble.sensor.thermal import TemperatureBasis

Complex = npt.NDArray[Any]
# Entries of a lower triangular matrix, scale factors first, and each as a matrix.
_ENTRIES = ((0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1))
_SHAPES = np.array([np.outer(np.eye(3)[i], np.eye(3)[j]) for i, j in _ENTRIES])
_NO_FORCE: Vectors = np.zeros((1, 3))


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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

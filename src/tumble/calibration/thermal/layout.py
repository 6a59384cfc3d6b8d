"""Which unknowns a thermal model has, and where each stands in the vector."""

from __future__ import annotations

from dataclasses import field

from tumble.records import dataclass
from tumble.sensor.thermal import TemperatureBasis

# Entries of a lower triangular matrix, scale factors first.
ENTRIES = ((0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1))


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
    def has_rates(self) -> bool:
        """Whether there are unknowns of the rate, to be given or as a doubt alone."""
        return self.rate or self.doubt is not None


@dataclass(slots=True)
class Layout:
    """Where each kind of unknown is in the vector."""

    terms: ThermalTerms
    has_force: bool
    has_rate: bool
    multiple: int
    places: dict[str, slice] = field(default_factory=dict[str, slice])
    size: int = 0

    def __post_init__(self) -> None:
        """Give every kind its place."""
        terms = self.terms
        functions = terms.basis.size
        entries = {9: 6, 6: 3, 0: 0}[terms.poses]
        if self.has_force:
            self._add("M0", entries)
            self._add("b0", 3 if terms.poses else 0)
            self._add("b", 3 * functions)
            self._add("M", entries * terms.matrix_functions)
            self._add("r", 3 * terms.has_rates)
            self._add("h", 3 * terms.hysteresis)
        if self.has_rate:
            self._add("gb0", 3)
            self._add("gb", 3 * functions)
            self._add("gr", 3 * terms.has_rates)
            self._add("gh", 3 * terms.hysteresis)
            self._add("G", 9 * terms.g_sensitivity)
        self._add("lag", int(terms.lag))
        self._add("width", int(terms.width))
        if self.has_force:
            self._add("directions", (2 if terms.poses else 3) * self.multiple)
        if self.has_rate:
            self._add("earth", 3 * self.multiple)

    @property
    def entries(self) -> int:
        """How many entries of the accelerometers' matrix are unknown."""
        return {9: 6, 6: 3, 0: 0}[self.terms.poses]

    @property
    def shared(self) -> int:
        """Number of unknowns that are no placement's own."""
        starts = [self.places[name].start for name in ("directions", "earth") if name in self.places]
        return min(starts, default=self.size)

    def _add(self, name: str, count: int) -> None:
        self.places[name] = slice(self.size, self.size + count)
        self.size += count

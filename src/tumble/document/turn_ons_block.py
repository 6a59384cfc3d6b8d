"""The block ``turn_ons`` of ``calibration.json``: what several recordings of one unit tell, as numbers."""

from __future__ import annotations

from tumble.calibration import TurnOns
from tumble.document.part import DocumentPart, part_of, spelled

Each = list[float | None]


class TurnOnBlock(DocumentPart, rename=spelled(rate="rate_hz")):
    """One recording; `variance_components` are standard deviations, SI."""

    name: str
    holds: int
    turns: int
    spins: int
    seconds: float
    rate: float
    sigma0: float | None
    variance_components: dict[str, float]


class BiasBlock(DocumentPart, rename=spelled(measurement="expected_scatter", turn_on="turn_on_scatter")):
    """A bias from turn-on to turn-on, raw units; lists have an entry for each recording, null where it has none.

    `scatter` is the standard deviation of the recordings' biases, `expected_scatter` what their own uncertainties
    make of it, `turn_on_scatter` what is left without these. `next_standard_uncertainty` is that of `mean` as the bias
    of the next turn-on, to be taken with `coverage_factor`. `probability` is that of such differences by chance, were
    the bias the same each time.
    """

    parameter: str
    unit: str
    values: Each
    sigmas: Each
    mean: float
    mean_sigma: float
    scatter: float
    scatter_sigma: float
    measurement: float
    turn_on: float
    next_sigma: float
    coverage_factor: float
    degrees: int
    chi_square: float
    probability: float


class StableBlock(DocumentPart, rename=spelled(enlarged="enlarged_by")):
    """A parameter that all recordings share, as each determines it by itself; null where one does not tell it.

    It agrees if the `probability` of such differences by chance is not below `limit`; if it does not, its standard
    uncertainty is `enlarged_by` this factor in the list of parameters.
    """

    parameter: str
    unit: str
    values: Each
    sigmas: Each
    value: float
    chi_square: float
    degrees: int
    probability: float
    limit: float
    agrees: bool
    enlarged: float


class TurnOnsBlock(DocumentPart, rename=spelled(agreements="stable")):
    """What several recordings of one unit tell: chi-square of all stable parameters together, and each by itself."""

    recordings: list[TurnOnBlock]
    biases: list[BiasBlock]
    agreements: list[StableBlock]
    chi_square: float
    degrees: int
    probability: float


def turn_ons_block(told: TurnOns) -> TurnOnsBlock:
    """Return the block of what several recordings told.

    Parameters
    ----------
    told : see there.
    """
    return part_of(TurnOnsBlock, told)

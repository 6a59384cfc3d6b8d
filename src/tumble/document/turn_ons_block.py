"""The block ``turn_ons`` of ``calibration.json``: what several recordings of one unit tell, as numbers."""

from __future__ import annotations

from tumble.arrays import Series
from tumble.calibration.evidence import Agreement, BiasScatter, TurnOns
from tumble.document.part import DocumentPart, finite, part_of

Each = list[float | None]


class TurnOnBlock(DocumentPart):
    """One recording; `variance_components` are standard deviations, SI."""

    name: str
    holds: int
    turns: int
    spins: int
    seconds: float
    rate_hz: float
    sigma0: float | None
    variance_components: dict[str, float]


class BiasBlock(DocumentPart):
    """A bias from turn-on to turn-on, raw units; lists have an entry for each recording, null where it has none.

    `scatter` is the standard deviation of the recordings' biases, `expected_scatter` what their own uncertainties
    make of it, `turn_on_scatter` what is left without these. `next_standard_uncertainty` is that of `mean` as the bias
    of the next turn-on, to be taken with `coverage_factor`. `probability` is that of such differences by chance, were
    the bias the same each time.
    """

    parameter: str
    unit: str
    values: Each
    standard_uncertainties: Each
    mean: float
    mean_standard_uncertainty: float
    scatter: float
    scatter_standard_uncertainty: float
    expected_scatter: float
    turn_on_scatter: float
    next_standard_uncertainty: float
    coverage_factor: float
    degrees_of_freedom: int
    chi_square: float
    probability: float


class StableBlock(DocumentPart):
    """A parameter that all recordings share, as each determines it by itself; null where one does not tell it.

    It agrees if the `probability` of such differences by chance is not below `limit`; if it does not, its standard
    uncertainty is `enlarged_by` this factor in the list of parameters.
    """

    parameter: str
    unit: str
    values: Each
    standard_uncertainties: Each
    value: float
    chi_square: float
    degrees_of_freedom: int
    probability: float
    limit: float
    agrees: bool
    enlarged_by: float


class TurnOnsBlock(DocumentPart):
    """What several recordings of one unit tell: chi-square of all stable parameters together, and each by itself."""

    recordings: list[TurnOnBlock]
    biases: list[BiasBlock]
    stable: list[StableBlock]
    chi_square: float
    degrees_of_freedom: int
    probability: float


def turn_ons_block(told: TurnOns) -> TurnOnsBlock:
    """Return the block of what several recordings told.

    Parameters
    ----------
    told : see there.
    """
    return part_of(
        TurnOnsBlock,
        told,
        recordings=[
            part_of(TurnOnBlock, one, rate_hz=one.rate, sigma0=finite(one.sigma0)) for one in told.recordings
        ],
        biases=[_bias(bias) for bias in told.biases],
        stable=[_stable(agreement) for agreement in told.agreements],
        degrees_of_freedom=told.degrees,
    )


def _bias(bias: BiasScatter) -> BiasBlock:
    return part_of(
        BiasBlock,
        bias,
        values=_each(bias.values),
        standard_uncertainties=_each(bias.sigmas),
        mean_standard_uncertainty=bias.mean_sigma,
        scatter_standard_uncertainty=bias.scatter_sigma,
        expected_scatter=bias.measurement,
        turn_on_scatter=bias.turn_on,
        next_standard_uncertainty=bias.next_sigma,
        degrees_of_freedom=bias.degrees,
    )


def _stable(agreement: Agreement) -> StableBlock:
    return part_of(
        StableBlock,
        agreement,
        values=_each(agreement.values),
        standard_uncertainties=_each(agreement.sigmas),
        degrees_of_freedom=agreement.degrees,
        enlarged_by=agreement.enlarged,
    )


def _each(values: Series) -> Each:
    return [finite(value) for value in values]

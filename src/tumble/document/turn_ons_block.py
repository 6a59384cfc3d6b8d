"""The block ``turn_ons`` of ``calibration.json``: what several recordings of one unit tell, as numbers."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series
from tumble.calibration.turn_ons.biases import Agreement, BiasScatter, RecordingOfUnit, TurnOns
from tumble.document.part import DocumentPart

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
    return TurnOnsBlock(
        recordings=[_recording(recording) for recording in told.recordings],
        biases=[_bias(bias) for bias in told.biases],
        stable=[_stable(agreement) for agreement in told.agreements],
        chi_square=told.chi_square,
        degrees_of_freedom=told.degrees,
        probability=told.probability,
    )


def _recording(recording: RecordingOfUnit) -> TurnOnBlock:
    return TurnOnBlock(
        name=recording.name,
        holds=recording.holds,
        turns=recording.turns,
        spins=recording.spins,
        seconds=recording.seconds,
        rate_hz=recording.rate,
        sigma0=recording.sigma0 if np.isfinite(recording.sigma0) else None,
        variance_components=recording.variance_components,
    )


def _bias(bias: BiasScatter) -> BiasBlock:
    return BiasBlock(
        parameter=bias.parameter,
        unit=bias.unit,
        values=_each(bias.values),
        standard_uncertainties=_each(bias.sigmas),
        mean=bias.mean,
        mean_standard_uncertainty=bias.mean_sigma,
        scatter=bias.scatter,
        scatter_standard_uncertainty=bias.scatter_sigma,
        expected_scatter=bias.measurement,
        turn_on_scatter=bias.turn_on,
        next_standard_uncertainty=bias.next_sigma,
        coverage_factor=bias.coverage_factor,
        degrees_of_freedom=bias.degrees,
        chi_square=bias.chi_square,
        probability=bias.probability,
    )


def _stable(agreement: Agreement) -> StableBlock:
    return StableBlock(
        parameter=agreement.parameter,
        unit=agreement.unit,
        values=_each(agreement.values),
        standard_uncertainties=_each(agreement.sigmas),
        value=agreement.value,
        chi_square=agreement.chi_square,
        degrees_of_freedom=agreement.degrees,
        probability=agreement.probability,
        limit=agreement.limit,
        agrees=agreement.agrees,
        enlarged_by=agreement.enlarged,
    )


def _each(values: Series) -> Each:
    return [float(value) if np.isfinite(value) else None for value in values]

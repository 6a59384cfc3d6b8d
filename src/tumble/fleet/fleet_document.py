"""A fleet as a document: the mean unit, with the spread between units as its covariance, for the next unit's prior."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np
from msgspec.structs import replace

import tumble
from tumble.document.entries import PLACES, entry_names, model_of_vector, named_parameters, stacked
from tumble.document.frame_change import turned_to
from tumble.document.part import row_of, rows_of
from tumble.document.result import Calibration, TriadBlock, VerdictBlock
from tumble.errors import UsageError
from tumble.fleet.between import FEWEST, Between, between_units
from tumble.fleet.unit_vector import FRAME, HELD
from tumble.sensor import FRAMES, ImuModel, Triad

PROCEDURE = "fleet"
_TERMS = ("accelerometer.matrix", "accelerometer.bias", "gyroscope.matrix", "gyroscope.bias")


def fleet_document(calibrations: Sequence[Calibration]) -> tuple[Calibration, Between]:
    """Return the mean unit of calibrations, and how they differ.

    The document's covariance is that of a next unit about the mean: between units, and of the mean.

    Parameters
    ----------
    calibrations : one a unit, with both triads in the same raw units.

    Raises
    ------
    UsageError
        If there are too few that can be compared.
    """
    chosen = _comparable(calibrations)
    pairs = [stacked(one) for one in chosen]
    names = entry_names()
    places = [k for term in _TERMS for k in range(PLACES[term][0].start, PLACES[term][0].stop)]
    at = [k for k in places if all(spread[k, k] > HELD for _, spread in pairs)]
    between = between_units(
        np.array([values[at] for values, _ in pairs]),
        np.array([spread[np.ix_(at, at)] for _, spread in pairs]),
    )
    # With those that the frame holds, whose variance is zero.
    common = set[str].intersection(*(set(one.covariance_parameters) for one in chosen))
    told = [k for k in places if names[k] in common]
    like = chosen[0].model
    values = pairs[0][0].copy()
    for term in PLACES:
        if term not in _TERMS:
            values[PLACES[term][0]] = 0.0
    values[at] = between.mean
    spread = np.zeros((len(values), len(values)))
    spread[np.ix_(at, at)] = between.predictive
    plain = ImuModel(_plain(like.accelerometer), _plain(like.gyroscope), None)
    model = model_of_vector(values, plain)
    words = (
        f"This is the mean of {between.count} units with the spread between them, a prior for the next unit: it is no "
        "unit's calibration."
    )
    document = replace(
        chosen[0],
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        software=f"tumble {tumble.__version__}",
        imu=replace(chosen[0].imu, serial_number=None, sensor_index=None),
        procedure=PROCEDURE,
        recordings=[],
        temperature_celsius=None,
        accelerometer=_block(model.accelerometer),
        gyroscope=_block(model.gyroscope),
        parameters=named_parameters(model, spread, chosen[0].raw_units),
        covariance_parameters=[names[k] for k in told],
        covariance=spread[np.ix_(told, told)].tolist(),
        verdict=VerdictBlock(fit=False, reasons=[words]),
        limits=None,
        remarks=[words],
        not_determined=[],
        test_vectors=[],
        thermal=None,
        lever_arms=None,
        magnetometer=None,
        turn_ons=None,
    )
    return document, between


def _comparable(calibrations: Sequence[Calibration]) -> list[Calibration]:
    """Those in one frame, in the raw units of most and with the triads of most."""
    chosen = [
        turned_to(one, FRAME) if one.frame.name != FRAME else one
        for one in calibrations
        if one.frame.name in FRAMES and one.covariance_parameters
    ]
    kinds = [
        (str(one.raw_units), one.gyroscope is not None and one.gyroscope.matrix is not None) for one in chosen
    ]
    usual = max(Counter(kinds).items(), key=lambda item: item[1], default=(None, 0))[0]
    chosen = [one for one, kind in zip(chosen, kinds, strict=True) if kind == usual]
    if len(chosen) < FEWEST:
        raise UsageError(
            f"{len(chosen)} calibrations with a covariance, in the same raw units, can be compared: a fleet takes "
            f"{FEWEST} units or more."
        )
    return chosen


def _plain(triad: Triad | None) -> Triad | None:
    return None if triad is None else Triad(triad.matrix, triad.bias)


def _block(triad: Triad | None) -> TriadBlock | None:
    if triad is None:
        return None
    return TriadBlock(matrix=rows_of(triad.matrix), bias=row_of(triad.bias))

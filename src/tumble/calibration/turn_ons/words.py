"""What several recordings of one unit tell about it, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tumble.calibration.turn_ons.biases import Agreement, BiasScatter, TurnOns
from tumble.calibration.verdict import WORST_FORCE_BIAS_SIGMA, two_digits
from tumble.units import angular_rate_factor, find_unit, specific_force_factor

# More parameters than this that change are counted.
MOST_NAMED = 4


def turn_on_sentences(told: TurnOns) -> list[str]:
    """Return what was found: how biases scatter, what to use, what is stable.

    Parameters
    ----------
    told : of several recordings.
    """
    count = len(told.recordings)
    first = (
        f"{count} recordings of one unit in one adjustment: scale factors, angles and optional terms are common, "
        "biases are each recording's own."
    )
    said = [first]
    for kind in ("accelerometer", "gyro"):
        biases = [b for b in told.biases if b.parameter.startswith(kind)]
        if biases:
            said.append(_of_biases(kind, biases))
    if told.biases:
        said.append(
            "The bias in the file is the mean of the recordings, and its standard uncertainty that "
            f"of the next turn-on. It follows from {count} recordings, with a factor of "
            f"{told.biases[0].coverage_factor:.2f} for 95 %."
        )
    said.append(_of_stable(told))
    optional = [agreement.parameter for agreement in told.changing if agreement.is_optional]
    if optional:
        it = "It" if len(told.changing) == 1 else "Among them"
        more = f" and {len(optional) - 1} like it" if len(optional) > 1 else ""
        said.append(
            f"{it} is {optional[0]}{more}: a gyro bias that drifted in step with the poses of one recording looks like "
            "it, too."
        )
    return said


def turn_on_cautions(told: TurnOns) -> list[str]:
    """Return what stands first in the verdict: what is not stable, and biases that have to be found anew.

    Parameters
    ----------
    told : of several recordings.
    """
    plain = [agreement for agreement in told.changing if not agreement.is_optional]
    said = [_changes(told, agreement) for agreement in plain[:MOST_NAMED]]
    if len(plain) > MOST_NAMED:
        said.append(f"{len(plain) - MOST_NAMED} more parameters differ between the recordings beyond chance.")
    for bias in told.biases:
        factor = specific_force_factor(bias.unit) if bias.parameter.startswith("acc") else None
        if factor is not None and factor * bias.next_sigma > WORST_FORCE_BIAS_SIGMA:
            said.append(
                f"The bias of accelerometer {bias.parameter[-1]} moves by {amount(bias.scatter, bias.unit)} from "
                "turn-on to turn-on, as much as an uncalibrated unit's may be: find it anew each time; the rest holds."
            )
    return said


def _of_biases(kind: str, biases: Sequence[BiasScatter]) -> str:
    unit, degrees = biases[0].unit, biases[0].degrees
    scatters = [amount(b.scatter, unit) for b in biases]
    expected = amount(float(np.sqrt(np.mean([b.measurement**2 for b in biases]))), unit)
    poorly = f"± {two_digits(100.0 / float(np.sqrt(2.0 * degrees)))} %, from {degrees + 1} turn-ons"
    listed = ", ".join(scatters[:-1]) + f" and {scatters[-1]}"
    told = f"From turn-on to turn-on the {kind} biases x, y and z scatter by {listed} (standard deviations, {poorly})"
    moved = [b.parameter[-1] for b in biases if b.changes]
    if not moved:
        return f"{told}: no more than the {expected} that the recordings' own uncertainties explain."
    every = len(moved) == len(biases)
    which = "each" if every else " and ".join(moved)
    do = "do" if len(moved) > 1 and not every else "does"
    return f"{told}; the recordings' own uncertainties explain {expected}, so that {which} {do} change."


def _of_stable(told: TurnOns) -> str:
    count = len(told.agreements)
    freedom = f"{told.degrees} degrees of freedom, probability {_p(told.probability)}"
    chance = f"chi-square {told.chi_square:.1f} of {freedom}"
    if not told.changing:
        return (
            f"The {count} parameters that should be stable agree between the recordings, each by itself; all together "
            f"{chance}."
        )
    do = "does" if len(told.changing) == 1 else "do"
    return (
        f"{len(told.changing)} of the {count} parameters that should be stable {do} not agree between the recordings; "
        f"all together {chance}. Standard uncertainties of these are enlarged to what the recordings show."
    )


def _changes(told: TurnOns, agreement: Agreement) -> str:
    values = np.where(np.isfinite(agreement.values), agreement.values, np.nan)
    low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
    names = [recording.name for recording in told.recordings]
    named = f"{agreement.parameter[0].upper()}{agreement.parameter[1:]}"
    return (
        f"{named} is not stable: {names[low]} and {names[high]} differ "
        f"by {amount(agreement.largest, agreement.unit)} (probability {_p(agreement.probability)}). Was one of them at "
        "another temperature, was the unit dropped or mounted anew, or is it another unit?"
    )


def amount(value: float, unit: str) -> str:
    """Return a size that is not negative in a unit that people compare.

    Parameters
    ----------
    value, unit : raw, or SI.

    Examples
    --------
    >>> amount(0.0123, "m/s^2"), amount(2e-4, "1"), amount(3e-3, "rad")
    ('12 mm/s²', '200 ppm', '3 mrad')
    """
    if unit == "1":
        return f"{two_digits(100.0 * value)} %" if value >= 1e-3 else f"{two_digits(1e6 * value)} ppm"
    if unit == "rad":
        return f"{two_digits(1e3 * value)} mrad" if value >= 1e-4 else f"{two_digits(1e6 * value)} µrad"
    force = specific_force_factor(unit) if find_unit("specific force", unit) else None
    rate = angular_rate_factor(unit) if find_unit("angular rate", unit) else None
    if force is not None:
        return f"{two_digits(1e3 * force * value)} mm/s²"
    if rate is not None:
        degrees = float(np.degrees(rate * value))
        return f"{two_digits(degrees)} °/s" if degrees >= 0.1 else f"{two_digits(3600.0 * degrees)} °/h"
    return f"{value:.2g} {unit}"


def _p(probability: float) -> str:
    return "below 1e-12" if probability < 1e-12 else f"{probability:.2g}"

"""Calibrations one after another: the second corrects what the first has corrected."""

from __future__ import annotations

from tumble.document.result import Calibration
from tumble.errors import UsageError
from tumble.units import angular_rate_factor, specific_force_factor


def compose_calibrations(first: Calibration, second: Calibration, *, unmarked: bool = False) -> Calibration:
    """Return one calibration that corrects by `first` and then by `second`, both with their temperature.

    The composition is exact, for one function is applied to what the other gives: coefficients are not added,
    which would lose the products of both (the second's bias goes through the first's matrix at every
    temperature), and which has no answer where lag, functions or reference temperature differ. With
    ``true_1 = M_1(T)^-1 (raw - b_1(T))`` the result is ``M_2(T)^-1 (true_1 - b_2(T))``.

    Parameters
    ----------
    first : of the raw numbers: a factory's or a firmware's compensation, or an earlier calibration.
    second : estimated on recordings that were corrected by `first`, as their columns say.
    unmarked : the caller knows that `second` was estimated so, and its recordings did not say it.

    Raises
    ------
    UsageError
        If `second` was estimated on other recordings, or takes other units than m/s² and rad/s, or does to them
        what `first` has done already.
    """
    identities = [*first.input_corrected_by, *(stage.identity for stage in first.stages)]
    if second.identity in identities:
        raise UsageError("The two calibrations are the same: the same correction would be applied twice.")
    if second.composed_with is not None:
        raise UsageError("The second calibration is composed already: compose its stages one by one.")
    if second.input_corrected_by != identities and not (unmarked and not second.input_corrected_by):
        was = (
            f"on recordings corrected by {', '.join(second.input_corrected_by)}"
            if second.input_corrected_by
            else "on raw recordings, as far as they say"
        )
        raise UsageError(
            f"The second calibration was made {was}, not on what the first one ({', '.join(identities)}) gives: "
            "together they would correct the same error twice. Correct a recording by the first "
            "(`tumble apply`), calibrate on the corrected one, and compose these two."
        )
    units = second.raw_units
    if specific_force_factor(units.specific_force) != 1.0 or angular_rate_factor(units.angular_rate) != 1.0:
        raise UsageError(
            f"The second calibration takes {units.specific_force} and {units.angular_rate}, and the first one "
            "gives m/s² and rad/s."
        )
    if (first.accelerometer is None) != (second.accelerometer is None) or (first.gyroscope is None) != (
        second.gyroscope is None
    ):
        raise UsageError("The two calibrations are not of the same triads.")
    return second.model_copy(
        update={"composed_with": first, "input_corrected_by": identities, "limits": None}
    )

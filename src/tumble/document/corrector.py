"""`Corrector`: a calibration at work on consecutive blocks of a recording."""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series, Vectors
from tumble.calibration import LeverArms
from tumble.document.part import Rows
from tumble.errors import CalibrationFileError, UsageError
from tumble.sensor import ImuModel, Outside, ThermalModel, ThermalState

NO_TEMPERATURE = (
    "The calibration changes with temperature, and no temperature was given: name the column with --columns "
    "(temperature, in °C), or give one for the whole recording with --temperature."
)


class Corrector:
    """Corrects block after block by a calibration.

    Lag, rate and hysteresis of the sensor's temperature are carried from one block to the next, and so is the last
    angular rate, of which lever arms make an acceleration: blocks
    give the same numbers as the whole, as long as the first one is longer than `smoothing`.

    Attributes
    ----------
    warmest, coldest : °C of the sensor so far; NaN without a thermal model.
    fastest : K/s, largest rate of change of it so far.
    """

    def __init__(
        self, model: ImuModel, thermal: ThermalModel | None, lever_arms: Rows | None, outside: Outside
    ) -> None:
        """Begin at the start of a recording."""
        self.outside: Outside = outside
        self.warmest = self.coldest = float("nan")
        self.fastest = 0.0
        self._thermal, self._model = thermal, model
        self._state: ThermalState | None = None
        self._arms = LeverArms.of(lever_arms, model)

    def correct(
        self,
        raw_specific_force: Vectors | None,
        raw_angular_rate: Vectors | None,
        time: Series | None,
        temperature_celsius: Series | float | None,
    ) -> tuple[Vectors | None, Vectors | None]:
        """Return corrected specific force (m/s²) and angular rate (rad/s) of the next block.

        Raises
        ------
        CalibrationFileError
            If a g-sensitivity is to be taken out and there is no corrected specific force, or a finite raw
            number becomes one that is not.
        UsageError
            If an array is not (samples, 3) or not as long as the others, a thermal model has no temperature, or a
            changing one no time; or if there are lever arms and no time.
        ThermalSpanError
            If the temperature leaves the calibrated span and `outside` is ``refuse``.
        ValueError
            If a matrix is singular.
        """
        force = _samples(raw_specific_force, "raw_specific_force")
        rate = _samples(raw_angular_rate, "raw_angular_rate")
        _same_length(
            raw_specific_force=force,
            raw_angular_rate=rate,
            time=time,
            temperature_celsius=temperature_celsius,
        )
        raw_force, raw_rate = force, rate
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused below
            force, rate = self._calibrated(force, rate, time, temperature_celsius)
        _refuse_not_finite("specific force", force, raw_force, raw_rate)
        _refuse_not_finite("angular rate", rate, raw_force, raw_rate)
        return force, rate

    def _calibrated(
        self,
        force: Vectors | None,
        rate: Vectors | None,
        time: Series | None,
        temperature_celsius: Series | float | None,
    ) -> tuple[Vectors | None, Vectors | None]:
        lacks_force = force is None or self._model.accelerometer is None
        if self._model.g_sensitivity is not None and rate is not None and lacks_force:
            raise CalibrationFileError(
                "The calibration's gyro has a g-sensitivity, which acts on the specific force: "
                "angular rates cannot be corrected without it."
            )
        if self._thermal is None:
            force, rate = corrected(self._model, force, rate)
        else:
            force, rate = self._along(self._thermal, force, rate, time, temperature_celsius)
        if self._arms is not None and force is not None and rate is not None:
            force = self._arms.taken_out(force, rate, time)
        return force, rate

    def _along(
        self,
        thermal: ThermalModel,
        force: Vectors | None,
        rate: Vectors | None,
        time: Series | None,
        temperature: Series | float | None,
    ) -> tuple[Vectors | None, Vectors | None]:
        samples = next((part.shape[0] for part in (force, rate) if part is not None), 0)
        if samples == 0:
            return force, rate
        given = _given_temperature(temperature, samples, begun=self._state is not None)
        if time is None:
            if np.ptp(given) > 0.0:
                raise UsageError(
                    "The temperature changes, and there is no time: rate, lag and hysteresis need it."
                )
            time = np.zeros(samples)
        path = thermal.path(np.asarray(time, dtype=float), given, self._state)
        corrected = thermal.correct_along(path, time, force, rate, outside=self.outside)
        self._state = path.end
        self.coldest = float(np.fmin(self.coldest, path.temperature.min()))
        self.warmest = float(np.fmax(self.warmest, path.temperature.max()))
        self.fastest = max(self.fastest, float(np.abs(path.rate).max()))
        return corrected


def _samples(values: object, name: str) -> Vectors | None:
    """Return an argument as an array of (samples, 3)."""
    if values is None:
        return None
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise UsageError(
            f"{name} holds something that is no number: give an array of (samples, 3)."
        ) from None
    if array.ndim != 2 or array.shape[1] != 3:
        advice = {(3,): ", of one sample (1, 3)"}.get(array.shape, "")
        if array.ndim == 2 and array.shape[0] == 3:
            advice = ": turn it round (.T)"
        raise UsageError(f"{name} has the shape {array.shape}: give (samples, 3), one row a sample{advice}.")
    return array


def _same_length(**arguments: Vectors | Series | float | None) -> None:
    """Refuse arrays of different numbers of samples; one number serves them all."""
    arrays = {name: np.asarray(values) for name, values in arguments.items() if values is not None}
    lengths = {name: array.shape[0] for name, array in arrays.items() if array.ndim}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise UsageError(f"The arrays have different numbers of samples ({told}): give as many of each.")


def _given_temperature(temperature: Series | float | None, samples: int, *, begun: bool) -> Series:
    if temperature is None:
        raise UsageError(NO_TEMPERATURE)
    given = np.broadcast_to(np.asarray(temperature, dtype=float), (samples,))
    if not begun and not np.isfinite(given).any():
        raise UsageError("The temperature holds no number: name another column with --columns.")
    if np.isinf(given).any():
        raise UsageError(
            f"The temperature of sample {int(np.argmax(np.isinf(given))) + 1} is infinite: give °C of the unit."
        )
    return np.ascontiguousarray(given)


def _refuse_not_finite(what: str, corrected: Vectors | None, *raw: Vectors | None) -> None:
    """Refuse numbers that overflowed; where a raw number is none already, neither is the corrected one."""
    if corrected is None or np.isfinite(corrected).all():
        return
    finite = np.logical_and.reduce([np.isfinite(part).all(axis=1) for part in raw if part is not None])
    wrong = finite & ~np.isfinite(corrected).all(axis=1)
    if wrong.any():
        raise CalibrationFileError(
            f"The corrected {what} of sample {int(np.argmax(wrong)) + 1} is not finite: the recording's raw numbers "
            "are not in the units of this calibration, or one of the two files is damaged."
        )


def corrected(
    model: ImuModel, raw_force: Vectors | None, raw_rate: Vectors | None
) -> tuple[Vectors | None, Vectors | None]:
    """Return both triads corrected by one model; None for a triad that it lacks, or of which there are no numbers.

    Parameters
    ----------
    model, raw_force, raw_rate : without a specific force beside it the gyros' g-sensitivity is left alone.
    """
    force = rate = None
    if model.accelerometer is not None and raw_force is not None:
        force = model.accelerometer.correct(raw_force)
    if model.gyroscope is not None and raw_rate is not None:
        if model.g_sensitivity is not None and force is not None:
            raw_rate = raw_rate - force @ model.g_sensitivity.T
        rate = model.gyroscope.correct(raw_rate)
    return force, rate

"""What the first two seconds of a stream show to be wrong: said then, and not when the unit is back in its box."""

from __future__ import annotations

import numpy as np

from tumble.capture.live_blocks import LiveBlocks
from tumble.units import COUNTS, STANDARD_GRAVITY, angular_rate_factor, specific_force_factor

# Of the stated rate, by how much the stamps may differ from it.
RATE_SLACK = 0.15
# g: no unit at rest or in the hand shows less on the average, unless gravity was taken out.
LEAST_FORCE, MOST_FORCE = 0.5, 2.0
# rad/s on the average of two seconds: no hand turns so fast.
MOST_RATE = 35.0
# Hz: slower streams lose the turns between poses.
SLOW = 20.0


def early_doubts(live: LiveBlocks, seconds: float) -> list[str]:
    """Return what is wrong with a stream, as sentences with what to do.

    Parameters
    ----------
    live : the blocks so far.
    seconds : from the first stamp to the last.
    """
    channels = live.channels
    doubts: list[str] = []
    rate = (live.samples - 1) / seconds if seconds > 0.0 else channels.rate
    if abs(rate / channels.rate - 1.0) > RATE_SLACK:
        doubts.append(
            f"Samples come at {rate:.4g} Hz, and {channels.rate:.4g} Hz was said: mend the setting of the unit, or "
            f"say --rate {rate:.4g}."
        )
    elif rate < SLOW:
        doubts.append(
            f"Samples come at {rate:.3g} Hz only: turns need 50 Hz or more. Set a higher output rate."
        )
    if channels.angular_rate_unit is None:
        doubts.append("No gyro comes in: only the accelerometers can be calibrated. Switch its output on.")
    if channels.specific_force_unit is None:
        doubts.append(
            "No accelerometer comes in: nothing can be calibrated from poses. Switch its output on."
        )
    return doubts + _of_force(live) + _of_rate(live)


def _of_force(live: LiveBlocks) -> list[str]:
    factor = specific_force_factor(live.channels.specific_force_unit or COUNTS)
    force = live.newest("force", 60)
    if force is None or not len(force):
        return []
    if np.all(force == force[0]):
        return ["The accelerometer always says the same number: it does not measure."]
    if factor is None:
        return []
    size = float(np.median(np.linalg.norm(force, axis=1))) * factor / STANDARD_GRAVITY
    if size < 0.2:
        words = (
            f"The accelerometer shows {size:.2f} g, so the device takes gravity out: send the raw acceleration, not "
            "the linear one."
        )
        return [words]
    if not LEAST_FORCE < size < MOST_FORCE:
        words = (
            f"The accelerometer shows {size:.3g} g, which cannot be in {live.channels.specific_force_unit}: say what "
            "unit it is (--units)."
        )
        return [words]
    return []


def _of_rate(live: LiveBlocks) -> list[str]:
    factor = angular_rate_factor(live.channels.angular_rate_unit or COUNTS)
    rate = live.newest("rate", 60)
    if rate is None or not len(rate):
        return []
    if np.all(rate == 0.0):
        words = (
            "The gyro shows exactly zero: the device takes its bias out at rest, or the gyro is off. Switch its own "
            "calibration off and send raw rates."
        )
        return [words]
    if np.mean(np.all(rate == 0.0, axis=1)) > 0.5:
        words = (
            "The gyro shows exactly zero for much of the time: the device corrects it already. Switch its own "
            "calibration (bias tracking, dead band) off."
        )
        return [words]
    if factor is not None and float(np.median(np.linalg.norm(rate, axis=1))) * factor > MOST_RATE:
        return [
            f"The gyro shows rates that cannot be in {live.channels.angular_rate_unit}: say the unit (--units)."
        ]
    return []

"""Do the triads agree? The turns show the lag between their samples, and whether they mean the same axes and units.

While the unit turns, gravity moves through the accelerometers as the gyro says: the change of the
specific force over a short window is the integral of ``cross(f, rate)``. If the accelerometer's
samples are later than the gyro's by ``lag``, the rate that belongs to f(t) is rate(t - lag), and the
window is off by ``-lag`` times the integral of ``cross(f, d rate / dt)``. One linear regression
over all windows gives the lag. The hand's own accelerations are noise in it; they are correlated
within a turn, so that the uncertainty comes from the scatter between turns.

Whether accelerometer and gyro columns agree on axes and units: the turns show it.

Gravity carried by the gyro must be what the accelerometers see. A gyro whose axes are swapped,
reversed or left-handed against the accelerometers', or in another unit than declared, cannot do it.
What turns cannot show: the overall sign of gravity, and both triads permuted in the same way.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tumble.arrays import Matrix, Series, Vectors
from tumble.calibration.equations.holds_and_turns import HoldsAndTurns
from tumble.calibration.estimate import Estimate, NamedValue, TermTest, coverage_factor
from tumble.calibration.evidence import Budget
from tumble.errors import RecordingError
from tumble.recording import Recording, describe_axis_contradiction, unit_of_scale
from tumble.records import dataclass
from tumble.sensor import ImuModel
from tumble.units import angular_rate_factor

# Consumer units have scale errors of a few per cent; a start value adds some 10 %. Beyond this the
# columns are not in the unit that they are said to be in.
LARGEST_SCALE_RATIO = 1.5


def refuse_contradicting_axes(recording: Recording, gyro_inverse: Matrix) -> None:
    """Refuse a recording whose turns show other gyro axes or units than its columns say.

    Parameters
    ----------
    gyro_inverse : (3, 3) rough rad/s per raw unit, from the turns.

    Raises
    ------
    RecordingError
        Naming the axes or the unit that the turns show.
    """
    contradiction = describe_axis_contradiction(gyro_inverse, recording.columns)
    if contradiction is not None:
        raise RecordingError(contradiction)
    factor = angular_rate_factor(recording.angular_rate_unit)
    if factor is None:
        return
    scale = float(np.median(np.linalg.norm(gyro_inverse, axis=0)))
    if not 1.0 / LARGEST_SCALE_RATIO < scale / factor < LARGEST_SCALE_RATIO:
        unit = unit_of_scale(scale)
        raise RecordingError(
            f"The angular rate is said to be in {recording.angular_rate_unit}, but the turns show "
            f"{scale / factor:.3g} times that{f' (it looks like {unit})' if unit else ''}. "
            "Declare the unit with --units."
        )


# A term that is not there is kept in fewer than this share of recordings, all terms together; the lag by hand takes a
# third of it.
TERM_FALSE_ALARM = 0.02
LAG_LIMIT = TERM_FALSE_ALARM / 3
WINDOW = 0.1  # s: short against a turn's acceleration, long against accelerometer noise
SMALLEST_TURNS = 8
# Of a sample's step: what the trapezoids between samples leave, (rate x step)² / 12 with 6 rad/s at 25 Hz.
TRUNCATION = 0.005


@dataclass(frozen=True)
class TimeLag:
    """How much later the accelerometer's samples are than the gyro's, s, and its standard uncertainty."""

    lag: float
    sigma: float
    turns: int


def estimate_time_lag(data: HoldsAndTurns, model: ImuModel) -> TimeLag | None:
    """Return the accelerometer's lag behind the gyro, or None where turns are too few.

    Parameters
    ----------
    data : holds and turns, raw.
    model : calibrated; its time lag is taken as zero in what follows from hold to hold, where a lag
        of a few samples does not matter.

    Raises
    ------
    ValueError
        If the model lacks a triad.
    """
    products: list[tuple[float, float]] = []
    turns = np.flatnonzero(data.turn_start >= 0)
    for turn in map(slice, data.turn_start[turns].tolist(), data.turn_stop[turns].tolist()):
        time = data.time[turn]
        edges = np.arange(0, time.size - 1, max(2, round(WINDOW / float(np.median(np.diff(time))))))
        if edges.size >= 3:
            force, rate = model.correct(data.raw_force[turn], data.raw_rate[turn])
            products.append(_window_products(time, force, rate, edges))
    if len(products) < SMALLEST_TURNS:
        return None
    top, bottom = np.array(products).T
    # A turn with a knock in it pulls at most as three ordinary ones do.
    single = top / np.maximum(bottom, 1e-300)
    centre = float(np.median(single))
    limit = 3.0 * 1.4826 * float(np.median(np.abs(single - centre)))
    keep = np.abs(single - centre) <= max(limit, 1e-9)
    lag = float(np.sum(top[keep]) / np.sum(bottom[keep]))
    misfit = top[keep] - lag * bottom[keep]
    count = int(np.count_nonzero(keep))
    sigma = float(np.sqrt(np.sum(misfit**2) * count / max(count - 1, 1)) / np.sum(bottom[keep]))
    truncation = TRUNCATION * data.step
    return TimeLag(lag, float(np.hypot(sigma, truncation)), count)


def _window_products(time: Series, force: Vectors, rate: Vectors, edges: np.ndarray) -> tuple[float, float]:
    """Return regressor . residual and regressor . regressor, summed over a turn's windows from edge to edge."""
    middle_force, middle_rate = 0.5 * (force[1:] + force[:-1]), 0.5 * (rate[1:] + rate[:-1])

    def over_windows(each: Vectors) -> Vectors:
        return np.diff(np.vstack([np.zeros(3), np.cumsum(each, axis=0)])[edges], axis=0)

    carried = over_windows(np.cross(middle_force, middle_rate) * np.diff(time)[:, None])
    regressor = -over_windows(np.cross(middle_force, np.diff(rate, axis=0)))
    residual = np.diff(force[edges], axis=0) - carried
    weight = 1.0 / np.maximum(np.linalg.norm(residual, axis=1), 0.3)[:, None]
    return float(np.sum(weight * regressor * residual)), float(np.sum(weight * regressor**2))


def add_time_lag(estimate: Estimate, data: HoldsAndTurns) -> None:
    """Test whether the triads are sampled at the same instants; note a lag that is significant.

    Parameters
    ----------
    estimate : gets the test, and the lag as a parameter and a remark.
    data : holds and turns.
    """
    from scipy.special import stdtr

    found = estimate_time_lag(data, estimate.model)
    if found is None:
        return
    ratio = found.lag / max(found.sigma, 1e-12)
    probability = 2.0 * float(stdtr(found.turns - 1, -abs(ratio)))
    kept = probability < LAG_LIMIT
    estimate.terms.append(
        TermTest("time_lag", kept, ratio**2, 1, probability, LAG_LIMIT, f"{ratio:+.1f} sigma")
    )
    if not kept:
        return
    name = "lag of the accelerometer behind the gyro"
    estimate.parameters.append(NamedValue(name, found.lag, found.sigma, "s"))
    size = estimate.correlations.shape[0]
    correlations = np.eye(size + 1)
    correlations[:size, :size] = estimate.correlations
    estimate.correlations = correlations
    budget = estimate.shown(Budget)
    if budget is not None:
        _add_lag(budget, found.sigma, found.turns - 1)
    earlier = "earlier" if found.lag > 0 else "later"
    estimate.say(
        "remark",
        f"The accelerometer's samples belong to instants {abs(1e3 * found.lag):.1f} ms (± "
        f"{1e3 * found.sigma:.1f} ms) {earlier} than the gyro's. The estimate does not depend on it. "
        "`tumble apply --shift-lag` takes it out, or give it to your filter.",
    )


def _add_lag(budget: Budget, sigma: float, degrees: int) -> None:
    """Append the lag: the turns tell it, and nothing else of the budget does."""
    shares, told = budget.shares, budget.statement
    cause = "gyros while turning" if "gyros while turning" in shares else next(iter(shares))
    budget.shares = {name: np.append(part, sigma if name == cause else 0.0) for name, part in shares.items()}
    if told is not None:
        told.effective_degrees = np.append(told.effective_degrees, float(degrees))
        told.coverage_factors = np.append(told.coverage_factors, coverage_factor(degrees))
        told.model_choice = [
            replace(choice, change=np.append(choice.change, 0.0)) for choice in told.model_choice
        ]

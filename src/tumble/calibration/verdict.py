"""Is the calibration fit for use? Plausibility gates, and a verdict in plain words.

An adjustment raises a variance until its residuals are as large as they should be, whatever made them so. What a unit
does by itself has a limit, which data sheets tell: the in-run stability of the worst of them, and what such a unit's
bias does within the few degrees by which a room warms while one records. Beyond it a variance is an objection.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Series
from tumble.calibration.estimate import Estimate, NamedValue
from tumble.calibration.session import PROCEDURES
from tumble.parameters import amount, parameter_of, two_digits
from tumble.recording import Recording
from tumble.records import dataclass
from tumble.sensor import Triad
from tumble.units import angular_rate_factor, specific_force_factor

# Start of a component's name: its ceiling, a factor to the unit shown, that unit, what to do. Phones' accelerometers
# wander by 0.3 mg and drift by 0.5 mg/K, their gyros by 0.01 °/s and by 0.03 (°/s)/K: 2 mg and 0.2 °/s are three to
# five kelvin.
_MOVED = "look for holds in which the unit moved, and for a wrong range or unit"
_WENT_WRONG = "look for holds or turns that went wrong, and for lost samples"
_CEILINGS = (
    ("accelerometer bias", 0.02, 1e3, "mm/s²", _MOVED),
    ("gyro bias", np.radians(0.2), np.degrees(1.0), "°/s", _WENT_WRONG),
)


def beyond_ceilings(estimate: Estimate) -> list[str]:
    """Object to variance components that nothing explains that a unit does.

    Parameters
    ----------
    estimate : with the components that were found.
    """
    against: list[str] = []
    for name, value in estimate.variance_components.items():
        for start, ceiling, factor, unit, remedy in _CEILINGS:
            if name.startswith(start) and value > ceiling:
                against.append(
                    f"The residuals ask for more than any unit does: {name.partition(',')[0]} of "
                    f"{factor * value:.2g} {unit}, where {factor * ceiling:.2g} {unit} is the most "
                    f"that one has{_worst_hold(estimate)}: {remedy}."
                )
    return against


def _worst_hold(estimate: Estimate) -> str:
    """Return which hold misses gravity most."""
    norms = estimate.holds.norms
    if not norms.size or not np.any(np.isfinite(norms)):
        return ""
    return f" (hold {int(np.nanargmax(np.abs(norms))) + 1} misses gravity most)"


# Beyond these a value is no sensor's: consumer data sheets allow 3 % of scale, analogue ones 10 %, and 2 % of
# cross-axis sensitivity (20 mrad); hand-soldered boards some degrees between the triads.
UNUSUAL_SCALE_ERROR = 0.05
LARGEST_SCALE_ERROR = 0.1
# Gyros that are all off alike, to this share of what they are off by, are off as a wrong sample rate makes them; a data
# sheet allows each of them the second.
ALIKE, ON_DATA_SHEETS = 0.2, 0.03
_A = {"accelerometer": "An accelerometer", "gyro": "A gyro"}
# Between two units that one may take for the other, and what the two are called.
_FACTORS = (
    (9.80665, "g beside m/s²"),
    (180.0 / np.pi, "degrees beside radians"),
    (2.0, "another range (of a gyro, or another sample rate)"),
)
LARGEST_ANGLE = np.radians(15.0)
# An accelerometer bias beyond 0.2 g, half of the worst consumer zero-g offsets on record.
LARGEST_FORCE_BIAS = 2.0
# Less certain than an uncalibrated consumer unit is by its data sheet: no use.
WORST_SCALE_SIGMA = 0.02
WORST_ANGLE_SIGMA = 0.02
WORST_FORCE_BIAS_SIGMA = 0.1
# More left out than this, and the rest is no majority to trust.
LARGEST_SHARE_LEFT_OUT = 0.25
# Residuals beyond these are no noise of any unit worth calibrating, however small the stated
# uncertainties: 2 mg on gravity, 1.5 degrees after a turn. The model does not describe the data.
LARGEST_RMS_NORM = 0.02
LARGEST_RMS_TURN = np.radians(1.5)
# Nor are residuals that are larger than is expected of them. What is expected is right to this factor (of 413 simulated
# recordings of all procedures none was beyond 1.75, real ones are at 0.6 to 1.2); beyond it chance adds something.
EXPECTED_TO, MISFIT_FALSE_ALARM = 1.6, 1e-3
# Residuals of right recordings are up to 2.7 times the noise at rest, of real ones by hand 3.7, over temperature 15.
LARGEST_SIGMA0 = 30.0


@dataclass(frozen=True)
class Judgement:
    """`fit` for use or not, with reasons as sentences (against first)."""

    fit: bool
    reasons: list[str]


def judge(estimate: Estimate, recording: Recording, *, confirm_scale: bool = False) -> Judgement:
    """Judge an estimate by plausibility, by its own uncertainties and by its residuals.

    Parameters
    ----------
    estimate, recording : what was found, and what it was found in.
    confirm_scale : the user knows that the scale factors are beyond what units have.
    """
    implausible, unusual = _doubtful_scales(estimate, recording)
    against_scale: list[str] = []
    if confirm_scale:
        unusual = [*(f"{text} It was confirmed (--confirm-scale)." for text in implausible), *unusual]
    else:
        against_scale = [f"{text} If the unit is really so, say --confirm-scale." for text in implausible]
    against = [
        *estimate.objections,
        *against_scale,
        *_implausible(estimate, recording),
        *misfit(estimate),
        *beyond_ceilings(estimate),
        *_too_uncertain(estimate),
        *_too_much_left_out(estimate),
    ]
    return Judgement(not against, [*against, *estimate.cautions, *unusual, *_in_plain_words(estimate)])


def misfit(estimate: Estimate) -> list[str]:
    """Object to residuals that no unit worth calibrating has, or that are far larger than is expected of them.

    Parameters
    ----------
    estimate : with holds and turns; those that were left out speak against nothing but themselves.
    """
    against: list[str] = []
    holds, turns = estimate.holds, estimate.turns
    norm, angle = _root_mean_square(holds.norms), float(np.degrees(_root_mean_square(turns.angles)))
    many = _times_expected(estimate, "hold", holds.norms, holds.sigmas, 1)
    if norm > LARGEST_RMS_NORM or many:
        against.append(
            f"The corrected specific force misses gravity by {two_digits(1e3 * norm)} mm/s² rms{many}. The "
            "fitted model does not describe these holds (too few unknowns, an alien prior, or a unit "
            "that moved)."
        )
    many = _times_expected(estimate, "turn", turns.angles, turns.sigmas, 2)
    if angle > np.degrees(LARGEST_RMS_TURN) or many:
        against.append(
            f"Gravity carried over the turns misses by {two_digits(angle)}° rms{many}: the gyro's model does not "
            "describe these turns (saturation, a wrong clock, lost samples)."
        )
    if estimate.sigma0 > LARGEST_SIGMA0:
        against.append(
            f"The residuals are {estimate.sigma0:.0f} times the noise inside the holds, and of right recordings no "
            f"more than {LARGEST_SIGMA0:.0f} times: something else than bias, tremor and bandwidth is in them. Look "
            "for what was left out and why, and record again."
        )
    return against


def _times_expected(estimate: Estimate, kind: str, found: Series, expected: Series, components: int) -> str:
    """Say by how much residuals that take part are too large, each of so many components; nothing if chance may be."""
    from scipy.special import chdtri

    taken = np.setdiff1d(
        np.arange(found.size), [left.index for left in estimate.left_out if left.kind == kind]
    )
    if not taken.size or expected.size != found.size:
        return ""
    ratios = found[taken] / np.where(expected[taken] > 0.0, expected[taken], np.nan)
    degrees = components * int(np.count_nonzero(np.isfinite(ratios)))
    if not degrees or estimate.degrees_of_freedom <= 0:
        return ""
    times, limit = (
        _root_mean_square(ratios),
        EXPECTED_TO * np.sqrt(chdtri(degrees, MISFIT_FALSE_ALARM) / degrees),
    )
    return f", {two_digits(times)} times what is expected" if times > limit else ""


def _root_mean_square(values: np.ndarray) -> float:
    """Return the root of the mean square of what is finite; zero of nothing."""
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else 0.0


def _known_triads(estimate: Estimate, recording: Recording) -> list[tuple[str, Triad, float | None]]:
    """Return (name, triad, SI units of one raw unit) of the triads whose matrices are known."""
    gyro_known = any(name.startswith("gyroscope.matrix") for name in estimate.names)
    model = estimate.model
    triads = (
        ("accelerometer", model.accelerometer, specific_force_factor(recording.specific_force_unit)),
        ("gyro", model.gyroscope if gyro_known else None, angular_rate_factor(recording.angular_rate_unit)),
    )
    return [(name, triad, factor) for name, triad, factor in triads if triad is not None]


def _doubtful_scales(estimate: Estimate, recording: Recording) -> tuple[list[str], list[str]]:
    """Return what is said of scale factors that no unit has, and of those that few have."""
    implausible: list[str] = []
    unusual: list[str] = []
    for name, triad, factor in _known_triads(estimate, recording):
        length = np.linalg.norm(triad.matrix, axis=1)
        if not np.min(length) > 0.0:
            continue
        # Counts have no nominal scale: there the axes are compared with one another.
        middle = 0.5 * (np.min(length) + np.max(length)) if factor is None else 1.0 / factor
        common, far = _of_sample_rate(length / middle, recording) if name == "gyro" else ("", False)
        if common:
            (implausible if far else unusual).append(common)
            continue
        error = np.abs(length / middle - 1.0)
        worst = float(length[np.argmax(error)] / middle)
        told = f"{_A[name]} scale of {worst:.3f} of the nominal one is"
        if factor is None:
            ratio = np.max(length) / np.min(length)
            told = f"A factor of {ratio:.3g} between the {name}s' scale factors is"
        if np.max(error) > LARGEST_SCALE_ERROR:
            implausible.append(
                f"{told} beyond belief: {_as_units(length, middle)}check the unit (--units) and gravity."
            )
        elif np.max(error) > UNUSUAL_SCALE_ERROR:
            unusual.append(f"{told} unusual, for data sheets allow 3 %: check the unit (--units).")
    return implausible, unusual


def _of_sample_rate(scales: Series, recording: Recording) -> tuple[str, bool]:
    """Say that all gyros are off alike, where only a counter of samples is behind them; and whether by too much."""
    off, clock = float(np.mean(scales)) - 1.0, recording.clock
    counted = clock.kind in ("nominal", "stated") and ON_DATA_SHEETS < abs(off) < LARGEST_SCALE_ERROR
    if not counted or float(np.ptp(scales)) > ALIKE * abs(off):
        return "", False
    said = (
        f"All gyro scales are {1.0 + off:.3f} of the nominal one, alike to {100.0 * float(np.ptp(scales)):.1g} %. A "
        f"sample rate of {clock.rate * (1.0 + off):.4g} Hz instead of {clock.rate:.4g} Hz does that, and data sheets "
        "allow a gyro 3 %. Check the rate (--rate)."
    )
    return said, abs(off) > UNUSUAL_SCALE_ERROR


def _as_units(length: np.ndarray, middle: float) -> str:
    """Return which mistaken unit has the factor that is seen, if one has."""
    ratios = np.abs(np.log([*(length / middle), np.max(length) / np.min(length)]))
    for size, words in _FACTORS:
        if np.min(np.abs(ratios - np.log(size))) < LARGEST_SCALE_ERROR:
            return f"a factor of {size:.3g} is {words}; "
    return ""


def _implausible(estimate: Estimate, recording: Recording) -> list[str]:
    against: list[str] = []
    for name, triad, factor in _known_triads(estimate, recording):
        if not np.min(np.linalg.norm(triad.matrix, axis=1)) > 0.0:
            against.append(f"{_A[name]} scale factor is zero or no number: check the columns (--columns).")
            continue
        if np.linalg.det(triad.matrix) <= 0:
            against.append(f"The {name}s form a left-handed triad: a scale factor is negative.")
        axes = triad.matrix / np.linalg.norm(triad.matrix, axis=1, keepdims=True)
        if np.max(np.arccos(np.clip(np.diag(axes), -1.0, 1.0))) > LARGEST_ANGLE:
            against.append(
                f"{_A[name]} axis is more than 15° off: check the order of the columns (--columns)."
            )
        bias = float(np.max(np.abs(triad.bias))) * (factor or 0.0)
        if name == "accelerometer" and bias > LARGEST_FORCE_BIAS:
            against.append(
                f"An accelerometer bias of {bias:.2f} m/s² is beyond what sensors have "
                f"({LARGEST_FORCE_BIAS:g} m/s²): check the unit and the columns."
            )
    return against


def _too_uncertain(estimate: Estimate) -> list[str]:
    against: list[str] = []
    own = PROCEDURES.get(estimate.procedure)
    remedy = "another estimator may determine more" if own is None else own.remedy
    for parameter in estimate.parameters:
        sigma, limit, shown = _relative_sigma(parameter) or (0.0, 1.0, "")
        if not sigma < limit:
            against.append(
                f"{parameter.name[0].upper()}{parameter.name[1:]} is only known to ± {shown}, worse than an "
                f"uncalibrated unit: {remedy}."
            )
    return against


def _relative_sigma(parameter: NamedValue) -> tuple[float, float, str] | None:
    """Return (sigma, limit, sigma in words) of the parameters that a limit exists for."""
    sigma, family = parameter.standard_uncertainty, parameter_of(parameter.name).family
    if family.kind == "scale factor error":
        return sigma, WORST_SCALE_SIGMA, amount(sigma, "1")
    if family.kind == "scale factor":
        share = sigma / abs(parameter.value) if parameter.value else float("inf")
        return share, WORST_SCALE_SIGMA, amount(share, "1")
    if parameter.unit == "rad":
        return sigma, WORST_ANGLE_SIGMA, amount(sigma, "rad")
    factor = specific_force_factor(parameter.unit) if family.name == "accelerometer bias" else None
    if factor is not None:
        return sigma * factor, WORST_FORCE_BIAS_SIGMA, amount(sigma, parameter.unit)
    return None


def _about_spins(estimate: Estimate) -> str:
    """Return how well the corrected gyro shows the table's rates."""
    if estimate.spins.rates.size == 0:
        return ""
    spins = estimate.spins
    # Of the rate as a vector: of one about the axis alone, three components are one number.
    rms, noise = (_root_mean_square(np.linalg.norm(rate, axis=1)) for rate in (spins.residuals, spins.sigmas))
    largest = float(np.max(np.abs(spins.rates)))
    return (
        f"Corrected, {spins.rates.size} spins show the table's rate within "
        f"{two_digits(1e3 * np.degrees(rms))} m°/s rms, {two_digits(1e6 * rms / largest)} ppm of the fastest "
        f"({two_digits(1e3 * np.degrees(noise))} expected)."
    )


def _too_much_left_out(estimate: Estimate) -> list[str]:
    against, turns = list[str](), estimate.turns.found.size
    holds, spins = estimate.holds.norms.size, estimate.spins.rates.size
    for kind, total in (("hold", holds), ("turn", turns), ("spin", spins)):
        gone = len({left.index for left in estimate.left_out if left.kind == kind})
        if total and gone > LARGEST_SHARE_LEFT_OUT * total:
            against.append(
                f"{gone} of {total} {kind}s contradict the others and were left out: too many to trust the rest."
            )
    return against


def _without_gyro_matrix(estimate: Estimate) -> str:
    """Return what a calibration is that has no matrix of the gyros."""
    if estimate.thermal is None:
        return "This is the accelerometers' calibration: of the gyro only the bias at rest is known."
    if any(name.startswith("accelerometer") for name in estimate.names):
        return (
            "This is the accelerometers' calibration over temperature: of the gyros the biases are known over "
            "temperature, and not their scale factors."
        )
    return (
        "This is a calibration of how the biases of both triads change with temperature, and of no "
        "scale factors. A calibration at one temperature completes it, of recordings that this one "
        "has corrected (tumble apply)."
    )


def _in_plain_words(estimate: Estimate) -> list[str]:
    """Return what can be said for the calibration, in numbers."""
    words: list[str] = []
    holds = estimate.holds.norms.size
    rms, noise = _root_mean_square(estimate.holds.norms), _root_mean_square(estimate.holds.sigmas)
    if holds:
        counted = f"{holds} {'holds' if estimate.thermal is None else 'stretches of rest'}"
        words.append(
            f"Corrected, {counted} show gravity within {two_digits(1e3 * rms)} mm/s² rms "
            f"({two_digits(1e3 * noise)} expected)."
        )
    words += filter(None, [_about_spins(estimate)])
    if estimate.model.accelerometer is None:
        words.append("This is the gyros' calibration: the accelerometers are not calibrated by it.")
    if estimate.model.gyroscope is not None and not any(
        name.startswith("gyroscope.matrix") for name in estimate.names
    ):
        words.append(_without_gyro_matrix(estimate))
    if count := estimate.turns.found.size:
        both = estimate.turns.angles, estimate.turns.sigmas
        angle, expected = (two_digits(float(np.degrees(_root_mean_square(of)))) for of in both)
        words.append(f"Corrected, {count} turns carry gravity to within {angle}° rms ({expected}° expected).")
    by_chance = estimate.frame == "fixture" and not any(estimate.variance_components.values())
    if np.isfinite(estimate.sigma0) and estimate.sigma0 > 1.5 and not by_chance:
        words.append(
            f"The residuals are {estimate.sigma0:.1f} times the noise inside the holds: biases that wander, knocks and "
            "bandwidth. The stated uncertainties include it."
        )
    return words

"""What to do next, in words: the weakest parameter, the pose or turn that would mend it, the rest."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tumble.arrays import Vector, Vectors
from tumble.calibration import PROCEDURES, describe_direction, most_telling_poses, norm_rows
from tumble.document import Calibration
from tumble.parameters import ACCELEROMETER, BETWEEN, GYRO, Measure, with_uncertainty
from tumble.report.parameters import ParameterRow
from tumble.report.subject import Subject

# One axis turned less than this share of the best one is worth a sentence.
_MUCH_LESS = 0.6


def next_steps(subject: Subject) -> list[str]:
    """Return what would improve the calibration or make it more trustworthy, as sentences.

    Parameters
    ----------
    subject : of the report; with a protocol nobody holds the unit with a corner up.
    """
    calibration, protocol, up_b = subject.calibration, subject.protocol, subject.up_b
    steps: list[str] = []
    if not calibration.verdict.fit:
        steps.append("The calibration is not fit for use: mend what the verdict names, and record again.")
    procedure = None if protocol is None else PROCEDURES.get(protocol.procedure)
    if procedure is not None and procedure.placement:
        steps.append(procedure.placement)
    elif up_b is not None:
        steps += _poses(_without_gravity(calibration, subject.rows), up_b)
        if procedure is None or procedure.free_turns:
            steps += _turns(subject, up_b)
    if calibration.accelerometer is not None:
        steps += _gravity(calibration)
        steps.append(
            "Verify it on another recording that it has not seen, of the same unit, some minutes of holds and turns: "
            "`tumble verify calibration.json` RECORDING."
        )
    temperature = calibration.temperature_celsius
    at = "at one temperature" if temperature is None else f"at {temperature:.0f} °C"
    steps.append(
        f"The values hold {at}. Calibrate again after a shock or a new mounting, when it works more "
        "than about 10 °C from where it was calibrated, and when a verification fails. Biases change "
        "with every power cycle: keep the unit at rest for a few seconds before each use."
    )
    return steps


def _without_gravity(calibration: Calibration, rows: list[ParameterRow]) -> list[ParameterRow]:
    """Return the rows with what gravity's uncertainty does to the scale factors taken out: no pose mends it."""
    site = calibration.site
    share = site.gravity_standard_uncertainty / site.gravity

    def reduced(row: ParameterRow) -> ParameterRow:
        sigma = _relative_sigma(row)
        if row.group != ACCELEROMETER or not row.kind.startswith("scale factor") or not sigma:
            return row
        left = math.sqrt(max(1.0 - (share / sigma) ** 2, 0.0))
        other = None if row.other is None else row.other.times(left, row.other.unit)
        # Only sigma matters here; a scaled value would be wrong, so that it is left away.
        shown = Measure(row.shown.value, left * row.shown.sigma, row.shown.unit)
        return replace(row, shown=shown, other=other)

    return [reduced(row) for row in rows]


def weakest(rows: list[ParameterRow], groups: tuple[str, ...]) -> ParameterRow | None:
    """Return the parameter of the groups that adds most to the error, or None if there is none.

    Bias over gravity, relative scale factor and angle are all errors over 1 g; a gyro's bias is left
    out, because holds tell it at any time.
    """
    errors = [(_relative_sigma(row), row) for row in rows if row.group in groups]
    known = [(error, row) for error, row in errors if error is not None]
    return max(known, key=lambda item: item[0])[1] if known else None


def _relative_sigma(row: ParameterRow) -> float | None:
    """Return sigma in units of what is measured: of 1 g, of the scale factor, or in radians."""
    if row.kind == "bias":
        if row.group != ACCELEROMETER or row.other is None:
            return None
        return row.other.sigma * {"mg": 1e-3, "µg": 1e-6}.get(row.other.unit, math.nan)
    if row.kind == "scale factor":
        return row.shown.sigma / abs(row.shown.value)
    factor = {"%": 1e-2, "ppm": 1e-6, "mrad": 1e-3, "µrad": 1e-6}.get(row.shown.unit)
    return None if factor is None else factor * row.shown.sigma


def _uncertainty(row: ParameterRow) -> str:
    """Return a row's standard uncertainty, in the unit that people compare."""
    measure = row.other if row.other is not None and row.kind in ("bias", "scale factor") else row.shown
    return f"{with_uncertainty(math.nan, measure.sigma)} {measure.unit}"


def _poses(rows: list[ParameterRow], up_b: Vectors) -> list[str]:
    row = weakest(rows, (ACCELEROMETER,))
    if row is None:
        return []
    units = up_b / np.linalg.norm(up_b, axis=1, keepdims=True)
    seen = norm_rows(units)
    first, second = most_telling_poses(seen.T @ seen, 2)
    words = _placed(first)
    if _placed(second) != words:
        words += f", then with {_placed(second)}"
    return [
        (
            f"Hold the unit with {words}: these poses add most. Least known is the accelerometers' {row.label} "
            f"({_uncertainty(row)})."
        )
    ]


def _placed(up: Vector) -> str:
    words = describe_direction(up).replace("-", "−")
    return words if words.endswith(("x up", "y up", "z up")) and len(words) == 5 else f"the {words}"


def _turns(subject: Subject, up_b: Vectors) -> list[str]:
    row = weakest(subject.rows, (GYRO, BETWEEN))
    if row is None:
        if subject.recording.angular_rate is None:
            return []
        return [
            (
                "The gyro's scale factors and axes are not known: turn the unit between the holds about all three "
                "axes, by 90° and more, and calibrate with the hand-held procedure."
            )
        ]
    sentence = f"The least known gyro parameter is the {row.label} ({_uncertainty(row)})."
    angles = _turned_about_horizontal(subject, up_b)
    if angles is None:
        return [sentence]
    least = int(np.argmin(angles))
    shown = ", ".join(f"{axis} {angle:.0f}°" for axis, angle in zip("xyz", np.degrees(angles), strict=True))
    sentence += (
        " Gravity shows a turn about an axis only as far as the axis is horizontal; so counted, the turns "
        f"add up to {shown}."
    )
    if angles[least] < _MUCH_LESS * np.max(angles):
        axis = "xyz"[least]
        return [f"{sentence} Add turns of 90° and more about {axis} while {axis} is horizontal, both ways."]
    return [f"{sentence} No axis lacks turns; more turns of 90° to 180° about all of them would help evenly."]


def _turned_about_horizontal(subject: Subject, up_b: Vectors) -> Vector | None:
    """Return (3,) rad turned about each axis, counted as far as the axis was horizontal; None without gyro."""
    gyro, recording = subject.calibration.gyroscope, subject.recording
    if recording.angular_rate is None or gyro is None or gyro.matrix is None:
        return None
    total = np.zeros(3)
    inverse = np.linalg.inv(np.array(gyro.matrix, dtype=float))
    units = up_b / np.linalg.norm(up_b, axis=1, keepdims=True)
    for turn in subject.timeline.turns:
        if not turn.usable:
            continue
        rates = recording.angular_rate[turn.start : turn.stop]
        angle = inverse @ (rates.sum(axis=0) - len(rates) * np.array(gyro.bias)) / recording.rate
        vertical = 0.5 * (units[turn.before] ** 2 + units[turn.after] ** 2)
        total += np.abs(angle) * np.sqrt(np.maximum(1.0 - vertical, 0.0))
    return total if np.any(total) else None


def _gravity(calibration: Calibration) -> list[str]:
    # Only turns tell the Earth rate from the gyros' own errors.
    if calibration.site.latitude_deg is None and calibration.quality.turns:
        return [
            (
                "With `--site LATITUDE,HEIGHT` instead of `--gravity` the Earth's rotation is known too, which helps "
                "the gyros' biases and g-sensitivity."
            )
        ]
    return []

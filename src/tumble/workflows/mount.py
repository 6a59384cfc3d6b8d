"""How a unit lies on its mount: two recordings at rest and a calibration in, a rotation with its uncertainty out."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from tumble.arrays import Square, Vector
from tumble.calibration import MountAlignment, align_to_mount, check_poses, mean_covariances
from tumble.document import Calibration, plain, read_calibration
from tumble.errors import CalibrationFileError, RecordingError, SegmentationError, UsageError, __version__
from tumble.files import write_text
from tumble.recording import read_recordings
from tumble.records import dataclass
from tumble.segmentation import find_timeline, observe_holds
from tumble.workflows.apply import in_calibration_units, raw_factors
from tumble.workflows.corrected import (
    FAR_FROM_CALIBRATION,
    corrections_of,
    recorded_span,
    refuse_twice,
)
from tumble.workflows.request import MountRequest, silent
from tumble.workflows.verify import force_wander

FORMAT = "tumble mount"
# Rests of one recording whose gravity is farther apart are of different poses, rad.
SAME_POSE = np.radians(0.5)
# Corrected gravity that is off by more is of another unit, or the calibration of another recording's units.
LARGEST_NORM_ERROR = 0.02
_FORMULA = "v_M = C_MB * v_B: from the unit's axes B (the calibration's frame) to the mount's axes M"
# Remarks of the reader that a user has to know of.
_SAID = ("assumed", "mended")
_TEST_VECTOR = np.array([1.0, -2.0, 3.0])


@dataclass(frozen=True)
class Mounted:
    """A unit on its mount.

    Attributes
    ----------
    alignment : the rotation, with its covariance.
    seconds : (2,) at rest, level and pitched.
    norms : (2,) m/s², corrected specific force less gravity.
    remarks : sentences.
    file : where it was written.
    """

    alignment: MountAlignment
    seconds: tuple[float, float]
    norms: tuple[float, float]
    remarks: list[str]
    file: Path


@dataclass(frozen=True)
class _Rest:
    """The rest found in a recording, and what the file was.

    Attributes
    ----------
    force, norm : (3,) m/s² of the mean as it is corrected, and its norm less gravity.
    covariance : (3, 3) of the mean, raw.
    """

    name: str
    sha256: str
    seconds: float
    force: Vector
    norm: float
    covariance: Square


def mount(request: MountRequest) -> Mounted:
    """Find the rotation from a unit's axes to its mount's, and write it.

    Parameters
    ----------
    request : the two recordings at rest, the calibration, and how well the mount was levelled.

    Raises
    ------
    CalibrationFileError, RecordingError, SegmentationError, UsageError
        If an input is wrong, or a recording has no rest, or several in different poses.
    ObservabilityError
        If the poses are not level and pitched with x up.
    OutputError
        If the file cannot be written; an earlier one is intact.
    """
    level, pitched, calibration = request.level, request.pitched, request.calibration
    say, mount_sigma = request.progress or silent, 1e-3 * request.mount_mrad
    if not 0.0 <= mount_sigma <= 0.1:
        raise UsageError(f"A mount levelled to {request.mount_mrad:g} mrad: give 0 to 100 (--mount-mrad).")
    if Path(level).exists() and Path(pitched).exists() and Path(level).samefile(pitched):
        raise UsageError(
            f"{level} is given twice: the second recording has to be of the mount pitched by 90°."
        )
    document = calibration if isinstance(calibration, Calibration) else read_calibration(calibration)
    if document.accelerometer is None or document.accelerometer.matrix is None:
        raise CalibrationFileError(
            "The calibration is of the gyro alone: gravity shows how a unit lies on its mount, and "
            "that takes the accelerometers' calibration."
        )
    target = Path(request.output)
    target = target / "mount.json" if target.is_dir() else target
    remarks: list[str] = []
    rests: list[_Rest] = []
    for path in (level, pitched):
        say(f"reading {Path(path).name}")
        rests.append(_rest(path, document, remarks, request))
    first, second = rests
    check_poses(first.force, second.force, (first.name, second.name))
    triad = document.model.accelerometer
    assert triad is not None
    covariance = mean_covariances(
        triad,
        [rest.force for rest in rests],
        [rest.covariance for rest in rests],
        document.covariance_parameters,
        document.covariance_matrix,
        force_wander(document),
    )
    found = align_to_mount(first.force, second.force, covariance)
    found = replace(found, covariance=found.covariance + mount_sigma**2 * np.eye(3))
    remarks += _remarks(found, mount_sigma)
    text = _document(found, document, rests, mount_sigma, remarks)
    write_text(target, json.dumps(text, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    return Mounted(found, (first.seconds, second.seconds), (first.norm, second.norm), remarks, target)


def _rest(
    path: str | os.PathLike[str], document: Calibration, remarks: list[str], request: MountRequest
) -> _Rest:
    """Read a recording and average its rest; refused where it is another unit's."""
    name, triad = Path(path).name, document.model.accelerometer
    recording = read_recordings(path, **request.how())[0]
    if recording.specific_force is None:
        raise RecordingError(
            f"{name} has no accelerometer columns: only gravity shows how a unit lies on its mount."
        )
    refuse_twice(document, corrections_of([Path(path)], request.topics))
    low, high = recorded_span(recording, None)
    made_at = document.temperature_celsius
    if made_at is not None and max(high - made_at, made_at - low) > FAR_FROM_CALIBRATION:
        remarks.append(
            f"{name} is at {low:.1f} to {high:.1f} °C, and the calibration is taken at {made_at:.1f} °C: "
            "its biases will have moved; record nearer to that temperature."
        )
    scaled = in_calibration_units(recording, raw_factors(document, recording))
    try:
        timeline = find_timeline(scaled)
    except SegmentationError as error:
        raise SegmentationError(f"{name} must be of the mount at rest. {error}") from error
    means = observe_holds(scaled, timeline)
    assert means.specific_force is not None
    assert means.specific_force_covariance is not None
    assert triad is not None
    force = triad.correct(means.specific_force)
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    longest = int(np.argmax(means.duration))
    apart = np.arccos(np.clip(up @ up[longest], -1.0, 1.0))
    if np.max(apart) > SAME_POSE:
        raise RecordingError(
            f"In {name} the unit rests in {len(means)} places, up to "
            f"{np.degrees(np.max(apart)):.0f}° apart: give a recording of one attitude of the mount."
        )
    if len(means) > 1:
        remarks.append(f"{name} is disturbed: the longest of {len(means)} rests is taken.")
    said = [r.text.removeprefix(f"{name}: ") for r in recording.remarks if r.kind in _SAID]
    remarks += [f"{name}: {text}" for text in said]
    gravity = document.site.gravity
    norm = float(np.linalg.norm(force[longest]) - gravity)
    if abs(norm) > LARGEST_NORM_ERROR * gravity:
        raise RecordingError(
            f"{name}: the corrected specific force at rest is {norm:+.2f} m/s² off gravity: "
            "this is another unit than the calibration's, or its units are not those that were taken (--units)."
        )
    spread = np.asarray(means.specific_force_covariance[longest], dtype=np.float64)
    seconds, source = float(means.duration[longest]), recording.sources[0]
    return _Rest(name, source.sha256, seconds, np.asarray(force[longest], dtype=np.float64), norm, spread)


def _remarks(found: MountAlignment, mount_sigma: float) -> list[str]:
    z = "down" if found.z_down else "up"
    off = abs(float(np.degrees(found.off_right_angle)))
    remarks = [
        f"The mount's axes are named as the unit's: z {z} when level, x up when pitched.",
        f"Gravity turned by {off:.3f}° more or less than 90°: so much the pitch was off, which does not matter.",
    ]
    if mount_sigma == 0.0:
        remarks.append(
            "The mount is taken as level, and as turned about its own y axis, without error. What it "
            "was off by is wrong in the angles, and --mount-mrad counts it in."
        )
    return remarks


def _document(
    found: MountAlignment,
    document: Calibration,
    rests: list[_Rest],
    mount_sigma: float,
    remarks: list[str],
) -> dict[str, Any]:
    """Everything as plain data; angles in rad."""
    poses = ("level", "pitched by 90 degrees about y, x up")
    return {
        "format": FORMAT,
        "version": 1,
        "what": "the rotation from the axes of a calibrated unit (B) to those of its mount (M)",
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "software": f"tumble {__version__}",
        "formula": _FORMULA,
        "convention": (
            "C_MB = exp(gamma x): gamma is the rotation vector, right-handed, in rad. z of both is "
            f"{'down' if found.z_down else 'up'} with the mount level, x is up with it pitched. An "
            "attitude C_nB of the unit is C_nM = C_nB * transpose(C_MB) of the mount"
        ),
        "C_MB": found.C_MB.tolist(),
        "gamma": found.angles.tolist(),
        "standard_uncertainty": found.sigmas.tolist(),
        "covariance": found.covariance.tolist(),
        "mount_standard_uncertainty": mount_sigma,
        "off_right_angle": found.off_right_angle,
        "calibration": {
            "created": document.created,
            "procedure": document.procedure,
            "imu": plain(document.imu),
            "frame": plain(document.frame),
        },
        "recordings": [
            {"pose": pose, "name": rest.name, "sha256": rest.sha256, "seconds_at_rest": rest.seconds}
            for pose, rest in zip(poses, rests, strict=True)
        ],
        "remarks": remarks,
        "test_vector": {"v_B": _TEST_VECTOR.tolist(), "v_M": (found.C_MB @ _TEST_VECTOR).tolist()},
    }

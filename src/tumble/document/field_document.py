"""The document of a magnetometer by itself: nothing of the other triads is calibrated."""

from __future__ import annotations

from datetime import UTC, datetime

from msgspec.structs import replace

import tumble
from tumble.calibration.magnetometer.estimate import Magnetometer
from tumble.calibration.magnetometer.verdict import FieldVerdict
from tumble.document.composition import name_of, site_block
from tumble.document.imported import NO_QUALITY
from tumble.document.magnetometer_block import magnetometer_block
from tumble.document.part import part_of
from tumble.document.result import (
    Calibration,
    FrameBlock,
    Imu,
    RawUnits,
    RecordingName,
    VerdictBlock,
)
from tumble.earth import Site
from tumble.recording.recording import Recording
from tumble.recording.temperature import mean_celsius
from tumble.units import COUNTS

FIELD_ALONE = "magnetometer"
"""Procedure of a document that has a magnetometer and no other triad."""
_FRAME = (
    "the magnetometer's own axes, made orthogonal: nothing determines how they lie against the other sensors'"
)


def field_document(
    found: Magnetometer,
    verdict: FieldVerdict,
    recording: Recording,
    site: Site,
    *,
    why: str,
    remarks: tuple[str, ...] = (),
    imu: tuple[str | None, str | None] = (None, None),
) -> Calibration:
    """Return the document of a magnetometer that was calibrated by itself.

    Parameters
    ----------
    found, verdict : what was found, and how it is judged.
    recording, site : of which, and where.
    why : why nothing else is calibrated, as a sentence.
    remarks : what else there is to know.
    imu : (model, serial number) of the unit.
    """
    alone = f"Only the magnetometer is calibrated. {why} The gyros' biases are not determined either."
    return Calibration(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        software=f"tumble {tumble.__version__}",
        imu=Imu(model=name_of(imu[0]), serial_number=name_of(imu[1])),
        procedure=FIELD_ALONE,
        recordings=[part_of(RecordingName, source) for source in recording.sources],
        site=site_block(site),
        temperature_celsius=mean_celsius(recording.temperature),
        frame=FrameBlock(name=FIELD_ALONE, description=_FRAME),
        not_determined=["Accelerometers and gyros: the recording has no holds that would determine them."],
        raw_units=RawUnits(
            specific_force=recording.specific_force_unit or COUNTS,
            angular_rate=recording.angular_rate_unit or COUNTS,
        ),
        accelerometer=None,
        parameters=[],
        covariance_parameters=[],
        covariance=[],
        quality=replace(NO_QUALITY, coverage_factor=found.coverage_factor),
        verdict=VerdictBlock(fit=verdict.fit, reasons=[alone, *verdict.reasons]),
        remarks=list(remarks),
        test_vectors=[],
        magnetometer=magnetometer_block(found, verdict),
    )

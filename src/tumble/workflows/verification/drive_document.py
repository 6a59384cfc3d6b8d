"""A drive's verification as a document for machines, and its files."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tumble.navigation import OutageErrors
    from tumble.navigation.block_bootstrap import Statistic
    from tumble.workflows.verification.drive_verification import DriveVerification, PartResult

FORMAT = "tumble verify drive"
VERSION = 1


def drive_document(found: DriveVerification) -> dict[str, Any]:
    """Return what was found as plain data: SI, with standard uncertainties; what is unknown is null.

    Parameters
    ----------
    found : by `tumble.workflows.verification.drive.verify_drive`.
    """
    return {
        "format": FORMAT,
        "version": VERSION,
        "recording": found.recording,
        "gnss": found.track,
        "fit": found.fit,
        "reasons": found.reasons,
        "remarks": found.remarks,
        "setting": found.setting,
        "time_offset": {
            "value": found.offset,
            "standard_uncertainty": found.offset_sigma,
            "unit": "s",
            "words": found.clock,
        },
        "alignment": found.alignment,
        "duration": found.duration,
        "positions_left_out": found.left_out,
        "variants": [_part(found, part) for part in found.parts],
        "sensor_states": {
            name: {"estimate": value, "normalised": normalised}
            for name, (value, normalised) in found.contradictions.items()
        },
        "units": {"drift": "m", "outage": "m", "drift_over_an_hour": "km", "sensor_states": "SI"},
    }


def write_drive(document: dict[str, Any], folder: Path, command: str) -> list[Path]:
    """Write ``verify.json`` and ``verify.html`` into a folder, and return them.

    Parameters
    ----------
    document, folder : of `drive_document`, and where.
    command : how to make it again.

    Raises
    ------
    OutputError
        If they cannot be written; earlier ones are intact.
    """
    from tumble.files import write_texts
    from tumble.report.drive import render_drive

    text = json.dumps(document, indent=1, ensure_ascii=False) + "\n"
    return write_texts(
        {folder / "verify.json": text, folder / "verify.html": render_drive(document, command)}
    )


def _part(found: DriveVerification, part: PartResult) -> dict[str, Any]:
    least, most, grade = found.accuracy(part.part)
    return {
        "name": part.part,
        "drift": [
            {
                "seconds": seconds,
                "starts": int(sum(math.isfinite(x) for x in part.drift.horizontal_squares(i))),
                "horizontal_rms": _number(found.drift_rms(part.part, i)),
                "ratio_to_uncalibrated": _number(found.drift_ratio(part.part, i)),
            }
            for i, seconds in enumerate(found.seconds.tolist())
        ],
        "outages_sliding": [_outage(found, part, one, "sliding") for one in part.sliding],
        "outages_repeated": [_outage(found, part, one, "gaps") for one in part.gaps],
        "drift_over_an_hour_at_least": _number(least),
        "drift_over_an_hour_at_most": _number(most),
        "accuracy_class": grade,
        "innovations": part.innovations,
        "positions_refused": part.refused,
        "positions": part.fixes,
    }


def _outage(found: DriveVerification, part: PartResult, one: OutageErrors, kind: str) -> dict[str, Any]:
    rms, ratio = found.outage_statistics(part.part, one.duration, kind)
    return {
        "seconds": one.duration,
        "outages": len(one.starts),
        "horizontal_rms": _number(rms),
        "ratio_to_uncalibrated": _number(ratio),
    }


def _number(number: Statistic) -> dict[str, float | None]:
    return {
        "value": number.value if math.isfinite(number.value) else None,
        "standard_uncertainty": number.sigma if math.isfinite(number.sigma) else None,
    }

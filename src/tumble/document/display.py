"""A calibration as a notebook shows it: the verdict, and the parameters with their uncertainties."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

from tumble.files.markup import notebook_html
from tumble.parameters.family import parameter_of
from tumble.parameters.measures import Measure, said

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tumble.document.result import Calibration


def calibration_html(calibration: Calibration, reason: str = "", files: Sequence[Path] = ()) -> str:
    """Return a heading with the verdict, and a table of the parameters.

    Parameters
    ----------
    calibration : any; parameters in its own procedure's convention.
    reason : why its procedure was chosen.
    files : that were written of it.
    """
    verdict = "fit for use" if calibration.verdict.fit else "NOT fit for use"
    unit = " ".join(part for part in (calibration.imu.model, calibration.imu.serial_number) if part)
    parameters, measures = calibration.parameters, list[Measure]()
    for _, members in groupby(parameters, key=lambda p: parameter_of(p.name).family):
        measures += said([Measure(p.value, p.standard_uncertainty, p.unit) for p in members])
    sources = ", ".join(recording.name for recording in calibration.recordings)
    return notebook_html(
        ("parameter", "value ± standard uncertainty", "unit"),
        [(p.name, one.number, one.unit) for p, one in zip(parameters, measures, strict=True)],
        title=f"Calibration{f' of {unit}' if unit else ''}: {verdict}",
        words=f"({calibration.procedure}; {sources})",
        notes=[*([reason] if reason else []), *calibration.verdict.reasons],
        foot=f"Frame: {calibration.frame.description}"
        + (f" Written: {', '.join(map(str, files))}." if files else ""),
    )

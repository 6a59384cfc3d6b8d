"""The report of a magnetometer that was calibrated by itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tumble.calibration.magnetometer.estimate import Magnetometer
from tumble.report.calibration import title
from tumble.report.evidence.magnetometer import magnetometer_blocks
from tumble.report.html import render_page
from tumble.report.page import Block, Facts, Footer, Page, Sentences, Verdict, section

if TYPE_CHECKING:
    from tumble.arrays import Vectors
    from tumble.document.result import Calibration


def render_field_report(
    calibration: Calibration, found: Magnetometer, samples: Vectors, library: str | None = None
) -> str:
    """Return the report as one HTML page that works offline.

    Parameters
    ----------
    calibration, found : the document, and what it is from.
    samples : (samples, 3) raw.
    library : where the plotting library lies, seen from the page; None puts it into the page.
    """
    verdict, block = calibration.verdict, calibration.magnetometer
    words = "fit for use" if verdict.fit else "not fit for use"
    facts = [
        ("Recording", ", ".join(r.name for r in calibration.recordings) or "not from a file"),
        ("Samples of the magnetometer", str(len(samples))),
        ("Frame", calibration.frame.description),
        ("Made", f"{calibration.created} by {calibration.software}"),
    ]
    blocks: list[Block] = [Facts(facts), Verdict(verdict.fit, words, verdict.reasons)]
    if block is not None:
        blocks += section("Magnetometer", *magnetometer_blocks(found, block, samples))
    if calibration.remarks:
        blocks += section("How it was made", Sentences(calibration.remarks))
    blocks.append(
        Footer(f"{calibration.software}, {calibration.created}. This page works without a network.")
    )
    document = calibration.model_dump(mode="json")
    return render_page(Page(title(calibration), blocks), {"calibration": document}, library)

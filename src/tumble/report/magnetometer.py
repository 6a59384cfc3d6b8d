"""A magnetometer's calibration in a few lines: its parameters with uncertainties, its verdict."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tumble.report.page import Table
from tumble.report.rounding import with_uncertainty
from tumble.units import magnetic_field_factor

if TYPE_CHECKING:
    from tumble.document.magnetometer_block import MagnetometerBlock

MICRO = 1e6
_ROWS = (
    ("bias (hard iron)", "magnetometer bias", "xyz"),
    ("scale factor", "magnetometer scale factor", "xyz"),
    ("soft iron", "magnetometer soft iron", ("yz", "xz", "xy")),
    ("rotation", "rotation of the magnetometer", "xyz"),
)


def magnetometer_table(block: MagnetometerBlock | None) -> Table | None:
    """Return the parameters, three to a line; None where there are none.

    Parameters
    ----------
    block : of the calibration.
    """
    rows = magnetometer_rows(block)
    return Table(("magnetometer", "x", "y", "z", ""), rows) if rows else None


def magnetometer_rows(block: MagnetometerBlock | None) -> list[list[str]]:
    """Return the parameters, three to a row between their name and their unit; empty where there are none.

    Parameters
    ----------
    block : of the calibration.
    """
    if block is None or not block.parameters:
        return []
    known = {p.name: p for p in block.parameters}
    scale = float(np.mean([known[f"magnetometer scale factor {a}"].value for a in "xyz"]))
    rows: list[list[str]] = []
    for label, name, ends in _ROWS:
        own = [known[f"{name} {end}"] for end in ends if f"{name} {end}" in known]
        if len(own) < 3:
            continue
        factor, unit = _practical(block, label, scale)
        texts = [with_uncertainty(factor * p.value, abs(factor) * p.standard_uncertainty) for p in own]
        # Heads name x, y and z; a pair of axes names itself.
        texts = [text if len(end) == 1 else f"{end} {text}" for end, text in zip(ends, texts, strict=True)]
        rows.append([label, *texts, unit])
    return rows


def _practical(block: MagnetometerBlock, label: str, scale: float) -> tuple[float, str]:
    """By what a parameter is multiplied, and the unit that people read."""
    if label.startswith("bias"):
        return 1.0, unit_name(block.raw_unit)
    if label.startswith("soft iron"):
        return 100.0 / scale, "%"
    if label == "rotation":
        return float(np.degrees(1.0)), "deg"
    factor = magnetic_field_factor(block.raw_unit)
    if block.unit == "T" and factor is not None:
        return factor, ""
    if block.unit == "T":
        return 1.0 / MICRO, f"{unit_name(block.raw_unit)}/µT"
    return 1.0, f"{unit_name(block.raw_unit)}/local field"


def unit_name(unit: str) -> str:
    """Return a unit as people write it.

    Examples
    --------
    >>> unit_name("uT")
    'µT'
    """
    return {"uT": "µT", "ugauss": "µgauss"}.get(unit, unit)


def magnetometer_sentences(block: MagnetometerBlock | None, *, every: bool = False) -> list[str]:
    """Return the verdict and the field in sentences; empty without a magnetometer.

    Parameters
    ----------
    block : of the calibration.
    every : all reasons and remarks, instead of the first reason.
    """
    if block is None or block.verdict is None:
        return []
    reasons = block.verdict.reasons
    first = f"Magnetometer: {block.verdict.use}. {' '.join(reasons if every else reasons[:1])}".strip()
    said = [first]
    if block.field is not None:
        said.append(f"Magnetic field: {field_words(block)}.")
    if every:
        said += [*block.remarks, *(block.quality.left_out if block.quality else [])]
    return said + [f"Not determined: {sentence}" for sentence in (block.not_determined if every else [])]


def field_words(block: MagnetometerBlock) -> str:
    """Return norm and dip with their uncertainties.

    Parameters
    ----------
    block : with a field.
    """
    field = block.field
    assert field is not None
    if block.unit == "T":
        sigma = field.norm_standard_uncertainty
        number = with_uncertainty(MICRO * field.norm, MICRO * sigma) if sigma else f"{MICRO * field.norm:.5g}"
        # What was given is one source: what the recording makes of it is as uncertain as it is stated.
        words = f"norm {number} µT ({'from the recording and ' if field.norm_given else ''}{field.source})"
    else:
        words = "norm not known (one local field)"
    if field.dip_deg is not None and field.dip_standard_uncertainty_deg is not None:
        words += f", dip {with_uncertainty(field.dip_deg, field.dip_standard_uncertainty_deg)}°"
    return words

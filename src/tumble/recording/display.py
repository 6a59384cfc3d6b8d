"""A recording as a notebook shows it: what it holds, and what was found on reading."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tumble.files.markup import notebook_html

if TYPE_CHECKING:
    from tumble.recording.recording import Recording


def recording_html(recording: Recording) -> str:
    """Return a table of what a recording holds, and its remarks as a list."""
    sources = ", ".join(source.name for source in recording.sources) or "made in memory"
    rows = [
        ("from", sources),
        ("samples", f"{len(recording):,} in {recording.duration:,.1f} s, {recording.rate:g} Hz"),
        ("specific force", _signal(recording.specific_force is not None, recording.specific_force_unit)),
        ("angular rate", _signal(recording.angular_rate is not None, recording.angular_rate_unit)),
        ("magnetic field", _field(recording)),
        ("temperature", "°C" if recording.temperature is not None else "none"),
        ("gaps", str(len(recording.gaps))),
    ]
    return notebook_html((), rows, notes=[remark.text for remark in recording.remarks])


def _signal(there: bool, unit: str) -> str:
    return f"three axes, {unit}" if there else "none"


def _field(recording: Recording) -> str:
    field = recording.magnetic_field
    return "none" if field is None else f"three axes, {field.unit}, {len(field):,} at {field.rate:.4g} Hz"

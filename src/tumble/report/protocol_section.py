"""What the protocol asked for and what was found: its steps as a table, its spins as a figure."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

import numpy as np

from tumble.calibration.verdict import two_digits
from tumble.report.figure import (
    AXIS_COLOURS,
    GREY,
    Figure,
    Plot,
    Section,
    base_layout,
    hover,
    plain,
    text_axis,
)

if TYPE_CHECKING:
    from tumble.calibration.estimate import Estimate
    from tumble.protocol import Protocol, Step
    from tumble.recording.recording import Recording
    from tumble.segmentation import Timeline
    from tumble.segmentation.matching import Matching


def protocol_table(protocol: Protocol, matching: Matching, recording: Recording, timeline: Timeline) -> str:
    """Return the steps of a protocol as an HTML table, each with where it was found, and what was said.

    Parameters
    ----------
    protocol, matching : what was to be done, and which hold and spin is which step.
    recording, timeline : for the times.
    """
    places: dict[int, list[str]] = {}
    start = float(recording.time[0])
    for matched in matching.holds:
        hold = timeline.holds[matched.hold]
        places.setdefault(matched.step, []).append(
            f"hold {matched.hold + 1}, {_span(recording, hold.start, hold.stop, start)}"
        )
    for spin in matching.spins:
        places.setdefault(spin.step, []).append(_span(recording, spin.start, spin.stop, start))
    rows = "".join(
        f"<tr><td>{number + 1}</td><td>{html.escape(step_words(step))}</td>"
        f"<td>{html.escape('; '.join(places.get(number, ['not found'])))}</td></tr>"
        for number, step in enumerate(protocol.steps)
        if number in places or not _is_turn(step)
    )
    said = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in matching.remarks)
    return (
        f"<h2>Protocol {html.escape(protocol.name)}</h2>"
        f"{f'<ul>{said}</ul>' if said else '<p>Every step was found, and nothing else.</p>'}"
        '<details><summary>The steps and where they were found</summary><div class="scroll"><table><thead><tr>'
        f"<th>step</th><th>what</th><th>found</th></tr></thead><tbody>{rows}</tbody></table></div></details>"
    )


def _is_turn(step: Step) -> bool:
    from tumble.protocol import TurnStep

    return isinstance(step, TurnStep)


def _span(recording: Recording, first: int, stop: int, start: float) -> str:
    return f"{recording.time[first] - start:.1f} to {recording.time[stop - 1] - start:.1f} s"


def step_words(step: Step) -> str:
    """Return what a step is, in words.

    Examples
    --------
    >>> from tumble.protocol import HoldStep, SpinStep
    >>> step_words(HoldStep(5.0, None, "on its back")), step_words(SpinStep(8.0, -0.7854))
    ('hold: on its back', 'spin: -45°/s about up')
    """
    from tumble.protocol import SpinStep

    if isinstance(step, SpinStep):
        axis = "up" if step.axis_b is None else "(" + ", ".join(f"{v:.3g}" for v in step.axis_b) + ")"
        words = f"{np.degrees(step.rate):.6g}°/s about {axis}"
        return f"spin: {step.name}, {words}" if step.name else f"spin: {words}"
    kind = type(step).__name__.removesuffix("Step").lower()
    return f"{kind}: {step.name}" if step.name else kind


def spin_section(estimate: Estimate) -> Section | None:
    """Return the figure of what each spin shows beyond the model, or None without spins."""
    if estimate.spin_rates.size == 0:
        return None
    rates = np.degrees(estimate.spin_rates)
    largest = float(np.max(np.abs(estimate.spin_rates)))
    data: list[Plot] = []
    for axis, name in enumerate("xyz"):
        residual = np.degrees(estimate.spin_residuals[:, axis]) * 1e3
        if not np.any(np.isfinite(residual)):
            continue
        sigma = np.degrees(estimate.spin_sigmas[:, axis]) * 1e3
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": f"gyro {name}",
                "x": plain(rates, 7),
                "y": plain(residual),
                "error_y": {"type": "data", "array": plain(sigma), "color": GREY, "thickness": 1},
                "text": [hover(words) for words in estimate.spin_names],
                "marker": {"size": 8, "color": AXIS_COLOURS[name]},
                "hovertemplate": "%{text}: %{y:.3g} m°/s<extra></extra>",
            }
        )
    finite = estimate.spin_residuals[np.isfinite(estimate.spin_residuals)]
    rms = float(np.sqrt(np.mean(finite**2))) if finite.size else 0.0
    layout = base_layout(
        360,
        xaxis=text_axis("reference rate of the spin / (°/s)", zeroline=True),
        yaxis=text_axis("residual / (m°/s)", zeroline=True),
    )
    label = "Residual of each gyro in each spin against the reference rate"
    caption = (
        f"After calibration the spins leave {two_digits(1e3 * np.degrees(rms))} m°/s rms over all three gyros, "
        f"{two_digits(1e6 * rms / largest)} ppm of the fastest spin; on the gyros that are not spun, a placement "
        "that is off shows. Points that follow a curve would be a nonlinear scale factor, a kink at zero an asymmetry; "
        "bars are one standard deviation."
    )
    return Section("Spins: residual against the rate", [Figure("spins", label, data, layout)], caption)

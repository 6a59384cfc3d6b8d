"""`tumble predict --trajectory`: free navigation along a trajectory, parameter by parameter."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer

if TYPE_CHECKING:
    from tumble.workflows.predict_navigation import NavigationPrediction

# Parameters that are listed: those that make more than this share of the largest one's error.
_LISTED = 0.02


def show_navigation(
    calibration: Path,
    *,
    seconds: tuple[float, ...],
    trajectory: str,
    noise: Path | None,
    data_sheet: str | None,
    turn_on: str | None,
    output: Path | None,
    as_json: bool,
) -> None:
    """Predict, write the filter's states where asked for, and print.

    Parameters
    ----------
    calibration, seconds, trajectory, noise, data_sheet, turn_on, output, as_json : as typed.

    Raises
    ------
    TumbleError
        If an input is wrong, or the file cannot be written.
    """
    from tumble.cli.progress import results_stand
    from tumble.cli.verify_drive import turn_on_of
    from tumble.workflows.predict_navigation import predict_navigation, states_document, write_states

    found = predict_navigation(
        calibration,
        seconds=seconds,
        trajectory=trajectory,
        noise=noise,
        data_sheet=data_sheet or "consumer-mems",
        turn_on=(0.0, 0.0) if turn_on is None else turn_on_of(turn_on),
    )
    file = None
    if output is not None:
        file = write_states(found, trajectory, output)
        results_stand()
    if as_json:
        document = {"errors": _errors(found), "filter": states_document(found, trajectory)}
        typer.echo(json.dumps(document, indent=1, ensure_ascii=False))
        return
    _print(found)
    if file is not None:
        typer.echo(f"written: {file.resolve()}")


def _errors(found: NavigationPrediction) -> list[dict[str, Any]]:
    """Standard uncertainties by length, in SI."""
    errors = found.errors
    each = errors.of_each()
    result: list[dict[str, Any]] = []
    for row, seconds in enumerate(errors.seconds.tolist()):
        total = errors.total[row]
        result.append(
            {
                "seconds": seconds,
                "horizontal": _size(total, (0, 1)),
                "horizontal_of_calibration": _size(errors.calibration[row], (0, 1)),
                "horizontal_of_noise": _size(errors.noise[row], (0, 1)),
                "vertical": _size(total, (2,)),
                "velocity": _size(total, (3, 4, 5)),
                "tilt": _size(total, (6, 7)),
                "heading": _size(total, (8,)),
                "horizontal_by_parameter": dict(
                    zip(errors.names, np.hypot(each[row, 0], each[row, 1]).tolist(), strict=True)
                ),
                "units": {"position": "m", "velocity": "m/s", "tilt": "rad", "heading": "rad"},
            }
        )
    return result


def _size(covariance: np.ndarray, rows: tuple[int, ...]) -> float:
    return math.sqrt(max(sum(float(covariance[row, row]) for row in rows), 0.0))


def _print(found: NavigationPrediction) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    errors = _errors(found)
    table = Table(
        title="Errors of free navigation, one sigma", title_justify="left", box=None, pad_edge=False
    )
    table.add_column("after")
    for row in errors:
        table.add_column(f"{row['seconds']:g} s", justify="right")
    for words, key, factor, unit in (
        ("horizontal position", "horizontal", 1.0, "m"),
        ("  of the calibration", "horizontal_of_calibration", 1.0, "m"),
        ("  of the noise", "horizontal_of_noise", 1.0, "m"),
        ("vertical position", "vertical", 1.0, "m"),
        ("velocity", "velocity", 1.0, "m/s"),
        ("tilt", "tilt", math.degrees(1.0), "°"),
        ("heading", "heading", math.degrees(1.0), "°"),
    ):
        table.add_row(words, *(f"{factor * row[key]:.2g} {unit}" for row in errors))
    console.print(table)
    largest = max(errors[-1]["horizontal_by_parameter"].values(), default=0.0)
    listed = sorted(errors[-1]["horizontal_by_parameter"].items(), key=lambda item: -item[1])
    table = Table(
        title="What one sigma of each parameter makes of the horizontal position",
        title_justify="left",
        box=None,
        pad_edge=False,
    )
    table.add_column("parameter")
    for row in errors:
        table.add_column(f"{row['seconds']:g} s", justify="right")
    for name, value in listed:
        if value > _LISTED * largest:
            table.add_row(name, *(f"{row['horizontal_by_parameter'][name]:.2g} m" for row in errors))
    console.print(table)
    carried = [state for state in found.states if state.carry]
    table = Table(title="States for a filter", title_justify="left", box=None, pad_edge=False)
    for head in ("state", "sigma at the start", "largest share of a variance"):
        table.add_column(head)
    for state in carried:
        table.add_row(
            state.name, _practical(state.kind, state.column, state.sigma), f"{100.0 * state.share:.0f} %"
        )
    console.print(table)
    left = len(found.states) - len(carried)
    console.print(
        f"{left} other sensor states make less than 1 % each of any error's variance: leave them out."
    )
    for sentence in found.remarks:
        console.print(f"• {sentence}", markup=False)


def _practical(kind: str, column: int, sigma: float) -> str:
    if kind == "g-sensitivity":
        return f"{math.degrees(sigma) * 3600.0 * 9.80665:.2g} °/h/g"
    if column >= 0:
        return f"{1e6 * sigma:.2g} ppm or µrad"
    if kind == "accelerometer":
        return f"{1e3 * sigma / 9.80665e-3:.2g} µg"
    return f"{math.degrees(sigma) * 3600.0:.2g} °/h"


__all__ = ["show_navigation"]

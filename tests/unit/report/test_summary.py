"""The terminal's table names every parameter, its quality and its verdict, and reads no markup in data."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import pytest
from msgspec import structs
from rich.console import Console

from tumble.document.magnetometer_block import FieldVerdictBlock, MagnetometerBlock
from tumble.document.result import Calibration
from tumble.parameters.family import TEMPERATURE
from tumble.report.parameters import parameter_rows
from tumble.report.summary import print_calibration, verdict_line


def printed(calibration: Calibration, *, width: int = 200, verbose: bool = True) -> str:
    console = Console(file=io.StringIO(), width=width, highlight=False)
    print_calibration(calibration, console, verbose=verbose)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_every_parameter_stands_in_the_table_with_unit_uncertainty_and_interval(
    calibration: Calibration,
) -> None:
    text = printed(calibration)
    for row in parameter_rows(calibration):
        line = next(
            line for line in text.splitlines() if line.startswith(row.label) and row.shown.text in line
        )
        assert row.shown.interval(2.0) in line
        assert row.other is None or row.other.text in line


def test_groups_follow_one_another_once_each(calibration: Calibration) -> None:
    lines = [line.strip() for line in printed(calibration).splitlines()]
    groups = [
        line for line in lines if line in ("Accelerometer", "Gyro", "Between the triads", "Optional terms")
    ]
    assert groups == ["Accelerometer", "Gyro", "Between the triads", "Optional terms"]


def test_verdict_reasons_and_what_was_left_out_are_printed_as_written(calibration: Calibration) -> None:
    """Square brackets in a sentence are no markup."""
    text = printed(calibration)
    assert "NOT FIT FOR USE" in text
    assert "Too [red]few[/red] holds." in text
    assert "Not determined: What [bold]this[/bold] cannot tell." in text
    assert "Left out: hold 7: it was knocked." in text


def test_a_calibration_that_is_fit_says_so(write_calibration: Callable[..., Calibration]) -> None:
    text = printed(write_calibration(verdict={"fit": True, "reasons": ["Residuals are small."]}))
    assert "FIT FOR USE" in text
    assert "NOT FIT" not in text


def test_one_line_says_the_verdict_why_it_is_against_and_where_the_files_are(
    calibration: Calibration, tmp_path: Path
) -> None:
    line = verdict_line(calibration, [tmp_path / "calibration.json"])
    assert line == f"NOT FIT FOR USE. Too [red]few[/red] holds. Written: {tmp_path / 'calibration.json'}"


@pytest.mark.parametrize("use", ["fit", "fit with reservations", "not fit"])
def test_one_line_names_the_magnetometers_verdict_where_it_is_not_plainly_fit(
    calibration: Calibration, use: Literal["fit", "fit with reservations", "not fit"]
) -> None:
    block = MagnetometerBlock(
        raw_unit="uT",
        unit="T",
        frame="b",
        method="holds and turns",
        matrix=None,
        bias=None,
        verdict=FieldVerdictBlock(use=use, reasons=["Its axes are mirrored.", "And more."]),
    )
    line = verdict_line(structs.replace(calibration, magnetometer=block), [])
    said = f" Magnetometer: {use}. Its axes are mirrored."
    assert line == verdict_line(calibration, []) + ("" if use == "fit" else said)


def test_unasked_the_verdict_comes_first_and_each_parameter_stands_once(calibration: Calibration) -> None:
    text = printed(calibration, verbose=False, width=80)
    assert text.startswith("NOT FIT FOR USE\n")
    assert "Not determined: What [bold]this[/bold] cannot tell." in text
    for row in parameter_rows(calibration):
        assert row.said.number in text or row.group == TEMPERATURE, row.name
    assert "interval" not in text


@pytest.mark.parametrize("verbose", [True, False])
@pytest.mark.parametrize("width", [40, 60, 80])
def test_a_narrow_terminal_folds_and_cuts_nothing_off(
    calibration: Calibration, width: int, verbose: bool
) -> None:
    text = printed(calibration, width=width, verbose=verbose)
    assert "…" not in text
    assert all(len(line) <= width for line in text.splitlines())


def test_wide_numbers_stand_a_family_a_line_and_no_number_is_torn_apart() -> None:
    from tumble.report.summary import _joined

    cells: list[tuple[str, ...]] = [
        ("± one sigma", "x", "y", "z", ""),
        ("acc. scale factor", "847.069 ± 0.061", "826.574 ± 0.060", "836.137 ± 0.063", "counts/(m/s²)"),
    ]
    assert _joined(cells, [], 90)[1:] == [
        "acc. scale factor: 847.069 ± 0.061, 826.574 ± 0.060, 836.137 ± 0.063 counts/(m/s²)"
    ]
    narrow = _joined(cells, [], 50)[1:]
    assert max(map(len, narrow)) <= 50
    assert "826.574 ± 0.060" in " ".join(narrow)

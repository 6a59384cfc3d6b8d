"""The joint estimate and the procedure's own, side by side: numbers worked out by hand."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import pytest

from tumble.calibration.estimate import NamedValue
from tumble.parameters.family import parameter_of
from tumble.parameters.measures import Measure
from tumble.report.evidence.budget import beside, parameters_beside
from tumble.report.html import render_page
from tumble.report.page import Page
from tumble.report.parameters import ParameterRow

A, B, C, D = (f"gyro non-orthogonality {axes}" for axes in ("yz", "zx", "zy", "xy"))


def row(name: str, value: float, sigma: float) -> ParameterRow:
    """Shown in thousandths of the parameter's unit."""
    shown = Measure(1e3 * value, 1e3 * sigma, "mrad")
    return ParameterRow(parameter_of(name), shown, None, shown)


@pytest.fixture
def joint() -> Any:
    """Angle A is better known by half, B worse; the procedure has no C, and D is exact."""
    other = SimpleNamespace(
        procedure="hand-<held>",
        parameters=[
            NamedValue(A, 0.010, 0.002, "rad"),
            NamedValue(B, 0.020, 0.001, "rad"),
            NamedValue(D, 0.0, 0.0, "rad"),
        ],
    )
    own = [
        NamedValue(A, 0.013, 0.001, "rad"),
        NamedValue(B, 0.016, 0.002, "rad"),
        NamedValue(C, 0.5, 0.1, "rad"),
        NamedValue(D, 0.0, 0.0, "rad"),
    ]
    return SimpleNamespace(parameters=own, beside=SimpleNamespace(estimate=other, source="a paper"))


def rows(joint: Any) -> list[ParameterRow]:
    return [row(p.name, p.value, p.standard_uncertainty) for p in joint.parameters]


def subject(joint: Any) -> Any:
    return SimpleNamespace(estimate=joint, rows=rows(joint))


def test_differences_are_in_the_procedure_s_uncertainties_and_units_are_the_reader_s(joint: Any) -> None:
    a, b = parameters_beside(joint.beside, joint, rows(joint))
    assert (a.value, a.sigma) == (pytest.approx(10.0), pytest.approx(2.0))
    assert (a.difference, a.ratio) == (pytest.approx(1.5), pytest.approx(0.5))
    assert (b.difference, b.ratio) == (pytest.approx(-4.0), pytest.approx(2.0))


def test_the_table_names_what_is_far_apart_and_escapes_names(joint: Any) -> None:
    page = render_page(Page("Beside", beside(joint.beside, subject(joint))))
    table = re.sub(r">\s+<", "><", page.split("<h2>")[-1])
    assert "hand-&lt;held&gt;" in table
    assert "hand-<held>" not in table
    assert "Farther apart are gyro non-orthogonality zx:" in table
    assert "<td>+1.5</td><td>0.50</td>" in table
    assert "<td>−4.0</td><td>2.00</td>" in table
    assert "1.00 times" in table  # the root of 0.5 times 2


def test_nothing_is_said_with_nothing_beside(joint: Any) -> None:
    joint.beside.estimate.parameters = []
    assert beside(joint.beside, subject(joint)) == []

"""The tables of grades on the page of simulation are those of the grades.

    python tests/docs/test_grades.py

prints them anew.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tumble.simulation import GRADES
from tumble.units import STANDARD_GRAVITY

PAGE = Path(__file__).resolve().parents[2] / "docs" / "simulation.md"
MICRO_G, DEGREE = 1e-6 * STANDARD_GRAVITY, np.pi / 180.0
PER_HOUR, PER_ROOT_HOUR = DEGREE / 3600.0, DEGREE / 60.0


def shown(value: float) -> str:
    """Three digits; a dash for what there is none of."""
    return "–" if value == 0.0 else f"{float(f'{value:.3g}'):g}"


def table(headings: str, rows: dict[str, list[str]]) -> str:
    lines = [f"| grade | {headings} |", "|" + "---|" * (headings.count("|") + 2)]
    return "\n".join([*lines, *(f"| `{name}` | " + " | ".join(cells) + " |" for name, cells in rows.items())])


def accelerometers() -> str:
    rows: dict[str, list[str]] = {}
    for name, grade in GRADES.items():
        triad = grade.accelerometer
        values = [
            triad.noise.random_walk / MICRO_G, triad.noise.bias_instability / MICRO_G,
            triad.bias_stability / MICRO_G, triad.bias / MICRO_G / 1e3, 1e6 * triad.scale_factor,
            1e6 * triad.misalignment, 1e6 * triad.alignment, 1e6 * triad.linearity,
            triad.noise.resolution / MICRO_G, triad.noise.full_scale / STANDARD_GRAVITY,
        ]  # fmt: skip
        rows[name] = [shown(value) for value in values]
    return table(
        "noise µg/√Hz | flicker µg | in-run µg | bias mg | scale ppm | axes µrad | triad µrad | linearity ppm "
        "| step µg | limit g",
        rows,
    )


def gyros() -> str:
    rows: dict[str, list[str]] = {}
    for name, grade in GRADES.items():
        triad = grade.gyroscope
        values = [
            triad.noise.random_walk / PER_ROOT_HOUR, triad.noise.bias_instability / PER_HOUR,
            triad.bias_stability / PER_HOUR, triad.bias / PER_HOUR, 1e6 * triad.scale_factor,
            1e6 * triad.misalignment, 1e6 * triad.alignment, 1e6 * triad.linearity,
            grade.g_sensitivity * STANDARD_GRAVITY / PER_HOUR, 3600.0 * triad.noise.resolution / DEGREE,
            triad.noise.full_scale / DEGREE,
        ]  # fmt: skip
        rows[name] = [shown(value) for value in values]
    return table(
        "noise deg/√h | flicker deg/h | in-run deg/h | bias deg/h | scale ppm | axes µrad | triad µrad "
        "| linearity ppm | g-sensitivity (deg/h)/g | step deg/h | limit deg/s",
        rows,
    )


TABLES = {"accelerometers": accelerometers, "gyros": gyros}


@pytest.mark.parametrize("name", TABLES)
def test_the_page_s_table_is_that_of_the_grades(name: str) -> None:
    text = PAGE.read_text(encoding="utf-8")
    found = re.search(rf"<!-- {name}: .*?-->\n(.*?)\n<!-- /{name} -->", text, re.S)
    assert found is not None
    assert found[1] == TABLES[name]()


if __name__ == "__main__":
    for make in TABLES.values():
        print(make(), end="\n\n")  # noqa: T201 (a script's output)

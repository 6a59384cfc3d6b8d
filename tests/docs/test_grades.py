"""The table of grades on the page of simulation is that of the grades."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from tumble.simulation import GRADES
from tumble.units import STANDARD_GRAVITY

PAGE = Path(__file__).resolve().parents[2] / "docs" / "simulation.md"


def table() -> str:
    """Each grade's numbers in the units that data sheets use."""
    micro, hour, root_hour = 1e-6 * STANDARD_GRAVITY, np.pi / 180.0 / 3600.0, np.pi / 180.0 / 60.0
    lines = [
        "| grade | accelerometer: noise µg/√Hz | flicker µg | bias mg | scale ppm | angles µrad "
        "| gyro: noise deg/√h | flicker deg/h | bias deg/h | scale ppm | angles µrad |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, grade in GRADES.items():
        force, rate = grade.accelerometer, grade.gyroscope
        values = [
            force.noise.random_walk / micro, force.noise.bias_instability / micro, force.bias / micro / 1e3,
            1e6 * force.scale_factor, 1e6 * force.misalignment,
            rate.noise.random_walk / root_hour, rate.noise.bias_instability / hour, rate.bias / hour,
            1e6 * rate.scale_factor, 1e6 * rate.misalignment,
        ]  # fmt: skip
        lines.append(f"| `{name}` | " + " | ".join(f"{float(f'{v:.3g}'):g}" for v in values) + " |")
    return "\n".join(lines)


def test_the_page_s_table_is_that_of_the_grades() -> None:
    found = re.search(r"test_grades.py -->\n(.*?)\n<!-- /grades -->", PAGE.read_text(encoding="utf-8"), re.S)
    assert found is not None
    assert found[1] == table()

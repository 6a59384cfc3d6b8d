"""The error budget of the strapdown rotation test against the same test simulated sample by sample.

The two share the sequences' linear model and nothing else: the budget is analysed, the study makes every increment
of both triads and plays it back.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tumble.design.strapdown_accuracy import analyse_strapdown_rotation
from tumble.design.strapdown_setup import SensorQuality, StrapdownSetup
from tumble.earth import Site
from tumble.sensor.conventions.savage import GROUPS
from tumble_papers.savage.strapdown_simulation import GRADES, Setting, Variant, run_study

RUNS = 100


def budget_of(name: str, **changes: object) -> np.ndarray:
    """Rms of each group over places and headings, SI."""
    grade = GRADES[name]
    quality = SensorQuality(
        gyro_walk=grade.angle_random_walk,
        gyro_pulse=grade.angle_pulse,
        gyro_bias=grade.gyro_bias,
        force_walk=grade.velocity_random_walk,
        force_pulse=grade.velocity_pulse,
        gyro_scale=grade.scale,
        gyro_asymmetry=grade.asymmetry,
        # υ is the sum of two misalignments
        gyro_misalignment=np.sqrt(2.0) * grade.angle,
        force_bias=grade.bias,
        force_scale=grade.scale,
        force_asymmetry=grade.asymmetry,
        force_misalignment=grade.angle,
    )
    found = []
    for latitude in (-0.9, 0.0, 0.9):
        for azimuth in (0.3, 1.9, 3.5, 5.0):
            site = replace(Site.from_latitude(latitude), gravity_sigma=0.0)
            plan = StrapdownSetup(quality, site=site, azimuth=azimuth, iterations=1)
            found.append(analyse_strapdown_rotation(replace(plan, **changes)).group_rms())  # type: ignore[arg-type]
    return np.sqrt(np.mean(np.square(found), axis=0))


@pytest.mark.parametrize("name", ["nav", "MEMS"])
def test_the_budget_is_that_of_a_simulation_sample_by_sample(name: str) -> None:
    """100 runs of three or six parameters know an rms to 5 %; the study's fixture has axes that are askew, too."""
    variants = {
        Variant("as printed", start_bias=False, norm=False): {
            "start_bias": False, "norm": False, "method": "formulas"
        },
        Variant("start window, norm"): {"method": "formulas"},
        Variant("least squares", all_components=True): {"method": "least-squares"},
    }  # fmt: skip
    errors = run_study(
        Setting(GRADES[name]), list(variants), RUNS, np.random.default_rng(21), iterations=2, threads=2
    )
    for number, changes in enumerate(variants.values()):
        simulated = [np.sqrt(np.mean(errors[number, :, 1, at] ** 2)) for at in GROUPS.values()]
        np.testing.assert_allclose(budget_of(name, **changes), simulated, rtol=0.2)

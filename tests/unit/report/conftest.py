"""A calibration written by hand, and the demo recording calibrated in three ways."""

from dataclasses import replace
from typing import Any

import pytest
from tests.unit.adjusted import adjusted
from tests.unit.written import WRITTEN, parameters, written

from tumble.document import calibration_from_estimate
from tumble.earth import Site
from tumble.recording import Source
from tumble.segmentation import find_timeline, observe_holds

NASTY_NAME = "</script><b>&\"'`.csv"

# Every number by hand; matrices are not symmetric.
PARAMETERS: list[tuple[str, float, float, str]] = [
    ("accelerometer bias x", 0.0980665, 0.000980665, "m/s^2"),
    ("accelerometer bias y", -0.012345, 0.00067, "m/s^2"),
    ("accelerometer bias z", 0.5, 0.012, "m/s^2"),
    ("accelerometer scale factor error x", 0.0031, 0.00015, "1"),
    ("accelerometer scale factor error y", -0.0012, 0.00015, "1"),
    ("accelerometer scale factor error z", 0.0002, 0.00015, "1"),
    ("accelerometer non-orthogonality yz", 0.00354, 0.00013, "rad"),
    ("accelerometer non-orthogonality zx", -0.02141, 0.00013, "rad"),
    ("accelerometer non-orthogonality zy", 0.00889, 0.00041, "rad"),
    ("gyro bias x", 33000.0, 0.25, "counts"),
    ("gyro bias y", 32000.0, 0.25, "counts"),
    ("gyro bias z", 32770.0, 0.50, "counts"),
    ("gyro scale factor x", 1000.0, 1.0, "counts/(rad/s)"),
    ("gyro scale factor y", 1010.0, 0.5, "counts/(rad/s)"),
    ("gyro scale factor z", 990.0, 2.0, "counts/(rad/s)"),
    ("rotation between the triads x", 0.0315, 0.0005, "rad"),
    ("accelerometer quadratic z", 2e-4, 1e-5, "1/(m/s^2)"),
    ("g-sensitivity of gyro x to force y", 0.5, 0.05, "counts/(m/s²)"),
    ("lag of the accelerometer behind the gyro", -0.0144, 0.0025, "s"),
]


def written_calibration(**changes):
    term = {"name": "quadratic", "kept": False, "f_statistic": 1.0, "degrees_of_freedom": 3}
    quality = {
        "sigma0": 1.5,
        "degrees_of_freedom": 100,
        "rms_hold_norm": 0.002,
        "rms_turn_angle": 0.001,
        "turns": 19,
        "variance_components": {"gyro bias from hold to hold, rad/s": 1e-4},
        "left_out": [{"kind": "hold", "number": 7, "reason": "it was knocked"}],
        "optional_terms": [{**term, "probability": 0.4, "limit": 0.01}],
    }
    document: dict[str, Any] = {
        "recordings": [{"name": NASTY_NAME, "sha256": "00"}],
        "not_determined": ["What [bold]this[/bold] cannot tell."],
        "raw_units": {"specific_force": "m/s^2", "angular_rate": "counts"},
        "accelerometer": {**WRITTEN["accelerometer"], "quadratic": [0.0, 1e-4, 2e-4]},
        "gyroscope": {
            "matrix": [[1000.0, 0.0, 0.0], [12.0, 1010.0, 0.0], [-7.0, 31.0, 990.0]],
            "bias": [33000.0, 32000.0, 32770.0],
            "g_sensitivity": [[0.0, 0.5, 0.1], [0.2, 0.0, 0.0], [0.0, -0.3, 0.0]],
        },
        "parameters": parameters(*PARAMETERS),
        "verdict": {"fit": False, "reasons": ["Too [red]few[/red] holds."]},
    }
    return written(quality, **{**document, **changes})


@pytest.fixture
def calibration():
    return written_calibration()


@pytest.fixture
def write_calibration():
    """Return a function that writes the calibration with changes to its document."""
    return written_calibration


def _made(estimate, recording, timeline, means, site, **more):
    """What a page is made of."""
    calibration = calibration_from_estimate(estimate, recording, site, **more)
    parts = {"estimate": estimate, "recording": recording, "timeline": timeline, "means": means}
    return {"calibration": calibration, **parts}


@pytest.fixture(scope="session")
def hand_held(tmp_path_factory):
    """The demo recording by the hand-held procedure, its file named so that it would break a page."""
    from tumble.workflows import demo

    run = demo(tmp_path_factory.mktemp("demo"))
    recording = replace(run.recording, sources=(Source(NASTY_NAME, "00"),))
    site, imu = Site.from_gravity(9.81), ("<i>MPU</i>", "7 & 8")
    return _made(run.estimate, recording, run.timeline, run.means, site, imu=imu)


def _by_poses(recording):
    timeline, site = find_timeline(recording), Site.unknown()
    means = observe_holds(recording, timeline)
    estimate = adjusted(recording, timeline, site, means, procedure="multi-position")
    return _made(estimate, recording, timeline, means, site)


@pytest.fixture(scope="session")
def without_gyro(hand_held):
    """The same recording without its gyro."""
    return _by_poses(replace(hand_held["recording"], angular_rate=None))


@pytest.fixture(scope="session")
def in_counts(hand_held):
    """The same recording by its poses, told in counts with a converter's zero of 32768."""
    recording = hand_held["recording"]
    return _by_poses(
        replace(
            recording,
            specific_force=recording.specific_force * 400.0 + 32768.0,
            angular_rate=recording.angular_rate * 4000.0 + 32768.0,
            specific_force_unit="counts",
            angular_rate_unit="counts",
        )
    )

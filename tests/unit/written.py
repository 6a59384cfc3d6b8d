"""A calibration that was written by hand, for tests to change in what they are about."""

from typing import Any

from tumble.document import Calibration, read_part

WRITTEN: dict[str, Any] = {
    "created": "2026-01-02T03:04:05+00:00",
    "software": "tumble 0.1.0",
    "procedure": "hand-held",
    "recordings": [],
    "site": {
        "gravity": 9.81,
        "gravity_standard_uncertainty": 0.0,
        "gravity_source": "given",
        "earth_rate": 7.292115e-5,
    },
    "frame": {"name": "accelerometer-x", "description": "x along the x accelerometer"},
    "not_determined": [],
    "raw_units": {"specific_force": "m/s^2", "angular_rate": "rad/s"},
    "accelerometer": {
        "matrix": [[1.0, 0.0, 0.0], [0.01, 1.0, 0.0], [-0.02, 0.03, 1.0]],
        "bias": [0.1, -0.01, 0.5],
    },
    "parameters": [],
    "covariance_parameters": [],
    "covariance": [],
    "quality": {
        "sigma0": 1.0,
        "sigma0_with_variance_components": 1.0,
        "degrees_of_freedom": 20,
        "largest_normalised_residual": 2.0,
        "coverage_factor": 2.0,
        "rms_hold_norm": 0.001,
        "rms_turn_angle": None,
        "holds": 20,
        "turns": 0,
        "variance_components": {},
        "left_out": [],
        "optional_terms": [],
    },
    "verdict": {"fit": True, "reasons": []},
    "test_vectors": [],
}


def written(quality: dict[str, Any] | None = None, **changes: Any) -> Calibration:
    """The calibration with changes of its parts, those of its quality one by one."""
    changes["quality"] = {**WRITTEN["quality"], **(quality or {})}
    return read_part(Calibration, {**WRITTEN, **changes})


def parameters(*rows: tuple[str, float, float, str]) -> list[dict[str, Any]]:
    """Blocks of a document from names, values, standard uncertainties and units."""
    keys = ("name", "value", "standard_uncertainty", "unit")
    return [dict(zip(keys, row, strict=True)) for row in rows]

"""Files of Kalibr that were not written by tumble: what they lack is said, what they are not is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tumble.document import read_calibration
from tumble.errors import CalibrationFileError
from tumble.workflows.convert import convert_from

M_A = [[1.012, 0.0, 0.0], [-0.009, 0.991, 0.0], [0.003, -0.012, 1.021]]
M_G = [[0.985, 0.0, 0.0], [0.006, 1.017, 0.0], [-0.013, 0.005, 1.008]]
# 30° about x
TURN = [[1.0, 0.0, 0.0], [0.0, 0.8660254037844387, -0.5], [0.0, 0.5, 0.8660254037844387]]
A = [[1e-3, -4e-4, 2e-4], [3e-4, -9e-4, 6e-4], [-7e-4, 5e-4, 8e-4]]


def imu(**update: Any) -> dict[str, Any]:
    """An imu0 as Kalibr writes it: without biases."""
    content = {
        "T_i_b": np.eye(4).tolist(),
        "accelerometers": {"M": M_A},
        "gyroscopes": {"M": M_G, "A": A, "C_gyro_i": TURN},
        "model": "scale-misalignment",
    }
    return content | update


def written(path: Path, document: Any) -> Path:
    path.write_text(yaml.safe_dump(document))
    return path


def test_a_result_of_kalibr_itself_has_no_biases_and_says_so(tmp_path: Path) -> None:
    """Forward formula of Kalibr by hand: the raw numbers that it predicts are corrected to the true ones."""
    path = written(tmp_path / "imu.yaml", {"imu0": imu()})
    found = convert_from(path, "kalibr", output=tmp_path / "a.json")
    remarks = " ".join(found.remarks)
    assert "no bias of the accelerometers: it is taken as zero" in remarks
    assert "no bias of the gyroscopes: it is taken as zero" in remarks
    f, w = np.array([1.0, -2.0, 9.5]), np.array([0.3, -0.1, 0.7])
    C = np.array(TURN)
    raw_f, raw_w = np.array(M_A) @ f, np.array(M_G) @ C @ w + np.array(A) @ (C @ f)
    force, rate = read_calibration(tmp_path / "a.json").correct(raw_f[None], raw_w[None])
    assert force is not None
    assert rate is not None
    assert np.allclose(force[0], f, rtol=0, atol=1e-12)
    assert np.allclose(rate[0], w, rtol=0, atol=1e-12)


def test_lever_arms_are_left_out_and_said(tmp_path: Path) -> None:
    given = imu(model="scale-misalignment-size-effect")
    found = convert_from(
        written(tmp_path / "imu.yaml", {"imu0": given}), "kalibr", output=tmp_path / "a.json"
    )
    assert "lever arms of the accelerometers are left out" in " ".join(found.remarks)


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ({"accelerometer_noise_density": 0.01}, "noise parameters and no calibration"),
        ({"cam0": {}}, "has no imu0: it is no result file of Kalibr"),
        ({"imu0": {"Tw": M_G, "Ta": M_A}}, "has OpenVINS' keys"),
        ({"imu0": imu(model="calibrated")}, "'calibrated', which has no matrices"),
        ({"imu0": {"model": "scale-misalignment"}}, "has no imu0.accelerometers.M"),
        ({"imu0": 5}, "has no imu0.model"),
        ({"imu0": imu(accelerometers={"M": [[1, 2, 3], [2, 4, 6], [0, 0, 1]]})}, "cannot be inverted"),
        (
            {"imu0": imu(gyroscopes={"M": M_G, "A": A, "C_gyro_i": M_G})},
            "C_gyro_i in .* is no rotation",
        ),
        ({"imu0": imu(gyroscopes={"M": M_G, "A": [1, 2], "C_gyro_i": TURN})}, "gyroscopes.A"),
        (
            {"imu0": imu(accelerometers={"M": M_A, "bias": [1e200, 0.0, 0.0]})},
            r"1e\+200: it is no calibration's number",
        ),
        ({"imu0": imu(accelerometers={"M": M_A, "bias": "none"})}, "accelerometers.bias"),
        (["imu0"], "holds no keys"),
    ],
)
def test_what_is_no_calibration_of_kalibr_is_refused(tmp_path: Path, document: Any, words: str) -> None:
    path = written(tmp_path / "imu.yaml", document)
    with pytest.raises(CalibrationFileError, match=words):
        convert_from(path, "kalibr", output=tmp_path / "a.json")
    assert not (tmp_path / "a.json").exists()

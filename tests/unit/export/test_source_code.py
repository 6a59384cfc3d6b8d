"""The C and C++ headers compile without a warning and correct the demo's recording as `tumble apply` does."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tumble.document.imported import calibration_from_model
from tumble.export.subject import prepare
from tumble.export.target import targets
from tumble.recording import read_recording
from tumble.sensor import ImuModel, Triad

TARGETS = targets()

DEMO = Path(__file__).parents[3] / "src" / "tumble" / "data" / "mpu9150-imu0.csv.gz"
COMPILERS = {
    "c": ("gcc", "-std=c99", "c", "tumble_correct_force(r, f); tumble_correct_rate(r + 3, f, w);"),
    "cpp": (
        "g++",
        "-std=c++17",
        "cpp",
        """const auto F = TumbleCalibration::force({r[0], r[1], r[2]});
        const auto W = TumbleCalibration::rate({r[3], r[4], r[5]}, F);
        for (int i = 0; i < 3; ++i) { f[i] = F[i]; w[i] = W[i]; }""",
    ),
}
# Every term there is, asymmetric matrices, and signs of every kind.
MODEL = ImuModel(
    Triad(
        np.array([[1.012, 0.004, -0.007], [-0.009, 0.991, 0.006], [0.003, -0.012, 1.021]]),
        np.array([0.11, -0.23, 0.34]),
        np.array([2e-4, -3e-4, 0.0]),
        np.array([1e-5, 0.0, -2e-5]),
    ),
    Triad(
        np.array([[0.985, -0.011, 0.008], [0.006, 1.017, -0.004], [-0.013, 0.005, 1.008]]),
        np.array([0.012, -0.034, 0.021]),
        np.array([0.0, 5e-4, -1e-4]),
        np.array([3e-4, -2e-4, 0.0]),
    ),
    np.array([[1.1e-3, -4e-4, 2e-4], [3e-4, -9e-4, 6e-4], [-7e-4, 5e-4, 8e-4]]),
)


@pytest.fixture(scope="module")
def demo() -> np.ndarray:
    """(samples, 6) raw of the recording that ships with the package."""
    recording = read_recording(DEMO, rate=100.0)
    assert recording.specific_force is not None
    assert recording.angular_rate is not None
    return np.column_stack([recording.specific_force, recording.angular_rate])


@pytest.mark.parametrize("name", COMPILERS)
def test_the_header_corrects_the_demo_s_recording_as_apply_does(
    name: str, demo: np.ndarray, tmp_path: Path
) -> None:
    compiler, standard, ending, call = COMPILERS[name]
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler} here")
    calibration = calibration_from_model(
        MODEL, ("m/s^2", "rad/s"), ("fixture", "the fixture's axes"), [], procedure="by hand", remarks=[]
    )
    target = TARGETS[name]
    (file,) = (texts := target.write(prepare(calibration, target)))
    (tmp_path / file).write_text(texts[file], encoding="utf-8")
    test = "tumble_self_test()" if name == "c" else "TumbleCalibration::self_test()"
    source = tmp_path / f"main.{ending}"
    source.write_text(
        f'#include <stdio.h>\n#include "{file}"\nint main(void)\n{{\n    double r[6], f[3], w[3];\n'
        f"    if ({test} > 1e-13) return 1;\n"
        "    while (fread(r, sizeof(double), 6, stdin) == 6) {\n"
        f"        {call}\n        fwrite(f, sizeof(double), 3, stdout); fwrite(w, sizeof(double), 3, stdout);\n"
        "    }\n    return 0;\n}\n"
    )
    program = tmp_path / "program"
    flags = [standard, "-O1", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run([compiler, *flags, source, "-o", program, "-lm"], check=True, capture_output=True)
    answer = subprocess.run([program], input=demo.tobytes(), stdout=subprocess.PIPE, check=True)
    corrected = np.frombuffer(answer.stdout).reshape(-1, 6)
    force, rate = calibration.correct(demo[:, :3], demo[:, 3:])
    assert force is not None
    assert rate is not None
    assert len(corrected) == len(demo) > 1000
    assert np.allclose(corrected[:, :3], force, rtol=0, atol=1e-12)
    assert np.allclose(corrected[:, 3:], rate, rtol=0, atol=1e-12)

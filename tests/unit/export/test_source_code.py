"""The headers compile without a warning and correct the demo's recording as `tumble apply` does."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.unit.export.a_unit import B_A, B_G, M_A, M_G, G, document

from tumble.export.subject import prepare
from tumble.export.target import targets
from tumble.recording import read_recording
from tumble.sensor import ImuModel, Triad

DEMO = Path(__file__).parents[3] / "src" / "tumble" / "data" / "mpu9150-imu0.csv.gz"
# How each is compiled and called, its own test, and how far it may be off: Arduino's floats have seven digits.
COMPILED = {
    "c": (
        "gcc -std=c99 -Wall -Wextra -Werror -pedantic",
        "tumble_correct_force(r, f); tumble_correct_rate(r + 3, f, w);",
        "tumble_self_test()",
        1e-12,
    ),
    "cpp": (
        "g++ -std=c++17 -Wall -Wextra -Werror -pedantic",
        """const auto F = TumbleCalibration::force({r[0], r[1], r[2]});
        const auto W = TumbleCalibration::rate({r[3], r[4], r[5]}, F);
        for (int i = 0; i < 3; ++i) { f[i] = F[i]; w[i] = W[i]; }""",
        "TumbleCalibration::self_test()",
        1e-12,
    ),
    "arduino": (
        "g++ -std=c++11 -Wall -Wextra -Werror",
        """float R[6], F[3], W[3];
        for (int i = 0; i < 6; ++i) R[i] = float(r[i]);
        tumble_correct(R, R + 3, F, W);
        for (int i = 0; i < 3; ++i) { f[i] = F[i]; w[i] = W[i]; }""",
        "0.0",
        1e-5,
    ),
}
# Every term there is, and signs of every kind.
MODEL = ImuModel(
    Triad(M_A, B_A, np.array([2e-4, -3e-4, 0.0]), np.array([1e-5, 0.0, -2e-5])),
    Triad(M_G, B_G, np.array([0.0, 5e-4, -1e-4]), np.array([3e-4, -2e-4, 0.0])),
    G,
)


@pytest.mark.parametrize("name", COMPILED)
def test_the_header_corrects_the_demo_s_recording_as_apply_does(name: str, tmp_path: Path) -> None:
    compiler, call, test, tolerance = COMPILED[name]
    if shutil.which(compiler[:3]) is None:
        pytest.skip(f"no {compiler[:3]} here")
    model = MODEL
    if name == "arduino":
        model = replace(MODEL, accelerometer=Triad(M_A, B_A), gyroscope=Triad(M_G, B_G))
    calibration, target = document(model), targets()[name]
    ((file, text),) = target.write(prepare(calibration, target)).items()
    (tmp_path / file).write_text(text, encoding="utf-8")
    source = "main.c" if name == "c" else "main.cpp"
    (tmp_path / source).write_text(
        f'#include <stdio.h>\n#include "{file}"\nint main(void)\n{{\n    double r[6], f[3], w[3];\n'
        f"    if ({test} > 1e-13) return 1;\n"
        "    while (fread(r, sizeof(double), 6, stdin) == 6) {\n"
        f"        {call}\n        fwrite(f, sizeof(double), 3, stdout); fwrite(w, sizeof(double), 3, stdout);\n"
        "    }\n    return 0;\n}\n"
    )
    subprocess.run([*compiler.split(), "-O1", source, "-o", "program", "-lm"], check=True, cwd=tmp_path)
    recording = read_recording(DEMO, rate=100.0)
    raw = np.hstack([recording.specific_force, recording.angular_rate])
    answer = subprocess.run([tmp_path / "program"], input=raw.tobytes(), stdout=subprocess.PIPE, check=True)
    corrected = np.frombuffer(answer.stdout).reshape(-1, 6)
    assert len(corrected) > 1000
    expected = np.hstack(calibration.correct(raw[:, :3], raw[:, 3:]))
    np.testing.assert_allclose(corrected, expected, rtol=0, atol=tolerance)

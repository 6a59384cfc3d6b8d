"""The headers compile without a warning and correct as `tumble apply` does."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs
from tests.unit.export.a_unit import B_A, B_G, M_A, M_G, TARGETS, G, compass, document
from tests.unit.export.test_files import register_after, registers, text_of

from tumble.export.preparing import prepare
from tumble.recording import read_recording
from tumble.sensor import ImuModel, Triad

DEMO = Path(__file__).parents[3] / "src" / "tumble" / "data" / "mpu9150-imu0.csv.gz"
# How each is compiled and called, its own tests, and how far it may be off: Arduino's floats have seven digits.
COMPILED = {
    "c": (
        "gcc -std=c99 -Wall -Wextra -Werror -pedantic",
        "tumble_correct_force(r, f); tumble_correct_rate(r + 3, f, w); tumble_correct_field(r, m);",
        "tumble_self_test() > 1e-13 || tumble_field_self_test() > 1e-12",
        1e-12,
    ),
    "cpp": (
        "g++ -std=c++17 -Wall -Wextra -Werror -pedantic",
        """const auto F = TumbleCalibration::force({r[0], r[1], r[2]});
        const auto W = TumbleCalibration::rate({r[3], r[4], r[5]}, F);
        const auto M = TumbleCalibration::field({r[0], r[1], r[2]});
        for (int i = 0; i < 3; ++i) { f[i] = F[i]; w[i] = W[i]; m[i] = M[i]; }""",
        "TumbleCalibration::self_test() > 1e-13 || TumbleCalibration::field_self_test() > 1e-12",
        1e-12,
    ),
    "arduino": (
        "g++ -std=c++11 -Wall -Wextra -Werror",
        """float R[6], F[3], W[3];
        for (int i = 0; i < 6; ++i) R[i] = float(r[i]);
        tumble_correct(R, R + 3, F, W);
        for (int i = 0; i < 3; ++i) { f[i] = F[i]; w[i] = W[i]; m[i] = 0.0; }""",
        "0",
        1e-5,
    ),
}
# Every term there is, and signs of every kind.
MODEL = ImuModel(
    Triad(M_A, B_A, np.array([2e-4, -3e-4, 0.0]), np.array([1e-5, 0.0, -2e-5])),
    Triad(M_G, B_G, np.array([0.0, 5e-4, -1e-4]), np.array([3e-4, -2e-4, 0.0])),
    G,
)


def compiled(folder: Path, compiler: str, source: str) -> Path:
    if shutil.which(compiler[:3]) is None:
        pytest.skip(f"no {compiler[:3]} here")
    name = "main.c" if compiler.startswith("gcc") else "main.cpp"
    (folder / name).write_text(source)
    subprocess.run([*compiler.split(), "-O1", name, "-o", "program", "-lm"], check=True, cwd=folder)
    return folder / "program"


@pytest.mark.parametrize("name", COMPILED)
def test_the_header_corrects_the_demo_s_recording_as_apply_does(name: str, tmp_path: Path) -> None:
    """The demo's forces serve as numbers of a magnetometer, too."""
    compiler, call, test, tolerance = COMPILED[name]
    model = (
        replace(MODEL, accelerometer=Triad(M_A, B_A), gyroscope=Triad(M_G, B_G))
        if name == "arduino"
        else MODEL
    )
    calibration = structs.replace(document(model), magnetometer=compass())
    ((file, text),) = TARGETS[name].write(prepare(calibration, TARGETS[name])).items()
    (tmp_path / file).write_text(text, encoding="utf-8")
    program = compiled(
        tmp_path,
        compiler,
        f'#include <stdio.h>\n#include "{file}"\nint main(void)\n{{\n    double r[6], f[3], w[3], m[3];\n'
        f"    if ({test}) return 1;\n"
        "    while (fread(r, sizeof(double), 6, stdin) == 6) {\n"
        f"        {call}\n        fwrite(f, sizeof(double), 3, stdout); fwrite(w, sizeof(double), 3, stdout);\n"
        "        fwrite(m, sizeof(double), 3, stdout);\n    }\n    return 0;\n}\n",
    )
    recording = read_recording(DEMO, rate=100.0)
    raw = np.hstack([recording.specific_force, recording.angular_rate])
    answer = subprocess.run([program], input=raw.tobytes(), stdout=subprocess.PIPE, check=True)
    corrected = np.frombuffer(answer.stdout).reshape(-1, 9)
    assert len(corrected) > 1000
    expected = np.hstack(calibration.correct(raw[:, :3], raw[:, 3:]))
    np.testing.assert_allclose(corrected[:, :6], expected, rtol=0, atol=tolerance)
    if name != "arduino":
        field = 1e6 * calibration.model.magnetometer.correct(raw[:, :3])
        np.testing.assert_allclose(corrected[:, 6:], field, rtol=1e-12)


def test_mpu6050_s_header_compiles_and_works_a_register_out(tmp_path: Path) -> None:
    header = text_of("mpu6050", ImuModel(Triad(M_A, B_A), Triad(M_G, B_G)), largest_loss=0.05)
    (tmp_path / "mpu6050_offsets.h").write_text(header)
    source = (
        '#include <stdio.h>\n#include "mpu6050_offsets.h"\nint main() { printf("%d %d\\n",'
        " mpu6050_accel_register(-2735, 0), mpu6050_accel_register(1184, 1)); }\n"
    )
    program = compiled(tmp_path, "g++ -Wall -Wextra -Werror -Wno-unused-variable", source)
    said = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    add = registers(header, "MPU6050_ACCEL_ADD")
    assert said.split() == [str(register_after(there, int(add[i]))) for i, there in enumerate((-2735, 1184))]


def test_a_file_that_holds_all_states_no_loss_but_of_a_curve_that_it_does_not_write(monkeypatch) -> None:
    made = document(MODEL)
    for name in ("c", "cpp", "python"):
        assert prepare(made, TARGETS[name]).losses == ()
    monkeypatch.setattr("tumble.export.preparing.CURVED", ("asymmetry",))
    lost = prepare(made, TARGETS["c"])
    assert (lost.gyroscope.quadratic, lost.gyroscope.asymmetry) == (
        None,
        pytest.approx(MODEL.gyroscope.asymmetry),
    )
    assert "in all, what this file corrects is off" in lost.losses[0].text
    assert [loss.text.partition(" are")[0] for loss in lost.losses[1:]] == [
        f"the {who}' quadratic terms" for who in ("accelerometers", "gyros")
    ]

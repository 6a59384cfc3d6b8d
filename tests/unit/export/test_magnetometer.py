"""Each tool's own formula for a magnetometer, written here by hand, gives the corrected field: asymmetric matrices."""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from tumble.document.imported import calibration_from_model
from tumble.document.magnetometer_block import FieldBlock, FieldVerdictBlock, MagnetometerBlock
from tumble.document.result import Calibration
from tumble.errors import UsageError
from tumble.export.subject import Wishes, prepare
from tumble.export.target import MAGNETOMETER, targets
from tumble.sensor import ImuModel, Triad, change_frame

TARGETS = targets()

# Raw µT per tesla, right-handed, turned by some degrees, no two entries alike.
M = 1e6 * np.array([[1.07, 0.031, -0.052], [-0.083, 0.94, 0.047], [0.021, -0.066, 1.12]])
H = np.array([12.5, -31.0, 47.25])
M_A = np.array([[1.012, 0.004, -0.007], [-0.009, 0.991, 0.006], [0.003, -0.012, 1.021]])
RAW = np.array([[30.0, -12.0, 71.0], [-25.0, 8.0, 10.0], [12.5, -31.0, 120.0]])
TRUE = 1e6 * np.linalg.solve(M, (RAW - H).T).T  # µT
TURNED = ("px4", "ardupilot", "motioncal")
"""Tools with a symmetric matrix: the field is right but for one rotation."""


def rows(matrix: np.ndarray) -> Any:
    return tuple(tuple(float(v) for v in row) for row in matrix)


def document(*, raw_unit: str = "uT", unit: Any = "T", matrix: np.ndarray = M) -> Calibration:
    made = calibration_from_model(
        ImuModel(Triad(M_A, np.array([0.1, -0.2, 0.3])), Triad(np.eye(3), np.zeros(3))),
        ("m/s^2", "rad/s"),
        ("fixture", "the axes of the fixture"),
        [],
        procedure="by hand",
        remarks=[],
    )
    block = MagnetometerBlock(
        raw_unit=raw_unit,
        unit=unit,
        frame="b",
        method="holds and turns",
        matrix=rows(matrix),
        bias=(float(H[0]), float(H[1]), float(H[2])),
        field=FieldBlock(norm=49e-6, norm_standard_uncertainty=1e-7, norm_given=True, source="by hand"),
    )
    return structs.replace(made, magnetometer=block)


def written(name: str, made: Calibration | None = None, **wishes: Any) -> str:
    texts = TARGETS[name].write(
        prepare(made or document(), TARGETS[name], Wishes(largest_loss=0.1, **wishes))
    )
    return "".join(texts.values())


def numbers(pattern: str, text: str) -> np.ndarray:
    """The numbers of the first group of a pattern, one after the other."""
    found = re.search(pattern, text, re.M)
    assert found
    return np.array([float(v.rstrip("f")) for v in re.split(r"[\s,;]+", found[1])])


def by_fusion(text: str) -> np.ndarray:
    """FusionMatrixMultiplyVector(softIronMatrix, uncalibrated - hardIronOffset)."""
    found = {
        name: numbers(name + r" = \{\.array = \{(.*?)\}\}", text)
        for name in ("softIronMatrix", "hardIronOffset")
    }
    return (RAW - found["hardIronOffset"]) @ found["softIronMatrix"].reshape(3, 3).T


def by_px4(text: str) -> np.ndarray:
    """_scale * (data - _offset) in gauss, rows [SX OX OY; OX SY OZ; OY OZ SZ]."""
    p = {w[2]: float(w[3]) for line in text.splitlines() if len(w := line.split("\t")) == 5}
    off, s, o = (np.array([p[f"CAL_MAG0_{a}{what}"] for a in "XYZ"]) for what in ("OFF", "SCALE", "ODIAG"))
    S = np.array([[s[0], o[0], o[1]], [o[0], s[1], o[2]], [o[1], o[2], s[2]]])
    return 100.0 * (0.01 * RAW - off) @ S.T


def by_ardupilot(text: str) -> np.ndarray:
    """mat * (mag + offsets) in milligauss, rows [DX OX OY; OX DY OZ; OY OZ DZ]; then the scale factor."""
    p = dict(line.split(",") for line in text.splitlines() if not line.startswith("#"))
    o, d, i = (np.array([float(p[f"COMPASS_{what}_{a}"]) for a in "XYZ"]) for what in ("OFS", "DIA", "ODI"))
    S = np.array([[d[0], i[0], i[1]], [i[0], d[1], i[2]], [i[1], i[2], d[2]]])
    return 0.1 * float(p["COMPASS_SCALE"]) * (10.0 * RAW + o) @ S.T


def by_matlab(text: str) -> np.ndarray:
    """C = (D-b)*A."""
    values = {name: numbers(rf"^{name} = \[(.*)\];", text) for name in ("mag_A", "mag_b")}
    assert "mag_expmfs = 49.0;" in text
    return (RAW - values["mag_b"]) @ values["mag_A"].reshape(3, 3)


def by_motioncal(text: str) -> np.ndarray:
    """invW (raw - V), and the packet says the same with the checksum of Modbus."""
    lines = {
        line.split()[0]: line.split()[1:] for line in text.splitlines() if not line.startswith(("#", "invW"))
    }
    V = np.array([float(v) for v in lines["V"]])
    W = np.array(
        [[float(v) for v in line.split()[1:]] for line in text.splitlines() if line.startswith("invW")]
    )
    sent = bytes.fromhex("".join(lines["packet"]))
    assert len(sent) == 68
    assert sent[:2] == b"uT"
    check = 0xFFFF
    for byte in sent[:66]:
        check ^= byte
        for _ in range(8):
            check = (check >> 1) ^ 0xA001 if check & 1 else check >> 1
    assert struct.unpack("<H", sent[66:]) == (check,)
    n = np.array(struct.unpack("<16f", sent[2:66]))
    np.testing.assert_array_equal(n[:6], 0.0)
    np.testing.assert_allclose(n[6:9], V, rtol=1e-6)
    assert n[9] == 49.0
    np.testing.assert_allclose(n[10:], [W[0, 0], W[1, 1], W[2, 2], W[0, 1], W[0, 2], W[1, 2]], rtol=1e-6)
    return (RAW - V) @ W.T


def by_python(text: str) -> np.ndarray:
    names: dict[str, Any] = {"__name__": "tumble_calibration"}
    exec(compile(text, "tumble_calibration.py", "exec"), names)
    assert names["field_self_test"]() < 1e-12
    assert names["self_test"]() < 1e-12
    return np.array([names["correct_field"](list(row)) for row in RAW])


FORMULAS: dict[str, Callable[[str], np.ndarray]] = {
    "fusion": by_fusion,
    "px4": by_px4,
    "ardupilot": by_ardupilot,
    "matlab": by_matlab,
    "motioncal": by_motioncal,
    "python": by_python,
}
COMPILED = {
    "c": ("gcc", "-std=c99", "tumble_correct_field(r, x);", "tumble_field_self_test()"),
    "cpp": (
        "g++",
        "-std=c++17",
        "const auto F = TumbleCalibration::field({r[0], r[1], r[2]}); for (int i = 0; i < 3; ++i) x[i] = F[i];",
        "TumbleCalibration::field_self_test()",
    ),
}


def test_every_target_that_holds_a_magnetometer_is_tested() -> None:
    assert {*FORMULAS, *COMPILED} == {t.name for t in TARGETS.values() if MAGNETOMETER in t.holds}


@pytest.mark.parametrize("name", sorted(FORMULAS))
def test_its_own_formula_gives_the_corrected_field(name: str) -> None:
    found = FORMULAS[name](written(name))
    if name not in TURNED:
        np.testing.assert_allclose(found, TRUE, rtol=2e-6)
        return
    # One rotation of all vectors (Kabsch), of the angle that the loss states.
    left, _, right = np.linalg.svd(TRUE.T @ found)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    np.testing.assert_allclose(found, TRUE @ turn, rtol=0, atol=2e-4)
    angle = np.degrees(np.arccos(0.5 * (np.trace(turn) - 1.0)))
    assert angle > 1.0
    stated = re.search(r"turned by ([\d.]+)°", written(name))
    assert stated
    assert float(stated[1]) == pytest.approx(angle, rel=0.03)


@pytest.mark.parametrize("name", COMPILED)
def test_the_header_compiles_and_corrects_the_field(name: str, tmp_path: Path) -> None:
    compiler, standard, call, check = COMPILED[name]
    if shutil.which(compiler) is None:
        pytest.skip(f"there is no {compiler}")
    file = tmp_path / TARGETS[name].file
    file.write_text(written(name), encoding="utf-8")
    print_it = 'printf("%.17g %.17g %.17g\\n", x[0], x[1], x[2]);'
    raw = ", ".join("{" + ", ".join(map(repr, map(float, row))) + "}" for row in RAW)
    code = (
        f'#include <stdio.h>\n#include "{file.name}"\n'
        f"int main(void) {{ const double rows[3][3] = {{{raw}}}; int k;\n"
        f"for (k = 0; k < 3; ++k) {{ const double *r = rows[k]; double x[3]; {call} {print_it} }}\n"
        f'printf("%g\\n", {check}); return 0; }}\n'
    )
    source = tmp_path / ("main.c" if name == "c" else "main.cpp")
    source.write_text(code, encoding="utf-8")
    flags = [standard, "-Wall", "-Wextra", "-Werror", "-Wno-unused-function", "-Wno-unused-const-variable"]
    done = subprocess.run(
        [compiler, *flags, source, "-o", tmp_path / "a", "-lm"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    lines = subprocess.run([tmp_path / "a"], capture_output=True, text=True, check=True).stdout.splitlines()
    np.testing.assert_allclose([[float(v) for v in line.split()] for line in lines[:3]], TRUE, rtol=1e-12)
    assert float(lines[3]) < 1e-12


def test_another_frame_turns_the_field_with_the_other_triads() -> None:
    made = document()
    found = by_matlab(written("matlab", made, frame="accelerometer-z"))
    turned = change_frame(made.model, "accelerometer-z")
    assert turned.magnetometer is not None
    np.testing.assert_allclose(found, 1e6 * turned.magnetometer.correct(RAW), rtol=1e-9)
    assert np.abs(found - TRUE).max() > 0.05


def test_counts_go_where_any_unit_goes_and_autopilots_say_why_they_do_not() -> None:
    counts = document(raw_unit="counts", unit="local field", matrix=49e-6 * M)
    found = by_fusion(written("fusion", counts))
    np.testing.assert_allclose(49.0 * found, TRUE, rtol=2e-6)
    for name in ("px4", "ardupilot"):
        text = written(name, counts)
        assert "loss: the magnetometer is left out: it takes counts" in text
        assert not re.search(r"^(?!#).*(CAL_MAG|COMPASS)", text, re.M)
    with pytest.raises(UsageError, match="MotionCal works in µT"):
        written("motioncal", counts)


def test_gauss_and_microtesla_are_one_field() -> None:
    gauss = document(raw_unit="gauss", matrix=0.01 * M)
    gauss = structs.replace(gauss, magnetometer=structs.replace(gauss.magnetometer, bias=tuple(0.01 * H)))
    np.testing.assert_allclose(by_px4(written("px4", gauss)), by_px4(written("px4")), rtol=1e-6)
    np.testing.assert_allclose(
        by_ardupilot(written("ardupilot", gauss)), by_ardupilot(written("ardupilot")), rtol=1e-6
    )


def unfit() -> Calibration:
    """A calibration whose magnetometer's verdict is against its use."""
    made = document()
    assert made.magnetometer is not None
    against = FieldVerdictBlock(use="not fit", reasons=["Its axes are mirrored."])
    return structs.replace(made, magnetometer=structs.replace(made.magnetometer, verdict=against))


@pytest.mark.parametrize("name", sorted({*FORMULAS, *COMPILED} - {"motioncal"}))
def test_a_magnetometer_that_is_not_fit_is_not_written_and_that_is_said(name: str) -> None:
    made = prepare(unfit(), TARGETS[name], Wishes(largest_loss=0.1))
    assert made.magnetometer is None
    assert any("magnetometer is left out: its calibration is not fit" in loss.text for loss in made.losses)
    assert "test vector: raw magnetic field [" not in "".join(TARGETS[name].write(made).values())


def test_motioncal_refuses_a_magnetometer_that_is_not_fit() -> None:
    with pytest.raises(UsageError, match="is not fit for use"):
        written("motioncal", unfit())


@pytest.mark.parametrize("name", TURNED)
def test_the_rotation_that_is_lost_counts_against_the_limit(name: str) -> None:
    # About z by 5.9°: a unit vector across z is off by the chord 2 sin(2.95°), which is 102929 ppm.
    angle = np.radians(5.9)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )
    made = document(matrix=1e6 * np.diag([1.07, 0.94, 1.12]) @ turn)
    for limit in (0.05, 0.1028):
        if name == "motioncal":
            with pytest.raises(UsageError, match=r"the magnetometer is turned by 5\.9°"):
                prepare(made, TARGETS[name], Wishes(largest_loss=limit))
            continue
        strict = prepare(made, TARGETS[name], Wishes(largest_loss=limit))
        # The other triads are no worse for it.
        text = "".join(TARGETS[name].write(strict).values())
        assert "the magnetometer is left out" in text
        assert not any(word in text for word in ("CAL_MAG0_XOFF", "COMPASS_OFS_X"))
        assert any(word in text for word in ("CAL_ACC0_XOFF", "INS_ACCOFFS_X"))
    text = "".join(TARGETS[name].write(prepare(made, TARGETS[name], Wishes(largest_loss=0.1031))).values())
    assert "turned by 5.9°" in text
    assert "(102929 ppm)" in text


def test_motioncal_wants_a_magnetometer() -> None:
    with pytest.raises(UsageError, match="the calibration has none"):
        written("motioncal", structs.replace(document(), magnetometer=None))

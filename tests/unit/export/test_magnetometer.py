"""Each tool's own formula for a magnetometer, written here by hand, gives the corrected field: asymmetric matrices."""

import re
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from msgspec import structs
from tests.unit.export.a_unit import B_M, M_M, TARGETS, ardupilot, compass, document as bare, parameters, px4

from tumble.document import Calibration
from tumble.errors import UsageError
from tumble.export.preparing import prepare
from tumble.export.subject import Wishes
from tumble.export.target import MAGNETOMETER
from tumble.sensor import change_frame

RAW = np.array([[30.0, -12.0, 71.0], [-25.0, 8.0, 10.0], [12.5, -31.0, 120.0]])
TRUE = 1e6 * np.linalg.solve(M_M, (RAW - B_M).T).T  # µT
TURNED = ("px4", "ardupilot", "motioncal")
"""Tools with a symmetric matrix: the field is right but for one rotation."""


def document(matrix: np.ndarray = M_M, bias: np.ndarray = B_M, **field: Any) -> Calibration:
    return structs.replace(bare(), magnetometer=compass(matrix, bias, **field))


def written(name: str, made: Calibration | None = None, limit: float = 0.1, **wishes: Any) -> str:
    subject = prepare(made or document(), TARGETS[name], Wishes(largest_loss=limit, **wishes))
    return "".join(TARGETS[name].write(subject).values())


def numbers(pattern: str, text: str) -> np.ndarray:
    """The numbers of the first group of a pattern, one after the other."""
    (found,) = re.findall(pattern, text, re.M)
    return np.array([float(v.rstrip("f")) for v in re.split(r"[\s,;]+", found)])


def by_fusion(text: str) -> np.ndarray:
    """FusionMatrixMultiplyVector(softIronMatrix, uncalibrated - hardIronOffset)."""
    soft, hard = (
        numbers(name + r" = \{\.array = \{(.*?)\}\}", text) for name in ("softIronMatrix", "hardIronOffset")
    )
    return (RAW - hard) @ soft.reshape(3, 3).T


def by_matlab(text: str) -> np.ndarray:
    """C = (D-b)*A."""
    assert "mag_expmfs = 49.0;" in text
    return (RAW - numbers(r"^mag_b = \[(.*)\];", text)) @ numbers(r"^mag_A = \[(.*)\];", text).reshape(3, 3)


def by_motioncal(text: str) -> np.ndarray:
    """invW (raw - V), and the packet says the same with the checksum of Modbus."""
    lines = [line.split() for line in text.splitlines() if not line.startswith("#")]
    V = np.array([line[1:] for line in lines if line[0] == "V"], float)[0]
    W = np.array([line[1:] for line in lines if line[0] == "invW"], float)
    sent = bytes.fromhex("".join(*(line[1:] for line in lines if line[0] == "packet")))
    assert (len(sent), sent[:2]) == (68, b"uT")
    check = 0xFFFF
    for byte in sent[:66]:
        check ^= byte
        for _ in range(8):
            check = (check >> 1) ^ 0xA001 if check & 1 else check >> 1
    assert struct.unpack("<H", sent[66:]) == (check,)
    expected = [*[0.0] * 6, *V, 49.0, W[0, 0], W[1, 1], W[2, 2], W[0, 1], W[0, 2], W[1, 2]]
    np.testing.assert_allclose(struct.unpack("<16f", sent[2:66]), expected, rtol=1e-6)
    return (RAW - V) @ W.T


def by_python(text: str) -> np.ndarray:
    names: dict[str, Any] = {"__name__": "tumble_calibration"}
    exec(compile(text, "tumble_calibration.py", "exec"), names)
    assert names["field_self_test"]() < 1e-12
    assert names["self_test"]() < 1e-12
    return np.array([names["correct_field"](list(row)) for row in RAW])


FORMULAS: dict[str, Callable[[str], np.ndarray]] = {
    "fusion": by_fusion,
    "px4": lambda text: 100.0 * px4("MAG", 0.01 * RAW, parameters(text)),  # gauss
    "ardupilot": lambda text: 0.1 * ardupilot("MAG", 10.0 * RAW, parameters(text)),  # mgauss
    "matlab": by_matlab,
    "motioncal": by_motioncal,
    "python": by_python,
}
COMPILED = ("c", "cpp")  # test_code.py


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
    assert numbers(r"turned by ([\d.]+)°", written(name)) == pytest.approx(angle, rel=0.03)


def test_another_frame_turns_the_field_with_the_other_triads() -> None:
    made = document()
    found = by_matlab(written("matlab", made, frame="accelerometer-z"))
    turned = change_frame(made.model, "accelerometer-z")
    np.testing.assert_allclose(found, 1e6 * turned.magnetometer.correct(RAW), rtol=1e-9)
    assert np.abs(found - TRUE).max() > 0.05


def test_counts_go_where_any_unit_goes_and_autopilots_say_why_they_do_not() -> None:
    counts = document(49e-6 * M_M, raw_unit="counts", unit="local field")
    np.testing.assert_allclose(49.0 * by_fusion(written("fusion", counts)), TRUE, rtol=2e-6)
    for name in ("px4", "ardupilot"):
        text = written(name, counts)
        assert "loss: the magnetometer is left out: it takes counts" in text
        assert not re.search(r"^(?!#).*(CAL_MAG|COMPASS)", text, re.M)
    for made, words in (
        (counts, "MotionCal works in µT"),
        (bare(), "the calibration has none"),
        (unfit(), "is not fit for use"),
    ):
        with pytest.raises(UsageError, match=words):
            written("motioncal", made)


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_gauss_and_microtesla_are_one_field(name: str) -> None:
    gauss = written(name, document(0.01 * M_M, 0.01 * B_M, raw_unit="gauss"))
    np.testing.assert_allclose(FORMULAS[name](gauss), FORMULAS[name](written(name)), rtol=1e-6)


def unfit() -> Calibration:
    """A calibration whose magnetometer's verdict is against its use."""
    return document(verdict={"use": "not fit", "reasons": ["Its axes are mirrored."]})


@pytest.mark.parametrize("name", sorted({*FORMULAS, *COMPILED} - {"motioncal"}))
def test_a_magnetometer_that_is_not_fit_is_not_written_and_that_is_said(name: str) -> None:
    made = prepare(unfit(), TARGETS[name], Wishes(largest_loss=0.1))
    assert made.magnetometer is None
    assert any("magnetometer is left out: its calibration is not fit" in loss.text for loss in made.losses)
    assert "test vector: raw magnetic field [" not in "".join(TARGETS[name].write(made).values())


@pytest.mark.parametrize("name", TURNED)
def test_the_rotation_that_is_lost_counts_against_the_limit(name: str) -> None:
    # About z by 5.9°: a unit vector across z is off by the chord 2 sin(2.95°), which is 102929 ppm.
    c, s = np.cos(np.radians(5.9)), np.sin(np.radians(5.9))
    made = document(
        1e6 * np.diag([1.07, 0.94, 1.12]) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    )
    for limit in (0.05, 0.1028):
        if name == "motioncal":
            with pytest.raises(UsageError, match=r"the magnetometer is turned by 5\.9°"):
                written(name, made, limit)
            continue
        text = written(name, made, limit)  # the other triads are no worse for it
        assert "the magnetometer is left out" in text
        assert not any(word in text for word in ("CAL_MAG0_XOFF", "COMPASS_OFS_X"))
        assert any(word in text for word in ("CAL_ACC0_XOFF", "INS_ACCOFFS_X"))
    text = written(name, made, 0.1031)
    assert "turned by 5.9°" in text
    assert "(102929 ppm)" in text

"""Acceptance limits: the decision rules against closed forms, the file's sentences, and documents held against it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs
from tests.unit.written import written

from tumble.document.result import Calibration, ParameterBlock
from tumble.errors import UsageError
from tumble.limits import decide, read_limits, with_limits
from tumble.limits.conformity import conformance_probability, decision, overall


def file_of(folder: Path, text: str) -> Path:
    path = folder / "limits.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def document() -> Calibration:
    return written()


def with_parameters(document: Calibration, *rows: tuple[str, float, float, str]) -> Calibration:
    blocks = [
        ParameterBlock(name=name, value=value, standard_uncertainty=sigma, unit=unit)
        for name, value, sigma, unit in rows
    ]
    return structs.replace(document, parameters=blocks)


# --- rules


def test_the_probability_is_what_drawing_shows() -> None:
    rng = np.random.default_rng(5)
    drawn = rng.normal(0.7, 0.4, 400_000)
    counted = np.mean((drawn > -0.2) & (drawn < 1.0))
    # Binomial: 4 sigma of 400,000 draws.
    assert conformance_probability(0.7, 0.4, -0.2, 1.0) == pytest.approx(
        counted, abs=4 * 0.5 / math.sqrt(4e5)
    )


@pytest.mark.parametrize(
    ("rule", "value", "sigma", "found"),
    [
        ("simple", 0.99, 0.5, "passed"),
        ("simple", 1.01, 0.5, "failed"),
        ("guarded", 0.79, 0.1, "passed"),
        ("guarded", 0.81, 0.1, "undecided"),
        ("guarded", 1.19, 0.1, "undecided"),
        ("guarded", 1.21, 0.1, "failed"),
        ("guarded", -1.21, 0.1, "failed"),
        # one side counts: Φ(1.645) = 95 %
        ("risk", 1.0 - 0.1646, 0.1, "passed"),
        ("risk", 1.0 - 0.1643, 0.1, "undecided"),
        ("risk", 1.0 + 0.1643, 0.1, "undecided"),
        ("risk", 1.0 + 0.1646, 0.1, "failed"),
        # known so badly that nothing is probable: no reason to fail a unit
        ("risk", 0.0, 100.0, "undecided"),
    ],
)
def test_a_rule_decides(rule: str, value: float, sigma: float, found: str) -> None:
    assert decision(rule, value, sigma, -1.0, 1.0, 0.05) == found  # pyright: ignore[reportArgumentType]


def test_one_failure_fails_and_nothing_at_all_passes_nothing() -> None:
    assert overall(["passed", "undecided", "failed"]) == "failed"
    assert overall(["passed", "undecided"]) == "undecided"
    assert overall([]) == "undecided"


# --- documents


def test_limits_in_other_units_are_the_same_limits(document: Calibration, tmp_path: Path) -> None:
    limits = read_limits(
        file_of(
            tmp_path, "limits:\n  accelerometer bias: 50 mg\n  gyro bias y: {from: -1 deg/s, to: 2 deg/s}\n"
        )
    )
    seen = with_parameters(
        document,
        ("accelerometer bias x", 0.49, 1e-3, "m/s^2"),
        ("accelerometer bias y", -0.0501, 1e-4, "g"),
        ("gyro bias y", 0.03, 1e-4, "rad/s"),
        ("gyro bias z", 9.0, 1e-4, "rad/s"),
    )
    block = decide(seen, limits)
    assert [one.decision for one in block.parameters] == ["passed", "failed", "passed"]
    assert block.parameters[0].upper == pytest.approx(0.4903325)
    assert block.parameters[2].upper == pytest.approx(math.radians(2.0))
    assert block.decision == "failed"
    assert "Accelerometer bias y" in block.reasons[0]


def test_a_parameters_own_limit_goes_before_its_groups(document: Calibration, tmp_path: Path) -> None:
    limits = read_limits(file_of(tmp_path, "limits:\n  gyro bias: 1 deg/s\n  gyro bias z: 5 deg/s\n"))
    rate = math.radians(3.0)
    seen = with_parameters(document, ("gyro bias z", rate, 0.0, "rad/s"), ("gyro bias x", rate, 0.0, "rad/s"))
    assert [one.decision for one in decide(seen, limits).parameters] == ["passed", "failed"]


def test_what_is_not_there_leaves_it_undecided(document: Calibration, tmp_path: Path) -> None:
    limits = read_limits(file_of(tmp_path, "limits:\n  accelerometer bias: 50 mg\n  gyro bias: 1 deg/s\n"))
    seen = with_parameters(document, ("accelerometer bias x", 0.01, 1e-3, "m/s^2"))
    block = decide(seen, limits)
    assert block.decision == "undecided"
    assert block.reasons == ["The calibration has no gyro bias: nothing was compared with its limits."]


def test_counts_are_not_compared_with_milli_g(document: Calibration, tmp_path: Path) -> None:
    limits = read_limits(file_of(tmp_path, "limits:\n  accelerometer bias: 50 mg\n"))
    seen = with_parameters(document, ("accelerometer bias x", 12.0, 1.0, "counts"))
    assert decide(seen, limits).decision == "undecided"


def test_a_nominal_scale_factor_in_counts_has_relative_limits(document: Calibration, tmp_path: Path) -> None:
    text = "limits:\n  accelerometer scale factor: {nominal: 1670 counts/(m/s²), within: 3 %}\n"
    limits = read_limits(file_of(tmp_path, text))
    seen = with_parameters(document, ("accelerometer scale factor x", 1700.0, 0.5, "counts/(m/s²)"))
    block = decide(seen, limits).parameters[0]
    assert (block.lower, block.upper) == (pytest.approx(1619.9), pytest.approx(1720.1))


def test_the_largest_uncertainty_is_asked_for(document: Calibration, tmp_path: Path) -> None:
    text = "limits:\n  gyro bias: {within: 1 deg/s, largest uncertainty: 0.01 deg/s}\n"
    limits = read_limits(file_of(tmp_path, text))
    seen = with_parameters(document, ("gyro bias x", 0.0, math.radians(0.006), "rad/s"))
    block = decide(seen, limits)
    assert block.decision == "undecided"
    assert "known worse" in block.reasons[0]


def test_a_data_sheet_gives_three_of_its_sigmas(document: Calibration, tmp_path: Path) -> None:
    from tumble.simulation import find_grade

    limits = read_limits(file_of(tmp_path, "limits:\n  gyro bias: {data sheet: consumer-mems}\n"))
    seen = with_parameters(document, ("gyro bias x", 0.0, 0.0, "rad/s"))
    assert decide(seen, limits).parameters[0].upper == pytest.approx(
        3 * find_grade("consumer-mems").gyroscope.bias
    )


@pytest.mark.parametrize("share", ["1", "3 %"])
def test_a_share_of_nothing_is_not_compared(document: Calibration, tmp_path: Path, share: str) -> None:
    limits = read_limits(file_of(tmp_path, f"limits:\n  gyro bias: {share}\n"))
    seen = with_limits(with_parameters(document, ("gyro bias x", 0.1, 0.0, "rad/s")), limits)
    assert seen.limits is not None
    assert seen.limits.decision == "undecided"
    assert "in another kind of unit" in seen.limits.reasons[0]


def test_the_verdict_is_left_as_it_is(document: Calibration, tmp_path: Path) -> None:
    limits = read_limits(file_of(tmp_path, "limits:\n  gyro bias: 1 deg/s\n"))
    seen = with_limits(with_parameters(document, ("gyro bias x", 5.0, 0.0, "rad/s")), limits)
    assert seen.limits is not None
    assert seen.limits.decision == "failed"
    assert seen.verdict == document.verdict
    assert seen.identity == document.identity


# --- the file's sentences


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("rule: strict\nlimits: {gyro bias: 1 deg/s}", "none of simple, guarded, risk"),
        ("limits: {gyro bais: 1 deg/s}", "'gyro bais' is no parameter"),
        ("limits: {gyro bias: fast}", "'fast' is no number with a unit"),
        ("limits: {gyro bias: 1 parsec}", "'parsec' is no unit"),
        ("limits: {gyro bias: -1 deg/s}", "leaves nothing within"),
        ("limits: {gyro bias: {from: 2 deg/s, to: 1 deg/s}}", "leaves nothing between"),
        ("limits: {gyro bias: {from: 2 deg/s, to: 1 mg}}", "not of one kind"),
        ("limits: {gyro bias: {within: 1 deg/s, to: 2 deg/s}}", "leave one of them out"),
        ("limits: {gyro bias: {nominal: 1 deg/s}}", "needs `within`"),
        ("limits: {gyro bias: {data sheet: best}}", "gyro bias: "),
        (
            "limits: {lag of the accelerometer behind the gyro: {data sheet: hg1700}}",
            "data sheet says nothing",
        ),
        ("limits: []", "no parameter or group"),
        ("- 1", "holds no limits"),
        ("limit: {}", "no entry of limits"),
        ("risk: 1 %\nlimits: {gyro bias: 1 deg/s}", "goes with `rule: risk`"),
        ("rule: risk\nlimits: {gyro bias: 1 deg/s}", "needs `risk:` with a probability"),
        ("rule: risk\nrisk: 80 %\nlimits: {gyro bias: 1 deg/s}", "no share between"),
        ("limits: {gyro bias: [1", "it is no YAML"),
    ],
)
def test_what_is_wrong_is_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(UsageError, match=r"^[^\n]+\.$") as caught:
        read_limits(file_of(tmp_path, text))
    assert said in str(caught.value)


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="There is no file of limits"):
        read_limits(tmp_path / "none.yaml")


def test_a_reason_speaks_in_the_unit_that_people_say(document: Calibration, tmp_path: Path) -> None:
    limits = read_limits(
        file_of(tmp_path, "limits:\n  gyro bias: 0.01 rad/s\n  gyro g-sensitivity: 0.1 deg/s/g\n")
    )
    rows = (
        ("gyro bias x", 0.02, 1e-5, "rad/s"),
        ("g-sensitivity of gyro x to force y", 1.0, 1e-3, "rad/s/(m/s²)"),
    )
    seen = decide(with_parameters(document, *rows), limits)
    assert "Gyro bias x of 1.14592 ± 0.00057 °/s is outside -0.573 to 0.573 °/s." in seen.reasons
    assert len(seen.parameters) == 2

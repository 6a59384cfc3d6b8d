"""Acceptance limits: the decision rules against closed forms, the file's sentences, and documents held against it."""

import math

import numpy as np
import pytest
from tests.unit.written import parameters, written

from tumble.errors import UsageError
from tumble.limits import read_limits, with_limits
from tumble.limits.conformity import conformance_probability, decision, overall
from tumble.simulation import find_grade

Row = tuple[str, float, float, str]


def limits_of(folder, text):
    path = folder / "limits.yaml"
    path.write_text(text, encoding="utf-8")
    return read_limits(path)


def held(folder, limits, *rows):
    """A document of these parameters held against limits."""
    return with_limits(written(parameters=parameters(*rows)), limits_of(folder, f"limits:\n  {limits}\n"))


def test_the_probability_is_what_drawing_shows():
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
def test_a_rule_decides(rule, value, sigma, found):
    assert decision(rule, value, sigma, -1.0, 1.0, 0.05) == found  # pyright: ignore[reportArgumentType]


def test_one_failure_fails_and_nothing_at_all_passes_nothing():
    assert overall(["passed", "undecided", "failed"]) == "failed"
    assert overall(["passed", "undecided"]) == "undecided"
    assert overall([]) == "undecided"


BIAS, RATE = "accelerometer bias", "gyro bias"
SHEET = 3.0 * find_grade("consumer-mems").gyroscope.bias  # a data sheet gives three of its sigmas


@pytest.mark.parametrize(
    ("limits", "rows", "found", "bounds"),
    [
        (f"{BIAS}: 50 mg", [(f"{BIAS} x", 0.49, 1e-3, "m/s^2")], ["passed"], (-0.4903325, 0.4903325)),
        (f"{BIAS}: 50 mg", [(f"{BIAS} y", -0.0501, 1e-4, "g")], ["failed"], (-0.05, 0.05)),
        (
            f"{RATE} y: {{from: -1 deg/s, to: 2 deg/s}}",
            [(f"{RATE} y", 0.03, 1e-4, "rad/s"), (f"{RATE} z", 9.0, 1e-4, "rad/s")],
            ["passed"],
            (math.radians(-1.0), math.radians(2.0)),
        ),
        (
            "accelerometer scale factor: {nominal: 1670 counts/(m/s²), within: 3 %}",
            [("accelerometer scale factor x", 1700.0, 0.5, "counts/(m/s²)")],
            ["passed"],
            (1619.9, 1720.1),
        ),
        (
            f"{RATE}: {{data sheet: consumer-mems}}",
            [(f"{RATE} x", 0.0, 0.0, "rad/s")],
            ["passed"],
            (-SHEET, SHEET),
        ),
        # a parameter's own limit goes before its group's
        (
            f"{RATE}: 1 deg/s\n  {RATE} z: 5 deg/s",
            [(f"{RATE} z", math.radians(3.0), 0.0, "rad/s"), (f"{RATE} x", math.radians(3.0), 0.0, "rad/s")],
            ["passed", "failed"],
            (math.radians(-5.0), math.radians(5.0)),
        ),
    ],
)
def test_limits_in_other_units_are_the_same_limits(tmp_path, limits, rows, found, bounds):
    block = held(tmp_path, limits, *rows).limits
    assert [one.decision for one in block.parameters] == found
    assert (block.parameters[0].lower, block.parameters[0].upper) == pytest.approx(bounds)


@pytest.mark.parametrize(
    ("limits", "row", "said"),
    [
        (
            f"{BIAS}: 50 mg\n  {RATE}: 1 deg/s",
            (f"{BIAS} x", 0.01, 1e-3, "m/s^2"),
            "has no gyro bias: nothing was",
        ),
        (f"{BIAS}: 50 mg", (f"{BIAS} x", 12.0, 1.0, "counts"), "in another kind of unit"),
        (f"{RATE}: 1", (f"{RATE} x", 0.1, 0.0, "rad/s"), "in another kind of unit"),
        (f"{RATE}: 3 %", (f"{RATE} x", 0.1, 0.0, "rad/s"), "in another kind of unit"),
        (
            f"{RATE}: {{within: 1 deg/s, largest uncertainty: 0.01 deg/s}}",
            (f"{RATE} x", 0.0, math.radians(0.006), "rad/s"),
            "known worse",
        ),
    ],
)
def test_what_is_not_there_not_comparable_or_known_worse_is_undecided(tmp_path, limits, row, said):
    block = held(tmp_path, limits, row).limits
    assert block.decision == "undecided"
    assert said in block.reasons[0]


def test_a_reason_speaks_in_the_unit_that_people_say_and_the_verdict_is_left_as_it_is(tmp_path):
    rows = (
        (f"{RATE} x", 0.02, 1e-5, "rad/s"),
        ("g-sensitivity of gyro x to force y", 1.0, 1e-3, "rad/s/(m/s²)"),
    )
    seen = held(tmp_path, f"{RATE}: 0.01 rad/s\n  gyro g-sensitivity: 0.1 deg/s/g", *rows)
    assert seen.limits.decision == "failed"
    assert "Gyro bias x of 1.14592 ± 0.00057 °/s is outside -0.573 to 0.573 °/s." in seen.limits.reasons
    assert len(seen.limits.parameters) == 2
    before = written(parameters=parameters(*rows))
    assert (seen.verdict, seen.identity) == (before.verdict, before.identity)


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
def test_what_is_wrong_is_one_sentence(tmp_path, text, said):
    with pytest.raises(UsageError, match=r"^[^\n]+\.$") as caught:
        limits_of(tmp_path, text)
    assert said in str(caught.value)
    with pytest.raises(UsageError, match="There is no file of limits"):
        read_limits(tmp_path / "none.yaml")

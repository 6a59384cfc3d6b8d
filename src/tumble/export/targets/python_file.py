"""A Python 3 file that corrects, with ``math`` alone."""

from __future__ import annotations

from tumble.export.magnetometer import field_lines
from tumble.export.source_code import FORMULA, HOLDS, sensitivity, tests_of, triad_numbers
from tumble.export.subject import Subject
from tumble.export.target import Target
from tumble.export.words import commented, head

_PYTHON_BODY = '''

def correct(raw_force, raw_rate):
    """Return specific force (m/s^2) and angular rate (rad/s), lists of 3, of raw ones (RAW_FORCE, RAW_RATE)."""
    force = _triad(FORCE, raw_force)
    without = [w - sum(g * f for g, f in zip(row, force)) for w, row in zip(raw_rate, G_SENSITIVITY)]
    return force, _triad(RATE, without)


def _triad(numbers, raw):
    own_input = []
    for value, bias, asymmetry, quadratic in zip(raw, numbers["bias"], numbers["asymmetry"], numbers["quadratic"]):
        output = value - bias
        slope = 1.0 + (asymmetry if output > 0.0 else -asymmetry if output < 0.0 else 0.0)
        if quadratic == 0.0:
            own_input.append(output / slope)
        else:
            root = math.sqrt(max(slope * slope + 4.0 * quadratic * output, 0.0))
            own_input.append(2.0 * output / (slope + root))
    return [sum(m * u for m, u in zip(row, own_input)) for row in numbers["inverse"]]


def self_test():
    """Return the largest relative difference from the test vectors: at most about 1e-12."""
    worst = 0.0
    for raw_force, raw_rate, *expected in TESTS:
        for got, wanted in zip(correct(raw_force, raw_rate), expected):
            worst = max(worst, *(abs(g - w) / (1.0 + abs(w)) for g, w in zip(got, wanted)))
    return worst


if __name__ == "__main__":
    print(f"largest relative difference from the test vectors: {self_test():.1e}")
'''


_FIELD_BODY = '''

def correct_field(raw):
    """Return the corrected magnetic field, a list of 3, of a raw one."""
    away = [value - offset for value, offset in zip(raw, HARD_IRON)]
    return [sum(s * a for s, a in zip(row, away)) for row in SOFT_IRON]


def field_self_test():
    """Return the largest relative difference of the field's test vectors: at most about 1e-12."""
    worst = 0.0
    for raw, wanted in FIELD_TESTS:
        size = math.sqrt(sum(w * w for w in wanted))
        worst = max(worst, *(abs(g - w) / size for g, w in zip(correct_field(raw), wanted)))
    return worst
'''


def _field_text(subject: Subject) -> str:
    """What corrects a magnetometer; empty without one."""
    field = subject.magnetometer
    if field is None:
        return ""
    told = commented(field_lines(field, "x = SOFT_IRON (u - HARD_IRON)"))
    tests = [[raw.tolist(), true.tolist()] for raw, true in zip(*field.vectors(), strict=True)]
    numbers = f"SOFT_IRON = {field.soft_iron.tolist()!r}\nHARD_IRON = {field.hard_iron.tolist()!r}\n"
    return f"{told}{numbers}FIELD_TESTS = {tests!r}\n{_FIELD_BODY}"


def write(subject: Subject) -> dict[str, str]:
    """Return a Python 3 module that imports ``math`` alone."""
    lines = [commented(head(subject, TARGET.title, FORMULA)), "import math\n\n"]
    for name, triad in (("FORCE", subject.accelerometer), ("RATE", subject.gyroscope)):
        lines.append(f"{name} = {{\n")
        lines += [f"    {key!r}: {value.tolist()!r},\n" for key, value in triad_numbers(triad).items()]
        lines.append("}\n")
    lines.append(
        f"G_SENSITIVITY = {sensitivity(subject).tolist()!r}\n# raw force, raw rate, force, rate\nTESTS = [\n"
    )
    lines += [f"    {[v.tolist() for v in four]!r},\n" for four in tests_of(subject)]
    lines.append("]\n")
    lines.append(_field_text(subject))
    body = _PYTHON_BODY.replace("RAW_FORCE", subject.units[0]).replace("RAW_RATE", subject.units[1])
    return {"tumble_calibration.py": "".join(lines) + body}


TARGET = Target("python", "Python without numpy", HOLDS, "tumble_calibration.py", write, units=None)

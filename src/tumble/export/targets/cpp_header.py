"""A C++17 header that corrects: one class of static functions."""

from __future__ import annotations

import numpy as np

from tumble.export.magnetometer import FieldCorrection, field_lines
from tumble.export.source_code import FORMULA, HOLDS, sensitivity, tests_of, triad_numbers
from tumble.export.subject import Subject
from tumble.export.target import Target
from tumble.export.words import commented, head, number

_CPP_BODY = """
    using Vector = std::array<double, 3>;
    using Matrix = std::array<Vector, 3>;

    /// Corrected specific force (m/s^2) of a raw one (RAW_FORCE).
    static Vector force(const Vector& raw)
    {
        return triad(force_inverse, force_bias, force_asymmetry, force_quadratic, raw);
    }

    /// Corrected angular rate (rad/s) of a raw one (RAW_RATE) and the corrected specific force.
    static Vector rate(const Vector& raw, const Vector& corrected_force)
    {
        Vector without = raw;
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 3; ++j) without[i] -= g_sensitivity[i][j] * corrected_force[j];
        return triad(rate_inverse, rate_bias, rate_asymmetry, rate_quadratic, without);
    }

    /// Largest relative difference from the test vectors: at most about 1e-12 if this file is compiled right.
    static double self_test()
    {
        double worst = 0.0;
        for (const auto& test : tests) {
            const Vector f = force(test[0]);
            const Vector w = rate(test[1], f);
            for (std::size_t i = 0; i < 3; ++i) {
                worst = std::fmax(worst, std::fabs(f[i] - test[2][i]) / (1.0 + std::fabs(test[2][i])));
                worst = std::fmax(worst, std::fabs(w[i] - test[3][i]) / (1.0 + std::fabs(test[3][i])));
            }
        }
        return worst;
    }

private:
    static Vector triad(const Matrix& inverse, const Vector& bias, const Vector& asymmetry, const Vector& quadratic,
                        const Vector& raw)
    {
        Vector u{}, corrected{};
        for (std::size_t i = 0; i < 3; ++i) {
            const double output = raw[i] - bias[i];
            const double slope = 1.0 + (output > 0.0 ? asymmetry[i] : output < 0.0 ? -asymmetry[i] : 0.0);
            const double square = slope * slope + 4.0 * quadratic[i] * output;
            u[i] = quadratic[i] == 0.0 ? output / slope
                                       : 2.0 * output / (slope + (square > 0.0 ? std::sqrt(square) : 0.0));
        }
        for (std::size_t i = 0; i < 3; ++i)
            corrected[i] = inverse[i][0] * u[0] + inverse[i][1] * u[1] + inverse[i][2] * u[2];
        return corrected;
    }

"""


def _cpp(values: object) -> str:
    array = np.asarray(values, dtype=float)
    if array.ndim == 1:
        return "{" + ", ".join(number(v) for v in array) + "}"
    # Aggregates of std::array want a second pair of braces.
    return "{{" + ", ".join(_cpp(line) for line in array) + "}}"


_CPP_FIELD = """
public:
    /// Corrected magnetic field of a raw one.
    static Vector field(const Vector& raw)
    {
        Vector corrected{};
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 3; ++j) corrected[i] += soft_iron[i][j] * (raw[j] - hard_iron[j]);
        return corrected;
    }

    /// Largest difference from the field's test vectors, as a share of the field: at most about 1e-12.
    static double field_self_test()
    {
        double worst = 0.0;
        for (const auto& test : field_tests) {
            const Vector f = field(test[0]);
            const double size = std::sqrt(test[1][0] * test[1][0] + test[1][1] * test[1][1] + test[1][2] * test[1][2]);
            for (std::size_t i = 0; i < 3; ++i) worst = std::fmax(worst, std::fabs(f[i] - test[1][i]) / size);
        }
        return worst;
    }

private:
"""


def _field_text(subject: Subject) -> str:
    """What corrects a magnetometer; empty without one."""
    made = subject.magnetometer
    if made is None:
        return ""
    told = "".join(f"    {line}\n" for line in _told(made))
    tests = ", ".join(
        "{{" + _cpp(raw) + ", " + _cpp(true) + "}}" for raw, true in zip(*made.vectors(), strict=True)
    )
    return (
        f"{_CPP_FIELD}{told}"
        f"    static constexpr Matrix soft_iron = {_cpp(made.soft_iron)};\n"
        f"    static constexpr Vector hard_iron = {_cpp(made.hard_iron)};\n"
        f"    static constexpr std::array<std::array<Vector, 2>, 3> field_tests = {{{{{tests}}}}};\n"
    )


def _told(made: FieldCorrection) -> list[str]:
    return commented(field_lines(made, "x = soft_iron (u - hard_iron)"), "//").splitlines()


def write(subject: Subject) -> dict[str, str]:
    """Return a C++17 header with one class of static functions."""
    text = commented(head(subject, TARGET.title, FORMULA), "//")
    text += "#pragma once\n\n#include <array>\n#include <cmath>\n#include <cstddef>\n\n"
    text += "class TumbleCalibration {\npublic:"
    text += _CPP_BODY.replace("RAW_FORCE", subject.units[0]).replace("RAW_RATE", subject.units[1])
    for name, triad in (("force", subject.accelerometer), ("rate", subject.gyroscope)):
        for key, value in triad_numbers(triad).items():
            kind = "Matrix" if key == "inverse" else "Vector"
            text += f"    static constexpr {kind} {name}_{key} = {_cpp(value)};\n"
    text += _field_text(subject)
    text += f"    static constexpr Matrix g_sensitivity = {_cpp(sensitivity(subject))};\n"
    tests = ", ".join("{{" + ", ".join(_cpp(v) for v in four) + "}}" for four in tests_of(subject))
    text += f"    static constexpr std::array<std::array<Vector, 4>, 3> tests = {{{{{tests}}}}};\n"
    return {"tumble_calibration.hpp": text + "};\n"}


TARGET = Target(
    "cpp", "C++ header-only class", HOLDS, "tumble_calibration.hpp", write, units=None, comment="//"
)

"""A C header that corrects: C99, double precision, no allocation, ``math.h`` alone."""

from __future__ import annotations

from tumble.export.magnetometer import field_lines
from tumble.export.source_code import FORMULA, HOLDS, braces, sensitivity, tests_of, triad_numbers
from tumble.export.subject import Subject
from tumble.export.target import Target
from tumble.export.words import commented, head

_C_BODY = """
/* One triad: raw less what other sensors add, to corrected. */
static inline void tumble_triad(const double inverse[3][3], const double bias[3], const double asymmetry[3],
                                const double quadratic[3], const double raw[3], double corrected[3])
{
    double u[3];
    int i;
    for (i = 0; i < 3; ++i) {
        const double output = raw[i] - bias[i];
        const double slope = 1.0 + (output > 0.0 ? asymmetry[i] : output < 0.0 ? -asymmetry[i] : 0.0);
        const double square = slope * slope + 4.0 * quadratic[i] * output;
        u[i] = quadratic[i] == 0.0 ? output / slope : 2.0 * output / (slope + (square > 0.0 ? sqrt(square) : 0.0));
    }
    for (i = 0; i < 3; ++i)
        corrected[i] = inverse[i][0] * u[0] + inverse[i][1] * u[1] + inverse[i][2] * u[2];
}

/* Specific force: raw_force in RAW_FORCE to force in m/s^2. */
static inline void tumble_correct_force(const double raw_force[3], double force[3])
{
    tumble_triad(TUMBLE_FORCE_INVERSE, TUMBLE_FORCE_BIAS, TUMBLE_FORCE_ASYMMETRY, TUMBLE_FORCE_QUADRATIC,
                 raw_force, force);
}

/* Angular rate: raw_rate in RAW_RATE and the corrected force to rate in rad/s. */
static inline void tumble_correct_rate(const double raw_rate[3], const double force[3], double rate[3])
{
    double without_force[3];
    int i;
    for (i = 0; i < 3; ++i)
        without_force[i] = raw_rate[i] - TUMBLE_G_SENSITIVITY[i][0] * force[0]
                           - TUMBLE_G_SENSITIVITY[i][1] * force[1] - TUMBLE_G_SENSITIVITY[i][2] * force[2];
    tumble_triad(TUMBLE_RATE_INVERSE, TUMBLE_RATE_BIAS, TUMBLE_RATE_ASYMMETRY, TUMBLE_RATE_QUADRATIC,
                 without_force, rate);
}

/* Largest relative difference from the test vectors: at most about 1e-12 if this file is compiled right. */
static inline double tumble_self_test(void)
{
    double worst = 0.0, force[3], rate[3];
    int k, i;
    for (k = 0; k < 3; ++k) {
        tumble_correct_force(TUMBLE_TEST[k][0], force);
        tumble_correct_rate(TUMBLE_TEST[k][1], force, rate);
        for (i = 0; i < 3; ++i) {
            const double a = fabs(force[i] - TUMBLE_TEST[k][2][i]) / (1.0 + fabs(TUMBLE_TEST[k][2][i]));
            const double b = fabs(rate[i] - TUMBLE_TEST[k][3][i]) / (1.0 + fabs(TUMBLE_TEST[k][3][i]));
            if (a > worst) worst = a;
            if (b > worst) worst = b;
        }
    }
    return worst;
}
"""


_C_FIELD = """
/* Magnetic field: raw to corrected, in the units above. */
static inline void tumble_correct_field(const double raw[3], double field[3])
{
    int i;
    for (i = 0; i < 3; ++i)
        field[i] = TUMBLE_SOFT_IRON[i][0] * (raw[0] - TUMBLE_HARD_IRON[0])
                   + TUMBLE_SOFT_IRON[i][1] * (raw[1] - TUMBLE_HARD_IRON[1])
                   + TUMBLE_SOFT_IRON[i][2] * (raw[2] - TUMBLE_HARD_IRON[2]);
}

/* Largest difference from the field's test vectors, as a share of the field: at most about 1e-12. */
static inline double tumble_field_self_test(void)
{
    double worst = 0.0, field[3];
    int k, i;
    for (k = 0; k < 3; ++k) {
        const double *wanted = TUMBLE_FIELD_TEST[k][1];
        const double size = sqrt(wanted[0] * wanted[0] + wanted[1] * wanted[1] + wanted[2] * wanted[2]);
        tumble_correct_field(TUMBLE_FIELD_TEST[k][0], field);
        for (i = 0; i < 3; ++i) {
            const double off = fabs(field[i] - wanted[i]) / size;
            if (off > worst) worst = off;
        }
    }
    return worst;
}
"""


def _field_lines(subject: Subject) -> list[str]:
    """What corrects a magnetometer; nothing without one."""
    field = subject.magnetometer
    if field is None:
        return []
    told = commented(field_lines(field, "x = TUMBLE_SOFT_IRON (u - TUMBLE_HARD_IRON)"), TARGET.comment)
    tests = ",\n    ".join(
        "{" + braces(raw) + ", " + braces(true) + "}" for raw, true in zip(*field.vectors(), strict=True)
    )
    return [
        f"/*\n{told} */",
        f"static const double TUMBLE_SOFT_IRON[3][3] =\n    {braces(field.soft_iron)};",
        f"static const double TUMBLE_HARD_IRON[3] =\n    {braces(field.hard_iron)};",
        f"static const double TUMBLE_FIELD_TEST[3][2][3] = {{\n    {tests}}};",
        _C_FIELD,
    ]


def write(subject: Subject) -> dict[str, str]:
    """Return the header."""
    lines = ["/*\n" + commented(head(subject, TARGET.title, FORMULA), TARGET.comment) + " */"]
    lines += ["#ifndef TUMBLE_CALIBRATION_H", "#define TUMBLE_CALIBRATION_H", "#include <math.h>", ""]
    for name, triad in (("FORCE", subject.accelerometer), ("RATE", subject.gyroscope)):
        for key, value in triad_numbers(triad).items():
            size = "[3][3]" if key == "inverse" else "[3]"
            lines.append(f"static const double TUMBLE_{name}_{key.upper()}{size} =\n    {braces(value)};")
    lines.append(f"static const double TUMBLE_G_SENSITIVITY[3][3] =\n    {braces(sensitivity(subject))};")
    tests = ",\n    ".join("{" + ", ".join(braces(v) for v in four) + "}" for four in tests_of(subject))
    lines.append("/* raw force, raw rate, force, rate */")
    lines.append(f"static const double TUMBLE_TEST[3][4][3] = {{\n    {tests}}};")
    lines += _field_lines(subject)
    body = _C_BODY.replace("RAW_FORCE", subject.units[0]).replace("RAW_RATE", subject.units[1])
    return {"tumble_calibration.h": "\n".join(lines) + "\n" + body + "\n#endif\n"}


TARGET = Target("c", "C header", HOLDS, "tumble_calibration.h", write, units=None, comment=" *")

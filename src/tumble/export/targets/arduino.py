"""A header for Arduino and other boards without double precision: ``float``, nothing included, no allocation.

``true = M (u - b)`` of each triad, the gyros' input less ``G f`` with the corrected specific force f.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import AnyArray
from tumble.export.source_code import sensitivity
from tumble.export.subject import Subject
from tumble.export.target import BIAS, G_SENSITIVITY, MATRIX, SCALE, Target
from tumble.export.words import commented, head
from tumble.sensor.gauge import inverse

FORMULA = (
    "force = FORCE_MATRIX * (u - FORCE_BIAS); rate = RATE_MATRIX * (u - G_SENSITIVITY * force - RATE_BIAS)",
    "single precision: seven digits, which is finer than sixteen bits of a converter",
)
_BODY = """
/* raw_force in RAW_FORCE, raw_rate in RAW_RATE; force in m/s^2, rate in rad/s. Raw and corrected may be one. */
static inline void tumble_correct(const float raw_force[3], const float raw_rate[3], float force[3], float rate[3])
{
  float u[3], w[3], f[3];
  for (int i = 0; i < 3; ++i)
    u[i] = raw_force[i] - TUMBLE_FORCE_BIAS[i];
  for (int i = 0; i < 3; ++i)
    f[i] = TUMBLE_FORCE_MATRIX[i][0] * u[0] + TUMBLE_FORCE_MATRIX[i][1] * u[1] + TUMBLE_FORCE_MATRIX[i][2] * u[2];
  for (int i = 0; i < 3; ++i)
    w[i] = raw_rate[i] - TUMBLE_RATE_BIAS[i] - TUMBLE_G_SENSITIVITY[i][0] * f[0] - TUMBLE_G_SENSITIVITY[i][1] * f[1]
           - TUMBLE_G_SENSITIVITY[i][2] * f[2];
  for (int i = 0; i < 3; ++i) {
    force[i] = f[i];
    rate[i] = TUMBLE_RATE_MATRIX[i][0] * w[0] + TUMBLE_RATE_MATRIX[i][1] * w[1] + TUMBLE_RATE_MATRIX[i][2] * w[2];
  }
}
"""


def _float(value: float) -> str:
    text = f"{float(np.float32(value)) + 0.0:.9g}"
    return (text if "." in text or "e" in text else text + ".0") + "f"


def _braces(values: AnyArray) -> str:
    if values.ndim == 1:
        return "{" + ", ".join(_float(v) for v in values) + "}"
    return "{" + ",\n   ".join(_braces(line) for line in values) + "}"


def write(subject: Subject) -> dict[str, str]:
    """Return the header."""
    lines = [
        "/*\n" + commented(head(subject, TARGET.title, FORMULA), TARGET.comment) + " */",
        "#pragma once",
        "",
    ]
    for name, triad in (("FORCE", subject.accelerometer), ("RATE", subject.gyroscope)):
        lines.append(f"static const float TUMBLE_{name}_MATRIX[3][3] =\n  {_braces(inverse(triad.matrix))};")
        lines.append(f"static const float TUMBLE_{name}_BIAS[3] = {_braces(triad.bias)};")
    lines.append(f"static const float TUMBLE_G_SENSITIVITY[3][3] =\n  {_braces(sensitivity(subject))};")
    body = _BODY.replace("RAW_FORCE", subject.units[0]).replace("RAW_RATE", subject.units[1])
    return {"tumble_arduino.h": "\n".join(lines) + "\n" + body}


TARGET = Target(
    "arduino",
    "Arduino header (float)",
    frozenset({MATRIX, SCALE, BIAS, G_SENSITIVITY}),
    "tumble_arduino.h",
    write,
    units=None,
    comment=" *",
)

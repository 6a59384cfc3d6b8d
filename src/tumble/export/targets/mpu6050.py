"""MPU-6000 and MPU-6050: the chip's own offset registers, which it adds to what it measures.

By InvenSense's application note *MPU Hardware Offset Registers* 1.0 (2014), as public drivers cite it; untried:
accelerometers (0x06 to 0x0B) in the scale of ±8 g, 4096 LSB/g, gyros (0x13 to 0x18) in that of ±1000 °/s,
32.8 LSB/(°/s), whichever range the outputs have. The accelerometers' registers begin with the factory's trim, so
that a number is to be added to what stands there; bit 0 of each belongs to the temperature compensation and stays. The
gyros' begin with zero, after each switching on.

Output = input + register: a bias b is taken out by adding -b. Nothing but biases has a register.
"""

from __future__ import annotations

import numpy as np

from tumble.arrays import Vector
from tumble.errors import UsageError
from tumble.export import losses
from tumble.export.losses import Loss
from tumble.export.subject import Subject, with_losses
from tumble.export.target import BIAS, Target
from tumble.export.words import commented, head, row
from tumble.sensor import ImuModel, Triad
from tumble.units import STANDARD_GRAVITY

PER_G, PER_DEG_S = 4096.0, 32.8
_LARGEST = 32767
# What the outputs are taken to be without scale factors, from SI.
_G, _DEGREES = np.eye(3) / STANDARD_GRAVITY, np.eye(3) * 180.0 / np.pi
FORMULA = (
    "accelerometers (0x06, 0x08, 0x0A), 4096 LSB/g: new = what stands there + ACCEL_ADD, bit 0 as it was",
    "gyros (0x13, 0x15, 0x17), 32.8 LSB/(deg/s): new = what stood there while recording (0 at power-on) + GYRO_ADD",
    "the output is the input plus the register, in any range; not for MPU-6500 and 9250, whose registers differ",
)
_BODY = """
/* What is to be written to one of the accelerometers' registers, from what was read there. */
static inline int16_t mpu6050_accel_register(int16_t there, int axis)
{
  return (int16_t)(((there + MPU6050_ACCEL_ADD[axis]) & ~1) | (there & 1));
}
"""


def _counts(bias: Vector, scale: float, name: str) -> Vector:
    """Return what is added, in counts of the register."""
    made = np.round(-scale * bias)
    if np.abs(made).max() > _LARGEST:
        raise UsageError(
            f"The {name}' bias of {np.abs(bias).max():.3g} does not fit into the MPU-6050's registers of 16 bits. See "
            "whether the calibration is in the units that it states."
        )
    return made


def write(subject: Subject) -> dict[str, str]:
    """Return the numbers as a C header.

    Raises
    ------
    UsageError
        If more is lost than the wishes allow, or a register cannot hold a bias.
    """
    accelerometer, gyroscope = subject.accelerometer, subject.gyroscope
    lost = losses.of_matrix(accelerometer, _G, "accelerometers", "scale factors and misalignments")
    lost += losses.of_matrix(gyroscope, _DEGREES, "gyros", "scale factors and misalignments")
    lost.append(
        Loss(
            "biases are rounded to the registers: by up to 370 µg, for bit 0 stays as it is, and 0.015 deg/s"
        )
    )
    kept = ImuModel(Triad(_G, accelerometer.bias), Triad(_DEGREES, gyroscope.bias))
    reduced = with_losses(subject, kept, lost, TARGET.title)
    force = _counts(accelerometer.bias, PER_G, "accelerometers")
    rate = _counts(gyroscope.bias, PER_DEG_S, "gyros")
    vectors = [f"example: at a bias of {row(accelerometer.bias)} g and {row(gyroscope.bias)} deg/s"]
    lines = [
        "/*\n" + commented(head(reduced, TARGET.title, FORMULA, vectors), TARGET.comment) + " */",
        "#pragma once",
        "#include <stdint.h>",
        "",
        f"static const int16_t MPU6050_ACCEL_ADD[3] = {{{', '.join(f'{v:.0f}' for v in force + 0.0)}}};",
        f"static const int16_t MPU6050_GYRO_ADD[3] = {{{', '.join(f'{v:.0f}' for v in rate + 0.0)}}};",
    ]
    return {"mpu6050_offsets.h": "\n".join(lines) + "\n" + _BODY}


TARGET = Target(
    "mpu6050",
    "MPU-6050 offset registers",
    frozenset({BIAS}),
    "mpu6050_offsets.h",
    write,
    units=("g", "deg/s"),
    comment=" *",
)

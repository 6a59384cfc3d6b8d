"""The one error model of an IMU: two triads, and other tools' conventions for the same numbers.

``raw = u + asymmetry * |u| + quadratic * u**2 + G @ specific_force_b + bias`` with
``u = matrix @ true``: `matrix` maps the true vector in body frame b (SI) to each sensor's own input
in raw units. What is called scale, non-orthogonality and misalignment are ways to split `matrix`.
"""

from tumble.sensor.gauge import FRAMES, change_frame, frame_rotation, polar_rotation
from tumble.sensor.imu import ImuModel, Triad
from tumble.sensor.propagation import propagate

__all__ = ["FRAMES", "ImuModel", "Triad", "change_frame", "frame_rotation", "polar_rotation", "propagate"]

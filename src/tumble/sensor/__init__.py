"""The one error model of an IMU: two triads, and other tools' conventions for the same numbers.

``raw = u + asymmetry * |u| + quadratic * u**2 + G @ specific_force_b + bias`` with
``u = matrix @ true``: `matrix` maps the true vector in body frame b (SI) to each sensor's own input
in raw units. What is called scale, non-orthogonality and misalignment are ways to split `matrix`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

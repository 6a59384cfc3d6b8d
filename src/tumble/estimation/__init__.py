"""Adjustment of condition equations: Gauss-Helmert, variance components, reliability.

This room knows no IMU.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Rotations and the integration of angular rate to attitude.

``C_ab`` turns the components of a vector from frame b to frame a: ``v_a = C_ab @ v_b``. Quaternions
have the scalar last, as in scipy. A rotation vector ``phi`` stands for ``exp(skew(phi))``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

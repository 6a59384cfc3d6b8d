"""Acceptance limits: what a unit may be off by, and whether a calibration shows that it is within.

A calibration that can be trusted may be of a unit that nobody wants, and the other way round: the verdict says the
one, limits the other. `read_limits` reads ``limits.yaml``, `decide` holds a calibration against it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

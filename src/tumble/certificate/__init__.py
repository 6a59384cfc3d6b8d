"""Certificates of a calibration: a PDF for people, and PTB's digital calibration certificate for machines.

Both carry the ``calibration.json`` that they are of, whole, so that every number in them can be compared with it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

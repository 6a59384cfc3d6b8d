"""Protocols: what is done to a unit in a test, step by step, as data that a file can hold.

The room is low in the house: simulation plays a protocol, segmentation matches a recording with it,
calibration interprets it, and none of them knows the others.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

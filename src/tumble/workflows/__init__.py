"""What a user asks for, end to end: inspect, calibrate, apply, verify, demonstrate; one module each."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The document of a calibration: read, written, applied, compared, combined and converted.

calibration.json says what it is, in which convention, with its formula, covariance and test vectors. Nothing in
this room estimates anything: an estimate comes in by `composition`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

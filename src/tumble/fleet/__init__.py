"""Statistics of many units: what is common to them, which of them stand out, and how one of them changes.

It takes vectors of parameters with their covariances, as `unit_vector` makes them of calibrations, and knows no files.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

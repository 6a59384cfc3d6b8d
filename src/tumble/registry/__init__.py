"""A registry of units and their calibrations: one SQLite file, or a PostgreSQL database.

Every calibration is kept whole, as the document that it came as, with columns beside it to find it by and its
parameters as numbers, so that questions over all units need not read documents. Documents are added, never changed.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

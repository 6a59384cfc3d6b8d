"""What a calibration looks like to its user: the terminal's table and the HTML report.

Nothing is estimated here. Non-SI units appear: this room writes numbers in the units people use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

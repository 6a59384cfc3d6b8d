"""What a user asks for, end to end: inspect, calibrate, apply, verify, demonstrate; one module each.

A workflow is imported from its module (``from tumble.workflows.calibrate import calibrate``): the package
itself offers no names, because they would be those of its modules.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

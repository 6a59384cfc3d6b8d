"""From a recording and what is believed of it to the sensor model: one adjustment, and procedures as records.

`calibrate` estimates, `Session` is what is given, `find_procedure` tells what a protocol is made for.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

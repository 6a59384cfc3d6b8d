"""What a test will tell, before anything is recorded: of any protocol, and which poses tell most.

It stands above `calibration`, whose refusals in words it shares, and draws nothing.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

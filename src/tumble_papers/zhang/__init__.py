"""Zhang et al. (2010): turntable calibration, inter-triad misalignment, the best poses."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Hayal (2010): multi-position calibration by Gauss-Helmert adjustment, laboratory tests, a field campaign."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The Earth as an IMU sees it: its figure, gravity, and its rotation at a site."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

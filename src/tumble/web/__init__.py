"""The page of a guided capture: a server for browsers on this machine, and what they show."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Tables and figures that are made anew: what an item is, and what it hands over. The items are `tumble_papers`'."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

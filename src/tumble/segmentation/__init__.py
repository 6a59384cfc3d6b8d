"""Holds and turns: where the unit was at rest, where it moved, and what each hold tells.

`find_timeline` finds them, `observe_holds` averages them; `read_intervals` reads a user's own list.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

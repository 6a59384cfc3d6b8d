"""Guided capture: samples come in while the unit is in the hand, and it is said what is good and what is next.

`Capture` is the state machine, fed with blocks of samples; it knows no terminal and no page. `run_capture` joins a
source, the files in a folder, and whoever listens.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

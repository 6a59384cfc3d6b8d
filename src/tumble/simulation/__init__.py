"""Recordings of which the truth is known: motion, sensor errors, noise.

`Motion` says what is done to the unit, a `Grade` says what kind of unit it
is, and `simulate_recording` plays it; `simulate_protocol` plays a protocol with its placement errors. Every
random number comes from the generator that is passed in.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Noise of a sensor at rest: how it averages down, its spectrum, and models of it.

Signals are in any unit, usually SI; averaging times in s, frequencies in Hz. Coefficients carry the
letters of IEEE Std 952, whose spectral densities are two-sided; what is drawn and printed as a spectrum is
one-sided, and says so.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

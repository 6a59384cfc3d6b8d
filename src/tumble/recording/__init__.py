"""Recordings of an IMU: reading them from any layout, and judging what they are good for.

`read_recording` reads one file or a pair of files, `read_blocks` a recording of any length in bounded
memory. Signals stay raw; what was found, assumed, mended or left unchecked stands in the recording's
remarks. `inspect_recording` is the doctor. `axis_agreement` compares the gyro with the way gravity
turns in body axes.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

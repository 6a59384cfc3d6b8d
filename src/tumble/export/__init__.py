"""Calibrations in other tools' forms: one template a target, each with its formula and a test vector.

A file of `targets` is a record and a Jinja2 text. Of a calibration the text is given what the record holds, and what it
does not hold is stated with its size (`losses`). Four tools' files are read, too.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

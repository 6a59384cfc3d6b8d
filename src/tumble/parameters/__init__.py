"""What a parameter is, what it is called, and how its number is said: one place for all that name or print one.

`family` makes names of records and finds records by names; `measures` writes a value with its uncertainty, to matching
digits, in the unit of data sheets.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

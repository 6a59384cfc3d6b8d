"""Optional terms: kept if the data want them.

A module of this room with a record `TERM`, or several in `TERMS`, is found here: nothing else names it. From its record
follow its unknowns among all others, its derivatives, its tests, its parameters in the result, and its words.
"""

import sys
from importlib import import_module
from pkgutil import iter_modules

from tumble.calibration.terms.term import Term

_MODULES = [import_module(f"{__name__}.{m.name}") for m in iter_modules(sys.modules[__name__].__path__)]
_FOUND: list[Term] = [
    t for m in _MODULES for t in getattr(m, "TERMS", (m.TERM,) if hasattr(m, "TERM") else ())
]
TERMS = {term.name: term for term in sorted(_FOUND, key=lambda term: (term.gives_way, term.name))}
"""All optional terms by name."""

__all__ = ["TERMS", "Term"]

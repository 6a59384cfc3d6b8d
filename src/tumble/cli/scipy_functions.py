"""scipy's special functions without what their package imports beside them: 20 ms of each command instead of 150.

`scipy.special` makes itself ready for arrays of other libraries, and on the way imports all of numpy, its Fortran
parser included. The functions themselves are in one compiled module, which is all that a command needs. Here a package
that has these alone stands in for it until something else is asked of it: then it loads itself as it always does.
Only the program does so; who imports tumble has scipy as it is.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence
    from importlib.abc import Loader
    from typing import Any

PACKAGE, FUNCTIONS = "scipy.special", "scipy.special._ufuncs"


class _Functions(ModuleType):
    """The package, with the compiled functions alone until it is loaded."""

    def __init__(self) -> None:
        from threading import RLock

        super().__init__(PACKAGE)
        self.whole: Loader | None = None
        self.lock = RLock()

    def __getattr__(self, name: str) -> Any:
        """Return a function of the compiled module, or what the whole package has."""
        if not name.startswith("_"):
            from numpy import ufunc

            try:
                found = getattr(import_module(FUNCTIONS), name, None)
            except ImportError:  # another scipy, which has them elsewhere
                found = None
            if isinstance(found, ufunc):
                return found
        with self.lock:
            whole, self.whole = self.whole, None
            if whole is not None:
                whole.exec_module(self)
        if name in vars(self):
            return vars(self)[name]
        raise AttributeError(f"module {PACKAGE!r} has no attribute {name!r}")


class _FirstFunctions:
    """Loads nothing but the place of the package."""

    def __init__(self, whole: Loader) -> None:
        self.whole = whole

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the empty package."""
        return _Functions()

    def exec_module(self, module: ModuleType) -> None:
        """Keep what loads the whole for later."""
        vars(module)["whole"] = self.whole


class FunctionsAlone:
    """Finds the package once, with the functions alone."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return where the package is; None for every other module."""
        if fullname != PACKAGE:
            return None
        sys.meta_path.remove(self)
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            functions: Any = _FirstFunctions(spec.loader)
            spec.loader = functions
        return spec

"""The targets by name: one file of `export.targets` each, found there."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from tumble.errors import UsageError
from tumble.export import targets
from tumble.export.target import Target


def _all() -> list[Target]:
    """Return the records, in the order of the files' names."""
    names = sorted(module.name for module in iter_modules(targets.__path__))
    return [import_module(f"{targets.__name__}.{name}").TARGET for name in names]


TARGETS: dict[str, Target] = {target.name: target for target in _all()}


def find_target(name: str, *, reading: bool = False) -> Target:
    """Return the target of a name.

    Parameters
    ----------
    name : as ``--to`` takes it.
    reading : it is to be read from.

    Raises
    ------
    UsageError
        If there is none, or it can be written only.
    """
    if name not in TARGETS:
        raise UsageError(f"There is no target {name!r}: choose one of {', '.join(TARGETS)}.")
    target = TARGETS[name]
    if reading and target.read is None:
        readable = ", ".join(t.name for t in TARGETS.values() if t.read is not None)
        raise UsageError(f"{target.title} is written only: its files do not say enough. Read are {readable}.")
    return target

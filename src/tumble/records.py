"""Records as `dataclasses` has them, whose constructor is compiled when the first one is made.

`dataclasses` compiles six functions a class while a module is imported: a tenth of a second of a calibration, for
classes of which it makes half. Here a record has one that is compiled, and that when it is called; what else it
does is one function for all. `fields`, `replace`, `asdict` and `__post_init__` are those of the standard library.
"""

from __future__ import annotations

import dataclasses
import sys
from functools import cache, partial
from math import isfinite
from operator import attrgetter
from reprlib import recursive_repr

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from dataclasses import dataclass as dataclass
    from typing import Any


def _record(kind: type[Any] | None = None, /, *, frozen: bool = False, **how: bool) -> Any:
    """Make a record of a class."""
    if kind is None:
        return partial(_record, frozen=frozen, **how)
    own = vars(kind)
    # Without words the standard library writes some, from a constructor that is not there yet.
    kind.__doc__ = kind.__doc__ or kind.__name__
    methods: dict[str, Any] = {"__repr__": _repr, "__eq__": _equal, "__hash__": _hash if frozen else None}
    if frozen:
        methods |= {"__setattr__": _refuse_setting, "__delattr__": _refuse_deleting}
    methods = {name: method for name, method in methods.items() if not _defines(own, name)}
    made: Any = dataclasses.dataclass(kind, init=False, repr=False, eq=False, **how)
    for name, method in methods.items():
        setattr(made, name, method)
    if "__init__" not in own:
        made.__init__ = _Constructor(made, "_set(_self, {0!r}, {0})" if frozen else "_self.{0} = {0}")
    return made


if not TYPE_CHECKING:
    dataclass = _record


def _defines(own: Mapping[str, Any], name: str) -> bool:
    """Whether a class has a method itself; one with `__eq__` has no `__hash__` of its own but None."""
    return name in own and not (name == "__hash__" and own[name] is None and "__eq__" in own)


class _Factory:
    """What a field has by default that is made anew each time."""

    def __repr__(self) -> str:
        return "<factory>"


_FACTORY = _Factory()


class _Constructor:
    """What stands for `__init__` until it is asked for."""

    def __init__(self, kind: type[Any], setting: str) -> None:
        self.kind = kind
        self.setting = setting

    def __get__(self, record: object, kind: type[Any] | None = None) -> Callable[..., None]:
        """Put the constructor in this one's place, and return it."""
        made = _constructor(self.kind, self.setting)
        type.__setattr__(self.kind, "__init__", made)
        return made if record is None else made.__get__(record)


def _constructor(kind: type[Any], setting: str) -> Callable[..., None]:
    """The constructor of a class with all its fields, in their order."""
    given: dict[str, Any] = {"_set": object.__setattr__, "_factory": _FACTORY}
    parameters, lines = ["_self"], list[str]()
    for field in sorted(dataclasses.fields(kind), key=attrgetter("kw_only")):
        if field.kw_only and "*" not in parameters:
            parameters.append("*")
        name, default = field.name, f"_default_{field.name}"
        if field.default is not dataclasses.MISSING:
            given[default] = field.default
            parameters.append(f"{name}={default}")
        elif field.default_factory is not dataclasses.MISSING:
            given[default] = field.default_factory
            parameters.append(f"{name}=_factory")
            lines.append(f"if {name} is _factory: {name} = {default}()")
        else:
            parameters.append(name)
        lines.append(setting.format(name))
    lines.append("_self.__post_init__()" if hasattr(kind, "__post_init__") else "return None")
    text = f" def __init__({', '.join(parameters)}):\n  " + "\n  ".join(lines)
    written: dict[str, Any] = {}
    # Among the names of the class's own module, where whoever reads the annotations looks for theirs.
    exec(
        f"def write({', '.join(given)}):\n{text}\n return __init__",
        vars(sys.modules[kind.__module__]),
        written,
    )
    made = written["write"](**given)
    made.__module__, made.__qualname__ = kind.__module__, f"{kind.__qualname__}.__init__"
    made.__annotations__ = {field.name: field.type for field in dataclasses.fields(kind)} | {"return": None}
    return made


@cache
def _names(kind: type[Any]) -> tuple[str, ...]:
    return tuple(field.name for field in dataclasses.fields(kind))


@cache
def _values(kind: type[Any]) -> Callable[[Any], tuple[Any, ...]]:
    names = _names(kind)
    return attrgetter(*names) if len(names) > 1 else lambda record: tuple(getattr(record, n) for n in names)


def _equal(self: Any, other: object) -> Any:
    if other.__class__ is not self.__class__:
        return NotImplemented
    values = _values(self.__class__)
    return values(self) == values(other)


def _hash(self: Any) -> int:
    return hash(_values(self.__class__)(self))


@recursive_repr()
def _repr(self: Any) -> str:
    shown = (f"{f.name}={getattr(self, f.name)!r}" for f in dataclasses.fields(self) if f.repr)
    return f"{self.__class__.__qualname__}({', '.join(shown)})"


def _refuse_setting(self: Any, name: str, value: object) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_deleting(self: Any, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


def as_document(value: Any) -> Any:
    """Return what JSON holds of records, lists and numbers; null for what is not finite."""
    kind: type[Any] = value.__class__
    if dataclasses.is_dataclass(kind):
        return {name: as_document(getattr(value, name)) for name in _names(kind)}
    if issubclass(kind, dict):
        return {key: as_document(one) for key, one in value.items()}
    if issubclass(kind, (list, tuple)):
        return [as_document(one) for one in value]
    return None if issubclass(kind, float) and not isfinite(value) else value

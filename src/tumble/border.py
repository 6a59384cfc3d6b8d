"""The border of the public functions: what is passed by mistake is refused in a sentence, before any work."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Sequence
from functools import wraps
from numbers import Integral, Real
from typing import Any, ParamSpec, TypeVar

from tumble.errors import UsageError

P = ParamSpec("P")
R = TypeVar("R")

# Annotation -> what is taken for it, and what to give in words. A number of numpy is a number, too.
_KINDS: dict[str, tuple[Any, str]] = {
    "str": (str, "text"),
    "int": (Integral, "a whole number"),
    "float": (Real, "a number"),
    "bool": ((bool, Integral), "True or False"),
    "None": (type(None), ""),
    "os.PathLike[str]": (os.PathLike, "a path"),
    "Sequence[str]": (Sequence, "a list of texts"),
    "Recording": ("Recording", "a Recording of tumble.read_recording"),
}


def border(function: Callable[P, R]) -> Callable[P, R]:
    """Return a public function that refuses names and kinds of arguments that it does not take.

    Of annotations that are more than texts, numbers, paths and recordings the function itself judges.

    Parameters
    ----------
    function : annotated.
    """
    shape = inspect.signature(function)

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        name = getattr(function, "__qualname__", "function")
        unknown = [one for one in kwargs if one not in shape.parameters]
        if unknown:
            from difflib import get_close_matches

            near = get_close_matches(unknown[0], shape.parameters, 1)
            meant = f" Is {near[0]} meant?" if near else f" It takes {', '.join(shape.parameters)}."
            raise UsageError(f"tumble.{name} has no option {unknown[0]}.{meant}")
        try:
            given = shape.bind(*args, **kwargs)
        except TypeError as error:
            raise UsageError(f"tumble.{name}: {error}; help(tumble.{name}) shows how it is called.") from None
        for key, value in given.arguments.items():
            _check(name, key, value, str(shape.parameters[key].annotation))
        return function(*args, **kwargs)

    return checked


def _check(name: str, key: str, value: object, annotation: str) -> None:
    kinds = [_KINDS.get(one.strip()) for one in annotation.split("|")]
    known = [kind for kind in kinds if kind is not None]
    if len(known) < len(kinds) or any(_is(value, kind) for kind, _ in known):
        return
    wanted = " or ".join(words for _, words in known if words)
    raise UsageError(
        f"tumble.{name}: {key} is {value!r:.60}, of the type {type(value).__name__}: give {wanted}."
    )


def _is(value: object, kind: Any) -> bool:
    if isinstance(kind, str):
        return any(one.__name__ == kind for one in type(value).__mro__)
    return isinstance(value, kind)

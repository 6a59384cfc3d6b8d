"""Values of a YAML file with the line that each stands on, so that a mistake can be named by its place."""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from tumble.errors import ProtocolError

# What a place in the file is called in a message.
Where = str


@dataclass(frozen=True, slots=True)
class Source:
    """The file that is read; it makes the messages."""

    path: Path

    def error(self, node: Any, message: str) -> ProtocolError:
        """Return the error that names the file and the node's line."""
        return ProtocolError(f"{self.path}, line {node.start_mark.line + 1}: {message}")


def compose(path: Path, text: str) -> Any:
    """Return the root node of a YAML text.

    Raises
    ------
    ProtocolError
        If it is no YAML, or empty.
    """
    import yaml

    try:
        root: Any = cast("Any", yaml).compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark is not None else 1
        hint = " (indent with spaces, not tabs)" if "\\t" in str(error.problem) else ""
        raise ProtocolError(f"{path}, line {line}: this is not YAML: {error.problem}{hint}.") from None
    except yaml.YAMLError as error:
        raise ProtocolError(f"{path}: this is not YAML: {error}.") from None
    if root is None:
        raise ProtocolError(f"{path} is empty: a protocol begins with `format: tumble protocol`.")
    return root


def mapping(source: Source, node: Any, where: Where, known: tuple[str, ...]) -> dict[str, Any]:
    """Return a mapping's nodes by key.

    Raises
    ------
    ProtocolError
        If it is no mapping, or a key is unknown or stands twice.
    """
    if node.id != "mapping":
        raise source.error(node, f"{where} is to be a list of `key: value`.")
    found: dict[str, Any] = {}
    for key_node, value in node.value:
        key = str(key_node.value)
        if key not in known:
            near = difflib.get_close_matches(key, known, 1, 0.5)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}."
            raise source.error(key_node, f"{where} has no key {key!r}; {hint}")
        if key in found:
            raise source.error(key_node, f"{where} has the key {key!r} twice.")
        found[key] = value
    return found


def sequence(source: Source, node: Any, where: Where) -> list[Any]:
    """Return a list's nodes.

    Raises
    ------
    ProtocolError
        If it is no list.
    """
    if node.id != "sequence":
        raise source.error(node, f"{where} is to be a list.")
    return list(node.value)


def text(source: Source, node: Any, where: Where) -> str:
    """Return a text; nothing is the empty text.

    Raises
    ------
    ProtocolError
        If it is a list or a mapping.
    """
    if node.id != "scalar":
        raise source.error(node, f"{where} is to be a text.")
    return "" if node.tag.endswith(":null") else str(node.value)


def number(
    source: Source,
    node: Any,
    where: Where,
    *,
    least: float = -math.inf,
    most: float = math.inf,
    above: float = -math.inf,
) -> float:
    """Return a finite number from `least` to `most`, and greater than `above`.

    Raises
    ------
    ProtocolError
        If it is none.
    """
    try:
        value = float(text(source, node, where))
    except ValueError:
        raise source.error(node, f"{where} is {str(node.value)[:30]!r}, and is to be a number.") from None
    if not math.isfinite(value):
        raise source.error(node, f"{where} is {node.value}, and is to be a finite number.")
    if value <= above:
        raise source.error(node, f"{where} is {value:g}, and is to be more than {above:g}.")
    if not least <= value <= most:
        span = f"from {least:g} to {most:g}" if math.isfinite(most) else f"{least:g} or more"
        raise source.error(node, f"{where} is {value:g}, and is to be {span}.")
    return value


def numbers(source: Source, node: Any, where: Where, count: int) -> list[float]:
    """Return a list of so many finite numbers.

    Raises
    ------
    ProtocolError
        If it is none.
    """
    nodes = sequence(source, node, where)
    if len(nodes) != count:
        raise source.error(node, f"{where} has {len(nodes)} numbers, and is to have {count}.")
    return [number(source, item, where) for item in nodes]
